//! One implicit stage, M w + c ∂V/∂q(û + w, t_s) = 0, and the steppers that are made of it: implicit
//! midpoint and, for comparison, Newmark, generalised-α, BDF2 and backward Euler differ only in û,
//! c, t_s and in what follows from w ([`Rule`]). It must not know how A is factored.
//!
//! The unknown is the increment w = c a of the stage and never u = û + w itself: so momenta come from
//! accelerations with their full relative precision, not from differences of positions. The solution
//! minimises Φ(w) = ½ wᵀM w + c V(x(û + w, t_s)).

use vi_core::{State, StepEnergy, System};

use crate::accounts::{self, Potentials};
use crate::balance;
use crate::constrained::Constrained;
use crate::forces::{Forces, check_state};
use crate::inverse::Inverse;
use crate::kick_drift::check_finite;
use crate::newton::{Equations, Newton, Start};
use crate::stepper::expect_method;
use crate::vectors;
use crate::{SolverError, SolverOptions, StepError, StepReport, Stepper, StepperMemory, UnitCosts, Work};

/// What one step of a one-stage method is, for one coordinate: v is its velocity at the start, w the
/// stage increment, and `k` its index in the rule's own history.
pub(crate) trait Rule: Send + Sync {
    /// Scene name.
    fn name(&self) -> &'static str;
    /// c of the stage equation, s².
    fn coefficient(&self, h: f64) -> f64;
    /// Is Δp·v̄ = R·Δq/c − g·Δq to round-off, as for implicit midpoint?
    fn is_variational(&self) -> bool {
        false
    }
    /// Time of the stage, in units of h from the start.
    fn time(&self) -> f64;
    /// û − q₀.
    fn offset(&self, k: usize, v: f64, h: f64) -> f64;
    /// The changes of q and of velocity over the step, affine in w.
    fn change(&self, k: usize, v: f64, w: f64, h: f64) -> (f64, f64);
    /// Velocity at the stage, for forces that depend on it: as far between the two ends as the stage is.
    fn velocity(&self, k: usize, v: f64, w: f64, h: f64) -> f64 {
        v + self.time() * self.change(k, v, w, h).1
    }
    /// The solver's tolerance that serves the tolerance asked for.
    fn tolerance(&self, tolerance: f64) -> f64 {
        tolerance
    }
    /// Where multipliers take their directions and whether the momentum is made tangent at the end;
    /// none where the scheme has no place for constraints.
    fn multipliers(&self) -> Option<Multipliers> {
        None
    }
    /// Is there a force beside −∂V/∂q at the stage? Then the stage minimises nothing.
    fn has_correction(&self) -> bool {
        false
    }
    /// What is added to ∂V/∂q at the stage.
    fn correction(&mut self, _trial: &Trial<'_>, _out: &mut [f64]) {}
    /// Makes ready for a step from `state`: a history that does not belong to it is begun anew.
    fn open(&mut self, _: &System, _: &mut Forces, _: &State, _h: f64) -> Result<(), SolverError> {
        Ok(())
    }
    /// The step has been made: keeps what the next one needs.
    fn close(&mut self, _system: &System, _before: &State, _after: &State, _w: &[f64], _h: f64) {}
    /// What it keeps.
    fn remember(&self, _memory: &mut StepperMemory) {}
    /// Takes over what it kept.
    fn restore(&mut self, _memory: &StepperMemory) -> Result<(), SolverError> {
        Ok(())
    }
}

/// Where the multipliers of a step take their directions ∂g/∂q.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Multipliers {
    /// At the start, and at the end for the momentum: variational (Marsden & West 2001, §3.5).
    Ends,
    /// At the stage in the middle of the step, where they do no work on quadratic constraints: energy
    /// is kept (Gonzalez 1999). The momentum is tangent in the mean of its ends.
    Middle,
}

/// A stage that is being solved, evaluated at û + w.
pub(crate) struct Trial<'a> {
    pub(crate) system: &'a System,
    pub(crate) forces: &'a Forces,
    pub(crate) start_q: &'a [f64],
    pub(crate) start_t: f64,
    pub(crate) h: f64,
    offset: &'a [f64],
    w: &'a [f64],
}

