//! The equations of one implicit stage for Newton's method: residual, start, correction, merit.

mod kept;

use vi_core::{State, System};

use super::complete_tangent::CompleteTangent;
use crate::assemble::evaluator::Evaluator;
use crate::assemble::inertia::Inertia;
use crate::assemble::live::end_per_stage;
use crate::error::SolverError;
use crate::newton::equations::Equations;
use crate::newton::inverse::Inverse;
use crate::newton::start::Start;
use crate::schemes::constraint::multipliers::Multipliers;
use crate::schemes::one_stage::rule::{Rule, Trial};
use crate::vectors;

/// Largest length of a correction, as a multiple of the motion of the stage without pairs, plus a multiple of the reach
/// of the pairs for bodies that begin to move.
const FARTHEST: f64 = 4.0;
const REACHES: f64 = 20.0;

/// The unknowns and buffers of one stage.
pub(super) struct Stage {
    pub(super) c: f64,
    /// Time of the stage, s.
    pub(super) t: f64,
    /// Change of the end of the step per change of the stage, if live terms act over steps.
    pub(super) end_per_stage: f64,
    /// 2 T at the start, J: part of the energy to which errors are relative.
    pub(super) twice_kinetic: f64,
    /// q₀ and û − q₀.
    pub(super) origin: Vec<f64>,
    pub(super) offset: Vec<f64>,
    /// w/c of the last steps, from which the next is extrapolated.
    pub(super) history: [Vec<f64>; 3],
    pub(super) history_count: usize,
    pub(super) w: Vec<f64>,
    pub(super) base: Vec<f64>,
    pub(super) correction: Vec<f64>,
    /// −R.
    pub(super) residual: Vec<f64>,
    /// û + w.
    pub(super) q: Vec<f64>,
    /// The rule's addition to the force at û + w.
    pub(super) added: Vec<f64>,
    /// Scratch memory for M w, if the mass is consistent.
    pub(super) scratch: Vec<f64>,
    pub(super) twice_origin: f64,
    pub(super) start_t: f64,
    pub(super) h: f64,
    /// Whether the rule's addition is omitted, so that the stage minimises Φ.
    pub(super) is_simple: bool,
    /// Whether there are forces without a potential. Then velocities at the start are stored.
    pub(super) is_forced: bool,
    pub(super) velocity: Vec<f64>,
    /// Whether these forces are held; see [`Evaluator::hold_forces`].
    pub(super) holds_forces: bool,
    /// Whether live terms act by discrete gradients. Then the stage does not minimise a function.
    pub(super) has_discrete: bool,
    /// The multipliers, if there are constraints.
    pub(super) multipliers: Option<Multipliers>,
    /// The complete tangent of steps with pairs.
    pub(super) complete: CompleteTangent,
}

impl Stage {
    pub(super) fn new(system: &System, rule: &impl Rule) -> Self {
        let (n, is_forced) = (system.coordinates().free_count(), !system.forces().is_empty());
        let zero = || vec![0.0; n];
        Self {
            multipliers: rule
                .multiplier_directions()
                .and_then(|directions| Multipliers::new(system, directions)),
            complete: CompleteTangent::default(),
            c: 0.0,
            t: 0.0,
            end_per_stage: 1.0,
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
            scratch: Vec::new(),
            twice_origin: 0.0,
            start_t: 0.0,
            h: 0.0,
            is_simple: false,
            is_forced,
            has_discrete: false,
            holds_forces: false,
            velocity: Vec::new(),
        }
    }

    pub(super) fn open(
        &mut self,
        system: &System,
        rule: &impl Rule,
        inertia: &Inertia,
        state: &State,
        h: f64,
    ) {
        self.complete.begin_step();
        let (mass, v) = (system.free_mass(), inertia.velocity(system, &state.p));
        self.c = rule.coefficient(h);
        self.t = state.t + rule.time() * h;
        self.end_per_stage = end_per_stage(rule.is_at_end());
        (self.start_t, self.h, self.is_simple) = (state.t, h, false);
        self.origin.copy_from_slice(&state.q);
        vectors::fill(&mut self.offset, |k| rule.offset(k, v.at(k), h));
        if self.is_forced {
            self.velocity.clear();
            self.velocity.extend((0..mass.len()).map(|k| v.at(k)));
        }
        self.twice_kinetic = match inertia.matrix() {
            Some(_) => vectors::sum(mass.len(), |k| state.p[k] * v.at(k)),
            None => vectors::sum(mass.len(), |k| state.p[k] * state.p[k] / mass[k]),
        };
        self.twice_origin = vectors::sum(mass.len(), |k| mass[k] * state.q[k] * state.q[k]);
        if let Some(multipliers) = &mut self.multipliers {
            multipliers.open(system, state, h, self.end_per_stage);
        }
    }

