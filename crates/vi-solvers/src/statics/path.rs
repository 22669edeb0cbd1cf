//! Steps along a path of equilibria whose load factor t is unknown, through limit points: by arc length, or
//! by a function of the positions that takes given values (`function.rs`). Nothing here knows elements.
//!
//! Unknowns are q and t. Newton's method solves r(q, t) = 0 with one equation more, linearised at every
//! iterate: Crisfield's sphere Δqᵀ M Δq / m + ψ² Δt² = Δl² with the total mass m, where ψ is the root mean
//! square of dq/dt at the start (Crisfield 1981; Ramm 1981), or c(q, t) = c₁. Beyond a limit point K is
//! indefinite: systems are then solved by minimal residuals, preconditioned by a Cholesky factor of K + σM.

use vi_core::State;

use super::{CriticalKind, CriticalPoint, LoadStep, PathFunction, Search, critical};
use crate::minres::minimal_residual;
use crate::vectors;
use crate::{HessianEvaluation, SolverError};

/// Newton iterations an arc step is sized for.
const WANTED_ITERATIONS: f64 = 5.0;

/// An arc step over which the path turns by more than the angle of this cosine (25°) is halved: it may have jumped
/// over a limit point. The arch of `tests/accuracy.rs`, which snaps at a twentieth of its load, is so followed through
/// both limit points from a first step of half of its load on; with 0.7 it is not.
const LEAST_COSINE: f64 = 0.9;
/// Halvings for that: where the path has a corner it turns however short the step is.
const MOST_TURN_HALVINGS: u32 = 8;

/// What the next step along a path depends on beside the state.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Path {
    /// What a unit of load weighs against a metre: the root mean square of dq/dt at the start, m.
    pub(crate) psi: f64,
    /// Radius of the next arc step, m.
    pub(crate) length: f64,
    /// The last shift σ that made K + σM definite, 1/s².
    pub(crate) shift: f64,
    /// The step before, Δq and Δt: its sense is kept.
    pub(crate) last: (Vec<f64>, f64),
    /// dq/dt at the state.
    pub(crate) velocity: Vec<f64>,
    /// Has K a Cholesky factor at the state?
    pub(crate) is_stable: bool,
}

/// A direction of the path.
struct Tangent {
    /// dq/dt.
    velocity: Vec<f64>,
    /// Has K a Cholesky factor?
    is_stable: bool,
}

/// The equation that fixes the load factor of a step.
enum Closure<'a> {
    /// The step has this length, m.
    Sphere(f64),
    /// The load factor has this value.
    Load(f64),
    /// A function of the positions has this value.
    Function(&'a mut PathFunction, f64),
}

/// Follows the path from `state` to the load factor at the end, in at most `steps` arc steps.
pub(super) fn follow(search: &mut Search, state: &mut State, steps: u32) -> Result<(), SolverError> {
    let end = search.options.end;
    let mut path = Path::begin(search, state)?;
    if state.t == end {
        let step = LoadStep { load_factor: end, iterations: 0, is_stable: path.is_stable };
        search.report.steps.push(step);
        (search.watch)(state, &step);
        return Ok(());
    }
    for _ in 0..steps {
        let step = path.arc_step(search, state)?;
        if !(search.watch)(state, &step) || state.t == end {
            return Ok(());
        }
    }
    Err(SolverError::ArcSteps { steps, load_factor: state.t, end })
}

impl Path {
    /// Brings the start into balance, and finds where the path goes from there.
    pub(crate) fn begin(search: &mut Search, state: &mut State) -> Result<Self, SolverError> {
        let mut stop = search.stop;
        let before = state.q.clone();
        if let Err(cause) = super::newton::solve(&mut search.balance, &mut state.q, state.t, &mut stop) {
            state.q = before;
            if !search.release(state) {
                return Err(cause);
            }
        }
        let mut path = Self {
            psi: 0.0,
            length: 0.0,
            shift: 0.0,
            last: (vec![0.0; state.q.len()], (search.options.end - state.t).signum()),
            velocity: Vec::new(),
            is_stable: true,
        };
        let tangent = path.tangent_at(search, state)?;
        (path.velocity, path.is_stable) = (tangent.velocity, tangent.is_stable);
        path.psi = rms(search, &path.velocity).max(f64::MIN_POSITIVE);
        path.length = path.arc_of(search.options.increment.min(search.options.largest_increment));
        Ok(path)
    }

