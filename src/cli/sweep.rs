//! `variational sweep`: parses arguments, prints progress and writes tables. This file runs no point.

use std::path::{Path, PathBuf};

use clap::Args;
use serde::Serialize;
use vi_solvers::Interrupt;

use super::exit;
use super::run::{code_of, name_of, writable};
use super::say::{Say, message, out};
use super::signals::Stop;
use crate::run::provenance::Provenance;
use crate::study::sweep::{Axis, SweepError, SweepOptions, SweepReport, SweepWatch, sweep};

#[derive(Debug, Args)]
pub(super) struct SweepArguments {
    /// The scene file
    scene: PathBuf,
    /// A key and its values: body.0.material.young=1e5:1e7:log5, time.step=1e-3,5e-4; repeat it for a grid
    #[arg(long = "over", value_name = "KEY=VALUES", required = true)]
    axes: Vec<Axis>,
    /// Set a key in every point, e.g. time.end=0.5
    #[arg(long = "set", value_name = "KEY=VALUE")]
    overrides: Vec<String>,
    /// Output directory (default: out/<scene>-sweep)
    #[arg(long, value_name = "DIRECTORY")]
    out: Option<PathBuf>,
    /// Number of points that run at the same time (default: one per core, or fewer if each has several threads)
    #[arg(long)]
    jobs: Option<usize>,
    /// Number of threads of each point; the results do not depend on it
    #[arg(long, default_value_t = 1)]
    threads: usize,
    /// Run only every N-th point, starting with number I (from 0): one task of an array of N
    #[arg(long, value_name = "I/N", default_value = "0/1", value_parser = task)]
    task: (usize, usize),
    #[command(flatten)]
    say: Say,
}

#[derive(Serialize)]
struct SweepJson<'a> {
    provenance: Provenance,
    #[serde(flatten)]
    report: &'a SweepReport,
    /// Paths of the tables.
    tables: [String; 2],
}

fn task(text: &str) -> Result<(usize, usize), String> {
    let parts = text.split_once('/').and_then(|(i, n)| Some((i.parse().ok()?, n.parse().ok()?)));
    parts.filter(|(i, n)| i < n).ok_or_else(|| "write it as I/N with I from 0 to N - 1, e.g. 0/10".to_owned())
}

pub(super) fn run(arguments: &SweepArguments) -> u8 {
    if arguments.jobs == Some(0) || arguments.threads == 0 {
        message!("error: --jobs and --threads must be at least 1");
        return exit::BAD_INPUT;
    }
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    let directory = arguments
        .out
        .clone()
        .unwrap_or_else(|| Path::new("out").join(format!("{}-sweep", name_of(&arguments.scene))));
    if let Err(error) = writable(&directory) {
        message!(
            "error: {}: output directory not writable: {error}; choose another with --out",
            directory.display()
        );
        return exit::BAD_INPUT;
    }
    let options = SweepOptions {
        scene: arguments.scene.clone(),
        overrides: arguments.overrides.clone(),
        axes: arguments.axes.clone(),
        directory,
        jobs: arguments.jobs.unwrap_or((cores / arguments.threads).max(1)),
        threads: arguments.threads,
        task: arguments.task,
    };
    let watch = Watch { quiet: arguments.say.is_brief(), stop: Stop::on_signals() };
    let report = match sweep(&options, &watch) {
        Ok(report) => report,
        Err(SweepError::Scene(problems)) => {
            problems.iter().for_each(|problem| message!("error: {problem}"));
            return exit::BAD_INPUT;
        }
        Err(error) => {
            message!("error: {error}");
            return match error {
                SweepError::Output { source, .. } => code_of(&source),
                SweepError::TooMany | SweepError::Overridden { .. } => exit::BAD_INPUT,
                _ => exit::INPUT_OUTPUT,
            };
        }
    };
    let tables =
        ["sweep.csv", "sweep-times.csv"].map(|name| options.directory.join(name).display().to_string());
    // Points may have different meshes: their own reports contain the numbers of coordinates.
    let provenance = Provenance::new(&name_of(&arguments.scene), 0);
    let json = SweepJson { provenance, report: &report, tables };
    arguments.say.result(&json, || {
        out!("{} of {} points are done, {} of them failed", report.done, report.points, report.failed);
        out!("written to {}", json.tables[0]);
    });
    if report.interrupted { watch.stop.code() } else { exit::DONE }
}

struct Watch {
    quiet: bool,
    stop: Stop,
}

impl SweepWatch for Watch {
    fn done(&self, point: usize, exit: u8, reason: &str, left: usize) {
        if !self.quiet {
            let why = if reason.is_empty() { String::new() } else { format!(": {reason}") };
            message!("point {point}: exit code {exit}{why}; {left} left to begin");
        }
    }

    fn go_on(&self) -> bool {
        !self.stop.is_asked()
    }

    fn interrupt(&self) -> Interrupt {
        self.stop.interrupt()
    }
}
