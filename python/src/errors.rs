//! Converts the errors of the library to the exceptions of `variational_sim.errors`.

use std::path::Path;

use pyo3::IntoPyObject;
use pyo3::call::PyCallArgs;
use pyo3::exceptions::{PyKeyboardInterrupt, PyValueError};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use variational::run::RunError;
use variational::run::checkpoint::CheckpointError;
use variational::scene::Problem;
use variational::solvers::{SolverError, StepError};

/// Makes the exception `class` of `variational_sim.errors`.
fn exception<'py>(py: Python<'py>, class: &str, args: impl PyCallArgs<'py>, facts: &[Fact<'_>]) -> PyErr {
    let make = || -> PyResult<Bound<'py, PyAny>> {
        let named = PyDict::new(py);
        for (name, fact) in facts {
            named.set_item(name, fact.into_pyobject(py)?)?;
        }
        py.import("variational_sim.errors")?.getattr(class)?.call(args, Some(&named))
    };
    make().map_or_else(|error| error, PyErr::from_value)
}

/// An attribute of an exception.
type Fact<'a> = (&'a str, Value);

#[derive(IntoPyObject, IntoPyObjectRef)]
enum Value {
    Number(f64),
    Count(u64),
    Text(String),
}

/// Makes an exception that has a message only.
pub(crate) fn plain(py: Python<'_>, class: &str, message: &str) -> PyErr {
    exception(py, class, (message,), &[])
}

/// Makes `SceneError` from all problems of a scene.
pub(crate) fn scene(py: Python<'_>, problems: Vec<Problem>) -> PyErr {
    let entry = |problem: Problem| {
        let file = problem.file.map(|file| file.display().to_string());
        (problem.key, problem.message, problem.line, file)
    };
    let problems: Vec<_> = problems.into_iter().map(entry).collect();
    exception(py, "SceneError", (problems,), &[])
}

/// Makes `StepError` from a failed step, which has the number `step` (from 1).
pub(crate) fn step(py: Python<'_>, step: u64, error: &StepError) -> PyErr {
    let mut facts =
        vec![("step", Value::Count(step)), ("t", Value::Number(error.t)), ("h", Value::Number(error.h))];
    if let SolverError::Term { term, .. } = error.cause.without_contact() {
        facts.push(("term", Value::Text(term.term.to_string())));
        facts.push(("element", Value::Count(term.fault.element as u64)));
        facts.push(("quantity", Value::Text(term.fault.quantity.to_owned())));
    }
    exception(py, "StepError", (format!("step {step}: {error}"),), &facts)
}

/// Makes the exception for a run that ended early.
pub(crate) fn run(py: Python<'_>, error: RunError) -> PyErr {
    let message = error.to_string();
    match error {
        RunError::Scene(problems) => scene(py, problems),
        RunError::Step { step: number, source } => step(py, number, &source),
        RunError::Guard { step, t, .. } => {
            exception(py, "GuardError", (message,), &[("step", Value::Count(step)), ("t", Value::Number(t))])
        }
        RunError::Beyond { step, .. } => {
            exception(py, "StepError", (message,), &[("step", Value::Count(step))])
        }
        RunError::Checkpoint(error) => checkpoint(py, &error),
        RunError::Stopped => PyKeyboardInterrupt::new_err(message),
        _ => plain(py, "OutputError", &message),
    }
}

/// Makes `CheckpointError`.
pub(crate) fn checkpoint(py: Python<'_>, error: &CheckpointError) -> PyErr {
    plain(py, "CheckpointError", &error.to_string())
}

/// Makes `OutputError` for a file that could not be read or written.
pub(crate) fn file(py: Python<'_>, path: &Path, error: &std::io::Error) -> PyErr {
    plain(py, "OutputError", &format!("{}: {error}", path.display()))
}

/// Makes `ValueError`.
pub(crate) fn value(error: impl std::fmt::Display) -> PyErr {
    PyValueError::new_err(error.to_string())
}