impl Trial<'_> {
    /// û + w − q₀ of coordinate k.
    pub(crate) fn increment(&self, k: usize) -> f64 {
        self.offset[k] + self.w[k]
    }
}

/// Linear × midpoint (Marsden & West 2001, §2.6.2): û = q₀ + (h/2) v₀, c = h²/4.
pub(crate) struct Midpoint;

impl Rule for Midpoint {
    fn name(&self) -> &'static str {
        "implicit-midpoint"
    }
    fn is_variational(&self) -> bool {
        true
    }
    fn coefficient(&self, h: f64) -> f64 {
        0.25 * h * h
    }
    fn time(&self) -> f64 {
        0.5
    }
    fn offset(&self, _k: usize, v: f64, h: f64) -> f64 {
        0.5 * h * v
    }
    fn multipliers(&self) -> Option<Multipliers> {
        Some(Multipliers::Ends)
    }
    fn change(&self, _k: usize, v: f64, w: f64, h: f64) -> (f64, f64) {
        (h * v + 2.0 * w, 4.0 * w / h)
    }
}

/// Names of the accelerations that are kept.
const HISTORY: [&str; 3] = ["stage.last", "stage.older", "stage.oldest"];

/// The unknowns and buffers of one stage.
struct Stage {
    c: f64,
    /// Time of the stage, s.
    t: f64,
    /// 2 T of the start, J: part of the energy that errors are relative to.
    twice_kinetic: f64,
    /// q₀ and û − q₀.
    origin: Vec<f64>,
    offset: Vec<f64>,
    /// w/c of the last steps, from which the next is extrapolated.
    history: [Vec<f64>; 3],
    history_count: usize,
    w: Vec<f64>,
    base: Vec<f64>,
    correction: Vec<f64>,
    /// −R.
    residual: Vec<f64>,
    /// û + w.
    q: Vec<f64>,
    /// The rule's addition to the force there.
    added: Vec<f64>,
    twice_origin: f64,
    start_t: f64,
    h: f64,
    /// Is the rule's addition left out, so that the stage minimises Φ?
    is_simple: bool,
    /// Are there forces without a potential? Then velocities at the start are kept.
    is_forced: bool,
    velocity: Vec<f64>,
    /// Where there are constraints.
    constrained: Option<Constrained>,
}

impl Stage {
    fn new(system: &System, rule: &impl Rule) -> Self {
        let (n, is_forced) = (system.coordinates().free_count(), !system.forces().is_empty());
        let zero = || vec![0.0; n];
        Self {
            constrained: rule.multipliers().and_then(|multipliers| Constrained::new(system, multipliers)),
            c: 0.0,
            t: 0.0,
            twice_kinetic: 0.0,
            origin: zero(),
            offset: zero(),
            history: [zero(), zero(), zero()],
            history_count: 0,
            w: zero(),
            base: zero(),
            correction: zero(),
            residual: zero(),
            q: zero(),
            added: zero(),
            twice_origin: 0.0,
            start_t: 0.0,
            h: 0.0,
            is_simple: false,
            is_forced,
            velocity: Vec::new(),
        }
    }

    fn open(&mut self, system: &System, rule: &impl Rule, state: &State, h: f64) {
        let mass = system.free_mass();
        self.c = rule.coefficient(h);
        self.t = state.t + rule.time() * h;
        (self.start_t, self.h, self.is_simple) = (state.t, h, false);
        self.origin.copy_from_slice(&state.q);
        vectors::fill(&mut self.offset, |k| rule.offset(k, state.p[k] / mass[k], h));
        if self.is_forced {
            self.velocity.clear();
            self.velocity.extend(state.p.iter().zip(mass).map(|(p, m)| p / m));
        }
        self.twice_kinetic = vectors::sum(mass.len(), |k| state.p[k] * state.p[k] / mass[k]);
        self.twice_origin = vectors::sum(mass.len(), |k| mass[k] * state.q[k] * state.q[k]);
        if let Some(constrained) = &mut self.constrained {
            constrained.open(system, state, h);
        }
    }

