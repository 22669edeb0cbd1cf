//! Static equilibrium: load steps that halve and grow, or steps along the path of equilibria through
//! limit points; critical points are found and named. Time is the load factor: loads and prescribed
//! motions are read at t, from where the state is to `end`. Nothing here knows elements or scenes.

mod balance;
mod critical;
mod function;
mod newton;
mod path;
mod release;

use vi_core::{State, System};

pub(crate) use balance::Balance;
pub use function::PathFunction;
pub(crate) use path::Path;

use crate::force_sum::ForceSum;
use crate::{Assembler, HessianEvaluation, SolverError, Work, vectors};
use newton::Stop;

/// A body that moves this many times further per unit of load than in the step before may have snapped.
const SNAP_RATIO: f64 = 5.0;

/// How equilibria are searched for.
#[derive(Debug, Clone, PartialEq)]
pub struct StaticOptions {
    /// Load factor (time) to end at.
    pub end: f64,
    /// First increment of the load factor.
    pub increment: f64,
    /// Increments grow to this at most.
    pub largest_increment: f64,
    /// A solve that fails at increments this small has failed.
    pub smallest_increment: f64,
    /// Relative tolerance in the energy norm, √(rᵀK⁻¹r / largest first decrement).
    pub tolerance: f64,
    /// Newton iterations after which an increment is halved.
    pub max_iterations: u32,
    /// Follow the path of equilibria by its arc length, through limit points, in at most so many steps. The first
    /// and the longest of them are those of `increment` and `largest_increment` where the body responds as at the
    /// start.
    pub arc_steps: Option<u32>,
    /// Find the load factors at which an equilibrium becomes unstable.
    pub find_critical: bool,
    /// Where the path becomes unstable, leave it along the critical mode: amplitude of the push, m.
    pub push: Option<f64>,
}

impl Default for StaticOptions {
    fn default() -> Self {
        Self {
            end: 1.0,
            increment: 1.0,
            largest_increment: 1.0,
            smallest_increment: 1e-6,
            tolerance: 1e-8,
            max_iterations: 25,
            arc_steps: None,
            find_critical: true,
            push: None,
        }
    }
}

/// An equilibrium on the way.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LoadStep {
    /// Its load factor.
    pub load_factor: f64,
    /// Newton iterations that it took.
    pub iterations: u32,
    /// Is V at a minimum there (has the tangent a Cholesky factor)?
    pub is_stable: bool,
}

/// What happens at a critical point.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum CriticalKind {
    /// The load has a maximum or minimum along the path: beyond it the body snaps.
    Limit,
    /// Another path branches off: the body buckles.
    Bifurcation,
}

/// A load factor at which stability is lost or won.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CriticalPoint {
    /// What happens.
    pub kind: CriticalKind,
    /// Load factor.
    pub load_factor: f64,
    /// Lowest ω² = λ(K, M) of the equilibria before and after it, 1/s².
    pub eigenvalues: [f64; 2],
}

/// What a search did.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct StaticReport {
    /// The equilibria, in order.
    pub steps: Vec<LoadStep>,
    /// Critical points passed, in order.
    pub critical: Vec<CriticalPoint>,
    /// Load factors of stable equilibria from which the next one could only be reached across states
    /// without stability: there the body snapped, and the path that it was on has ended.
    pub jumps: Vec<f64>,
    /// Increments that failed and were halved.
    pub halvings: u32,
    /// Work done.
    pub work: Work,
}

impl StaticReport {
    /// Load factor reached.
    pub fn load_factor(&self) -> f64 {
        self.steps.last().map_or(0.0, |step| step.load_factor)
    }

    /// Is the last equilibrium stable?
    pub fn is_stable(&self) -> bool {
        self.steps.last().is_some_and(|step| step.is_stable)
    }
}

/// Brings `state` to the equilibrium at load factor `options.end`, from where it is (state.t); momenta
/// become zero. Where state.t is already there, solves at that load factor.
///
/// # Errors
/// [`SolverError::Equilibrium`] with the load factor that was reached where no increment succeeds,
/// [`SolverError::ArcStep`] where no arc step does, [`SolverError::ArcSteps`] where they are used up, or the error
/// of a term or factor; `state` is then as before.
pub fn equilibrium(
    system: &System,
    state: &mut State,
    options: &StaticOptions,
) -> Result<StaticReport, SolverError> {
    equilibrium_path(system, state, options, &mut |_, _| true)
}

