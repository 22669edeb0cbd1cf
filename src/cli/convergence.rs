//! `variational convergence`: parses arguments, prints tables and writes files. This file measures nothing.

use std::path::Path;

use clap::Args;

use super::exit;
use super::run::print_problems;
use super::say::{self, message, out};
use super::signals::Stop;
use super::study::{Study, StudyArguments};
use crate::auto::trial::TrialWatch;
use crate::study::convergence::{ConvergenceError, ConvergenceOptions, ConvergenceReport, convergence};

#[derive(Debug, Args)]
pub(super) struct ConvergenceArguments {
    #[command(flatten)]
    study: StudyArguments,
    /// Number of meshes or steps of each study, each with half the size of the previous one; at least 3 show an order
    #[arg(long, default_value_t = 3, value_parser = clap::value_parser!(u32).range(2..=6))]
    levels: u32,
    /// Refine only the mesh
    #[arg(long, conflicts_with = "time")]
    space: bool,
    /// Refine only the step
    #[arg(long)]
    time: bool,
    /// Study the lowest vibration frequencies, including rigid ones, instead of the end of the run
    #[arg(long, value_name = "COUNT", conflicts_with = "time", value_parser = clap::value_parser!(u32).range(1..=1000))]
    modes: Option<u32>,
}

pub(super) fn study(arguments: &ConvergenceArguments) -> u8 {
    let stop = Stop::on_signals();
    let Study { scene, parsed, pool, name, directory, claim: _claim } =
        match arguments.study.open("convergence") {
            Ok(study) => study,
            Err(code) => return code,
        };
    let scene = scene.interruptible(stop.interrupt());
    let options = ConvergenceOptions {
        name,
        levels: arguments.levels,
        space: !arguments.time,
        time: !arguments.space,
        modes: arguments.modes.map(|count| count as usize),
    };
    let mut watch = Watch { quiet: arguments.study.say.is_brief(), stop: stop.clone() };
    let report = match pool.install(|| convergence(&scene, &options, &mut watch)) {
        Ok(report) => report,
        Err(ConvergenceError::Scene(problems)) => {
            print_problems(problems, &parsed, &arguments.study.scene);
            return exit::BAD_INPUT;
        }
        Err(error) => {
            message!("error: {}: {error}", arguments.study.scene.display());
            return match error {
                ConvergenceError::Stopped => stop.code(),
                ConvergenceError::Nothing(_) => exit::BAD_INPUT,
                _ => exit::NO_CONVERGENCE,
            };
        }
    };
    let title = if scene.title.is_empty() { &options.name } else { &scene.title };
    if let Err(error) = write(&report, title, &directory) {
        message!("error: {}: {error}", directory.display());
        return exit::INPUT_OUTPUT;
    }
    arguments.study.say.result(&report, || {
        say::write_result(format_args!("{}", report.table()));
        out!("written to {}", directory.display());
    });
    exit::DONE
}

fn write(report: &ConvergenceReport, title: &str, directory: &Path) -> std::io::Result<()> {
    std::fs::create_dir_all(directory)?;
    let json = serde_json::to_string_pretty(report)? + "\n";
    std::fs::write(directory.join("convergence.csv"), report.csv())?;
    std::fs::write(directory.join("convergence.json"), json)?;
    std::fs::write(directory.join("convergence.svg"), report.chart(title))
}

/// Prints a line for every run.
struct Watch {
    quiet: bool,
    stop: Stop,
}

impl TrialWatch for Watch {
    fn next(&mut self, what: &str) {
        if !self.quiet {
            message!("{what}");
        }
    }

    fn go_on(&mut self) -> bool {
        !self.stop.is_asked()
    }
}
