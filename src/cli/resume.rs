//! `variational resume`: finds the newest valid checkpoint of a directory, and its scene.

use std::path::{Path, PathBuf};

use clap::Args;

use super::exit;
use super::run::{RunSay, conclude, fail, thread_pool};
use super::say::{message, out};
use super::signals::Stop;
use crate::run::checkpoint::{Origin, newest};
use crate::run::claim::Claim;
use crate::run::{RunError, Team, resume_by};
use crate::scene::Scene;

#[derive(Debug, Args)]
pub(super) struct ResumeArguments {
    /// The output directory of the run
    directory: PathBuf,
    /// Number of threads (default: one per core); the results do not depend on it
    #[arg(long)]
    threads: Option<usize>,
    #[command(flatten)]
    output: RunSay,
}

pub(super) fn resume(team: &Team, arguments: &ResumeArguments) -> u8 {
    arguments.output.end(resume_directory(team, arguments))
}

fn resume_directory(team: &Team, arguments: &ResumeArguments) -> u8 {
    let directory = &arguments.directory;
    if let Some((report, steps)) = finished(directory) {
        // The run may have been killed between its report and the end of its claim.
        Claim::remove_stale(directory);
        if arguments.output.say.json {
            out!("{}", report.trim_end());
        } else if !arguments.output.is_brief() {
            out!("{}: the run is finished, {steps} steps; there is nothing to resume", directory.display());
        }
        return exit::DONE;
    }
    let found = match newest(directory) {
        Ok(found) => found,
        Err(error) => return fail(&error.into(), directory),
    };
    for damage in &found.damages {
        message!("warning: damaged: {damage}");
    }
    let (path, step) = (found.path.display(), found.checkpoint.steps());
    if !found.damages.is_empty() {
        message!("warning: falling back to {path}");
    }
    let scene = match scene(&found.checkpoint.origin) {
        Ok(scene) => scene,
        Err(code) => return code,
    };
    let stop = Stop::on_signals();
    let pool = match thread_pool(arguments.threads.or(team.threads())) {
        Ok(pool) => pool,
        Err(code) => return code,
    };
    if !arguments.output.is_brief() {
        message!("resuming {path} after step {step}");
    }
    let scene = scene.interruptible(stop.interrupt());
    let mut watch = arguments.output.watch(directory, &stop);
    let result = pool.install(|| resume_by(team, scene, &found.checkpoint, directory, &mut *watch));
    drop(watch);
    if let Err(RunError::Scene(problems)) = &result {
        problems.iter().for_each(|problem| message!("error: {problem}"));
        return exit::BAD_INPUT;
    }
    conclude(result, directory, &arguments.output, &stop)
}

/// Returns the report and the number of steps of a completed run.
fn finished(directory: &Path) -> Option<(String, u64)> {
    let text = std::fs::read_to_string(directory.join("report.json")).ok()?;
    let report: serde_json::Value = serde_json::from_str(&text).ok()?;
    let steps = report["steps"].as_u64()?;
    (report["outcome"] == "done").then_some((text, steps))
}

/// Returns the scene of the run, from its file, or from the checkpoint if the file does not exist.
fn scene(origin: &Origin) -> Result<Scene, u8> {
    if let Some((file, _)) = origin.file.as_ref().filter(|(file, _)| !file.exists()) {
        message!("note: {} is gone; the scene is taken from the checkpoint", file.display());
    }
    let parsed = origin.read_scene().map_err(|error| {
        message!("error: {error}");
        exit::INPUT_OUTPUT
    })?;
    for problem in &parsed.problems {
        message!("error: {problem}");
    }
    match parsed.scene {
        Some(scene) if parsed.problems.is_empty() => Ok(scene),
        _ => Err(exit::BAD_INPUT),
    }
}