    fn configure(&mut self) {
        let Self { q, origin, offset, w, .. } = self;
        vectors::fill(q, |k| origin[k] + (offset[k] + w[k]));
    }

    /// Evaluates the forces at û + w, the rule's addition with them.
    fn evaluate(
        &mut self,
        system: &System,
        rule: &mut impl Rule,
        forces: &mut Forces,
    ) -> Result<(), SolverError> {
        self.configure();
        self.set_velocities(system, rule, forces);
        forces.evaluate(system, &self.q, self.t, false)?;
        if self.is_simple {
            self.added.fill(0.0);
        } else if rule.has_correction() {
            let Self { origin, offset, w, added, start_t, h, .. } = self;
            let (start_t, h, start_q) = (*start_t, *h, &*origin);
            rule.correction(&Trial { system, forces, start_q, start_t, h, offset, w }, added);
        }
        let Self { constrained, added, q, origin, offset, w, t, .. } = self;
        if let Some(constrained) = constrained {
            if !rule.has_correction() {
                added.fill(0.0);
            }
            let end = |k: usize| origin[k] + 2.0 * (offset[k] + w[k]);
            constrained.evaluate(system, q, *t, end, added);
        }
        Ok(())
    }

    /// Tells the forces without a potential how fast the stage moves.
    fn set_velocities(&self, system: &System, rule: &impl Rule, forces: &mut Forces) {
        if self.is_forced && !self.w.is_empty() {
            let (v, w, h) = (&self.velocity, &self.w, self.h);
            let rate = rule.velocity(0, 0.0, 1.0, h) - rule.velocity(0, 0.0, 0.0, h);
            let q_dot: Vec<f64> = (0..w.len()).map(|k| rule.velocity(k, v[k], w[k], h)).collect();
            forces.set_velocities(system, &q_dot, self.t, rate);
        }
    }

    /// Puts the end of the step on the surface of the constraints, to round-off.
    fn reach(&mut self, system: &System, before: &State) -> Result<(), SolverError> {
        let Self { constrained, origin, offset, w, h, .. } = self;
        match constrained {
            Some(constrained) => {
                let end = |k: usize, w: f64| origin[k] + 2.0 * (offset[k] + w);
                constrained.reach(system, end, w, before.t + *h)
            }
            None => Ok(()),
        }
    }

    fn close(&mut self) {
        let Self { history, w, c, .. } = self;
        history.rotate_right(1);
        vectors::fill(&mut history[0], |k| w[k] / *c);
        self.history_count = (self.history_count + 1).min(history.len());
    }
}

/// A stage of a system: what Newton's method sees.
struct StageEquations<'a, R> {
    system: &'a System,
    rule: &'a mut R,
    stage: &'a mut Stage,
}

