//! The path of equilibria by its arc length, through limit points: Riks' continuation with Crisfield's
//! spherical constraint, linearised at every iterate. It must not know elements.
//!
//! Unknowns are q and the load factor t; the step satisfies Δqᵀ M Δq / m + ψ² Δt² = Δl² with the total
//! mass m, ψ being the root mean square of dq/dt at the start (Crisfield 1981; Ramm 1981). Beyond a
//! limit point K is indefinite: systems are then solved by minimal residuals, preconditioned by a
//! Cholesky factor of K + σM.

use vi_core::State;

use super::{CriticalPoint, LoadStep, Search, critical};
use crate::minres::minimal_residual;
use crate::vectors;
use crate::{HessianEvaluation, SolverError};

/// Newton iterations a step is sized for.
const WANTED_ITERATIONS: f64 = 5.0;

/// A direction of the path.
struct Tangent {
    /// dq/dt.
    velocity: Vec<f64>,
    /// Has K a Cholesky factor?
    is_stable: bool,
}

/// Follows the path from `state` to the load factor at the end.
pub(super) fn follow(search: &mut Search, state: &mut State, steps: u32) -> Result<(), SolverError> {
    let n = state.q.len();
    let end = search.options.end;
    // The start must be an equilibrium itself.
    let mut stop = search.stop;
    let before = state.q.clone();
    if let Err(cause) = super::newton::solve(&mut search.balance, &mut state.q, state.t, &mut stop) {
        state.q = before;
        if !search.release(state) {
            return Err(cause);
        }
    }
    let mut shift = 0.0;
    let mut tangent = direction(search, &state.q, state.t, &mut shift)?;
    let psi = rms(search, &tangent.velocity).max(f64::MIN_POSITIVE);
    let span = end - state.t;
    if span == 0.0 {
        let step = LoadStep { load_factor: end, iterations: 0, is_stable: tangent.is_stable };
        search.report.steps.push(step);
        (search.watch)(state, &step);
        return Ok(());
    }
    let unit = |dt: f64| dt.abs() * psi * 2.0_f64.sqrt();
    let mut length = unit(search.options.increment.min(search.options.largest_increment) * span);
    let longest = unit(search.options.largest_increment * span);
    let shortest = unit(search.options.smallest_increment * span);
    // The step before, in (q, t): its sense is kept.
    let mut last = (vec![0.0; n], span.signum());
    for _ in 0..steps {
        let norm = (rms(search, &tangent.velocity).powi(2) + psi * psi).sqrt();
        let sense = mass_product(search, &last.0, &tangent.velocity) + psi * psi * last.1;
        let mut dt = length / norm * sense.signum();
        let overshoots = (state.t + dt - end) * span.signum() >= 0.0;
        if overshoots {
            dt = end - state.t;
        }
        let mut trial = State {
            t: state.t + dt,
            q: (0..n).map(|k| state.q[k] + dt * tangent.velocity[k]).collect(),
            p: Vec::new(),
        };
        let result = if overshoots {
            super::newton::solve(&mut search.balance, &mut trial.q, end, &mut stop)
                .map(|solved| solved.iterations)
        } else {
            correct(search, state, &mut trial, psi, length, &mut shift)
        };
        let iterations = match result {
            Ok(iterations) => iterations,
            Err(cause) => {
                search.report.halvings += 1;
                length = 0.5 * length.min(dt.abs() * norm);
                if length < shortest {
                    return Err(search.no_equilibrium(state, dt, cause));
                }
                continue;
            }
        };
        let next = direction(search, &trial.q, trial.t, &mut shift)?;
        let step_q: Vec<f64> = (0..n).map(|k| trial.q[k] - state.q[k]).collect();
        let step_t = trial.t - state.t;
        if next.is_stable != tangent.is_stable && search.options.find_critical {
            note_critical(search, state, &trial, last.1 * step_t < 0.0)?;
        }
        state.q.copy_from_slice(&trial.q);
        state.t = trial.t;
        let step = LoadStep { load_factor: state.t, iterations, is_stable: next.is_stable };
        search.report.steps.push(step);
        last = (step_q, step_t);
        tangent = next;
        if !(search.watch)(state, &step) || state.t == end {
            return Ok(());
        }
        let factor = (WANTED_ITERATIONS / f64::from(iterations.max(1))).sqrt().clamp(0.5, 2.0);
        length = (length * factor).min(longest);
    }
    let cause =
        SolverError::NoConvergence { iterations: steps, residual: (end - state.t).abs(), tolerance: 0.0 };
    Err(search.no_equilibrium(state, last.1, cause))
}

/// xᵀM y / m.
fn mass_product(search: &Search, x: &[f64], y: &[f64]) -> f64 {
    let mass = search.balance.system.free_mass();
    let total = vectors::sum(x.len(), |k| mass[k]);
    vectors::sum(x.len(), |k| mass[k] * x[k] * y[k]) / total
}

fn rms(search: &Search, x: &[f64]) -> f64 {
    mass_product(search, x, x).sqrt()
}

