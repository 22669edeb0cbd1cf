//! Descent from a state that is not in equilibrium to a minimum of V, by a trust region (Conn, Gould, Toint 2000, chapter 6).
//!
//! A correction minimises the quadratic model of V with a penalty on its length, rᵀd + ½ dᵀKd + ½ σ dᵀMd: d = −(K + σM)⁻¹ r. The shift σ
//! grows if V decreases less than the model says, or if K + σM is not positive definite, and shrinks if the model is right. In
//! contrast to Newton's method with a line search it leaves states whose tangent is singular or indefinite: cloth that is not taut,
//! bodies that hang from a hinge, sheets with wrinkles.

use crate::assemble::hessian::HessianEvaluation;
use crate::equilibrium::balance::Balance;
use crate::equilibrium::headway::Headway;
use crate::equilibrium::line_search::NOISE;
use crate::equilibrium::newton::{ACCURATE, MOST_ITERATIONS, Stop, WHOLE_STEPS_BELOW, has_reached_round_off};
use crate::error::SolverError;
use crate::vectors;

/// Ratio of the decrease of V to that of the model above which σ shrinks, and below which it grows.
const RIGHT: f64 = 0.75;
const POOR: f64 = 0.25;
/// Least ratio at which a correction is made.
const ACCEPTABLE: f64 = 1e-3;
/// Factors by which σ shrinks and grows.
const LESS: f64 = 0.25;
const MORE: f64 = 4.0;
/// Shift below which none is made, as a fraction of the first.
const SMALLEST: f64 = 1e-3;
/// Number of corrections in which a descent must make headway.
const PATIENCE: usize = 40;
/// Number of shifts tried for a tangent that is not positive definite.
const SHIFTS: usize = 60;

/// The shift σ of the tangent, 1/s².
struct Shift {
    value: f64,
    /// The first shift.
    unit: f64,
    /// Whether the last correction was refused: then σ may not shrink at once.
    was_refused: bool,
}

impl Shift {
    fn new(unit: f64) -> Self {
        Self { value: unit, unit, was_refused: false }
    }

    /// Returns σ, or zero if it is small.
    fn effective(&self) -> f64 {
        if self.value < SMALLEST * self.unit { 0.0 } else { self.value }
    }

    fn grow(&mut self) {
        self.value = (MORE * self.value).max(SMALLEST * self.unit);
    }

    fn refuse(&mut self) {
        self.grow();
        self.was_refused = true;
    }

    /// Adapts σ to the `ratio` of the decrease of V to that of the model, after a correction that was made.
    fn follow(&mut self, ratio: f64) {
        if ratio < POOR {
            self.value *= 2.0;
        } else if ratio > RIGHT && !std::mem::take(&mut self.was_refused) {
            self.value *= LESS;
        }
    }

    /// Prepares solves with K + σM, with a larger σ if this is not positive definite. Returns whether it was.
    fn factorize(&mut self, balance: &mut Balance, q: &[f64], t: f64) -> Result<bool, SolverError> {
        for attempt in 0..SHIFTS {
            if balance.factorize(q, t, HessianEvaluation::Exact, self.effective())?.is_ok() {
                return Ok(attempt == 0);
            }
            self.grow();
        }
        Err(SolverError::NotFactored)
    }
}

/// Descends from `q` to a minimum of V at t. Overwrites `q` even if it fails.
///
/// # Errors
/// Returns [`SolverError::NoConvergence`] if the descent gets stuck, [`SolverError::MovesAway`] if V has no minimum, or the errors of
/// terms and solves.
pub(super) fn minimise(
    balance: &mut Balance,
    q: &mut [f64],
    t: f64,
    stop: &mut Stop,
) -> Result<(), SolverError> {
    let n = q.len();
    let (start, mass) = (q.to_vec(), balance.system.free_mass());
    let (mut r, mut next, mut step, mut trial) = (vec![0.0; n], vec![0.0; n], vec![0.0; n], vec![0.0; n]);
    balance.residual(q, t, &mut r)?;
    if r.iter().all(|&r| r == 0.0) {
        return Ok(());
    }
    balance.check_supports(&r)?;
    stop.scale = stop.scale.max(1e-12 * balance.energy_scale(q, t));
    let at_start = balance.energy(q, t);
    let mut energy = at_start;
    let mut shift = Shift::new(balance.gentle_shift(&r));
    let mut headway = Headway::default();
    let mut last = f64::INFINITY;
    for _ in 0..MOST_ITERATIONS {
        if !headway.continues(PATIENCE) {
            break;
        }
        let was_definite = shift.factorize(balance, q, t)?;
        if balance.is_round_off(&r) {
            return Ok(());
        }
        vectors::fill(&mut step, |k| -r[k]);
        match balance.solve(&mut step, ACCURATE) {
            Err(SolverError::NegativeCurvature { .. }) => {
                shift.grow();
                continue;
            }
            outcome => outcome?,
        }
        balance.work.newton_iterations += 1;
        let decrement = -vectors::dot(&step, &r);
        let length = balance.largest_step(q, t, &step);
        let relative = stop.relative(decrement);
        headway.add(relative, at_start - energy, was_definite);
        vectors::fill(&mut trial, |k| q[k] + length * step[k]);
        let there = balance.energy(&trial, t);
        let sigma = shift.effective();
        // dᵀKd = decrement − σ dᵀMd.
        let penalty = sigma * vectors::sum(n, |k| mass[k] * step[k] * step[k]);
        let predicted = length * decrement - 0.5 * length * length * (decrement - penalty);
        let noise = NOISE * energy.abs().max(there.abs());
        let ratio = (energy - there + noise) / (predicted + noise);
        let is_round_off = has_reached_round_off(relative, last);
        let is_least = sigma == 0.0 || !was_definite;
        let is_done = length == 1.0 && is_least && (relative <= stop.tolerance || is_round_off);
        let is_close = length == 1.0 && sigma == 0.0 && relative < WHOLE_STEPS_BELOW;
        let is_better = is_done || is_close || (there.is_finite() && ratio > ACCEPTABLE);
        if !is_better || balance.residual(&trial, t, &mut next).is_err() {
            shift.refuse();
            continue;
        }
        q.copy_from_slice(&trial);
        std::mem::swap(&mut r, &mut next);
        if is_done {
            return Ok(());
        }
        (energy, last) = (there, relative);
        stop.scale = stop.scale.max(length * decrement);
        balance.check_distance(&start, q, t)?;
        shift.follow(ratio);
    }
    let (iterations, residual) = (headway.count(), headway.last());
    Err(SolverError::NoConvergence { iterations, residual, tolerance: stop.tolerance })
}