impl<R: Rule> Equations for StageEquations<'_, R> {
    fn coefficient(&self) -> f64 {
        self.stage.c
    }

    fn model_is_exact(&self) -> bool {
        !self.rule.has_correction() && self.stage.constrained.is_none()
    }

    fn simplify(&mut self, simple: bool) -> bool {
        let may_be = self.rule.has_correction() && !self.stage.is_forced;
        self.stage.is_simple = simple && may_be;
        may_be
    }

    fn unknowns(&self) -> &[f64] {
        &self.stage.w
    }

    fn go_to(&mut self, unknowns: &[f64]) {
        let Stage { w, base, .. } = &mut *self.stage;
        w.copy_from_slice(unknowns);
        base.copy_from_slice(unknowns);
    }

    fn start(&mut self, start: Start) {
        let Stage { c, history: [last, older, oldest], history_count, w, base, offset, .. } = self.stage;
        match (start, *history_count) {
            (Start::Predicted, 2..) => vectors::fill(w, |k| *c * (2.0 * last[k] - older[k])),
            // Exact for straight lines and for what changes its sign at every step.
            (Start::Stiff, 3..) => vectors::fill(w, |k| *c * (last[k] + (older[k] - oldest[k]))),
            (Start::Stiff, 2) => vectors::fill(w, |k| *c * older[k]),
            (Start::Predicted, 1) => vectors::fill(w, |k| *c * last[k]),
            (Start::Predicted | Start::Stiff | Start::Inertial, _) => w.fill(0.0),
            (Start::Still, _) => vectors::fill(w, |k| -offset[k]),
        }
        base.copy_from_slice(w);
    }

    fn linearize(&mut self, _system: &System, _forces: &mut Forces) -> Result<(), SolverError> {
        // The last evaluation was made at the iterate.
        Ok(())
    }

    fn evaluate(&mut self, system: &System, forces: &mut Forces) -> Result<(), SolverError> {
        self.stage.evaluate(system, self.rule, forces)?;
        let (gradient, mass, free) = (forces.gradient(), system.free_mass(), system.coordinates().free());
        let Stage { w, c, added, residual, .. } = &mut *self.stage;
        vectors::fill(residual, |k| -(mass[k] * w[k] + *c * (gradient[free[k] as usize] + added[k])));
        Ok(())
    }

    fn correct(&mut self, inverse: &mut Inverse, forces: &mut Forces) -> Result<f64, SolverError> {
        let Stage { correction, residual, w, base, c, constrained, .. } = self.stage;
        correction.copy_from_slice(residual);
        inverse.apply(forces, correction)?;
        base.copy_from_slice(w);
        if let Some(constrained) = constrained {
            return constrained.correct(*c, inverse, forces, residual, correction);
        }
        Ok(vectors::sum(residual.len(), |k| residual[k] * correction[k]) / *c)
    }

    fn correction(&mut self) -> (&mut [f64], &[f64]) {
        let Stage { correction, residual, constrained, .. } = &mut *self.stage;
        (correction, constrained.as_ref().map_or(&residual[..], Constrained::load))
    }

    fn advance(&mut self, fraction: f64) {
        let Stage { w, base, correction, .. } = self.stage;
        vectors::fill(w, |k| base[k] + fraction * correction[k]);
    }

    fn slope(&self) -> f64 {
        let Stage { residual, correction, c, .. } = &*self.stage;
        vectors::sum(residual.len(), |k| residual[k] * correction[k]) / c
    }

    fn has_merit(&self) -> bool {
        let is_plain = !self.stage.is_forced && self.stage.constrained.is_none();
        (!self.rule.has_correction() || self.stage.is_simple) && is_plain
    }

    fn merit(&mut self, system: &System, forces: &mut Forces) -> Option<f64> {
        if !self.has_merit() {
            return None;
        }
        self.stage.configure();
        let (w, mass, c) = (&self.stage.w, system.free_mass(), self.stage.c);
        let kinetic = vectors::sum(w.len(), |k| 0.5 * mass[k] * w[k] * w[k]) / c;
        Some(kinetic + forces.energy(system, &self.stage.q, self.stage.t))
    }

    fn energy_scale(&self) -> f64 {
        let (w, mass) = (&self.stage.w, self.system.free_mass());
        0.5 * self.stage.twice_kinetic + vectors::sum(w.len(), |k| mass[k] * w[k] * w[k]) / self.stage.c
    }

    fn is_at_resolution(&self) -> bool {
        let (d, mass) = (&self.stage.correction, self.system.free_mass());
        let square = vectors::sum(d.len(), |k| mass[k] * d[k] * d[k]);
        square <= f64::EPSILON * f64::EPSILON * self.stage.twice_origin
    }
}

/// The stepper of a one-stage method.
pub(crate) struct OneStage<R> {
    rule: R,
    forces: Forces,
    inverse: Inverse,
    newton: Newton,
    potentials: Potentials,
    ledger: bool,
    stage: Stage,
    after: State,
    x_start: Vec<f64>,
    dx: Vec<f64>,
}

