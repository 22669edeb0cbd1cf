//! How a path turns over a step: too much for one step, or around a limit point. Nothing here makes a step.

use vi_core::State;

use crate::equilibrium::critical;
use crate::equilibrium::options::{CriticalKind, CriticalPoint};
use crate::equilibrium::path::branch::{Path, Tangent, mass_product};
use crate::equilibrium::search::Search;
use crate::error::SolverError;

/// An arc step over which the path turns by more than the angle of this cosine (18°) is halved: it may have jumped
/// over a limit point. The arch of `tests/laws/accuracy.rs`, which snaps at a twentieth of its load, is so followed through
/// both limit points from a first step of half of its load on; with 0.9 (25°) it is not. Allgower & Georg (2003,
/// chapter 6) bound the angle alike.
const LEAST_COSINE: f64 = 0.95;

impl Path {
    /// Does the path turn by more than [`LEAST_COSINE`] allows over a step to `next`, forwards for dt > 0?
    pub(super) fn turns(
        &self,
        search: &Search,
        state: &State,
        next: &State,
        tangent: &Tangent,
        dt: f64,
    ) -> bool {
        let product = |a: &[f64], b: &[f64]| mass_product(search, a, b) + self.psi * self.psi;
        let norms = product(&self.velocity, &self.velocity) * product(&tangent.velocity, &tangent.velocity);
        let cosine = product(&self.velocity, &tangent.velocity) / norms.sqrt();
        dt.signum() * self.sense(search, state, next, tangent) * cosine < LEAST_COSINE
    }

    /// Does the load factor rise (1) or fall (−1) where a step from `state` to `next` goes on?
    pub(super) fn sense(&self, search: &Search, state: &State, next: &State, tangent: &Tangent) -> f64 {
        let moved: Vec<f64> = next.q.iter().zip(&state.q).map(|(next, q)| next - q).collect();
        let moved_t = next.t - state.t;
        (mass_product(search, &moved, &tangent.velocity) + self.psi * self.psi * moved_t).signum()
    }

    /// The load factor at which it turns between two equilibria: that of the cubic through both with the slopes there.
    pub(super) fn turning_load(
        &self,
        search: &Search,
        state: &State,
        next: &State,
        tangent: &Tangent,
        senses: [f64; 2],
    ) -> f64 {
        let moved: Vec<f64> = next.q.iter().zip(&state.q).map(|(next, q)| next - q).collect();
        let (squared, moved_t) = (self.psi * self.psi, next.t - state.t);
        let length = (mass_product(search, &moved, &moved) + squared * moved_t * moved_t).sqrt();
        let slope = |velocity: &[f64], sense: f64| {
            sense * length / (mass_product(search, velocity, velocity) + squared).sqrt()
        };
        let (a, b) = (slope(&self.velocity, senses[0]), slope(&tangent.velocity, senses[1]));
        // The slope a + 2 c s + 3 d s² has unlike signs at s = 0 and 1: one zero between them, found by bisection.
        let (c, d) = (3.0 * moved_t - 2.0 * a - b, a + b - 2.0 * moved_t);
        let (mut low, mut high) = (0.0, 1.0);
        for _ in 0..60 {
            let s = 0.5 * (low + high);
            if (a + s * (2.0 * c + 3.0 * d * s)) * a > 0.0 { low = s } else { high = s }
        }
        state.t + low * (a + low * (c + low * d))
    }
}

/// Enters a critical point between two equilibria; without its load factor, where the lowest eigenvalue crosses zero.
pub(super) fn note_critical(
    search: &mut Search,
    before: &State,
    after: &State,
    kind: CriticalKind,
    load_factor: Option<f64>,
) -> Result<(), SolverError> {
    let (first, _) = critical::lowest(&mut search.balance, &before.q, before.t)?;
    let (last, _) = critical::lowest(&mut search.balance, &after.q, after.t)?;
    let along = if first == last { 0.5 } else { (first / (first - last)).clamp(0.0, 1.0) };
    let load_factor = load_factor.unwrap_or(before.t + along * (after.t - before.t));
    search.report.critical.push(CriticalPoint { kind, load_factor, eigenvalues: [first, last] });
    Ok(())
}
