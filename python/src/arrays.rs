//! Numpy arrays from vectors, without a copy, and checked vectors from numpy arrays.

use numpy::{PyArray1, PyArray2, PyArrayMethods, PyReadonlyArray2, PyUntypedArrayMethods};
use pyo3::prelude::*;

use crate::errors;

/// Returns an array of shape (n, 3).
pub(crate) fn points_array(py: Python<'_>, points: Vec<[f64; 3]>) -> PyResult<Bound<'_, PyArray2<f64>>> {
    let count = points.len();
    PyArray1::from_vec(py, points.into_flattened()).reshape([count, 3])
}

/// Returns an array with `columns` columns.
pub(crate) fn float_array(
    py: Python<'_>,
    values: Vec<f64>,
    columns: usize,
) -> PyResult<Bound<'_, PyArray2<f64>>> {
    let count = values.len() / columns.max(1);
    PyArray1::from_vec(py, values).reshape([count, columns])
}

/// Returns an array of whole numbers with `columns` columns.
pub(crate) fn int_array(
    py: Python<'_>,
    values: Vec<i64>,
    columns: usize,
) -> PyResult<Bound<'_, PyArray2<i64>>> {
    let count = values.len() / columns.max(1);
    PyArray1::from_vec(py, values).reshape([count, columns])
}

/// Reads an array of shape (count, 3) with finite entries; `name` names it in errors.
pub(crate) fn vectors(
    name: &str,
    array: &PyReadonlyArray2<'_, f64>,
    count: usize,
) -> PyResult<Vec<[f64; 3]>> {
    let shape = array.shape();
    if shape != [count, 3] {
        return Err(errors::value(format!("{name}: expected shape ({count}, 3), found {shape:?}")));
    }
    let values = array.to_vec().map_err(errors::value)?;
    if let Some(at) = values.iter().position(|value| !value.is_finite()) {
        let (node, axis, value) = (at / 3, at % 3, values[at]);
        return Err(errors::value(format!("{name}: entry ({node}, {axis}) is {value}, but must be finite")));
    }
    Ok(values.as_chunks::<3>().0.to_vec())
}