/// [`equilibrium`], showing every equilibrium on the way to `watch`, which returns false to stop there.
///
/// # Errors
/// As [`equilibrium`].
pub fn equilibrium_path(
    system: &System,
    state: &mut State,
    options: &StaticOptions,
    watch: &mut dyn FnMut(&State, &LoadStep) -> bool,
) -> Result<StaticReport, SolverError> {
    check(options)?;
    crate::surface::refuse("a static solve", system)?;
    crate::forces::check_state(state, system)?;
    let mut search = Search::new(system, options, watch);
    let mut found = State { t: state.t, q: state.q.clone(), p: vec![0.0; state.p.len()] };
    if !found.q.is_empty() {
        match options.arc_steps {
            Some(steps) => path::follow(&mut search, &mut found, steps)?,
            None => search.step_loads(&mut found)?,
        }
    } else {
        found.t = options.end;
        search.report.steps.push(LoadStep { load_factor: options.end, iterations: 0, is_stable: true });
    }
    search.report.work = search.balance.work;
    *state = found;
    Ok(search.report)
}

/// The forces that hold the prescribed coordinates, N: ∂V/∂x − f where they do not accelerate, with what
/// consistent mass passes on to them, M_pf q̈; zero at free coordinates. One entry a coordinate.
pub fn reactions(system: &System, state: &State) -> Vec<f64> {
    let (x, v) = (system.positions(state), system.velocities(state));
    let mut out = vec![0.0; x.len()];
    Assembler::new(system).gradient(&x, state.t, &mut out);
    if let Some(mut forces) = ForceSum::new(system) {
        forces.evaluate(&x, &v, state.t);
        for (dof, out) in out.iter_mut().enumerate() {
            *out -= forces.total(dof);
        }
    }
    if let Some(kinetic) = system.kinetic() {
        let free = system.coordinates().free();
        let force: Vec<f64> = free.iter().map(|&dof| -out[dof as usize]).collect();
        let (mut acceleration, mut inertial) = (vec![0.0; x.len()], vec![0.0; x.len()]);
        kinetic.coordinates().embed(&system.velocity(&force), state.t, &mut acceleration);
        Assembler::new(kinetic).gradient(&acceleration, 0.0, &mut inertial);
        out.iter_mut().zip(&inertial).for_each(|(out, inertial)| *out += inertial);
    }
    for &dof in system.coordinates().free() {
        out[dof as usize] = 0.0;
    }
    system.coordinates().to_space(&mut out);
    out
}

pub(crate) fn check(options: &StaticOptions) -> Result<(), SolverError> {
    for (option, value) in [
        ("static.increment", options.increment),
        ("static.largest_increment", options.largest_increment),
        ("static.smallest_increment", options.smallest_increment),
    ] {
        if !(value > 0.0 && value.is_finite()) {
            return Err(SolverError::Option { option, value, allowed: "must be positive and finite" });
        }
    }
    if !(1e-14..=0.1).contains(&options.tolerance) {
        let allowed = "must be 1e-14 (to round-off) to 0.1";
        return Err(SolverError::Option { option: "static.tolerance", value: options.tolerance, allowed });
    }
    Ok(())
}

/// A search under way.
pub(crate) struct Search<'a> {
    pub(crate) balance: Balance<'a>,
    options: &'a StaticOptions,
    stop: Stop,
    pub(crate) report: StaticReport,
    watch: &'a mut dyn FnMut(&State, &LoadStep) -> bool,
}

impl<'a> Search<'a> {
    pub(crate) fn new(
        system: &'a System,
        options: &'a StaticOptions,
        watch: &'a mut dyn FnMut(&State, &LoadStep) -> bool,
    ) -> Self {
        let stop = Stop { tolerance: options.tolerance, max_iterations: options.max_iterations, scale: 0.0 };
        Self { balance: Balance::new(system), options, stop, report: StaticReport::default(), watch }
    }

