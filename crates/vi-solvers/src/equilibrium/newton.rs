//! Newton's method for an equilibrium at a fixed load factor. It uses a line search on the energy, projects the
//! Hessian if the tangent has no Cholesky factor, and stops in the energy norm. Before a step, the terms limit its
//! length.

use crate::assemble::hessian::HessianEvaluation;
use crate::equilibrium::balance::Balance;
use crate::equilibrium::headway::Headway;
use crate::equilibrium::line_search::{Way, bend, line_search};
use crate::equilibrium::lowest_mode::lowest;
use crate::error::SolverError;
use crate::vectors;

/// Below this relative energy norm full steps are made, because differences of energies are round-off there.
pub(super) const WHOLE_STEPS_BELOW: f64 = 1e-4;

/// Below this relative energy norm a solve that stalls has reached round-off.
const ROUND_OFF_BELOW: f64 = 1e-5;

/// Relative accuracy in the energy norm of predicted changes by conjugate gradients.
pub(super) const PREDICTION: f64 = 1e-3;

/// Least and most accurate corrections by conjugate gradients, relative in the energy norm. Between them the accuracy follows
/// the size of the correction before, so that Newton's method still converges superlinearly (Dembo, Eisenstat, Steihaug
/// 1982).
const ROUGH: f64 = 1e-2;
pub(super) const ACCURATE: f64 = 1e-4;

/// Number of corrections in which a solve must make headway once [`Stop::max_iterations`] are made.
const PATIENCE: usize = 12;

/// Largest number of iterations of a solve that makes headway.
pub(super) const MOST_ITERATIONS: u32 = 500;

/// The criteria for stopping a solve.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Stop {
    pub(crate) tolerance: f64,
    pub(crate) max_iterations: u32,
    /// Energy to which the norm is relative, J; it grows with what the first correction of each solve releases.
    pub(crate) scale: f64,
}

impl Stop {
    /// Returns the relative energy norm of a decrement.
    pub(crate) fn relative(&self, decrement: f64) -> f64 {
        if decrement <= 0.0 { 0.0 } else { (decrement / self.scale).sqrt() }
    }
}

/// Returns whether a solve has reached round-off, from the relative energy norms of its last two corrections.
pub(super) fn has_reached_round_off(relative: f64, last: f64) -> bool {
    relative < ROUND_OFF_BELOW && relative > 0.3 * last
}

/// The effort of a solve.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Solved {
    pub(crate) iterations: u32,
    /// Whether the tangent was positive definite at every iterate. Then the equilibrium lies on the path of the
    /// start; otherwise the body may have snapped.
    pub(crate) stayed_definite: bool,
    /// Whether it made passes with lagged friction, whose iterations tell nothing about the curvature of the path.
    pub(crate) made_passes: bool,
}

/// What a solve looks for.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Goal {
    /// An equilibrium, which is a minimum of V if the start lies in its basin.
    Equilibrium,
    /// A minimum of V beyond the unstable equilibrium at the start.
    Minimum,
}

impl Goal {
    /// Prepares solves with a positive definite substitute for the tangent.
    fn substitute(self, balance: &mut Balance, q: &[f64], t: f64) -> Result<(), SolverError> {
        match self {
            Self::Equilibrium => factorize_projected(balance, q, t),
            Self::Minimum => factorize_beyond(balance, q, t),
        }
    }
}

/// Prepares solves with the tangent, or a positive definite substitute for it; returns whether the tangent was found to be
/// positive definite.
pub(super) fn factorize_definite(balance: &mut Balance, q: &[f64], t: f64) -> Result<bool, SolverError> {
    factorize_for(Goal::Equilibrium, balance, q, t)
}

fn factorize_for(goal: Goal, balance: &mut Balance, q: &[f64], t: f64) -> Result<bool, SolverError> {
    if balance.factorize(q, t, HessianEvaluation::Exact, 0.0)?.is_ok() {
        return Ok(true);
    }
    goal.substitute(balance, q, t).map(|()| false)
}