    pub(super) fn configure(&mut self) {
        let Self { q, origin, offset, w, .. } = self;
        vectors::fill(q, |k| origin[k] + (offset[k] + w[k]));
    }

    /// Evaluates the forces at û + w, including the rule's addition.
    pub(super) fn evaluate(
        &mut self,
        system: &System,
        rule: &mut impl Rule,
        evaluator: &mut Evaluator,
    ) -> Result<(), SolverError> {
        self.configure();
        self.set_velocities(system, rule, evaluator);
        if evaluator.acts_over_steps() {
            let end: Vec<f64> = (0..self.w.len()).map(|k| self.end(k)).collect();
            evaluator.set_ends(system, (&self.origin, self.start_t), (&end, self.start_t + self.h));
        }
        let outcome = evaluator.evaluate(system, &self.q, self.t, false);
        self.has_discrete = evaluator.has_discrete();
        outcome?;
        if self.is_simple {
            self.added.fill(0.0);
        } else if rule.has_correction() {
            let Self { origin, offset, w, added, start_t, h, .. } = self;
            let (start_t, h, start_q) = (*start_t, *h, &*origin);
            rule.correction(&Trial { system, evaluator, start_q, start_t, h, offset, w }, added);
            evaluator.work.energies += 1;
        }
        let Self { multipliers, added, q, origin, offset, w, t, end_per_stage, .. } = self;
        if let Some(multipliers) = multipliers {
            if !rule.has_correction() {
                added.fill(0.0);
            }
            let end = |k: usize| origin[k] + *end_per_stage * (offset[k] + w[k]);
            multipliers.evaluate(system, q, *t, end, added);
        }
        Ok(())
    }

    /// Returns coordinate k at the end of the step, if live terms act over steps.
    fn end(&self, k: usize) -> f64 {
        self.origin[k] + self.end_per_stage * (self.offset[k] + self.w[k])
    }

    /// Returns the largest fraction of the change dq of the stage, from its current place, that the terms allow.
    fn largest_step(&mut self, system: &System, evaluator: &mut Evaluator, dq: &[f64]) -> f64 {
        self.configure();
        let coordinates = system.coordinates();
        let mut dx = vec![0.0; coordinates.dof_count()];
        coordinates.embed_change(dq, &mut dx);
        let x = coordinates.positions(&self.q, self.t);
        if !evaluator.acts_over_steps() {
            return evaluator.largest_step(&x, &dx, None);
        }
        let end: Vec<f64> = (0..self.w.len()).map(|k| self.end(k)).collect();
        let x_end = coordinates.positions(&end, self.start_t + self.h);
        let dx_end: Vec<f64> = dx.iter().map(|dx| self.end_per_stage * dx).collect();
        evaluator.largest_step(&x, &dx, Some([&x_end, &dx_end]))
    }

    /// Sets the velocity of the stage for the forces without a potential.
    pub(super) fn set_velocities(&self, system: &System, rule: &impl Rule, evaluator: &mut Evaluator) {
        if self.is_forced && !self.w.is_empty() {
            let (v, w, h) = (&self.velocity, &self.w, self.h);
            let rate = rule.velocity(0, 0.0, 1.0, h) - rule.velocity(0, 0.0, 0.0, h);
            let q_dot: Vec<f64> = (0..w.len()).map(|k| rule.velocity(k, v[k], w[k], h)).collect();
            evaluator.set_velocities(system, &q_dot, self.t, rate);
        }
    }

