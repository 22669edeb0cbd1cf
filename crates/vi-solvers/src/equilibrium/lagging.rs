//! A way to equilibria with friction: passes with lagged friction. In each pass, the normal forces and the directions of slip are those of
//! the pass before, so that friction has a potential and every correction can be judged by the decrease of V.
//!
//! In the first pass, a bond to the start replaces the friction that bodies which do not touch yet will have: ½ σ |q − q̂|² in the norm
//! of mass, with the gentle shift. Otherwise bodies that only friction holds would slide away.
//!
//! The rotation of a ball that slides at all its contacts has hardly any stiffness, so that passes converge slowly. Newton's method with the friction
//! of each iterate then goes on from the place that they reached.

use crate::equilibrium::balance::Balance;
use crate::equilibrium::bond::Bond;
use crate::equilibrium::newton::{self, Solved, Stop};
use crate::equilibrium::trust_region;
use crate::error::SolverError;
use crate::vectors;

/// Largest number of passes. Errors fall to about a tenth from pass to pass: a block that falls onto a floor by a fifth of its height, and one
/// that is pressed and pushed on a soft slab (6 × 6 × 6 and 4 × 4 × 4 cells, μ = .3 and .5), need 7 for a relative error of 1e-8.
const PASSES: usize = 30;
/// The error must halve within this many passes.
const PATIENCE: usize = 3;
const GAIN: f64 = 0.5;
/// Relative error of a pass as a fraction of that of the pass before, and its bound.
const FRACTION: f64 = 0.01;
const ROUGHEST: f64 = 1e-4;
/// Below this relative error, passes that do not improve it have reached round-off.
const ROUND_OFF_BELOW: f64 = 1e-5;
/// Relative error below which Newton's method may go on where passes converge slowly.
const CLOSE: f64 = 0.1;
/// Relative accuracy of errors by conjugate gradients, in the energy norm.
const ACCURACY: f64 = 1e-3;

/// How far passes went.
pub(super) enum Reached {
    /// To an equilibrium.
    Equilibrium(Solved),
    /// Close to an equilibrium, to which they converge slowly.
    Neighbourhood(Solved),
}

/// Goes from `q` to an equilibrium with friction at t, or close to it. Overwrites `q` even if it fails.
///
/// # Errors
/// Returns [`SolverError::NoConvergence`] if the passes do not converge, or the error of a pass.
pub(super) fn solve(
    balance: &mut Balance,
    q: &mut [f64],
    t: f64,
    stop: &mut Stop,
) -> Result<Reached, SolverError> {
    let mut r = vec![0.0; q.len()];
    balance.residual(q, t, &mut r)?;
    let bond = Bond { place: q.to_vec(), shift: balance.gentle_shift(&r) };
    let mut done = Solved { iterations: 0, stayed_definite: true, made_passes: true };
    let mut errors: Vec<f64> = Vec::new();
    for pass in 0..PASSES {
        let last = errors.last().copied().unwrap_or(1.0);
        let roughest = if pass == 0 { FRACTION } else { ROUGHEST };
        let tolerance = (FRACTION * last).min(roughest).max(0.1 * stop.tolerance);
        let mut own = Stop { tolerance, ..*stop };
        balance.bond = (pass == 0).then(|| bond.clone());
        let outcome = minimise(balance, q, t, &mut own);
        balance.bond = None;
        let solved = match outcome {
            // The state that the first pass reached will do.
            Err(SolverError::NoConvergence { iterations, .. }) if pass == 0 => {
                Solved { iterations, stayed_definite: true, made_passes: true }
            }
            outcome => outcome?,
        };
        balance.check_distance(&bond.place, q, t)?;
        stop.scale = stop.scale.max(own.scale);
        done.iterations += solved.iterations;
        done.stayed_definite &= solved.stayed_definite || pass == 0;
        balance.residual(q, t, &mut r)?;
        let mut correction = r.clone();
        balance.solve(&mut correction, ACCURACY)?;
        let error = stop.relative(vectors::dot(&correction, &r).abs());
        let is_round_off = balance.is_round_off(&r) || (error < ROUND_OFF_BELOW && error > GAIN * last);
        if pass > 0 && (error <= stop.tolerance || is_round_off) {
            return Ok(Reached::Equilibrium(done));
        }
        errors.push(error);
        let before = errors.len().checked_sub(1 + PATIENCE);
        if before.is_some_and(|before| error > GAIN * errors[before]) {
            break;
        }
    }
    let residual = errors.last().copied().unwrap_or(1.0);
    if residual < CLOSE {
        return Ok(Reached::Neighbourhood(done));
    }
    Err(SolverError::NoConvergence { iterations: done.iterations, residual, tolerance: stop.tolerance })
}

/// Minimises V with the friction that is lagged at `q`.
fn minimise(balance: &mut Balance, q: &mut [f64], t: f64, stop: &mut Stop) -> Result<Solved, SolverError> {
    let x = balance.positions(q, t);
    if let Some(friction) = &mut balance.friction {
        friction.lag(&x);
    }
    let start = q.to_vec();
    let outcome = match newton::solve(balance, q, t, stop) {
        Err(error) if !error.is_interruption() => {
            q.copy_from_slice(&start);
            let count = balance.work.newton_iterations;
            trust_region::minimise(balance, q, t, stop).map(|()| {
                let iterations = (balance.work.newton_iterations - count) as u32;
                Solved { iterations, stayed_definite: true, made_passes: false }
            })
        }
        outcome => outcome,
    };
    if let Some(friction) = &mut balance.friction {
        friction.end_lag();
    }
    outcome
}
