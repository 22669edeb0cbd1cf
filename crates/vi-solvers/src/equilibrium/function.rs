//! A function c(x) of the positions that controls a path of equilibria: a displacement, or an enclosed volume. It is
//! given as a sum of local terms, like a potential.

use std::sync::Arc;

use vi_core::{Coordinates, Potential, System, Terms};

use crate::assemble::assembler::Assembler;
use crate::error::SolverError;
use crate::vectors;

/// The function c(x) = Σ terms − origin.
pub struct PathFunction {
    assembler: Assembler,
    origin: f64,
}

/// Value and derivatives of a [`PathFunction`] at (q, t).
pub(crate) struct FunctionValue {
    /// c(x(q, t)).
    pub(crate) value: f64,
    /// ∂c/∂q.
    pub(crate) gradient: Vec<f64>,
    /// ∂c/∂t; not zero if prescribed coordinates move with the load factor.
    rate: f64,
}

impl FunctionValue {
    /// Returns dc/dt along dq/dt.
    pub(crate) fn slope(&self, velocity: &[f64]) -> f64 {
        vectors::sum(velocity.len(), |k| self.gradient[k] * velocity[k]) + self.rate
    }
}

impl PathFunction {
    /// Returns the sum of the energies of `terms` over the coordinates of `system`, minus its value at the positions
    /// `rest` (m, one per coordinate).
    ///
    /// # Errors
    /// Returns [`SolverError::Memory`] if a term names a node that the system does not have.
    pub fn new(system: &System, terms: Vec<Box<dyn Potential>>, rest: &[f64]) -> Result<Self, SolverError> {
        let mismatch = |_| SolverError::Memory { missing: "node of the function that controls the path" };
        // All coordinates are free here, so that no term counts as constant.
        let coordinates = Coordinates::all_free(system.coordinates().dof_count());
        let terms = terms.into_iter().map(Arc::from).collect();
        let mut assembler = Assembler::new(&Terms::new(Arc::new(coordinates), terms).map_err(mismatch)?);
        let origin = assembler.energies(rest, 0.0).total();
        Ok(Self { assembler, origin })
    }

    /// Returns c at positions x, one per coordinate.
    pub fn value(&mut self, x: &[f64]) -> f64 {
        self.assembler.energies(x, 0.0).total() - self.origin
    }

    /// Returns c and its derivatives at (q, t) of the system that is followed; `end` gives the size of its load
    /// factors.
    pub(crate) fn at(&mut self, followed: &System, q: &[f64], t: f64, end: f64) -> FunctionValue {
        let coordinates = followed.coordinates();
        let mut x = vec![0.0; coordinates.dof_count()];
        let mut rate = 0.0;
        if coordinates.is_moving() {
            let e = 1e-6 * t.abs().max(end.abs());
            coordinates.embed(q, t + e, &mut x);
            let above = self.value(&x);
            coordinates.embed(q, t - e, &mut x);
            rate = (above - self.value(&x)) / (2.0 * e);
        }
        coordinates.embed(q, t, &mut x);
        let mut gradient = vec![0.0; x.len()];
        self.assembler.gradient(&x, 0.0, &mut gradient);
        coordinates.pull_back(&mut gradient);
        let mut free = vec![0.0; q.len()];
        coordinates.restrict(&gradient, &mut free);
        FunctionValue { value: self.value(&x), gradient: free, rate }
    }
}
