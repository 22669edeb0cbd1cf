//! Prescribed motions that are written in Python.

use numpy::{PyArray1, PyArrayMethods};
use pyo3::prelude::*;
use variational::fem::NodalMotion;

use super::{Raised, numbers};

/// A prescribed motion `f(x, t)` (n, 3): the positions at time t of the points that start at x (n, 3). A method
/// `velocity(x, t)` gives their velocities; without it, the positions are differenced to order 4.
pub(crate) struct CallableMotion {
    object: Py<PyAny>,
    has_velocity: bool,
    /// Step of the differences, s.
    difference: f64,
    raised: Raised,
}

impl CallableMotion {
    /// Makes the motion; `step` is the step of the scene, s.
    pub(crate) fn new(object: Py<PyAny>, step: f64, raised: Raised) -> Self {
        let has_velocity = Python::attach(|py| object.bind(py).hasattr("velocity").unwrap_or(false));
        Self { object, has_velocity, difference: 0.1 * step, raised }
    }

    fn call(&self, method: &str, start: &[[f64; 3]], t: f64, out: &mut [[f64; 3]]) {
        let count = start.len();
        let values = self.raised.guard(|py| {
            let x = PyArray1::from_slice(py, start.as_flattened()).reshape([count, 3])?;
            numbers(self.object.bind(py), method, (x, t), &[&[count, 3]])
        });
        match values {
            Some(values) => out.as_flattened_mut().copy_from_slice(&values),
            None => out.as_flattened_mut().fill(f64::NAN),
        }
    }
}

impl NodalMotion for CallableMotion {
    fn positions(&self, start: &[[f64; 3]], t: f64, out: &mut [[f64; 3]]) {
        self.call("__call__", start, t, out);
    }

    fn velocities(&self, start: &[[f64; 3]], t: f64, out: &mut [[f64; 3]]) {
        if self.has_velocity {
            return self.call("velocity", start, t, out);
        }
        let h = self.difference;
        let mut at = vec![[0.0; 3]; start.len()];
        out.as_flattened_mut().fill(0.0);
        for (step, weight) in [(-2.0, 1.0), (-1.0, -8.0), (1.0, 8.0), (2.0, -1.0)] {
            self.positions(start, t + step * h, &mut at);
            for (out, x) in out.as_flattened_mut().iter_mut().zip(at.as_flattened()) {
                *out += weight / (12.0 * h) * x;
            }
        }
    }
}