    /// Projects the end of the step onto the manifold of the constraints, to round-off.
    pub(super) fn project_end(&mut self, system: &System, before: &State) -> Result<(), SolverError> {
        let Self { multipliers, origin, offset, w, h, c, end_per_stage, .. } = self;
        match multipliers {
            Some(multipliers) => {
                let end = |k: usize, w: f64| origin[k] + *end_per_stage * (offset[k] + w);
                multipliers.project_end(system, *c, end, w, before.t + *h)
            }
            None => Ok(()),
        }
    }

    pub(super) fn close(&mut self) {
        let Self { history, w, c, .. } = self;
        history.rotate_right(1);
        vectors::fill(&mut history[0], |k| w[k] / *c);
        self.history_count = (self.history_count + 1).min(history.len());
    }
}

/// The equations of a stage for Newton's method.
pub(super) struct StageEquations<'a, R> {
    pub(super) system: &'a System,
    pub(super) rule: &'a mut R,
    pub(super) inertia: &'a Inertia,
    pub(super) stage: &'a mut Stage,
}

/// Returns the load to which the last correction belongs, kg m: with constraints not the whole residual.
pub(super) fn load_of<'a>(residual: &'a [f64], multipliers: &'a Option<Multipliers>) -> &'a [f64] {
    multipliers.as_ref().map_or(residual, Multipliers::load)
}

/// Returns ½ vᵀM v.
fn inertial_energy(system: &System, inertia: &Inertia, v: &[f64], scratch: &mut Vec<f64>) -> f64 {
    match inertia.matrix() {
        Some(_) => {
            let inertial = inertia.momentum(system, v, scratch);
            vectors::sum(v.len(), |k| 0.5 * inertial.at(k) * v[k])
        }
        None => {
            let mass = system.free_mass();
            vectors::sum(v.len(), |k| 0.5 * mass[k] * v[k] * v[k])
        }
    }
}

impl<R: Rule> StageEquations<'_, R> {
    /// If `holds`, replaces forces without a potential by their linearisation at the last evaluation; otherwise uses
    /// the forces themselves again.
    pub(super) fn hold_forces(&mut self, evaluator: &mut Evaluator, holds: bool) {
        self.stage.holds_forces = holds && self.stage.is_forced;
        match self.stage.holds_forces {
            true => evaluator.hold_forces(self.system),
            false => evaluator.release_forces(),
        }
    }
}

