//! Decides which files of an output directory belong to the runs of a scene. A new run removes those, renames the
//! results of other scenes, and changes nothing else.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use serde_json::Value;

use super::RunError;
use crate::run::checkpoint;
use crate::run::frames::frame_number;
use crate::run::surfaces::SurfaceFiles;
use crate::scene::{Problem, Scene};

/// Files whose names do not contain the name of the scene. Those of another scene are renamed `<scene>.history.csv` and
/// `<scene>.report.json`.
const SHARED: [&str; 3] = ["history.csv", "report.json", "energy.svg"];

/// Prepares a new run of the scene `name`: removes the files of its earlier run.
///
/// # Errors
/// Returns, before any change, [`RunError::Scene`] if the scene reads a file that would be removed, and
/// [`RunError::Unfinished`] if the run of another scene can still be continued. Returns [`RunError::Output`] if a file
/// cannot be moved or removed.
pub(super) fn prepare(directory: &Path, name: &str, scene: &Scene) -> Result<(), RunError> {
    refuse_inputs(directory, name, scene)?;
    rename_results_of_others(directory, name)?;
    for path in own_files(directory, name, scene)? {
        fs::remove_file(&path).map_err(RunError::output(&path))?;
    }
    Ok(())
}

/// Refuses a scene that reads a file which its run would remove or replace.
pub(super) fn refuse_inputs(directory: &Path, name: &str, scene: &Scene) -> Result<(), RunError> {
    let problems = inputs_among(scene, &own_files(directory, name, scene)?);
    if problems.is_empty() { Ok(()) } else { Err(RunError::Scene(problems)) }
}

/// Returns a problem for each file that a scene reads and that is one of `outputs`, by any path.
pub(crate) fn inputs_among(scene: &Scene, outputs: &[PathBuf]) -> Vec<Problem> {
    let is_output = |input: &Path| {
        // A file that does not exist is not the same file.
        outputs.iter().any(|output| same_file::is_same_file(input, output).unwrap_or(false))
    };
    let problem = |(key, path): (String, &Path)| {
        let path = path.display();
        let message = format!(
            "{path} would be replaced by this run's own output; copy it to another place, or choose another directory \
             with --out"
        );
        Problem::new(key, message)
    };
    scene.files().into_iter().filter(|(_, path)| is_output(path)).map(problem).collect()
}

/// Lists the existing files in the directory that a run of the scene `name` writes.
fn own_files(directory: &Path, name: &str, scene: &Scene) -> Result<Vec<PathBuf>, RunError> {
    let mut found = Vec::new();
    let surfaces = SurfaceFiles::new(directory, name, scene);
    let listed = (|| {
        for entry in fs::read_dir(directory)? {
            let entry = entry?;
            // A run killed while writing a file leaves it under its temporary name.
            let is_own = entry.file_name().to_str().is_some_and(|file| {
                let file = file.strip_suffix(".tmp").unwrap_or(file);
                is_own(file, name) || surfaces.contain(file)
            });
            if is_own && !entry.file_type()?.is_dir() {
                found.push(entry.path());
            }
        }
        io::Result::Ok(())
    })();
    listed.map_err(RunError::output(directory))?;
    found.sort();
    Ok(found)
}

fn is_own(file: &str, name: &str) -> bool {
    let of_scene = file.strip_prefix(name).and_then(|rest| rest.strip_prefix('.')).unwrap_or_default();
    SHARED.contains(&file)
        || SHARED.contains(&of_scene)
        || of_scene == "pvd"
        || frame_number(name, file).is_some()
        || checkpoint::is_file_name(file)
}

/// Renames the history and the report of another scene's run: puts the name of that scene in front.
fn rename_results_of_others(directory: &Path, name: &str) -> Result<(), RunError> {
    let Some((other, is_done)) = last_run(directory).filter(|(other, _)| other != name) else {
        return Ok(());
    };
    if !is_done && checkpoint::newest(directory).is_ok() {
        return Err(RunError::Unfinished { directory: directory.to_owned(), name: other });
    }
    for file in SHARED {
        let path = directory.join(file);
        match fs::rename(&path, directory.join(format!("{other}.{file}"))) {
            Err(error) if error.kind() == io::ErrorKind::NotFound => {}
            renamed => renamed.map_err(RunError::output(&path))?,
        }
    }
    Ok(())
}

/// Returns the scene that ran last in a directory, from its report or its newest checkpoint, and whether the run is
/// complete.
fn last_run(directory: &Path) -> Option<(String, bool)> {
    let report = fs::read(directory.join("report.json")).ok();
    let found = match report.and_then(|bytes| serde_json::from_slice::<Value>(&bytes).ok()) {
        Some(report) => (report["name"].as_str()?.to_owned(), report["outcome"] == "done"),
        None => (checkpoint::newest(directory).ok()?.checkpoint.origin.name, false),
    };
    // The name must be usable as part of a file name.
    (Path::new(&found.0).file_name() == Some(found.0.as_ref())).then_some(found)
}
