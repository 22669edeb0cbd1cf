//! The way of a correction to an equilibrium: how it bends, and how far the energy decreases along it.

use crate::equilibrium::balance::Balance;
use crate::error::SolverError;
use crate::vectors;

/// Distance by which the change of forces along a correction is found, as a fraction of the extent of the bodies. Second differences
/// of forces then have a relative error of some 1e-7.
const CLOSE: f64 = 1e-4;

/// Relative accuracy in the energy norm of bends by conjugate gradients.
const ACCURACY: f64 = 1e-3;

/// Round-off of a difference of two energies, relative to them.
pub(super) const NOISE: f64 = 1e-14;

/// Returns half the curvature of the way that begins along `step` d and stays where forces across it balance: b = −½ K⁻¹ ∂²r[d, d]
/// without its part along d (geodesic acceleration, Transtrum and Sethna 2012). A slender body that bends must not become longer:
/// along a straight line its energy soon grows, and 250 corrections do not bend a column with L/h = 50. Returns `None` if K, which
/// is prepared, does not solve, or if the terms limit steps.
pub(super) fn bend(
    balance: &mut Balance,
    (q, t): (&[f64], f64),
    step: &[f64],
    r: &[f64],
) -> Result<Option<Vec<f64>>, SolverError> {
    let n = q.len();
    let far = vectors::max_abs(n, |k| step[k]);
    if balance.limits_steps() || far == 0.0 {
        return Ok(None);
    }
    let e = CLOSE * balance.extent() / far;
    let (mut ahead, mut behind) = (vec![0.0; n], vec![0.0; n]);
    for (side, out) in [(e, &mut ahead), (-e, &mut behind)] {
        let place: Vec<f64> = q.iter().zip(step).map(|(q, step)| q + side * step).collect();
        if balance.residual(&place, t, out).is_err() {
            return Ok(None);
        }
    }
    let mut bend: Vec<f64> = (0..n).map(|k| (r[k] - 0.5 * (ahead[k] + behind[k])) / (e * e)).collect();
    match balance.solve(&mut bend, ACCURACY) {
        Ok(()) => {}
        Err(error) if error.is_interruption() => return Err(error),
        Err(_) => return Ok(None),
    }
    let mass = balance.system.free_mass();
    let along = vectors::sum(n, |k| mass[k] * bend[k] * step[k]);
    let along = along / vectors::sum(n, |k| mass[k] * step[k] * step[k]);
    vectors::update(&mut bend, |k, bend| *bend -= along * step[k]);
    Ok(vectors::all_finite(&bend).then_some(bend))
}

/// The way of a line search from q: q + s step + s² bend with s ≤ `longest`.
pub(super) struct Way<'a> {
    pub(super) step: &'a [f64],
    pub(super) bend: Option<&'a [f64]>,
    pub(super) longest: f64,
}

/// Moves `q` along the way as far as the energy decreases, and evaluates the residual there. Returns the fraction s, or `stalled` if
/// the energy does not decrease along it.
pub(super) fn line_search(
    balance: &mut Balance,
    q: &mut [f64],
    t: f64,
    Way { step, bend, longest }: Way<'_>,
    (r, trial): (&mut [f64], &mut [f64]),
    stalled: SolverError,
) -> Result<f64, SolverError> {
    const TRIALS: usize = 25;
    let slope = vectors::sum(q.len(), |k| step[k] * r[k]);
    let energy = if balance.is_conservative() { balance.energy(q, t) } else { 0.0 };
    let noise = NOISE * energy.abs();
    let mut length = longest;
    let mut failure = stalled;
    for _ in 0..TRIALS {
        balance.work.line_searches += 1;
        for ((trial, q), step) in trial.iter_mut().zip(&*q).zip(step) {
            *trial = q + length * step;
        }
        if let Some(bend) = bend {
            vectors::update(trial, |k, trial| *trial += length * length * bend[k]);
        }
        let mut next = 0.25 * length;
        if balance.is_conservative() {
            let change = balance.energy(trial, t) - energy;
            if change <= 1e-4 * length * slope + noise {
                match balance.residual(trial, t, r) {
                    Ok(()) => {
                        q.copy_from_slice(trial);
                        return Ok(length);
                    }
                    Err(error) => failure = error,
                }
            } else if change.is_finite() {
                // The minimum of the parabola through the known values.
                let minimum = -0.5 * slope * length * length / (change - slope * length);
                next = minimum.clamp(0.1 * length, 0.5 * length);
            }
        } else {
            match balance.residual(trial, t, r) {
                Ok(()) => {
                    let there = vectors::sum(q.len(), |k| step[k] * r[k]);
                    if there.abs() <= 0.9 * slope.abs() {
                        q.copy_from_slice(trial);
                        return Ok(length);
                    }
                    next = (length * slope / (slope - there)).clamp(0.1 * length, 0.5 * length);
                }
                Err(error) => failure = error,
            }
        }
        length = next;
    }
    Err(failure)
}
