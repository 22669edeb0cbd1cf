//! A bond of all free coordinates to a place.

use crate::vectors;

/// The potential ½ σ |q − q̂|² in the norm of mass.
#[derive(Debug, Clone)]
pub(super) struct Bond {
    /// q̂, m.
    pub(super) place: Vec<f64>,
    /// σ, 1/s².
    pub(super) shift: f64,
}

impl Bond {
    /// Returns the potential at q, J, with the mass of each coordinate, kg.
    pub(super) fn energy(&self, mass: &[f64], q: &[f64]) -> f64 {
        0.5 * self.shift * vectors::sum(q.len(), |k| mass[k] * (q[k] - self.place[k]).powi(2))
    }

    /// Adds σ M (q − q̂) to `gradient`, N.
    pub(super) fn add_gradient(&self, mass: &[f64], q: &[f64], gradient: &mut [f64]) {
        vectors::update(gradient, |k, gradient| {
            *gradient += self.shift * mass[k] * (q[k] - self.place[k]);
        });
    }
}
