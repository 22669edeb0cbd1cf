//! `variational bench`: parses arguments, prints the table and writes files. This file measures nothing.

use std::io::IsTerminal;
use std::path::Path;
use std::time::Duration;

use clap::Args;
use indicatif::{ProgressBar, ProgressStyle};

use super::exit;
use super::run::print_problems;
use super::say::{self, message, out};
use super::signals::Stop;
use super::study::{Study, StudyArguments};
use crate::study::bench::{BenchError, BenchOptions, BenchReport, BenchWatch, bench};

#[derive(Debug, Args)]
pub(super) struct BenchArguments {
    #[command(flatten)]
    study: StudyArguments,
    /// Wall time for the whole bench, s
    #[arg(long, default_value_t = 60.0, value_name = "SECONDS")]
    budget: f64,
    /// Required relative error at the end (default: the scene's time.tolerance, else 0.01)
    #[arg(long, value_name = "ERROR")]
    error: Option<f64>,
    /// Schemes to compare, comma-separated, e.g. stormer-verlet,"gauss 3"
    #[arg(long, value_delimiter = ',', value_name = "NAMES")]
    schemes: Vec<String>,
}

pub(super) fn bench_scene(arguments: &BenchArguments) -> u8 {
    let stop = Stop::on_signals();
    let Study { scene, parsed, pool, name, directory, claim: _claim } = match arguments.study.open("bench") {
        Ok(study) => study,
        Err(code) => return code,
    };
    let scene = scene.interruptible(stop.interrupt());
    for (key, value) in [("--budget", Some(arguments.budget)), ("--error", arguments.error)] {
        if value.is_some_and(|value| !(value > 0.0 && value < 1e9)) {
            message!("error: {key} must be positive");
            return exit::BAD_INPUT;
        }
    }
    let options = BenchOptions {
        name: name.clone(),
        budget: Duration::from_secs_f64(arguments.budget),
        accuracy: arguments.error,
        schemes: arguments.schemes.clone(),
    };
    let mut watch = Watch::new(arguments.study.say.is_brief(), stop.clone());
    let result = pool.install(|| bench(&scene, &options, &mut watch));
    watch.finish();
    let report = match result {
        Ok(report) => report,
        Err(BenchError::Scene(problems)) => {
            print_problems(problems, &parsed, &arguments.study.scene);
            return exit::BAD_INPUT;
        }
        Err(error) => {
            message!("error: {}: {error}", arguments.study.scene.display());
            return match error {
                _ if stop.is_asked() => stop.code(),
                BenchError::Reference { .. } => exit::NO_CONVERGENCE,
                _ => exit::BAD_INPUT,
            };
        }
    };
    let title = if scene.title.is_empty() { name } else { scene.title };
    if let Err(error) = write(&report, &title, &directory) {
        message!("error: {}: {error}", directory.display());
        return exit::INPUT_OUTPUT;
    }
    arguments.study.say.result(&report, || {
        say::write_result(format_args!("{}", report.table()));
        out!("written to {}", directory.display());
        out!("{}.", report.recommendation);
    });
    if let Some(busy) = report.busy() {
        message!("warning: {busy}");
    }
    if report.interrupted { stop.code() } else { exit::DONE }
}

fn write(report: &BenchReport, title: &str, directory: &Path) -> std::io::Result<()> {
    std::fs::create_dir_all(directory)?;
    let json = serde_json::to_string_pretty(report)? + "\n";
    std::fs::write(directory.join("bench.csv"), report.csv())?;
    std::fs::write(directory.join("bench.json"), json)?;
    std::fs::write(directory.join("bench.svg"), report.chart(title))
}

/// Shows a bar with the remaining time on a terminal, or a line for every run in a pipe.
struct Watch {
    quiet: bool,
    stop: Stop,
    bar: Option<ProgressBar>,
}

impl Watch {
    fn new(quiet: bool, stop: Stop) -> Self {
        let bar = (!quiet && std::io::stderr().is_terminal()).then(|| {
            let bar = ProgressBar::new(1000);
            match ProgressStyle::with_template("{bar:40} {percent:>3} %  {msg}") {
                Ok(style) => bar.with_style(style),
                Err(_) => bar,
            }
        });
        Self { quiet, stop, bar }
    }

    fn finish(&self) {
        if let Some(bar) = &self.bar {
            bar.finish_and_clear();
        }
    }
}

impl BenchWatch for Watch {
    fn next(&mut self, what: &str, spent: f64, left: Duration) {
        let left = left.as_secs_f64();
        match &self.bar {
            Some(bar) => {
                bar.set_position((1000.0 * spent.min(1.0)) as u64);
                bar.set_message(format!("{what}, at most {left:.0} s left"));
            }
            None if !self.quiet => {
                message!("{:3.0} %  {what}, at most {left:.0} s left", 100.0 * spent.min(1.0));
            }
            None => {}
        }
    }

    fn go_on(&mut self) -> bool {
        !self.stop.is_asked()
    }
}
