//! `variational stress`.

use std::path::PathBuf;
use std::time::Duration;

use clap::Args;

use super::exit;
use super::say::{self, message, out};
use crate::study::stress::{Outcome, StressOptions, stress, write_scenes};

#[derive(Debug, Args)]
pub(super) struct StressArguments {
    /// Violent scenes to run
    #[arg(long, default_value_t = 1000)]
    count: u64,
    /// The seed that they come from
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Scenes run at once (default: one a core)
    #[arg(long)]
    jobs: Option<usize>,
    /// Seconds after which a scene is ended after its step; at ten times this it counts as hung
    #[arg(long, default_value_t = 10.0)]
    limit: f64,
    /// Where the scenes of forbidden outcomes are written
    #[arg(long, default_value = "stress-failures")]
    keep: PathBuf,
    /// Write the scenes and their meshes into this directory and run none
    #[arg(long, value_name = "DIRECTORY")]
    write: Option<PathBuf>,
    /// Print the counts as JSON
    #[arg(long)]
    json: bool,
    /// Print what came of every scene
    #[arg(long)]
    verbose: bool,
}

pub(super) fn run(arguments: &StressArguments) -> u8 {
    let limit = Duration::try_from_secs_f64(arguments.limit).unwrap_or(Duration::from_secs(10));
    let jobs = arguments.jobs.unwrap_or_else(|| std::thread::available_parallelism().map_or(1, usize::from));
    let keep = arguments.keep.clone();
    let options = StressOptions { count: arguments.count, seed: arguments.seed, jobs, limit, keep };
    if let Some(directory) = &arguments.write {
        return match write_scenes(&options, directory) {
            Ok(()) => exit::DONE,
            Err(error) => {
                message!("error: {}: the scenes cannot be written: {error}", directory.display());
                exit::INPUT_OUTPUT
            }
        };
    }
    let report = stress(&options, &|case, outcome| {
        if arguments.verbose || matches!(outcome, Outcome::Forbidden(_)) {
            let scheme = case.scene.time.scheme.unwrap_or(crate::scene::SchemeName::Auto);
            message!("scene {}: {}, {scheme:?}: {outcome:?}", case.index, case.violence.words());
        }
    });
    if arguments.json {
        out!("{:#}", report.json(&options));
    } else {
        say::write_result(format_args!("{}", report.markdown(&options)));
    }
    if report.forbidden.is_empty() {
        return exit::DONE;
    }
    for (index, why) in &report.forbidden {
        message!("forbidden: scene {index}: {why}");
    }
    message!("their scenes are in {}", options.keep.display());
    exit::BROKEN
}
