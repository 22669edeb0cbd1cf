//! Observations and matrices of a simulation as Python objects.

use numpy::PyArray1;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use variational::simulation::Observation;
use variational::simulation::matrices::LowerTriangle;

/// Returns energies, momenta, probes and rigid bodies as a dict; the names are those of probes and rigid bodies.
pub(crate) fn observation<'py>(
    py: Python<'py>,
    seen: &Observation,
    probes: &[String],
    rigids: &[String],
) -> PyResult<Bound<'py, PyDict>> {
    let out = PyDict::new(py);
    for (name, value) in [
        ("t", seen.t),
        ("kinetic", seen.kinetic),
        ("elastic", seen.elastic),
        ("gravity", seen.gravity),
        ("load", seen.load),
        ("contact", seen.contact),
        ("total", seen.total()),
    ] {
        out.set_item(name, value)?;
    }
    out.set_item("momentum", PyArray1::from_slice(py, &seen.momentum))?;
    out.set_item("angular_momentum", PyArray1::from_slice(py, &seen.angular_momentum))?;
    out.set_item("load_factor", seen.load_factor)?;
    let values = PyDict::new(py);
    for (name, probe) in probes.iter().zip(&seen.probes) {
        let [x, u] = [&probe.position, &probe.displacement].map(|of| PyArray1::from_slice(py, of));
        values.set_item(name, (x, u))?;
    }
    out.set_item("probes", values)?;
    let poses = PyDict::new(py);
    for (name, pose) in rigids.iter().zip(&seen.rigids) {
        let orientation = PyArray1::from_slice(py, &pose.orientation);
        poses.set_item(name, (PyArray1::from_slice(py, &pose.position), orientation))?;
    }
    out.set_item("rigids", poses)?;
    if let Some(facts) = seen.contact_facts {
        out.set_item("contact_facts", (facts.pairs, facts.smallest_gap, facts.friction, facts.damping))?;
    }
    Ok(out)
}

/// Returns rows, columns and values of a lower triangle.
pub(crate) fn triangle<'py>(py: Python<'py>, triangle: &LowerTriangle) -> [Bound<'py, PyAny>; 3] {
    let numbers = |pick: fn(&(usize, usize, f64)) -> usize| {
        let numbers = triangle.entries.iter().map(|entry| pick(entry) as i64).collect();
        PyArray1::from_vec(py, numbers).into_any()
    };
    let values = triangle.entries.iter().map(|entry| entry.2).collect();
    [numbers(|entry| entry.0), numbers(|entry| entry.1), PyArray1::from_vec(py, values).into_any()]
}
