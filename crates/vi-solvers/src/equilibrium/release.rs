//! Brings a state that is out of equilibrium to an equilibrium at the same load factor, by releasing it step by step.
//!
//! With the residual r₀ at the start, r(q) − (1 − s) r₀ = 0 has the start as its solution at s = 0 and the
//! equilibrium at s = 1. In this way a body under weight alone, whose load has no amplitude to increase, is loaded
//! step by step.

use crate::assemble::hessian::HessianEvaluation;
use crate::equilibrium::balance::Balance;
use crate::equilibrium::newton::{PREDICTION, Stop};
use crate::equilibrium::rubbing;
use crate::error::SolverError;

/// First and largest step of s.
const STEP: f64 = 0.125;
/// Smallest step; a release that needs smaller ones fails.
const SMALLEST_STEP: f64 = 1e-5;

/// Brings `q` to an equilibrium at t. If that fails, `q` is unchanged. Returns how often steps were halved.
///
/// # Errors
/// Returns the error that stopped the last step.
pub(super) fn release(balance: &mut Balance, q: &mut [f64], t: f64, stop: &Stop) -> Result<u32, SolverError> {
    let n = q.len();
    let mut unbalanced = vec![0.0; n];
    balance.residual(q, t, &mut unbalanced)?;
    let mut found = q.to_vec();
    let result = follow(balance, &mut found, t, stop, &unbalanced);
    balance.held.clear();
    let halvings = result?;
    q.copy_from_slice(&found);
    Ok(halvings)
}

fn follow(
    balance: &mut Balance,
    q: &mut [f64],
    t: f64,
    stop: &Stop,
    unbalanced: &[f64],
) -> Result<u32, SolverError> {
    let (mut s, mut step, mut halvings) = (0.0, STEP, 0);
    let mut trial = q.to_vec();
    let mut slope = vec![0.0; q.len()];
    while s < 1.0 {
        let next = f64::min(s + step, 1.0);
        balance.held.clear();
        balance.held.extend(unbalanced.iter().map(|r| (1.0 - next) * r));
        // K dq/ds = −r₀.
        slope.iter_mut().zip(unbalanced).for_each(|(slope, r)| *slope = -r);
        let is_predicted = balance.factorize(q, t, HessianEvaluation::Exact, 0.0)?.is_ok()
            && balance.solve(&mut slope, PREDICTION).is_ok();
        slope.iter_mut().for_each(|slope| *slope *= next - s);
        let is_predicted = is_predicted && balance.largest_step(q, t, &slope) == 1.0;
        for (trial, (q, slope)) in trial.iter_mut().zip(q.iter().zip(&slope)) {
            *trial = q + slope;
        }
        let is_predicted = is_predicted && balance.lowers_energy(q, &trial, t);
        if !is_predicted {
            trial.copy_from_slice(q);
        }
        let mut result = rubbing::solve(balance, &mut trial, t, &mut { *stop });
        if is_predicted && result.as_ref().is_err_and(|error| !error.is_interruption()) {
            // The prediction may be the cause; try without it.
            trial.copy_from_slice(q);
            result = rubbing::solve(balance, &mut trial, t, &mut { *stop });
        }
        match result {
            Ok(solved) => {
                q.copy_from_slice(&trial);
                balance.accept(q, t)?;
                s = next;
                if solved.iterations <= 6 {
                    step = f64::min(2.0 * step, STEP);
                }
            }
            Err(cause) if cause.is_interruption() => return Err(cause),
            Err(cause) => {
                step *= 0.5;
                halvings += 1;
                if step < SMALLEST_STEP {
                    return Err(cause);
                }
            }
        }
    }
    Ok(halvings)
}
