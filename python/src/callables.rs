//! Terms and motions that are written in Python.
//!
//! A callable is called once per evaluation, with the arrays of all its nodes; the ranges of stencils that the solvers
//! ask for are served from its last result. An exception is kept until the step has ended; the results of that step
//! are NaN and are discarded.

mod force;
mod motion;
mod potential;

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use numpy::{PyArrayDyn, PyArrayMethods, PyUntypedArrayMethods};
use pyo3::call::PyCallArgs;
use pyo3::prelude::*;
use variational::core::packed_len;

use crate::errors;
pub(crate) use force::CallableForce;
pub(crate) use motion::CallableMotion;
pub(crate) use potential::CallablePotential;

/// Returns the value of a mutex. No code panics while it holds one of these.
pub(crate) fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// The first exception of the callables of a simulation.
#[derive(Clone, Default)]
pub(crate) struct Raised(Arc<Mutex<Option<PyErr>>>);

impl Raised {
    /// Returns whether there is an exception.
    pub(crate) fn is_set(&self) -> bool {
        lock(&self.0).is_some()
    }

    /// Takes the exception.
    pub(crate) fn take(&self) -> Option<PyErr> {
        lock(&self.0).take()
    }

    /// Calls `make` unless there is an exception; an exception of the call is kept and gives `None`.
    fn guard<T>(&self, make: impl FnOnce(Python<'_>) -> PyResult<T>) -> Option<T> {
        if self.is_set() {
            return None;
        }
        Python::attach(make).map_err(|error| *lock(&self.0) = Some(error)).ok()
    }
}

/// Calls a method and returns its result as numbers, of the expected shape.
fn numbers<'py>(
    object: &Bound<'py, PyAny>,
    method: &str,
    args: impl PyCallArgs<'py>,
    shapes: &[&[usize]],
) -> PyResult<Vec<f64>> {
    let py = object.py();
    let result =
        if method == "__call__" { object.call1(args)? } else { object.call_method1(method, args)? };
    let array = py.import("numpy")?.call_method1("ascontiguousarray", (result, "d"))?;
    let array = array.cast_into::<PyArrayDyn<f64>>()?;
    if !shapes.contains(&array.shape()) {
        return Err(errors::value(format!(
            "{method} of {}: expected an array of shape {:?}, found {:?}",
            object.get_type().name()?,
            shapes[0],
            array.shape()
        )));
    }
    array.readonly().to_vec().map_err(errors::value)
}

/// The last result of a method.
#[derive(Default)]
struct Last {
    t: f64,
    local: Vec<f64>,
    values: Vec<f64>,
}

/// Returns the packed lower triangles of n × n matrices, symmetrised.
fn packed(full: &[f64], n: usize) -> Vec<f64> {
    let mut out = Vec::with_capacity(full.len() / (n * n) * packed_len(n));
    for matrix in full.chunks_exact(n * n) {
        for i in 0..n {
            out.extend((0..=i).map(|j| 0.5 * (matrix[n * i + j] + matrix[n * j + i])));
        }
    }
    out
}

/// Returns the name of a term: its attribute `name`, or its class.
fn name_of(object: &Bound<'_, PyAny>) -> PyResult<String> {
    let given = object.getattr_opt("name")?.and_then(|name| name.extract().ok());
    match given.or_else(|| object.getattr("__name__").and_then(|name| name.extract()).ok()) {
        Some(name) => Ok(name),
        None => Ok(object.get_type().name()?.to_string()),
    }
}
