//! Newton's method from the end of a straight step back to the path, and the direction of the path there. The step
//! length and its reduction are decided elsewhere.

use vi_core::State;

use crate::assemble::hessian::HessianEvaluation;
use crate::equilibrium::function::PathFunction;
use crate::equilibrium::path::branch::{Path, Tangent, mass_product};
use crate::equilibrium::search::Search;
use crate::error::SolverError;
use crate::vectors;

/// Relative accuracy of solves if they are not made with a factor.
const EXACT: f64 = 1e-12;

/// The equation that determines the load factor of a step.
pub(super) enum Closure<'a> {
    /// The step has this length, m.
    Sphere(f64),
    /// The load factor has this value.
    Load(f64),
    /// The scalar product of the step with a chord, `moved` and `moved_t`, has the value `goal`, m².
    Chord { moved: &'a [f64], moved_t: f64, goal: f64 },
    /// A function of the positions has this value.
    Function(&'a mut PathFunction, f64),
}

impl Path {
    /// Solves r = 0 and `closure` by Newton's method; changes are measured relative to `length`, m.
    pub(super) fn correct(
        &mut self,
        search: &mut Search,
        from: &State,
        trial: &mut State,
        mut closure: Closure,
        length: f64,
    ) -> Result<u32, SolverError> {
        let n = from.q.len();
        search.balance.check_move(from, &trial.q, trial.t)?;
        let squared = self.psi * self.psi;
        let mut r = vec![0.0; n];
        let mut last = f64::INFINITY;
        let mut iterations = 0;
        for iteration in 1..=search.options.max_iterations {
            iterations = iteration;
            search.balance.residual(&trial.q, trial.t, &mut r)?;
            let mut along = load_rate(search, &trial.q, trial.t)?;
            let mut step: Vec<f64> = r.iter().map(|r| -r).collect();
            along.iter_mut().for_each(|value| *value = -*value);
            solve(search, &trial.q, trial.t, &mut self.shift, &mut [&mut step, &mut along])?;
            search.balance.work.newton_iterations += 1;
            let dt = match &mut closure {
                Closure::Sphere(radius) => {
                    let moved: Vec<f64> = (0..n).map(|k| trial.q[k] - from.q[k]).collect();
                    let moved_t = trial.t - from.t;
                    let square = mass_product(search, &moved, &moved) + squared * moved_t * moved_t;
                    let slope = 2.0 * (mass_product(search, &moved, &along) + squared * moved_t);
                    -(square - *radius * *radius + 2.0 * mass_product(search, &moved, &step)) / slope
                }
                Closure::Load(end) => *end - trial.t,
                Closure::Chord { moved: chord, moved_t, goal } => {
                    let moved: Vec<f64> = (0..n).map(|k| trial.q[k] - from.q[k] + step[k]).collect();
                    let here = mass_product(search, &moved, chord) + squared * (trial.t - from.t) * *moved_t;
                    (*goal - here) / (mass_product(search, &along, chord) + squared * *moved_t)
                }
                Closure::Function(function, goal) => {
                    let here = function.at(search.balance.system, &trial.q, trial.t, search.options.end);
                    let gap = *goal - here.value - vectors::sum(n, |k| here.gradient[k] * step[k]);
                    gap / here.slope(&along)
                }
            };
            if !dt.is_finite() {
                break;
            }
            let change: Vec<f64> = (0..n).map(|k| step[k] + dt * along[k]).collect();
            // If K is indefinite, rᵀδ may have either sign, so measure the change relative to the step.
            let relative = (mass_product(search, &change, &change) + squared * dt * dt).sqrt() / length;
            if relative > 3.0 || (iteration > 3 && relative > last && relative > 1e-6) {
                last = relative;
                break;
            }
            let longest = search.balance.largest_step(&trial.q, trial.t, &change);
            for (q, change) in trial.q.iter_mut().zip(&change) {
                *q += longest * change;
            }
            trial.t += longest * dt;
            if longest < 1.0 {
                continue;
            }
            if relative <= search.options.tolerance || (relative < 1e-6 && relative > 0.3 * last) {
                return Ok(iteration);
            }
            last = relative;
        }
        Err(SolverError::Correction { iterations, change: last, tolerance: search.options.tolerance })
    }

    /// Returns the direction of the path at an equilibrium.
    pub(super) fn tangent_at(&mut self, search: &mut Search, state: &State) -> Result<Tangent, SolverError> {
        let mut velocity = load_rate(search, &state.q, state.t)?;
        velocity.iter_mut().for_each(|value| *value = -*value);
        let is_stable = solve(search, &state.q, state.t, &mut self.shift, &mut [&mut velocity])?;
        Ok(Tangent { velocity, is_stable })
    }
}

/// Solves K x = b with K at (q, t), definite or not, for several right-hand sides; returns whether K was positive
/// definite.
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
            balance.solve(rhs, EXACT)?;
        }
        return Ok(true);
    }
    // The smaller the shift, the fewer iterations the solution takes.
    let stiffest = balance.stiffest(q, t)?;
    *shift = (0.1 * *shift).max(1e-12 * stiffest);
    while let Err(failure) = balance.factorize(q, t, HessianEvaluation::Exact, *shift)? {
        *shift *= 4.0;
        if *shift > 10.0 * stiffest {
            return Err(failure.into());
        }
    }
    for rhs in rhs {
        let solution = balance.solve_indefinite(rhs, 1e-11, 400)?;
        rhs.copy_from_slice(&solution);
    }
    Ok(false)
}

/// Returns ∂r/∂t at an equilibrium.
fn load_rate(search: &mut Search, q: &[f64], t: f64) -> Result<Vec<f64>, SolverError> {
    let (mut above, mut below) = (vec![0.0; q.len()], vec![0.0; q.len()]);
    let e = 1e-5 * search.options.end.abs().max(t.abs()).max(search.options.increment);
    search.balance.residual(q, t + e, &mut above)?;
    search.balance.residual(q, t - e, &mut below)?;
    for (above, below) in above.iter_mut().zip(&below) {
        *above = (*above - below) / (2.0 * e);
    }
    Ok(above)
}
