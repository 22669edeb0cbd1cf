//! `variational check`: reports all errors of scenes without running them.

use std::path::{Path, PathBuf};

use clap::Args;
use serde::Serialize;

use super::exit;
use super::run::{located, name_of, output_directory, read, writable};
use super::say::{Say, message, out};
use crate::auto::stand_in;
use crate::run::Team;
use crate::run::provenance::Provenance;
use crate::scene::Problem;
use crate::simulation::Simulation;

#[derive(Debug, Args)]
pub(super) struct CheckArguments {
    /// Scene files
    #[arg(required = true)]
    scenes: Vec<PathBuf>,
    /// Set a key of the scene, e.g. time.step=0.01
    #[arg(long = "set", value_name = "KEY=VALUE")]
    overrides: Vec<String>,
    #[command(flatten)]
    say: Say,
}

#[derive(Serialize)]
struct CheckReport {
    provenance: Provenance,
    scenes: Vec<SceneReport>,
}

#[derive(Serialize)]
struct SceneReport {
    file: String,
    is_sound: bool,
    problems: Vec<ProblemReport>,
}

#[derive(Serialize)]
struct ProblemReport {
    /// Line of the scene file, from 1.
    line: Option<usize>,
    /// The key, e.g. `body[0].material.density`; empty for the whole scene.
    key: String,
    message: String,
}

pub(super) fn run(team: &Team, arguments: &CheckArguments) -> u8 {
    let mut scenes = Vec::new();
    let mut free_coordinates = 0;
    for path in &arguments.scenes {
        let problems = match problems(team, path, &arguments.overrides) {
            Ok(free) => {
                free_coordinates += free;
                Vec::new()
            }
            Err(problems) => problems,
        };
        if problems.is_empty() && !arguments.say.is_brief() {
            out!("{}: ok", path.display());
        }
        problems.iter().for_each(|problem| message!("error: {problem}"));
        scenes.push(SceneReport {
            file: path.display().to_string(),
            is_sound: problems.is_empty(),
            problems: problems.into_iter().map(ProblemReport::new).collect(),
        });
    }
    let names: Vec<String> = arguments.scenes.iter().map(|path| name_of(path)).collect();
    let report = CheckReport { provenance: Provenance::new(&names.join(", "), free_coordinates), scenes };
    arguments.say.result(&report, || {});
    if report.scenes.iter().all(|scene| scene.is_sound) { exit::DONE } else { exit::BAD_INPUT }
}

/// Returns the number of free coordinates of a scene, or all problems of the scene, its meshes and its output
/// directory.
fn problems(team: &Team, path: &Path, overrides: &[String]) -> Result<usize, Vec<Problem>> {
    let (scene, parsed) = read(path, overrides)?;
    let directory = output_directory(&scene, &name_of(path), None);
    let mut problems = Vec::new();
    let mut free_coordinates = 0;
    match Simulation::new(stand_in(&scene)) {
        Ok(simulation) => free_coordinates = simulation.free_coordinates(),
        Err(found) => problems = found,
    }
    problems.extend(team.problems(&scene));
    if let Err(error) = writable(&directory) {
        let message = format!("{}: not writable: {error}", directory.display());
        problems.push(Problem::new("output.directory", message));
    }
    if problems.is_empty() { Ok(free_coordinates) } else { Err(located(problems, &parsed, path)) }
}

impl ProblemReport {
    fn new(problem: Problem) -> Self {
        Self { line: problem.line, key: problem.key, message: problem.message }
    }
}