impl<R: Rule> OneStage<R> {
    pub(crate) fn new(rule: R, system: &System, options: &SolverOptions) -> Result<Self, SolverError> {
        let n = system.coordinates().free_count();
        let tolerance = rule.tolerance(options.tolerance);
        Ok(Self {
            forces: Forces::with_nonconservative(system),
            inverse: Inverse::new(system, options.linear),
            newton: Newton::new(&SolverOptions { tolerance, ..options.clone() })?,
            potentials: Potentials::new(),
            ledger: options.ledger,
            stage: Stage::new(system, &rule),
            rule,
            after: State { t: 0.0, q: vec![0.0; n], p: vec![0.0; n] },
            x_start: Vec::new(),
            dx: Vec::new(),
        })
    }

    fn advance(&mut self, system: &System, state: &State, h: f64) -> Result<(u32, StepEnergy), SolverError> {
        check_state(state, system)?;
        if self.ledger {
            self.potentials.open(system, &mut self.forces, &state.q, state.t);
        }
        self.rule.open(system, &mut self.forces, state, h)?;
        self.stage.open(system, &self.rule, state, h);
        let iterations = self.solve(system)?;
        self.stage.reach(system, state)?;
        let (rule, w, mass) = (&self.rule, &self.stage.w, system.free_mass());
        let State { t, q, p } = &mut self.after;
        *t = state.t + h;
        vectors::update_pair(q, p, |k, q, p| {
            let (dq, dv) = rule.change(k, state.p[k] / mass[k], w[k], h);
            *q = state.q[k] + dq;
            *p = state.p[k] + mass[k] * dv;
        });
        if let Some(constrained) = &mut self.stage.constrained {
            constrained.close(system, q, p, *t)?;
        }
        check_finite(q, p, system)?;
        let energy = if self.ledger { self.account(system, state)? } else { StepEnergy::default() };
        self.rule.close(system, state, &self.after, &self.stage.w, h);
        self.stage.close();
        Ok((iterations, energy))
    }

    /// Solves the stage; 0 iterations where the body is at rest in balance.
    fn solve(&mut self, system: &System) -> Result<u32, SolverError> {
        let Self { rule, forces, inverse, newton, stage, .. } = self;
        if stage.origin.is_empty() {
            return Ok(0);
        }
        if !stage.is_forced
            && stage.constrained.is_none()
            && balance::may_be_at_rest(stage.twice_kinetic, &stage.history[0], stage.history_count)
        {
            stage.w.fill(0.0);
            stage.configure();
            forces.evaluate(system, &stage.q, stage.t, false)?;
            if balance::is_at_rest(system, forces, newton.tolerance()) {
                forces.work.skipped += 1;
                return Ok(0);
            }
        }
        let mut equations = StageEquations { system, rule, stage };
        Ok(newton.solve(system, forces, inverse, &mut equations)?.iterations)
    }

