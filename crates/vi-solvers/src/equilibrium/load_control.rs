//! Finds static equilibria by load steps that are halved and enlarged. Time is the load factor: loads and prescribed
//! motions are evaluated at t, from the state's own t to `end`.

use vi_core::{State, System};

use crate::assemble::finite::check_state;
use crate::assemble::hessian::HessianEvaluation;
use crate::equilibrium::balance::refuse_constraints;
use crate::equilibrium::constrained::ConstraintForces;
use crate::equilibrium::friction::Rubbed;
use crate::equilibrium::lowest_mode::lowest;
use crate::equilibrium::newton::{PREDICTION, Solved, Stop};
use crate::equilibrium::options::{LoadStep, StaticOptions, StaticReport};
use crate::equilibrium::path::follow;
use crate::equilibrium::rubbing;
use crate::equilibrium::search::Search;
use crate::equilibrium::tangent_solver::ConstantTangent;
use crate::error::SolverError;
use crate::vectors;
use crate::work::Work;

/// If a body moves this many times farther per unit of load than in the previous step, it may have snapped.
const SNAP_RATIO: f64 = 5.0;

/// Largest number of attempts after the first under loads that do not change, whose equations are the same. Later ones omit passes with
/// lagged friction that have failed: two of 25 scenes of balls of `stress --equilibria` come to rest only then. One that does not takes 4731
/// instead of 10 176 iterations to fail.
const REPEATS: u32 = 3;

/// Brings `state` from its load factor state.t to the equilibrium at load factor `options.end`; momenta become zero.
/// If state.t is already there, solves at that load factor.
///
/// # Errors
/// Returns [`SolverError::Equilibrium`] with the load factor that was reached, if no increment succeeds;
/// [`SolverError::ArcStep`] if no arc step succeeds; [`SolverError::ArcSteps`] if they are used up; or the error of a
/// term or factor, or [`SolverError::Interrupted`]. Then `state` is unchanged.
pub fn equilibrium(
    system: &System,
    state: &mut State,
    options: &StaticOptions,
) -> Result<StaticReport, SolverError> {
    equilibrium_path(system, state, options, &mut |_, _| true)
}

/// Does the same as [`equilibrium`], and passes every equilibrium on the way to `watch`, which returns false to stop
/// there.
///
/// # Errors
/// Returns the errors of [`equilibrium`].
pub fn equilibrium_path(
    system: &System,
    state: &mut State,
    options: &StaticOptions,
    watch: &mut dyn FnMut(&State, &LoadStep) -> bool,
) -> Result<StaticReport, SolverError> {
    let earlier = Earlier {
        is_stable: None,
        rubbed: &mut Rubbed::default(),
        work: &mut Work::default(),
        tangent: &mut None,
        was_made: false,
    };
    search(system, state, options, watch, earlier)
}

/// What searches for earlier equilibria left.
pub(super) struct Earlier<'a> {
    /// Whether the last equilibrium is stable; `None` if the state is not that equilibrium.
    pub(super) is_stable: Option<bool>,
    /// The state of friction.
    pub(super) rubbed: &'a mut Rubbed,
    /// The work of all searches, whether they succeeded or failed.
    pub(super) work: &'a mut Work,
    /// The factor of a K that is the same everywhere.
    pub(super) tangent: &'a mut Option<ConstantTangent>,
    /// Whether a run that this one continues has made that factor.
    pub(super) was_made: bool,
}

