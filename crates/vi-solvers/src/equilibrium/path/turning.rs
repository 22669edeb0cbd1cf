//! Judges how a path turns over a step: too much for one step, or around a limit point.

use vi_core::State;

use crate::equilibrium::lowest_mode::lowest;
use crate::equilibrium::options::{CriticalKind, CriticalPoint};
use crate::equilibrium::path::branch::{Path, Tangent, mass_product};
use crate::equilibrium::search::Search;
use crate::error::SolverError;

/// Smallest cosine of the angle by which the path may turn over an arc step (18°). A step with a larger angle is
/// halved, because it may have jumped over a limit point. With this value the arch of `tests/laws/accuracy.rs`, which
/// snaps at a twentieth of its load, is followed through both limit points even if the first step is half of its
/// load; with 0.9 (25°) it is not. Allgower & Georg (2003, chapter 6) bound the angle in the same way.
const LEAST_COSINE: f64 = 0.95;

impl Path {
    /// Returns whether the path turns by more than [`LEAST_COSINE`] allows over a step to `next`, forwards for dt >
    /// 0.
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

    /// Returns whether the load factor rises (1) or falls (−1) after the step from `state` to `next`.
    pub(super) fn sense(&self, search: &Search, state: &State, next: &State, tangent: &Tangent) -> f64 {
        let moved: Vec<f64> = next.q.iter().zip(&state.q).map(|(next, q)| next - q).collect();
        let moved_t = next.t - state.t;
        (mass_product(search, &moved, &tangent.velocity) + self.psi * self.psi * moved_t).signum()
    }

    /// Returns the load factor at which the path turns between two equilibria: that of the cubic through both with
    /// the slopes there.
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
        // The slope a + 2 c s + 3 d s² has different signs at s = 0 and 1; bisection finds the zero between them.
        let (c, d) = (3.0 * moved_t - 2.0 * a - b, a + b - 2.0 * moved_t);
        let (mut low, mut high) = (0.0, 1.0);
        for _ in 0..60 {
            let s = 0.5 * (low + high);
            if (a + s * (2.0 * c + 3.0 * d * s)) * a > 0.0 { low = s } else { high = s }
        }
        state.t + low * (a + low * (c + low * d))
    }
}

/// Records a limit point between two equilibria.
pub(super) fn note_limit(
    search: &mut Search,
    before: &State,
    after: &State,
    load_factor: f64,
) -> Result<(), SolverError> {
    let (first, _) = lowest(&mut search.balance, &before.q, before.t)?;
    let (last, _) = lowest(&mut search.balance, &after.q, after.t)?;
    let (kind, error) = (CriticalKind::Limit, 0.0);
    search.report.critical.push(CriticalPoint { kind, load_factor, error, eigenvalues: [first, last] });
    Ok(())
}
