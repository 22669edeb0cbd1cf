//! Runs that write files, as the command line does, and the command line itself.

use std::ffi::OsString;
use std::path::PathBuf;

use pyo3::prelude::*;
use variational::run as runs;
use variational::run::checkpoint::{Found, newest};
use variational::run::report::Report;

use crate::callables::Raised;
use crate::errors;
use crate::scene::Scene;
use crate::supervise::supervise;
use crate::threads::Threads;

/// Runs a scene and writes its files into a directory; returns the report as JSON.
#[pyfunction]
pub(crate) fn run(
    py: Python<'_>,
    scene: &Scene,
    name: &str,
    directory: PathBuf,
    threads: Option<usize>,
    hear: Option<&Bound<'_, PyAny>>,
) -> PyResult<String> {
    let (threads, raised) = (Threads::new(threads)?, Raised::default());
    let armed = scene.reporting_to(py, &raised)?;
    let source = scene.source.as_ref().map(|(path, keys)| (path.as_path(), keys.as_slice()));
    let result = supervise(py, &threads, &raised, hear, |mut link| {
        let armed = armed.interruptible(link.interrupt());
        runs::run_from(source, armed, name, &directory, &mut link)
    })?;
    json(&result.map_err(|error| scene.failed(py, error))?)
}

/// Continues the run in a directory from its newest checkpoint; returns its name and the report as JSON.
#[pyfunction]
pub(crate) fn resume(
    py: Python<'_>,
    directory: PathBuf,
    scene: Option<&Scene>,
    threads: Option<usize>,
    hear: Option<&Bound<'_, PyAny>>,
) -> PyResult<(String, String)> {
    let (threads, raised) = (Threads::new(threads)?, Raised::default());
    let Found { checkpoint, damages, .. } =
        newest(&directory).map_err(|error| errors::checkpoint(py, &error))?;
    if let Some(hear) = hear {
        for damage in damages {
            hear.call1(("finding", format!("damaged checkpoint: {damage}")))?;
        }
    }
    let armed = match scene {
        Some(scene) => scene.reporting_to(py, &raised)?,
        None => {
            let parsed = checkpoint.origin.read_scene().map_err(|error| errors::checkpoint(py, &error))?;
            match parsed.scene.filter(|_| parsed.problems.is_empty()) {
                Some(scene) => scene,
                None => return Err(errors::scene(py, parsed.problems)),
            }
        }
    };
    let name = checkpoint.origin.name.clone();
    let result = supervise(py, &threads, &raised, hear, |mut link| {
        let armed = armed.interruptible(link.interrupt());
        runs::resume(armed, &checkpoint, &directory, &mut link)
    })?;
    Ok((name, json(&result.map_err(|error| errors::run(py, error))?)?))
}

fn json(report: &Report) -> PyResult<String> {
    serde_json::to_string(report).map_err(errors::value)
}

/// Runs the command `variational` with these arguments (the first is its name); returns the exit code.
#[pyfunction]
pub(crate) fn cli(py: Python<'_>, arguments: Vec<OsString>) -> u8 {
    py.detach(|| variational::cli::execute(arguments))
}