/// Does the same as [`equilibrium_path`], after earlier equilibria.
pub(super) fn search(
    system: &System,
    state: &mut State,
    options: &StaticOptions,
    watch: &mut dyn FnMut(&State, &LoadStep) -> bool,
    Earlier { is_stable, rubbed, work, tangent, was_made }: Earlier<'_>,
) -> Result<StaticReport, SolverError> {
    options.check()?;
    if options.arc_steps.is_some() {
        refuse_constraints("a path of equilibria", system)?;
    }
    check_state(state, system)?;
    let (constraints, held) = ConstraintForces::of(system)?.unzip();
    let mut search = Search::new(held.as_ref().unwrap_or(system), options, watch);
    search.constraints = constraints;
    search.balance.begin(state, rubbed)?;
    search.balance.take_over(tangent.take(), was_made);
    let mut found = State { t: state.t, q: state.q.clone(), p: vec![0.0; state.p.len()] };
    let outcome = search.find(&mut found, is_stable);
    *work += search.balance.work;
    search.report.linear = search.balance.linear_solver().map(|(linear, reason)| (linear, reason.to_owned()));
    *tangent = search.balance.hand_over();
    outcome?;
    search.report.work = search.balance.work;
    search.report.energy = search.balance.work_done();
    if let Some(friction) = &search.balance.friction {
        *rubbed = friction.rubbed.clone();
    }
    *state = found;
    Ok(search.report)
}