/// Prepares solves with K − 2 λ₁ M, where λ₁ < 0 is the lowest eigenvalue of (K, M). A correction then doubles the component of the
/// way from a saddle point along its critical mode. Projected element by element, the tangent loses the compression that makes
/// a body buckle, and corrections along the mode are λ₁ over the stiffness without load: 250 of them do not leave Euler's
/// column at a load .2 % beyond the critical one.
fn factorize_beyond(balance: &mut Balance, q: &[f64], t: f64) -> Result<(), SolverError> {
    let (lowest, _) = lowest(balance, q, t)?;
    if lowest < 0.0 && balance.factorize(q, t, HessianEvaluation::Exact, -2.0 * lowest)?.is_ok() {
        return Ok(());
    }
    factorize_projected(balance, q, t)
}

/// Prepares solves with a positive definite substitute for the tangent.
fn factorize_projected(balance: &mut Balance, q: &[f64], t: f64) -> Result<(), SolverError> {
    if balance.factorize(q, t, HessianEvaluation::Projected, 0.0)?.is_ok() {
        return Ok(());
    }
    factorize_shifted(balance, q, t)
}

/// Prepares solves with the projected tangent plus a small multiple of the mass. The mass makes a semidefinite matrix
/// definite, such as that of a string that is not yet taut.
fn factorize_shifted(balance: &mut Balance, q: &[f64], t: f64) -> Result<(), SolverError> {
    let stiffest = balance.stiffest(q, t)?;
    let mut failure = SolverError::NotFactored;
    for exponent in [-10, -8, -6, -4, -2] {
        match balance.factorize(q, t, HessianEvaluation::Projected, stiffest * 10.0_f64.powi(exponent))? {
            Ok(()) => return Ok(()),
            Err(next) => failure = next.into(),
        }
    }
    Err(failure)
}

/// Computes the correction −K⁻¹r to the relative `accuracy`, with the prepared K. A positive definite substitute replaces K if
/// conjugate gradients find that it is indefinite, or if it is singular up to round-off, so that energy does not decrease
/// along the correction. Returns whether K was not replaced.
fn correction(
    balance: &mut Balance,
    goal: Goal,
    (q, t): (&[f64], f64),
    r: &[f64],
    accuracy: f64,
    out: &mut [f64],
) -> Result<bool, SolverError> {
    for attempt in 0..3 {
        vectors::fill(out, |k| -r[k]);
        match balance.solve(out, accuracy) {
            Ok(()) if vectors::dot(out, r) < 0.0 => return Ok(attempt == 0),
            Ok(()) => factorize_shifted(balance, q, t)?,
            Err(SolverError::NegativeCurvature { .. }) if attempt == 0 => goal.substitute(balance, q, t)?,
            Err(error) => return Err(error),
        }
    }
    Err(SolverError::NoConvergence { iterations: 0, residual: 1.0, tolerance: accuracy })
}

/// Iterates from `q` to an equilibrium at t, minimising V if all forces are conservative. Overwrites `q` even if it
/// fails.
pub(crate) fn solve(
    balance: &mut Balance,
    q: &mut [f64],
    t: f64,
    stop: &mut Stop,
) -> Result<Solved, SolverError> {
    iterate(balance, q, t, stop, Goal::Equilibrium)
}

/// Descends from `q`, near an unstable equilibrium, to a minimum of V at t: where the tangent is indefinite, corrections follow its
/// negative curvature, and the iteration does not end. Overwrites `q` even if it fails.
pub(crate) fn descend(
    balance: &mut Balance,
    q: &mut [f64],
    t: f64,
    stop: &mut Stop,
) -> Result<Solved, SolverError> {
    iterate(balance, q, t, stop, Goal::Minimum)
}

