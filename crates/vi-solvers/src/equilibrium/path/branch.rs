//! A place on a path of equilibria: where the path goes from there, and lengths along it.

use vi_core::State;

use crate::equilibrium::search::Search;
use crate::vectors;

/// What the next step along a path depends on beside the state.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Path {
    /// What a unit of load weighs against a metre: the root mean square of dq/dt at the start, m.
    pub(crate) psi: f64,
    /// Radius of the next arc step, m.
    pub(crate) length: f64,
    /// The last shift σ that made K + σM definite, 1/s².
    pub(crate) shift: f64,
    /// The step before, Δq and Δt: its sense is kept.
    pub(crate) last: (Vec<f64>, f64),
    /// dq/dt at the state.
    pub(crate) velocity: Vec<f64>,
    /// Has K a Cholesky factor at the state?
    pub(crate) is_stable: bool,
}

/// A direction of the path.
pub(super) struct Tangent {
    /// dq/dt.
    pub(super) velocity: Vec<f64>,
    /// Has K a Cholesky factor?
    pub(super) is_stable: bool,
}

impl Path {
    /// Arc length of a change of the load factor where the body responds as at the start, m.
    pub(super) fn arc_of(&self, load: f64) -> f64 {
        load.abs() * self.psi * 2.0_f64.sqrt()
    }

    /// Where the path would be at t + dt if it were straight.
    pub(super) fn predict(&self, state: &State, dt: f64) -> State {
        let q = state.q.iter().zip(&self.velocity).map(|(q, v)| q + dt * v).collect();
        State { t: state.t + dt, q, p: Vec::new() }
    }
}

/// xᵀM y / m.
pub(super) fn mass_product(search: &Search, x: &[f64], y: &[f64]) -> f64 {
    let mass = search.balance.system.free_mass();
    let total = vectors::sum(x.len(), |k| mass[k]);
    vectors::sum(x.len(), |k| mass[k] * x[k] * y[k]) / total
}

pub(super) fn rms(search: &Search, x: &[f64]) -> f64 {
    mass_product(search, x, x).sqrt()
}
