//! A way to equilibria with friction: passes with lagged friction. In each pass, the normal forces and the directions of slip are those of
//! the pass before, so that friction has a potential and every correction can be judged by the decrease of V.
//!
//! Before the first pass, bodies that do not touch yet approach each other in hops of a quarter of their extent. In each hop, a bond to its start
//! replaces the friction that they will have, ½ σ |q − q̂|² in the norm of mass. Otherwise bodies that only friction holds would slide away.
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
/// Length of a hop as a fraction of the extent of the bodies, and the largest number of hops. Of 200 scenes of `stress --equilibria`, 6 and 5 find no
/// equilibrium in 40 s with 1/4 and 1/8, and those that do take 30 740 and 35 680 iterations. With one hop of the whole extent, and without
/// [`NEARLY`], 19 found none in 60 s.
const HOP: f64 = 0.25;
const HOPS: usize = 16;
/// Relative error of a pass that need not be repeated although it did not converge: where many pairs turn between sticking and sliding, a
/// descent may end at an error of 1e-4.
const NEARLY: f64 = 1e-2;
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
    let start = q.to_vec();
    let iterations = approach(balance, q, t, stop)?;
    let mut done = Solved { iterations, stayed_definite: true, made_passes: true };
    let mut r = vec![0.0; q.len()];
    let mut last = error_of(balance, (q, t), stop, &mut r)?;
    let mut errors = vec![last];
    for _ in 0..PASSES {
        let tolerance = (FRACTION * last).min(ROUGHEST).max(0.1 * stop.tolerance);
        let mut own = Stop { tolerance, ..*stop };
        let solved = match minimise(balance, q, t, &mut own) {
            // A state that is nearly the minimum will do.
            Err(SolverError::NoConvergence { iterations, residual, .. }) if residual < NEARLY => {
                Solved { iterations, stayed_definite: true, made_passes: true }
            }
            outcome => outcome?,
        };
        balance.check_distance(&start, q, t)?;
        stop.scale = stop.scale.max(own.scale);
        done.iterations += solved.iterations;
        done.stayed_definite &= solved.stayed_definite;
        let error = error_of(balance, (q, t), stop, &mut r)?;
        let is_round_off = balance.is_round_off(&r) || (error < ROUND_OFF_BELOW && error > GAIN * last);
        if error <= stop.tolerance || is_round_off {
            return Ok(Reached::Equilibrium(done));
        }
        errors.push(error);
        last = error;
        let before = errors.len().checked_sub(1 + PATIENCE);
        if before.is_some_and(|before| error > GAIN * errors[before]) {
            break;
        }
    }
    if last < CLOSE {
        return Ok(Reached::Neighbourhood(done));
    }
    Err(SolverError::NoConvergence { iterations: done.iterations, residual: last, tolerance: stop.tolerance })
}

/// Goes from `q` to a place where bodies touch, in hops, each of which minimises V with a bond to the place before it. Returns the number
/// of iterations.
///
/// # Errors
/// Returns [`SolverError::MovesAway`] if the bodies still move after the last hop, or the error of a hop.
fn approach(balance: &mut Balance, q: &mut [f64], t: f64, stop: &mut Stop) -> Result<u32, SolverError> {
    let start = q.to_vec();
    let mut r = vec![0.0; q.len()];
    balance.residual(q, t, &mut r)?;
    // The extent is that at the place of the last evaluation.
    let (extent, shift) = (balance.extent(), balance.gentle_shift(&r) / HOP);
    let mut done = 0;
    for _ in 0..HOPS {
        let place = q.to_vec();
        let mut own = Stop { tolerance: FRACTION, ..*stop };
        balance.bond = Some(Bond { place: place.clone(), shift });
        let outcome = minimise(balance, q, t, &mut own);
        balance.bond = None;
        done += match outcome {
            Ok(solved) => solved.iterations,
            // The place that a hop reached will do.
            Err(SolverError::NoConvergence { iterations, .. }) => iterations,
            Err(error) => return Err(error),
        };
        stop.scale = stop.scale.max(own.scale);
        balance.check_distance(&start, q, t)?;
        if extent == 0.0 || vectors::max_abs(q.len(), |k| q[k] - place[k]) < 0.5 * HOP * extent {
            return Ok(done);
        }
    }
    Err(SolverError::MovesAway { extents: vectors::max_abs(q.len(), |k| q[k] - start[k]) / extent })
}

/// Returns the relative error of a place, by the last tangent, and writes its residual to `r`.
fn error_of(
    balance: &mut Balance,
    (q, t): (&[f64], f64),
    stop: &Stop,
    r: &mut [f64],
) -> Result<f64, SolverError> {
    balance.residual(q, t, r)?;
    let mut correction = r.to_vec();
    balance.solve(&mut correction, ACCURACY)?;
    Ok(stop.relative(vectors::dot(&correction, r).abs()))
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
