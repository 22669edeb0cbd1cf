//! Bifurcations on a path of equilibria: the load factor at which the lowest eigenvalue crosses zero between two steps.

use vi_core::State;

use crate::equilibrium::lowest_mode::lowest;
use crate::equilibrium::options::{CriticalKind, CriticalPoint};
use crate::equilibrium::path::branch::{Path, mass_product};
use crate::equilibrium::path::corrector::Closure;
use crate::equilibrium::search::Search;
use crate::error::SolverError;

/// Largest number of equilibria between the two steps that are tried.
const MOST_TRIALS: usize = 40;

/// Largest number of equilibria that are tried in place of one that is not found.
const MOST_RETRIES: usize = 4;

/// Relative change of the load factor, and fraction of the smaller eigenvalue of the two steps, below which the search ends.
const CLOSE: [f64; 2] = [1e-8, 1e-3];

/// An equilibrium on the path.
#[derive(Clone, Copy)]
struct Place {
    /// Projection of the way from the start of the step to this equilibrium on the chord of the step, as a fraction of
    /// the chord.
    share: f64,
    load: f64,
    /// The lowest eigenvalue there, 1/s².
    lowest: f64,
}

impl Path {
    /// Records the bifurcation between two equilibria, at only one of which K is positive definite. Regula falsi (Illinois
    /// variant) narrows the interval by equilibria with a given projection on the chord of the step. Very close to the
    /// bifurcation K is singular and they are not found; then others farther away are tried.
    pub(super) fn note_bifurcation(
        &self,
        search: &mut Search,
        before: &State,
        after: &State,
    ) -> Result<(), SolverError> {
        let (first, _) = lowest(&mut search.balance, &before.q, before.t)?;
        let (last, _) = lowest(&mut search.balance, &after.q, after.t)?;
        let mut low = Place { share: 0.0, load: before.t, lowest: first };
        let mut high = Place { share: 1.0, load: after.t, lowest: last };
        let (mut f_low, mut f_high) = (first, last);
        let (mut load_factor, mut error) = (crossing(low, high), (after.t - before.t).abs());
        for _ in 0..MOST_TRIALS {
            if f_low * f_high >= 0.0 {
                break;
            }
            let mut share = low.share - f_low * (high.share - low.share) / (f_high - f_low);
            let mut found = None;
            for _ in 0..=MOST_RETRIES {
                found = self.place_at(search, before, after, share)?;
                if found.is_some() {
                    break;
                }
                share = 0.5 * (share + 0.5 * (low.share + high.share));
            }
            let Some(here) = found else { break };
            if here.lowest * f_low > 0.0 {
                (low, f_low, f_high) = (here, here.lowest, 0.5 * f_high);
            } else {
                (high, f_high, f_low) = (here, here.lowest, 0.5 * f_low);
            }
            let next = crossing(low, high);
            error = (next - load_factor).abs().min((high.load - low.load).abs());
            load_factor = next;
            let is_near = here.lowest.abs() <= CLOSE[1] * first.abs().min(last.abs());
            if is_near && error <= CLOSE[0] * load_factor.abs() {
                break;
            }
        }
        let (kind, eigenvalues) = (CriticalKind::Bifurcation, [first, last]);
        search.report.critical.push(CriticalPoint { kind, load_factor, error, eigenvalues });
        Ok(())
    }

    /// Returns the equilibrium whose projection on the chord between two others is the fraction `share` of the chord;
    /// `None` if it is not found.
    fn place_at(
        &self,
        search: &mut Search,
        before: &State,
        after: &State,
        share: f64,
    ) -> Result<Option<Place>, SolverError> {
        let moved: Vec<f64> = after.q.iter().zip(&before.q).map(|(after, before)| after - before).collect();
        let moved_t = after.t - before.t;
        let squared = mass_product(search, &moved, &moved) + self.psi * self.psi * moved_t * moved_t;
        let q = before.q.iter().zip(&moved).map(|(q, moved)| q + share * moved).collect();
        let mut trial = State { t: before.t + share * moved_t, q, p: Vec::new() };
        let closure = Closure::Chord { moved: &moved, moved_t, goal: share * squared };
        match self.clone().correct(search, before, &mut trial, closure, squared.sqrt()) {
            Ok(_) => {
                let (lowest, _) = lowest(&mut search.balance, &trial.q, trial.t)?;
                Ok(Some(Place { share, load: trial.t, lowest }))
            }
            Err(error) if error.is_interruption() => Err(error),
            Err(_) => Ok(None),
        }
    }
}

/// Returns the load factor at which a line through both eigenvalues crosses zero; that of the smaller eigenvalue if they do not differ
/// in sign.
fn crossing(low: Place, high: Place) -> f64 {
    if low.lowest == high.lowest {
        return 0.5 * (low.load + high.load);
    }
    let along = (low.lowest / (low.lowest - high.lowest)).clamp(0.0, 1.0);
    low.load + along * (high.load - low.load)
}