    /// Arc length of a change of the load factor where the body responds as at the start, m.
    fn arc_of(&self, load: f64) -> f64 {
        load.abs() * self.psi * 2.0_f64.sqrt()
    }

    /// Makes one arc step, shorter where that fails, and not beyond the load factor at the end.
    pub(crate) fn arc_step(
        &mut self,
        search: &mut Search,
        state: &mut State,
    ) -> Result<LoadStep, SolverError> {
        let end = search.options.end;
        let span = (end - state.t).signum();
        let shortest = self.arc_of(search.options.smallest_increment);
        let (mut length, mut turn_halvings) = (self.length, 0);
        loop {
            let norm = (rms(search, &self.velocity).powi(2) + self.psi * self.psi).sqrt();
            let along = mass_product(search, &self.last.0, &self.velocity);
            let mut dt = length / norm * (along + self.psi * self.psi * self.last.1).signum();
            let overshoots = (state.t + dt - end) * span >= 0.0;
            if overshoots {
                dt = end - state.t;
            }
            let mut trial = self.predict(state, dt);
            let closure = if overshoots { Closure::Load(end) } else { Closure::Sphere(length) };
            match self.correct(search, state, &mut trial, closure, length) {
                Ok(iterations) => {
                    let tangent = self.tangent_at(search, &trial)?;
                    if turn_halvings < MOST_TURN_HALVINGS && self.turns(search, state, &trial, &tangent, dt) {
                        search.report.halvings += 1;
                        turn_halvings += 1;
                        length = 0.5 * length.min(dt.abs() * norm);
                        continue;
                    }
                    let factor = (WANTED_ITERATIONS / f64::from(iterations.max(1))).sqrt().clamp(0.5, 2.0);
                    self.length = (length * factor).min(self.arc_of(search.options.largest_increment));
                    return self.accept(search, state, trial, tangent, iterations);
                }
                Err(cause) => {
                    search.report.halvings += 1;
                    length = 0.5 * length.min(dt.abs() * norm);
                    if length < shortest {
                        let load = length / (self.psi * 2.0_f64.sqrt());
                        let cause = Box::new(cause);
                        return Err(SolverError::ArcStep { load_factor: state.t, load, cause });
                    }
                }
            }
        }
    }

    /// Does the path turn by more than [`LEAST_COSINE`] allows over a step to `next`, forwards for dt > 0?
    fn turns(&self, search: &Search, state: &State, next: &State, tangent: &Tangent, dt: f64) -> bool {
        let product = |a: &[f64], b: &[f64]| mass_product(search, a, b) + self.psi * self.psi;
        let moved: Vec<f64> = next.q.iter().zip(&state.q).map(|(next, q)| next - q).collect();
        let moved_t = next.t - state.t;
        let ahead = mass_product(search, &moved, &tangent.velocity) + self.psi * self.psi * moved_t;
        let norms = product(&self.velocity, &self.velocity) * product(&tangent.velocity, &tangent.velocity);
        let cosine = product(&self.velocity, &tangent.velocity) / norms.sqrt();
        dt.signum() * ahead.signum() * cosine < LEAST_COSINE
    }

    /// Goes on to where `function` is `goal`, in smaller changes where that fails.
    pub(crate) fn step_to(
        &mut self,
        search: &mut Search,
        state: &mut State,
        function: &mut PathFunction,
        goal: f64,
        smallest: f64,
    ) -> Result<LoadStep, SolverError> {
        let mut change = f64::INFINITY;
        let mut iterations = 0;
        loop {
            let here = function.at(search.balance.system, &state.q, state.t);
            let left = goal - here.value;
            let is_last = left.abs() <= change;
            let target = if is_last { goal } else { here.value + change * left.signum() };
            let slope = here.slope(&self.velocity);
            let dt = (target - here.value) / slope;
            let norm = rms(search, &self.velocity) + self.psi;
            let result = if dt.is_finite() {
                let mut trial = self.predict(state, dt);
                let closure = Closure::Function(function, target);
                self.correct(search, state, &mut trial, closure, dt.abs() * norm).map(|count| (trial, count))
            } else {
                Err(SolverError::Unmoved { load_factor: state.t })
            };
            match result {
                Ok((trial, count)) => {
                    iterations += count;
                    let tangent = self.tangent_at(search, &trial)?;
                    let step = self.accept(search, state, trial, tangent, iterations)?;
                    if is_last {
                        return Ok(step);
                    }
                    change *= 2.0;
                }
                Err(cause) => {
                    search.report.halvings += 1;
                    change = 0.5 * (target - here.value).abs();
                    if change.is_nan() || change < smallest {
                        let cause = Box::new(cause);
                        return Err(SolverError::ControlStep { load_factor: state.t, change, cause });
                    }
                }
            }
        }
    }

