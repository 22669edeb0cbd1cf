//! A point on a path of equilibria: the direction of the path there, and lengths along it.

use vi_core::State;

use crate::equilibrium::search::Search;
use crate::vectors;

/// The data besides the state on which the next step along a path depends.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Path {
    /// The length that corresponds to a unit of load: the root mean square of dq/dt at the start, m.
    pub(crate) psi: f64,
    /// Radius of the next arc step, m.
    pub(crate) length: f64,
    /// The last shift σ that made K + σM definite, 1/s².
    pub(crate) shift: f64,
    /// The previous step, Δq and Δt; the next one keeps its direction.
    pub(crate) last: (Vec<f64>, f64),
    /// dq/dt at the state.
    pub(crate) velocity: Vec<f64>,
    /// Whether K has a Cholesky factor at the state.
    pub(crate) is_stable: bool,
}

/// The direction of the path.
pub(super) struct Tangent {
    /// dq/dt.
    pub(super) velocity: Vec<f64>,
    /// Whether K has a Cholesky factor.
    pub(super) is_stable: bool,
}

impl Path {
    /// Returns the arc length (m) of a change of the load factor, with the response of the body at the start.
    pub(super) fn arc_of(&self, load: f64) -> f64 {
        load.abs() * self.psi * 2.0_f64.sqrt()
    }

    /// Returns the linear prediction of the path at t + dt.
    pub(super) fn predict(&self, state: &State, dt: f64) -> State {
        let q = state.q.iter().zip(&self.velocity).map(|(q, v)| q + dt * v).collect();
        State { t: state.t + dt, q, p: Vec::new() }
    }
}

/// Returns xᵀM y / m.
pub(super) fn mass_product(search: &Search, x: &[f64], y: &[f64]) -> f64 {
    let mass = search.balance.system.free_mass();
    let total = vectors::sum(x.len(), |k| mass[k]);
    vectors::sum(x.len(), |k| mass[k] * x[k] * y[k]) / total
}

pub(super) fn rms(search: &Search, x: &[f64]) -> f64 {
    mass_product(search, x, x).sqrt()
}
