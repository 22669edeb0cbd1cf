//! `variational stress`: runs random violent scenes and prints their outcomes.

use std::path::PathBuf;
use std::time::Duration;

use clap::Args;

use super::exit;
use super::say::{self, Say, message};
use super::signals::Stop;
use crate::study::stress::{Case, Outcome, Scenes, StressOptions, StressWatch, stress, write_scenes};

#[derive(Debug, Args)]
pub(super) struct StressArguments {
    /// Number of the first scene
    #[arg(long, default_value_t = 0)]
    first: u64,
    /// Number of violent scenes
    #[arg(long, default_value_t = 1000)]
    count: u64,
    /// Seed of the scenes
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Scenes in which bodies meet, judged by exact predicates after every step
    #[arg(long)]
    contact: bool,
    /// Scenes in which bodies meet and come to rest (`[static]`), judged in the same way
    #[arg(long, conflicts_with = "contact")]
    equilibria: bool,
    /// Number of scenes that run at the same time (default: one per core)
    #[arg(long)]
    jobs: Option<usize>,
    /// Time limit of a scene, s, after which it ends with its current step, or at once if it searches for an equilibrium; at ten times this limit it counts as hung
    #[arg(long, default_value_t = 10.0)]
    limit: f64,
    /// Directory for the scenes with forbidden outcomes
    #[arg(long, default_value = "stress-failures")]
    keep: PathBuf,
    /// Write the scenes and their meshes into this directory without running them
    #[arg(long, value_name = "DIRECTORY")]
    write: Option<PathBuf>,
    #[command(flatten)]
    say: Say,
    /// Print the outcome of every scene
    #[arg(long)]
    verbose: bool,
}

pub(super) fn run(arguments: &StressArguments) -> u8 {
    let limit = Duration::try_from_secs_f64(arguments.limit).unwrap_or(Duration::from_secs(10));
    let jobs = arguments.jobs.unwrap_or_else(|| std::thread::available_parallelism().map_or(1, usize::from));
    let keep = arguments.keep.clone();
    let scenes = match arguments {
        StressArguments { contact: true, .. } => Scenes::Contact,
        StressArguments { equilibria: true, .. } => Scenes::Equilibria,
        _ => Scenes::OneBody,
    };
    let options = StressOptions {
        first: arguments.first,
        count: arguments.count,
        seed: arguments.seed,
        scenes,
        jobs,
        limit,
        keep,
    };
    if let Some(directory) = &arguments.write {
        return match write_scenes(&options, directory) {
            Ok(()) => exit::DONE,
            Err(error) => {
                message!("error: {}: the scenes cannot be written: {error}", directory.display());
                exit::INPUT_OUTPUT
            }
        };
    }
    let watch = Watch { verbose: arguments.verbose, stop: Stop::on_signals() };
    let report = stress(&options, &watch);
    arguments
        .say
        .result(&report.json(&options), || say::write_result(format_args!("{}", report.markdown(&options))));
    for (index, why) in &report.forbidden {
        message!("forbidden: scene {index}: {why}");
    }
    if !report.forbidden.is_empty() {
        message!("their scenes are in {}", options.keep.display());
    }
    match (report.interrupted, report.forbidden.is_empty()) {
        (true, _) => watch.stop.code(),
        (false, true) => exit::DONE,
        (false, false) => exit::BROKEN,
    }
}

/// Prints forbidden outcomes, or all outcomes, as they occur.
struct Watch {
    verbose: bool,
    stop: Stop,
}

impl StressWatch for Watch {
    fn ended(&self, case: &Case, outcome: &Outcome) {
        if self.verbose || matches!(outcome, Outcome::Forbidden(_)) {
            let scheme = case.scene.time.scheme.unwrap_or(crate::scene::SchemeName::Auto);
            message!("scene {}: {}, {scheme:?}: {outcome:?}", case.index, case.violence.words());
        }
    }

    fn go_on(&self) -> bool {
        !self.stop.is_asked()
    }
}
