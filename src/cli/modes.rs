//! `variational modes`: parses arguments, prints tables and writes files. This file solves nothing.

use clap::Args;

use super::exit;
use super::run::{code_of, output_directory, print_problems};
use super::say::{self, message, out};
use super::signals::Stop;
use super::study::{Study, StudyArguments};
use crate::run::RunError;
use crate::scene::MassKind;
use crate::study::modes::write_modes;

#[derive(Debug, Args)]
pub(super) struct ModesArguments {
    #[command(flatten)]
    study: StudyArguments,
    /// Number of modes of each set of interacting bodies, including rigid ones
    #[arg(long, default_value_t = 12)]
    count: usize,
    /// Use lumped mass, regardless of the scene's `solver.mass` (default: consistent)
    #[arg(long)]
    lumped: bool,
}

pub(super) fn modes(arguments: &ModesArguments) -> u8 {
    let stop = Stop::on_signals();
    let Study { scene, parsed, pool, name, directory, claim } =
        match arguments.study.open_in(|scene, name| output_directory(scene, name, None)) {
            Ok(study) => study,
            Err(code) => return code,
        };
    // `write_modes` claims the directory again by itself.
    drop(claim);
    let scene = scene.interruptible(stop.interrupt());
    let mass = arguments.lumped.then_some(MassKind::Lumped);
    let report = match pool.install(|| write_modes(scene, &name, &directory, arguments.count, mass)) {
        Ok(report) => report,
        Err(RunError::Scene(problems)) => {
            print_problems(problems, &parsed, &arguments.study.scene);
            return exit::BAD_INPUT;
        }
        Err(error) => {
            message!("error: {error}");
            return if stop.is_asked() { stop.code() } else { code_of(&error) };
        }
    };
    arguments.study.say.result(&report, || {
        say::write_result(format_args!("{}", report.table()));
        out!("written to {}", directory.display());
    });
    for note in &report.notes {
        message!("note: {note}");
    }
    exit::DONE
}