/// Replaces a correction that is longer than the bodies by −(K + σM)⁻¹ r with the gentle shift. K is then nearly singular: a sheet without
/// bending stiffness is not yet taut, or a body may turn about its support. A part of −K⁻¹r would move along these motions alone.
///
/// # Errors
/// Returns [`SolverError::MovesAway`] if no length of such motions balances the loads.
fn shorten(
    balance: &mut Balance,
    (q, t): (&[f64], f64),
    is_definite: bool,
    r: &[f64],
    step: &mut [f64],
) -> Result<(), SolverError> {
    balance.check_supports(r)?;
    let kind = if is_definite { HessianEvaluation::Exact } else { HessianEvaluation::Projected };
    let shift = balance.gentle_shift(r);
    if balance.factorize(q, t, kind, shift)?.is_ok() {
        vectors::fill(step, |k| -r[k]);
        balance.solve(step, ACCURATE)?;
    }
    Ok(())
}

fn iterate(
    balance: &mut Balance,
    q: &mut [f64],
    t: f64,
    stop: &mut Stop,
    goal: Goal,
) -> Result<Solved, SolverError> {
    let n = q.len();
    let (mut r, mut step, mut trial) = (vec![0.0; n], vec![0.0; n], vec![0.0; n]);
    stop.scale = stop.scale.max(1e-12 * balance.energy_scale(q, t));
    balance.residual(q, t, &mut r)?;
    let start = q.to_vec();
    let mut last = f64::INFINITY;
    let mut stayed_definite = true;
    let (mut headway, mut released) = (Headway::default(), 0.0);
    for iteration in 1..=MOST_ITERATIONS.max(stop.max_iterations) {
        if iteration > stop.max_iterations
            && !(headway.is_mostly_definite(PATIENCE) && headway.continues(PATIENCE))
        {
            break;
        }
        if r.iter().all(|&r| r == 0.0) {
            return Ok(Solved { iterations: iteration - 1, stayed_definite, made_passes: false });
        }
        let mut is_definite = factorize_for(goal, balance, q, t)?;
        stayed_definite &= is_definite;
        if balance.is_round_off(&r) && (is_definite || goal == Goal::Equilibrium) {
            return Ok(Solved { iterations: iteration - 1, stayed_definite, made_passes: false });
        }
        let accuracy = last.clamp(ACCURATE, ROUGH);
        is_definite &= correction(balance, goal, (q, t), &r, accuracy, &mut step)?;
        balance.work.newton_iterations += 1;
        if balance.is_too_long(&step) {
            shorten(balance, (q, t), is_definite, &r, &mut step)?;
        }
        stayed_definite &= is_definite;
        let decrement = -vectors::sum(n, |k| step[k] * r[k]);
        let longest = balance.largest_step(q, t, &step);
        let relative = stop.relative(decrement);
        let is_round_off = has_reached_round_off(relative, last);
        let may_end = longest == 1.0 && (is_definite || goal == Goal::Equilibrium);
        let is_done = may_end && (relative <= stop.tolerance || is_round_off);
        last = relative;
        headway.add(relative, released, is_definite);
        if is_done || relative < WHOLE_STEPS_BELOW {
            for (q, step) in q.iter_mut().zip(&step) {
                *q += longest * step;
            }
            balance.check_distance(&start, q, t)?;
            balance.residual(q, t, &mut r)?;
            if is_done {
                return Ok(Solved { iterations: iteration, stayed_definite, made_passes: false });
            }
            continue;
        }
        let (iterations, residual, tolerance) = (iteration, relative, stop.tolerance);
        let stalled = SolverError::NoConvergence { iterations, residual, tolerance };
        let bend = match goal {
            Goal::Equilibrium => None,
            Goal::Minimum => bend(balance, (q, t), &step, &r)?,
        };
        let path = Way { step: &step, bend: bend.as_deref(), longest };
        let length = line_search(balance, q, t, path, (&mut r, &mut trial), stalled)?;
        released += 0.5 * length * decrement;
        balance.check_distance(&start, q, t)?;
        if iteration == 1 {
            // If the tangent is almost singular, or nothing supports the body yet, the correction is far too long: only
            // the part of it that was made counts.
            stop.scale = stop.scale.max(length * decrement);
            last = stop.relative(decrement);
        }
    }
    Err(SolverError::NoConvergence { iterations: headway.count(), residual: last, tolerance: stop.tolerance })
}