impl Search<'_> {
    /// Brings a state to the end of the load factor.
    fn find(&mut self, state: &mut State, is_stable: Option<bool>) -> Result<(), SolverError> {
        if state.q.is_empty() {
            state.t = self.options.end;
            self.report.steps.push(LoadStep { load_factor: state.t, iterations: 0, is_stable: true });
            return Ok(());
        }
        match (self.options.arc_steps, is_stable) {
            (Some(steps), _) => follow::follow(self, state, steps),
            (None, Some(is_stable)) if self.persists(state) => self.keep(state, is_stable),
            (None, known) => self.step_loads(state, known.is_some()),
        }
    }

    /// Steps the load factor to its end. A start that is an equilibrium need not be released.
    fn step_loads(&mut self, state: &mut State, is_equilibrium: bool) -> Result<(), SolverError> {
        let end = self.options.end;
        let span = end - state.t;
        let (mut q, mut velocity) = (state.q.clone(), vec![0.0; state.q.len()]);
        let mut increment = self.options.increment.min(self.options.largest_increment) * span.signum();
        // The distance that the body moved per unit of load in the last step.
        let mut last_rate = 0.0;
        // Whether dq/dt is known from a tangent at `state`.
        let mut has_velocity = false;
        let (mut may_release, mut may_predict) = (true, true);
        // Whether bodies moved away at the last load that was tried.
        let mut moved_away = false;
        // The number of increments that failed under loads that do not change.
        let mut repeated = 0;
        // Equilibria with friction are no stationary points of a potential.
        let has_friction = self.balance.friction.is_some();
        let judges = self.balance.judges_stability();
        loop {
            let t =
                if (end - state.t).abs() <= 1.0000001 * increment.abs() { end } else { state.t + increment };
            for k in 0..q.len() {
                q[k] = state.q[k] + (t - state.t) * velocity[k];
            }
            let is_predicted = has_velocity && self.is_better_start(state, &q, t)?;
            if !is_predicted {
                q.copy_from_slice(&state.q);
            }
            let mut stop = self.stop;
            let mut result = self.solve_at(state, &mut q, t, !may_predict, &mut stop);
            if is_predicted
                && result.as_ref().is_err_and(|error| !error.is_interruption() && !error.moves_away())
            {
                // The prediction may be the cause; try without it.
                q.copy_from_slice(&state.q);
                stop = self.stop;
                result = self.solve_at(state, &mut q, t, !may_predict, &mut stop);
            }
            let tried = (t - state.t).abs();
            let was_stable = self.report.steps.last().map_or(self.start_is_stable, |step| step.is_stable);
            let rate = self.distance(&q, &state.q) / tried;
            let lost_definiteness = result.as_ref().is_ok_and(|solved| !solved.stayed_definite);
            let has_leapt = last_rate > 0.0 && rate > SNAP_RATIO * last_rate;
            let may_have_snapped = !has_friction
                && (was_stable || !judges)
                && !self.report.steps.is_empty()
                && ((lost_definiteness && judges) || has_leapt);
            // An unstable equilibrium is left before it is accepted: if that fails, the step is halved.
            let mut left = None;
            if let Some(push) = self.options.push
                && let Ok(_) = result
                && !(has_friction || !judges || (may_have_snapped && tried > self.closest(span)))
                && !self.balance.is_stable(&q, t)?
            {
                let known = self.report.critical.len();
                if was_stable && self.options.find_critical {
                    // The forces of constraints change beyond the branch.
                    self.find_critical(state, &State { t, q: q.clone(), p: Vec::new() })?;
                }
                match self.leave_branch(&q, t, push) {
                    Ok(minimum) => left = Some(minimum),
                    Err(cause) => {
                        self.report.critical.truncate(known);
                        result = Err(cause);
                    }
                }
            }
            match result {
                // The step may have gone to another equilibrium; refine it before accepting it.
                Ok(_) if may_have_snapped && tried > self.closest(span) => {
                    increment = 0.25 * tried * span.signum();
                    self.report.halvings += 1;
                }
                Ok(solved) => {
                    let iterations = solved.iterations;
                    last_rate = rate;
                    self.stop.scale = stop.scale;
                    let before =
                        State { t: state.t, q: std::mem::replace(&mut state.q, q.clone()), p: Vec::new() };
                    state.t = t;
                    self.balance.accept(&state.q, t)?;
                    let mut is_stable = match has_friction {
                        true => solved.stayed_definite,
                        false => self.balance.is_stable(&state.q, t)?,
                    };
                    if (is_stable || !judges) && may_have_snapped {
                        self.report.jumps.push(before.t);
                    }
                    let is_new = left.is_none() && is_stable != was_stable;
                    if is_new && self.options.find_critical && !has_friction && judges {
                        self.find_critical(&before, state)?;
                    }
                    if let Some(minimum) = left {
                        state.q = minimum;
                        self.balance.accept(&state.q, t)?;
                        is_stable = self.balance.is_stable(&state.q, t)?;
                    }
                    let step = LoadStep { load_factor: t, iterations, is_stable };
                    self.report.steps.push(step);
                    if !(self.watch)(state, &step) || t == end {
                        return Ok(());
                    }
                    if !std::mem::take(&mut moved_away) && (iterations <= 6 || solved.made_passes) {
                        increment *= 2.0;
                    }
                    increment = increment.abs().min(self.options.largest_increment) * span.signum();
                    may_predict = false;
                    has_velocity = is_stable && self.velocity(state, increment, &mut velocity)?;
                }
                Err(cause) if cause.is_interruption() => return Err(cause),
                // The tangent gives the response of bodies to a prescribed motion.
                Err(SolverError::Blocked { .. })
                    if std::mem::take(&mut may_predict)
                        && self.velocity(state, increment, &mut velocity)? =>
                {
                    has_velocity = true;
                }
                // A smaller motion may not be blocked.
                Err(cause)
                    if (!matches!(cause, SolverError::Blocked { .. })
                        || 0.5 * tried < self.options.smallest_increment)
                        && std::mem::take(&mut may_release)
                        && self.report.steps.is_empty()
                        && (self.leave_mechanism(state, t)?
                            || (!is_equilibrium && self.release(state)?)) =>
                {
                    q.copy_from_slice(&state.q);
                    has_velocity = false;
                }
                Err(cause) => {
                    increment = 0.5 * tried * span.signum();
                    self.report.halvings += 1;
                    moved_away = cause.moves_away();
                    // Shorter increments only tell more digits of a load that bodies cannot bear.
                    let smallest =
                        if moved_away { self.closest(span) } else { self.options.smallest_increment };
                    repeated += u32::from(self.loads_are_equal(&state.q, [t, state.t + increment]));
                    if increment.abs() < smallest || repeated > REPEATS {
                        return Err(self.no_equilibrium(state, tried, cause));
                    }
                }
            }
        }
    }

    /// Solves at load factor t with `q` as the first guess, if the terms allow the straight path from `state` to it; if
    /// `clears_way`, it is changed so that they do.
    fn solve_at(
        &mut self,
        state: &State,
        q: &mut [f64],
        t: f64,
        clears_way: bool,
        stop: &mut Stop,
    ) -> Result<Solved, SolverError> {
        let Self { balance, constraints, .. } = self;
        if let Err(blocked) = balance.check_move(state, q, t) {
            if !clears_way {
                return Err(blocked);
            }
            balance.clear_way(state, q, t);
            balance.check_move(state, q, t)?;
        }
        let Some(constraints) = constraints else { return rubbing::solve(balance, q, t, stop) };
        constraints.stiffen(balance, q, t)?;
        constraints.meet(q, |q| {
            let solved = rubbing::solve(balance, q, t, stop)?;
            Ok((balance.positions(q, t), solved))
        })
    }

    /// Returns whether a solve at t should begin at the prediction `q` rather than at the equilibrium `state`.
    fn is_better_start(&mut self, state: &State, q: &[f64], t: f64) -> Result<bool, SolverError> {
        // Where a prescribed motion passes through bodies that stay behind, forces and energy there say nothing.
        if self.balance.check_move(state, &state.q, t).is_err() {
            return Ok(true);
        }
        if self.balance.friction.is_none() {
            return Ok(self.balance.lowers_energy(&state.q, q, t));
        }
        let mut r = vec![0.0; q.len()];
        self.balance.residual(&state.q, t, &mut r)?;
        let before = self.balance.scaled_norm(&r);
        Ok(self.balance.residual(q, t, &mut r).is_ok() && self.balance.scaled_norm(&r) < before)
    }

    /// Returns the increment at which a step across an indefinite tangent is accepted, and a load at which bodies move away is known.
    fn closest(&self, span: f64) -> f64 {
        (1e-3 * span.abs()).max(self.options.smallest_increment)
    }

    /// Returns the root mean square distance of two configurations, m, weighted by mass.
    fn distance(&self, a: &[f64], b: &[f64]) -> f64 {
        let mass = self.balance.system.free_mass();
        let square = vectors::sum(a.len(), |k| mass[k] * (a[k] - b[k]).powi(2));
        (square / vectors::sum(a.len(), |k| mass[k])).sqrt()
    }

    /// Writes dq/dt = −K⁻¹ ∂r/∂t at an equilibrium whose tangent was just factored; returns false if it does not
    /// exist.
    fn velocity(&mut self, state: &State, increment: f64, out: &mut [f64]) -> Result<bool, SolverError> {
        let mut here = vec![0.0; out.len()];
        self.balance.residual(&state.q, state.t, &mut here)?;
        let e = 1e-4 * increment;
        if e == 0.0 || self.balance.residual(&state.q, state.t + e, out).is_err() {
            return Ok(false);
        }
        for (out, here) in out.iter_mut().zip(&here) {
            *out = (here - *out) / e;
        }
        if self.balance.factorize(&state.q, state.t, HessianEvaluation::Exact, 0.0)?.is_err() {
            return Ok(false);
        }
        match self.balance.solve(out, PREDICTION) {
            Err(error) if error.is_interruption() => Err(error),
            solved => Ok(solved.is_ok()),
        }
    }

    /// Returns the error for a load that cannot be carried, with the facts about the last equilibrium.
    fn no_equilibrium(&mut self, state: &State, increment: f64, cause: SolverError) -> SolverError {
        let t = state.t;
        // A body that is too large for a factor is too large for its eigenvalues. With friction or circulatory forces, they tell
        // nothing about the path.
        let has_eigenvalues =
            self.balance.has_factor() && self.balance.friction.is_none() && self.balance.judges_stability();
        let lowest =
            has_eigenvalues.then(|| lowest(&mut self.balance, &state.q, t).ok()).flatten().map(|mode| mode.0);
        let round_off = self.balance.round_off_of_eigenvalues();
        let lowest = lowest.map(|lowest| if lowest.abs() <= round_off { 0.0 } else { lowest });
        let last = Box::new(state.clone());
        SolverError::Equilibrium { load_factor: t, increment, lowest, last, cause: Box::new(cause) }
    }
}