/// Solves K x = b with K at (q, t), definite or not, for some right-hand sides.
fn solve(
    search: &mut Search,
    q: &[f64],
    t: f64,
    shift: &mut f64,
    rhs: &mut [&mut Vec<f64>],
) -> Result<bool, SolverError> {
    let balance = &mut search.balance;
    if balance.factorize(q, t, HessianEvaluation::Exact, 0.0)?.is_ok() {
        for rhs in rhs {
            balance.solve(rhs)?;
        }
        return Ok(true);
    }
    // As small a shift as will do: it decides how many iterations the solution takes.
    let stiffest = balance.stiffest(q, t)?;
    *shift = (0.1 * *shift).max(1e-12 * stiffest);
    while let Err(failure) = balance.factorize(q, t, HessianEvaluation::Exact, *shift)? {
        *shift *= 4.0;
        if *shift > 10.0 * stiffest {
            return Err(failure.into());
        }
    }
    for rhs in rhs {
        let solution = minimal_residual(balance, rhs, 1e-11, 400)?;
        rhs.copy_from_slice(&solution);
    }
    Ok(false)
}

/// ∂r/∂t at an equilibrium.
fn load_rate(search: &mut Search, q: &[f64], t: f64) -> Result<Vec<f64>, SolverError> {
    let (mut above, mut below) = (vec![0.0; q.len()], vec![0.0; q.len()]);
    let e = 1e-5 * search.options.end.abs().max(1e-3);
    search.balance.residual(q, t + e, &mut above)?;
    search.balance.residual(q, t - e, &mut below)?;
    for (above, below) in above.iter_mut().zip(&below) {
        *above = (*above - below) / (2.0 * e);
    }
    Ok(above)
}

fn direction(search: &mut Search, q: &[f64], t: f64, shift: &mut f64) -> Result<Tangent, SolverError> {
    let mut velocity = load_rate(search, q, t)?;
    velocity.iter_mut().for_each(|value| *value = -*value);
    let is_stable = solve(search, q, t, shift, &mut [&mut velocity])?;
    Ok(Tangent { velocity, is_stable })
}

/// Newton's method for r = 0 on the sphere of radius `length` about `from`.
fn correct(
    search: &mut Search,
    from: &State,
    trial: &mut State,
    psi: f64,
    length: f64,
    shift: &mut f64,
) -> Result<u32, SolverError> {
    let n = from.q.len();
    let mut r = vec![0.0; n];
    let mut last = f64::INFINITY;
    for iteration in 1..=search.options.max_iterations {
        search.balance.residual(&trial.q, trial.t, &mut r)?;
        let mut along = load_rate(search, &trial.q, trial.t)?;
        let mut step: Vec<f64> = r.iter().map(|r| -r).collect();
        along.iter_mut().for_each(|value| *value = -*value);
        solve(search, &trial.q, trial.t, shift, &mut [&mut step, &mut along])?;
        search.balance.work.newton_iterations += 1;
        let moved: Vec<f64> = (0..n).map(|k| trial.q[k] - from.q[k]).collect();
        let moved_t = trial.t - from.t;
        let gap = mass_product(search, &moved, &moved) + psi * psi * moved_t * moved_t - length * length;
        let slope = 2.0 * (mass_product(search, &moved, &along) + psi * psi * moved_t);
        let dt = -(gap + 2.0 * mass_product(search, &moved, &step)) / slope;
        if !dt.is_finite() {
            break;
        }
        let change: Vec<f64> = (0..n).map(|k| step[k] + dt * along[k]).collect();
        // rᵀδ may have either sign where K is indefinite: measure the step against the arc instead.
        let relative = (mass_product(search, &change, &change) + psi * psi * dt * dt).sqrt() / length;
        if relative > 3.0 || (iteration > 3 && relative > last && relative > 1e-6) {
            last = relative;
            break;
        }
        for (q, change) in trial.q.iter_mut().zip(&change) {
            *q += change;
        }
        trial.t += dt;
        if relative <= search.options.tolerance || (relative < 1e-6 && relative > 0.3 * last) {
            return Ok(iteration);
        }
        last = relative;
    }
    let tolerance = search.options.tolerance;
    Err(SolverError::NoConvergence { iterations: search.options.max_iterations, residual: last, tolerance })
}

/// Enters the critical point between two equilibria, where the lowest eigenvalue crosses zero.
fn note_critical(
    search: &mut Search,
    before: &State,
    after: &State,
    turned: bool,
) -> Result<(), SolverError> {
    let (first, _) = critical::lowest(&mut search.balance, &before.q, before.t)?;
    let (last, mode) = critical::lowest(&mut search.balance, &after.q, after.t)?;
    let kind = if turned { super::CriticalKind::Limit } else { search.kind_of(&mode, after)? };
    let along = if first == last { 0.5 } else { (first / (first - last)).clamp(0.0, 1.0) };
    let load_factor = before.t + along * (after.t - before.t);
    search.report.critical.push(CriticalPoint { kind, load_factor, eigenvalues: [first, last] });
    Ok(())
}
