//! Arc steps, and steps of a controlled function, along a path of equilibria; a step that fails is shortened.

use vi_core::State;

use crate::equilibrium::function::PathFunction;
use crate::equilibrium::newton;
use crate::equilibrium::options::LoadStep;
use crate::equilibrium::path::branch::{Path, Tangent, mass_product, rms};
use crate::equilibrium::path::corrector::Closure;
use crate::equilibrium::path::turning::note_limit;
use crate::equilibrium::search::Search;
use crate::error::SolverError;

/// Number of Newton iterations for which the length of an arc step is chosen.
const WANTED_ITERATIONS: f64 = 5.0;

/// Largest number of halvings of an arc step that turns too much. At a corner of the path it turns however short the
/// step is.
const MOST_TURN_HALVINGS: u32 = 8;

/// Follows the path from `state` to the final load factor, in at most `steps` arc steps.
pub(crate) fn follow(search: &mut Search, state: &mut State, steps: u32) -> Result<(), SolverError> {
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
    /// Brings the start to equilibrium, and finds the direction of the path there.
    pub(crate) fn begin(search: &mut Search, state: &mut State) -> Result<Self, SolverError> {
        let mut stop = search.stop;
        let before = state.q.clone();
        if let Err(cause) = newton::solve(&mut search.balance, &mut state.q, state.t, &mut stop) {
            state.q = before;
            if cause.is_interruption() || !search.release(state)? {
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

    /// Makes one arc step, shorter if it fails, and not beyond the final load factor.
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
                    let most = if turn_halvings > 0 { 1.0 } else { 2.0 };
                    let factor = (WANTED_ITERATIONS / f64::from(iterations.max(1))).sqrt().clamp(0.5, most);
                    self.length = (length * factor).min(self.arc_of(search.options.largest_increment));
                    return self.accept(search, state, trial, tangent, (dt, iterations));
                }
                Err(cause) if cause.is_interruption() => return Err(cause),
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

    /// Moves along the path until `function` is `goal`, in smaller changes if that fails.
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
            let here = function.at(search.balance.system, &state.q, state.t, search.options.end);
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
                    let step = self.accept(search, state, trial, tangent, (dt, iterations))?;
                    if is_last {
                        return Ok(step);
                    }
                    change *= 2.0;
                }
                Err(cause) if cause.is_interruption() => return Err(cause),
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

    /// Accepts an equilibrium, from which the path continues. `dt` is the predicted change of the load factor.
    fn accept(
        &mut self,
        search: &mut Search,
        state: &mut State,
        next: State,
        tangent: Tangent,
        (dt, iterations): (f64, u32),
    ) -> Result<LoadStep, SolverError> {
        if search.options.find_critical && search.balance.judges_stability() {
            let sense = self.sense(search, state, &next, &tangent);
            if sense != dt.signum() {
                let load_factor = self.turning_load(search, state, &next, &tangent, [dt.signum(), sense]);
                note_limit(search, state, &next, load_factor)?;
            } else if tangent.is_stable != self.is_stable {
                self.note_bifurcation(search, state, &next)?;
            }
        }
        let moved: Vec<f64> = next.q.iter().zip(&state.q).map(|(next, q)| next - q).collect();
        self.last = (moved, next.t - state.t);
        (self.velocity, self.is_stable) = (tangent.velocity, tangent.is_stable);
        (state.q, state.t) = (next.q, next.t);
        let step = LoadStep { load_factor: state.t, iterations, is_stable: self.is_stable };
        search.report.steps.push(step);
        Ok(step)
    }
}