    /// The parts of the step's change of energy. With ΔT = Δp·v̄ and g = ∂V/∂x at the stage, they are
    /// the work g·Δx (g with the rule's addition) on prescribed coordinates, the residual's work R·Δq/c, and the
    /// rest that the scheme makes: ΔV − g·Δx (with forces f that have no potential g is ∂V/∂x − f, and their work
    /// f·Δx is a part of its own), and for schemes that are not variational Δp·v̄ + (g − R/c)·Δq.
    fn account(&mut self, system: &System, before: &State) -> Result<StepEnergy, SolverError> {
        let Self { rule, forces, stage, after, potentials, x_start, dx, .. } = self;
        stage.evaluate(system, rule, forces)?;
        let (mass, free) = (system.free_mass(), system.coordinates().free());
        let coordinates = system.coordinates();
        x_start.resize(coordinates.dof_count(), 0.0);
        dx.resize(coordinates.dof_count(), 0.0);
        coordinates.embed(&before.q, before.t, x_start);
        coordinates.embed(&after.q, after.t, dx);
        vectors::update(dx, |k, dx| *dx -= x_start[k]);
        let gradient = forces.gradient();
        let (w, c, step) = (&stage.w, stage.c, &*dx);
        let along = |k: usize| step[free[k] as usize];
        let mut prescribed = accounts::prescribed_work(system, gradient, step);
        if let Some(constrained) = &stage.constrained {
            prescribed += constrained.prescribed_work(step);
        }
        let added = &stage.added;
        let elastic =
            accounts::free_work(system, gradient, along) + vectors::sum(w.len(), |k| added[k] * along(k));
        let inertia = |k: usize| mass[k] * w[k] / c;
        let residual =
            vectors::sum(w.len(), |k| (inertia(k) + gradient[free[k] as usize] + added[k]) * along(k));
        let kinetic = vectors::sum(w.len(), |k| {
            (after.p[k] - before.p[k]) * 0.5 * (before.p[k] + after.p[k]) / mass[k]
        });
        let inertial = vectors::sum(w.len(), |k| inertia(k) * along(k));
        let (force, damping) = forces.nonconservative_work(step);
        let (change, loads) = potentials.close(system, forces, &after.q, after.t);
        let mut scheme = change - loads - elastic - prescribed - force - damping;
        if !self.rule.is_variational() || stage.constrained.is_some() {
            scheme += kinetic - inertial;
        }
        Ok(StepEnergy { prescribed, force: force + loads, damping, scheme, residual })
    }
}

impl<R: Rule> Stepper for OneStage<R> {
    fn step(&mut self, system: &System, state: &mut State, h: f64) -> Result<StepReport, StepError> {
        let before = self.forces.work;
        let (iterations, energy) = self.advance(system, state, h).map_err(|error| {
            let cause = self.forces.explain(system, state, error);
            StepError { t: state.t, h, cause }
        })?;
        std::mem::swap(&mut self.after, state);
        self.forces.work.steps += 1;
        Ok(StepReport { iterations, energy, work: self.forces.work - before })
    }

    fn work(&self) -> Work {
        self.forces.work
    }

    fn unit_costs(&self, system: &System) -> UnitCosts {
        if self.inverse.is_ready() { *self.inverse.costs() } else { UnitCosts::explicit(system) }
    }

    fn linear_solver(&self) -> Option<&str> {
        Some(self.inverse.reason()).filter(|reason| !reason.is_empty())
    }

    fn memory(&self) -> StepperMemory {
        let mut memory = StepperMemory { method: self.rule.name().to_owned(), ..Default::default() };
        for (name, history) in HISTORY.iter().zip(&self.stage.history) {
            memory.arrays.push(((*name).to_owned(), history.clone()));
        }
        memory.counts.push(("stage.history".into(), self.stage.history_count as u64));
        self.forces.remember(&mut memory);
        self.potentials.remember(&mut memory);
        if let Some(constrained) = &self.stage.constrained {
            memory.arrays.push(("stage.multipliers".into(), constrained.multipliers().to_vec()));
        }
        self.inverse.remember(&mut memory);
        self.newton.remember(&mut memory);
        self.rule.remember(&mut memory);
        memory
    }

    fn restore(&mut self, system: &System, memory: &StepperMemory) -> Result<(), SolverError> {
        expect_method(memory, self.rule.name())?;
        for (history, name) in self.stage.history.iter_mut().zip(HISTORY) {
            let array = memory.array(name)?;
            if array.len() != history.len() {
                return Err(SolverError::Memory { missing: name });
            }
            history.copy_from_slice(array);
        }
        self.stage.history_count = memory.count("stage.history")? as usize;
        if let Some(constrained) = &mut self.stage.constrained {
            constrained.restore(memory.array("stage.multipliers")?)?;
        }
        self.forces = Forces::with_nonconservative(system);
        self.potentials = Potentials::recall(memory);
        self.newton.restore(memory)?;
        self.rule.restore(memory)?;
        self.inverse.restore(system, &mut self.forces, memory)?;
        self.forces.recall(system, memory)?;
        self.forces.work = Work::default();
        Ok(())
    }
}