impl<R: Rule> Equations for StageEquations<'_, R> {
    fn coefficient(&self) -> f64 {
        self.stage.c
    }

    fn model_is_exact(&self) -> bool {
        !self.rule.has_correction() && self.stage.multipliers.is_none() && !self.stage.has_discrete
    }

    fn model_is_partial(&self) -> bool {
        self.stage.has_discrete
    }

    fn omits_curvature(&self) -> bool {
        self.stage.multipliers.is_some()
    }

    fn simplify(&mut self, evaluator: &mut Evaluator, simple: bool) -> bool {
        let Stage { is_forced, has_discrete, .. } = *self.stage;
        if self.rule.has_correction() {
            let may_be = !is_forced && !has_discrete;
            self.stage.is_simple = simple && may_be;
            return may_be;
        }
        if !is_forced || has_discrete || self.stage.is_bound() {
            return false;
        }
        self.hold_forces(evaluator, simple);
        true
    }

    fn unknowns(&self) -> &[f64] {
        &self.stage.w
    }

    fn go_to(&mut self, unknowns: &[f64]) {
        let Stage { w, base, multipliers, .. } = &mut *self.stage;
        if let Some(multipliers) = multipliers {
            multipliers.forget_failure();
        }
        w.copy_from_slice(unknowns);
        base.copy_from_slice(unknowns);
    }

    fn start(&mut self, start: Start) {
        if let Some(multipliers) = &mut self.stage.multipliers {
            multipliers.forget_directions();
        }
        let Stage { c, history: [last, older, oldest], history_count, w, offset, .. } = &mut *self.stage;
        match (start, *history_count) {
            (Start::Predicted, 2..) => vectors::fill(w, |k| *c * (2.0 * last[k] - older[k])),
            // Exact for linear sequences and for values that change their sign at every step.
            (Start::Stiff, 3..) => vectors::fill(w, |k| *c * (last[k] + (older[k] - oldest[k]))),
            (Start::Stiff, 2) => vectors::fill(w, |k| *c * older[k]),
            (Start::Predicted, 1) => vectors::fill(w, |k| *c * last[k]),
            (Start::Predicted | Start::Stiff | Start::Inertial, _) => w.fill(0.0),
            (Start::Still, _) => vectors::fill(w, |k| -offset[k]),
        }
        self.stage.meet_constraints(self.system, true);
        let Stage { w, base, .. } = &mut *self.stage;
        base.copy_from_slice(w);
    }

    fn shorten_start(&mut self, system: &System, evaluator: &mut Evaluator) {
        if system.coordinates().dof_count().is_multiple_of(3) && evaluator.has_live() {
            return self.shorten_path(evaluator);
        }
        // The path leads from the beginning of the step to the start of the iteration.
        let stage = &mut *self.stage;
        let goal: Vec<f64> = stage.offset.iter().zip(&stage.w).map(|(offset, w)| offset + w).collect();
        let at_start = stage.offset.iter().map(|offset| -offset).collect();
        let wanted = std::mem::replace(&mut stage.w, at_start);
        let part = stage.largest_step(system, evaluator, &goal);
        let Stage { w, base, offset, .. } = stage;
        w.copy_from_slice(&wanted);
        if part < 1.0 {
            vectors::fill(w, |k| part * goal[k] - offset[k]);
        }
        base.copy_from_slice(w);
    }

    fn largest_step(&mut self, system: &System, evaluator: &mut Evaluator, most: f64) -> f64 {
        let stage = &mut *self.stage;
        let reached = std::mem::take(&mut stage.w);
        stage.w = stage.base.clone();
        let change: Vec<f64> = stage.correction.iter().map(|delta| most * delta).collect();
        let part = stage.largest_step(system, evaluator, &change);
        stage.w = reached;
        most * part
    }

    fn longest_correction(&self, evaluator: &Evaluator) -> f64 {
        let reach = evaluator.reach();
        if reach == 0.0 {
            // Nothing can meet.
            return f64::INFINITY;
        }
        let Stage { offset, w, residual, .. } = &*self.stage;
        let (mass, coordinates) = (self.system.free_mass(), self.system.coordinates());
        let motion = (0..offset.len()).map(|k| offset[k].abs().max((offset[k] + w[k]).abs()));
        let pushed = residual.iter().zip(mass).map(|(residual, mass)| residual / mass);
        let [motion, pushed] = [coordinates.farthest(motion), coordinates.farthest(pushed)];
        let bound = (3.0_f64.sqrt() * 2.0 * pushed).min(REACHES * reach);
        3.0_f64.sqrt() * FARTHEST * motion + bound
    }

    fn keep_constraints(&mut self, keeps: bool) {
        if let Some(multipliers) = &mut self.stage.multipliers {
            multipliers.keep(keeps);
        }
    }

    fn restrain(&mut self, system: &System, evaluator: &mut Evaluator) -> Result<(), SolverError> {
        // Supports that move give energy by the forces of constraints, which are not known well enough to judge the end by.
        match system.coordinates().is_moving() {
            true => Ok(()),
            false => self.shorten_step(system, evaluator),
        }
    }

    fn linearize(&mut self, _system: &System, evaluator: &mut Evaluator) -> Result<(), SolverError> {
        // The last evaluation was made at the iterate, with the last correction.
        evaluator.set_step(if self.stage.is_simple { None } else { self.rule.step() });
        Ok(())
    }

    fn evaluate(&mut self, system: &System, evaluator: &mut Evaluator) -> Result<(), SolverError> {
        if let Some(failure) = self.stage.off_constraints() {
            return Err(failure.clone());
        }
        self.stage.evaluate(system, self.rule, evaluator)?;
        let (gradient, free) = (evaluator.gradient(), system.coordinates().free());
        let Stage { w, c, added, residual, scratch, .. } = &mut *self.stage;
        let inertial = self.inertia.momentum(system, w, scratch);
        vectors::fill(residual, |k| -(inertial.at(k) + *c * (gradient[free[k] as usize] + added[k])));
        Ok(())
    }

    fn correct(&mut self, inverse: &mut Inverse, evaluator: &mut Evaluator) -> Result<f64, SolverError> {
        let Stage { correction, residual, w, base, c, multipliers, .. } = self.stage;
        base.copy_from_slice(w);
        if let Some(multipliers) = multipliers.as_mut().filter(|multipliers| multipliers.is_kept()) {
            correction.copy_from_slice(multipliers.balance(*c, inverse, evaluator, residual)?);
            inverse.apply(evaluator, correction)?;
            multipliers.project_change(*c, inverse, evaluator, correction)?;
            let load = multipliers.load();
            return Ok(vectors::sum(load.len(), |k| load[k] * correction[k]) / *c);
        }
        correction.copy_from_slice(residual);
        inverse.apply(evaluator, correction)?;
        if let Some(multipliers) = multipliers {
            return multipliers.correct(*c, inverse, evaluator, residual, correction);
        }
        Ok(vectors::sum(residual.len(), |k| residual[k] * correction[k]) / *c)
    }

    fn correction(&mut self) -> (&mut [f64], &[f64]) {
        let Stage { correction, residual, multipliers, .. } = &mut *self.stage;
        (correction, load_of(residual, multipliers))
    }

    fn advance(&mut self, fraction: f64) {
        let Stage { w, base, correction, .. } = &mut *self.stage;
        vectors::fill(w, |k| base[k] + fraction * correction[k]);
        self.stage.meet_constraints(self.system, false);
    }

    fn slope(&self) -> f64 {
        let Stage { residual, correction, c, .. } = &*self.stage;
        vectors::sum(residual.len(), |k| residual[k] * correction[k]) / c
    }

    fn has_merit(&self) -> bool {
        let is_forced = self.stage.is_forced && !self.stage.holds_forces;
        let is_plain = !is_forced && !self.stage.is_bound() && !self.stage.has_discrete;
        (!self.rule.has_correction() || self.stage.is_simple) && is_plain
    }

    fn merit(&mut self, system: &System, evaluator: &mut Evaluator) -> Option<f64> {
        if !self.has_merit() || self.stage.off_constraints().is_some() {
            return None;
        }
        self.stage.configure();
        let Stage { w, c, scratch, .. } = &mut *self.stage;
        let kinetic = inertial_energy(system, self.inertia, w, scratch) / *c;
        Some(kinetic + evaluator.energy(system, &self.stage.q, self.stage.t))
    }

    fn energy_scale(&self) -> f64 {
        // The lumped mass is enough for the size of the acceleration term.
        let (w, mass) = (&self.stage.w, self.system.free_mass());
        0.5 * self.stage.twice_kinetic + vectors::sum(w.len(), |k| mass[k] * w[k] * w[k]) / self.stage.c
    }

    fn levers(&self) -> Option<Vec<f64>> {
        let coordinates = self.system.coordinates();
        let free = coordinates.free();
        if !free.iter().any(|dof| coordinates.is_director(dof / 3)) {
            return None;
        }
        let levers: Vec<f64> = free.iter().map(|dof| coordinates.lever(dof / 3)).collect();
        let of_director = |(dof, lever): (&u32, &f64)| coordinates.is_director(dof / 3).then_some(*lever);
        let longest = free.iter().zip(&levers).filter_map(of_director).fold(0.0, f64::max);
        // A director that nothing follows counts as the one with the longest lever.
        let instead = if longest > 0.0 { longest } else { 1.0 };
        Some(levers.into_iter().map(|lever| if lever > 0.0 { lever } else { instead }).collect())
    }

    fn is_at_resolution(&self) -> bool {
        let (d, mass) = (&self.stage.correction, self.system.free_mass());
        let square = vectors::sum(d.len(), |k| mass[k] * d[k] * d[k]);
        // The forces of a stiff contact layer amplify the round-off of positions several times.
        let resolution = f64::EPSILON * if self.stage.has_discrete { 8.0 } else { 1.0 };
        square <= resolution * resolution * self.stage.twice_origin + self.rule.correction_noise()
    }
}
