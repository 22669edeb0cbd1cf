//! Studies of a scene: bench, convergence, modes and sweeps.

use std::path::PathBuf;
use std::time::Duration;

use numpy::{PyArray1, PyArray2};
use pyo3::prelude::*;
use variational::auto::stand_in;
use variational::run::RunError;
use variational::scene::MassKind;
use variational::simulation::Simulation;
use variational::study::bench::{self as benches, BenchError, BenchOptions};
use variational::study::convergence::{self as refinement, ConvergenceError, ConvergenceOptions};
use variational::study::modes::{SceneModes, scene_modes};
use variational::study::sweep::{self as sweeps, Axis, SweepError, SweepOptions};

use crate::arrays::{float_array, int_array};
use crate::callables::Raised;
use crate::errors;
use crate::scene::Scene;
use crate::supervise::{SweepLink, supervise};
use crate::threads::Threads;

/// Measures schemes and steps; returns the report as JSON.
#[pyfunction]
#[allow(clippy::too_many_arguments, reason = "keywords of one Python function")]
pub(crate) fn bench(
    py: Python<'_>,
    scene: &Scene,
    name: String,
    budget: f64,
    accuracy: Option<f64>,
    schemes: Vec<String>,
    threads: Option<usize>,
    hear: Option<&Bound<'_, PyAny>>,
) -> PyResult<String> {
    if !(budget > 0.0 && budget < 1e9) {
        return Err(errors::value(format!("budget must be positive (s), is {budget}")));
    }
    let (threads, raised) = (Threads::new(threads)?, Raised::default());
    let armed = scene.reporting_to(py, &raised)?;
    let options = BenchOptions { name, budget: Duration::from_secs_f64(budget), accuracy, schemes };
    let result = supervise(py, &threads, &raised, hear, |mut link| {
        let armed = armed.interruptible(link.interrupt());
        benches::bench(&armed, &options, &mut link)
    })?;
    let report = result.map_err(|error| match error {
        BenchError::Scene(problems) => scene.refused(py, problems),
        error => errors::plain(py, "StudyError", &error.to_string()),
    })?;
    serde_json::to_string(&report).map_err(errors::value)
}

/// Refines mesh and step; returns the report as JSON.
#[pyfunction]
#[allow(clippy::too_many_arguments, reason = "keywords of one Python function")]
pub(crate) fn convergence(
    py: Python<'_>,
    scene: &Scene,
    name: String,
    levels: u32,
    space: bool,
    time: bool,
    modes: Option<usize>,
    threads: Option<usize>,
    hear: Option<&Bound<'_, PyAny>>,
) -> PyResult<String> {
    if !(2..=6).contains(&levels) {
        return Err(errors::value(format!("levels must be 2 to 6, is {levels}")));
    }
    let (threads, raised) = (Threads::new(threads)?, Raised::default());
    let armed = scene.reporting_to(py, &raised)?;
    let options = ConvergenceOptions { name, levels, space, time, modes };
    let result = supervise(py, &threads, &raised, hear, |mut link| {
        let armed = armed.interruptible(link.interrupt());
        refinement::convergence(&armed, &options, &mut link)
    })?;
    let report = result.map_err(|error| match error {
        ConvergenceError::Scene(problems) => scene.refused(py, problems),
        error => errors::plain(py, "StudyError", &error.to_string()),
    })?;
    serde_json::to_string(&report).map_err(errors::value)
}

/// Shapes of a component: its number, the modes (rows), and body, node and axis of each column.
type Shapes<'py> = (usize, Bound<'py, PyArray2<f64>>, Bound<'py, PyArray2<i64>>);

/// Returns ω², effective masses (3 per mode), components, and the shapes of each component.
#[pyfunction]
#[allow(clippy::type_complexity, reason = "the tuple is unpacked in Python")]
pub(crate) fn modes<'py>(
    py: Python<'py>,
    scene: &Scene,
    count: usize,
    lumped: bool,
    threads: Option<usize>,
) -> PyResult<(Bound<'py, PyArray1<f64>>, Bound<'py, PyArray2<f64>>, Vec<usize>, Vec<Shapes<'py>>)> {
    let (threads, raised) = (Threads::new(threads)?, Raised::default());
    let armed = stand_in(&scene.reporting_to(py, &raised)?);
    let mass = if lumped { MassKind::Lumped } else { MassKind::Consistent };
    let result = supervise(py, &threads, &raised, None, |link| -> Result<_, RunError> {
        let armed = armed.interruptible(link.interrupt());
        let mut simulation = Simulation::new(armed).map_err(RunError::Scene)?;
        let found = scene_modes(&mut simulation, count, mass)?;
        let free: Vec<_> = (0..simulation.components().len())
            .map(|component| crate::simulation::free_coordinates(&simulation, component))
            .collect();
        Ok((found, free))
    })?;
    let (SceneModes { modes, .. }, free) = result.map_err(|error| scene.failed(py, error))?;
    let squares = modes.iter().map(|mode| mode.mode.omega_squared).collect();
    let masses =
        modes.iter().flat_map(|mode| mode.mode.participation.map(|factor| factor * factor)).collect();
    let components = modes.iter().map(|mode| mode.component).collect();
    let mut shapes = Vec::new();
    for (component, free) in free.into_iter().enumerate() {
        let own = modes.iter().filter(|mode| mode.component == component);
        let values: Vec<f64> = own.flat_map(|mode| mode.mode.shape.iter().copied()).collect();
        if !values.is_empty() {
            let columns = free.len() / 3;
            shapes.push((component, float_array(py, values, columns)?, int_array(py, free, 3)?));
        }
    }
    Ok((PyArray1::from_vec(py, squares), float_array(py, masses, 3)?, components, shapes))
}

/// Runs a scene file at every combination of values; returns points, ended and failed ones.
#[pyfunction]
#[allow(clippy::too_many_arguments, reason = "keywords of one Python function")]
pub(crate) fn sweep(
    py: Python<'_>,
    scene: PathBuf,
    overrides: Vec<String>,
    axes: Vec<(String, Vec<String>)>,
    directory: PathBuf,
    jobs: usize,
    threads: usize,
    task: (usize, usize),
    hear: Option<&Bound<'_, PyAny>>,
) -> PyResult<(usize, usize, usize)> {
    if jobs == 0 || threads == 0 || task.0 >= task.1 {
        return Err(errors::value("jobs and threads must be at least 1, and task (i, n) have 0 ≤ i < n"));
    }
    let axes = axes.into_iter().map(|(key, values)| Axis { key, values }).collect();
    let options = SweepOptions { scene, overrides, axes, directory, jobs, threads, task };
    let (threads, raised) = (Threads::new(Some(1))?, Raised::default());
    let result =
        supervise(py, &threads, &raised, hear, |link| sweeps::sweep(&options, &SweepLink::new(link)))?;
    let report = result.map_err(|error| match error {
        SweepError::Scene(problems) => errors::scene(py, problems),
        SweepError::Output { source, .. } => errors::run(py, source),
        error => errors::plain(py, "StudyError", &error.to_string()),
    })?;
    Ok((report.points, report.done, report.failed))
}