    /// Where the path would be at t + dt if it were straight.
    fn predict(&self, state: &State, dt: f64) -> State {
        let q = state.q.iter().zip(&self.velocity).map(|(q, v)| q + dt * v).collect();
        State { t: state.t + dt, q, p: Vec::new() }
    }

    /// Takes over an equilibrium: the path goes on from there.
    fn accept(
        &mut self,
        search: &mut Search,
        state: &mut State,
        next: State,
        tangent: Tangent,
        iterations: u32,
    ) -> Result<LoadStep, SolverError> {
        let was_stable = self.is_stable;
        (self.velocity, self.is_stable) = (tangent.velocity, tangent.is_stable);
        let moved: Vec<f64> = next.q.iter().zip(&state.q).map(|(next, q)| next - q).collect();
        let moved_t = next.t - state.t;
        if self.is_stable != was_stable && search.options.find_critical {
            note_critical(search, state, &next, self.last.1 * moved_t < 0.0)?;
        }
        self.last = (moved, moved_t);
        (state.q, state.t) = (next.q, next.t);
        let step = LoadStep { load_factor: state.t, iterations, is_stable: self.is_stable };
        search.report.steps.push(step);
        Ok(step)
    }

    /// Where the path goes from an equilibrium.
    fn tangent_at(&mut self, search: &mut Search, state: &State) -> Result<Tangent, SolverError> {
        let mut velocity = load_rate(search, &state.q, state.t)?;
        velocity.iter_mut().for_each(|value| *value = -*value);
        let is_stable = solve(search, &state.q, state.t, &mut self.shift, &mut [&mut velocity])?;
        Ok(Tangent { velocity, is_stable })
    }

    /// Newton's method for r = 0 and `closure`; changes are measured against `length`, m.
    fn correct(
        &mut self,
        search: &mut Search,
        from: &State,
        trial: &mut State,
        mut closure: Closure,
        length: f64,
    ) -> Result<u32, SolverError> {
        let n = from.q.len();
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
                Closure::Function(function, goal) => {
                    let here = function.at(search.balance.system, &trial.q, trial.t);
                    let gap = *goal - here.value - vectors::sum(n, |k| here.gradient[k] * step[k]);
                    gap / here.slope(&along)
                }
            };
            if !dt.is_finite() {
                break;
            }
            let change: Vec<f64> = (0..n).map(|k| step[k] + dt * along[k]).collect();
            // rᵀδ may have either sign where K is indefinite: measure the change against the step instead.
            let relative = (mass_product(search, &change, &change) + squared * dt * dt).sqrt() / length;
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
        Err(SolverError::Correction { iterations, change: last, tolerance: search.options.tolerance })
    }
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

/// Solves K x = b with K at (q, t), definite or not, for some right-hand sides; returns whether it was definite.
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
        let solution = minimal_residual(balance, rhs, 1e-11, 400)?;
        rhs.copy_from_slice(&solution);
    }
    Ok(false)
}

/// ∂r/∂t at an equilibrium.
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

/// Enters the critical point between two equilibria, where the lowest eigenvalue crosses zero.
fn note_critical(
    search: &mut Search,
    before: &State,
    after: &State,
    turned: bool,
) -> Result<(), SolverError> {
    let (first, _) = critical::lowest(&mut search.balance, &before.q, before.t)?;
    let (last, mode) = critical::lowest(&mut search.balance, &after.q, after.t)?;
    let kind = if turned { CriticalKind::Limit } else { search.kind_of(&mode, after)? };
    let along = if first == last { 0.5 } else { (first / (first - last)).clamp(0.0, 1.0) };
    let load_factor = before.t + along * (after.t - before.t);
    search.report.critical.push(CriticalPoint { kind, load_factor, eigenvalues: [first, last] });
    Ok(())
}