    /// Load control.
    fn step_loads(&mut self, state: &mut State) -> Result<(), SolverError> {
        let end = self.options.end;
        let span = end - state.t;
        let (mut q, mut velocity) = (state.q.clone(), vec![0.0; state.q.len()]);
        let mut increment = self.options.increment.min(self.options.largest_increment) * span.signum();
        // How far the body moved per unit of load in the last step.
        let mut last_rate = 0.0;
        // Is dq/dt known, from a tangent that holds at `state`?
        let mut has_velocity = false;
        let mut may_release = true;
        loop {
            let t =
                if (end - state.t).abs() <= 1.0000001 * increment.abs() { end } else { state.t + increment };
            for k in 0..q.len() {
                q[k] = state.q[k] + if has_velocity { (t - state.t) * velocity[k] } else { 0.0 };
            }
            let mut stop = self.stop;
            let mut result = newton::solve(&mut self.balance, &mut q, t, &mut stop);
            if result.is_err() && has_velocity {
                // Perhaps the prediction was at fault.
                q.copy_from_slice(&state.q);
                stop = self.stop;
                result = newton::solve(&mut self.balance, &mut q, t, &mut stop);
            }
            let tried = (t - state.t).abs();
            let was_stable = self.report.steps.last().is_none_or(|step| step.is_stable);
            let rate = self.distance(&q, &state.q) / tried;
            let lost_definiteness = result.as_ref().is_ok_and(|solved| !solved.stayed_definite);
            let has_leapt = last_rate > 0.0 && rate > SNAP_RATIO * last_rate;
            let may_have_snapped =
                was_stable && !self.report.steps.is_empty() && (lost_definiteness || has_leapt);
            match result {
                // Perhaps to another equilibrium: look closer before that is accepted.
                Ok(_) if may_have_snapped && tried > self.closest(span) => {
                    increment = 0.25 * tried * span.signum();
                    self.report.halvings += 1;
                }
                Ok(newton::Solved { iterations, .. }) => {
                    last_rate = rate;
                    self.stop.scale = stop.scale;
                    let before =
                        State { t: state.t, q: std::mem::replace(&mut state.q, q.clone()), p: Vec::new() };
                    state.t = t;
                    let mut is_stable =
                        self.balance.factorize(&state.q, t, HessianEvaluation::Exact, 0.0)?.is_ok();
                    if is_stable && may_have_snapped {
                        self.report.jumps.push(before.t);
                    }
                    if is_stable != was_stable && self.options.find_critical {
                        self.find_critical(&before, state)?;
                    }
                    if !is_stable && let Some(push) = self.options.push {
                        is_stable = self.leave_branch(state, push)?;
                    }
                    let step = LoadStep { load_factor: t, iterations, is_stable };
                    self.report.steps.push(step);
                    if !(self.watch)(state, &step) || t == end {
                        return Ok(());
                    }
                    if iterations <= 6 {
                        increment *= 2.0;
                    }
                    increment = increment.abs().min(self.options.largest_increment) * span.signum();
                    has_velocity = is_stable && self.velocity(state, increment, &mut velocity)?;
                }
                Err(_)
                    if std::mem::take(&mut may_release)
                        && self.report.steps.is_empty()
                        && self.release(state) =>
                {
                    q.copy_from_slice(&state.q);
                }
                Err(cause) => {
                    increment = 0.5 * tried * span.signum();
                    self.report.halvings += 1;
                    if increment.abs() < self.options.smallest_increment {
                        return Err(self.no_equilibrium(state, tried, cause));
                    }
                }
            }
        }
    }

    /// Balances the start at its own load factor; false, with the state as it was, where that fails.
    fn release(&mut self, state: &mut State) -> bool {
        match release::release(&mut self.balance, &mut state.q, state.t, &self.stop) {
            Ok(halvings) => {
                self.report.halvings += halvings;
                true
            }
            Err(_) => false,
        }
    }

    /// The increment at which a step across an indefinite tangent is accepted.
    fn closest(&self, span: f64) -> f64 {
        (1e-3 * span.abs()).max(self.options.smallest_increment)
    }

    /// Root mean square distance of two configurations, m, weighted by mass.
    fn distance(&self, a: &[f64], b: &[f64]) -> f64 {
        let mass = self.balance.system.free_mass();
        let square = vectors::sum(a.len(), |k| mass[k] * (a[k] - b[k]).powi(2));
        (square / vectors::sum(a.len(), |k| mass[k])).sqrt()
    }

    /// dq/dt = −K⁻¹ ∂r/∂t at an equilibrium whose tangent was just factored; false where it has none.
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
        Ok(self.balance.solve(out).is_ok())
    }

    /// The error of a load that cannot be carried, with what is known of the last equilibrium.
    fn no_equilibrium(&mut self, state: &State, increment: f64, cause: SolverError) -> SolverError {
        let t = state.t;
        let lowest = critical::lowest(&mut self.balance, &state.q, t).ok().map(|mode| mode.0);
        SolverError::Equilibrium { load_factor: t, increment, lowest, cause: Box::new(cause) }
    }
}
