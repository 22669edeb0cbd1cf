//! One implicit stage, M w + c ∂V/∂q(û + w, t_s) = 0, and the steppers based on it. Implicit midpoint and, for
//! comparison, Newmark, generalised-α, BDF2 and backward Euler differ only in û, c, t_s and in the update from w
//! ([`Rule`]).
//!
//! The unknown is the increment w = c a of the stage and never u = û + w itself. So momenta come from accelerations
//! with their full relative precision, and not from differences of positions. The solution minimises Φ(w) = ½ wᵀM w +
//! c V(x(û + w, t_s)).

mod bordered;
mod complete_tangent;
mod end_damping;
mod middle;
mod pairs;
pub(crate) mod rule;
mod stage;

use vi_core::{Impulse, State, StepEnergy, System};

use crate::assemble::evaluator::Evaluator;
use crate::assemble::finite::{check_finite, check_state};
use crate::assemble::inertia::Inertia;
use crate::assemble::live::LiveState;
use crate::assemble::passage::check_narrowest;
use crate::assemble::stencil_forces::SeeForces;
use crate::error::SolverError;
use crate::linear::cost::UnitCosts;
use crate::memory::{StepperMemory, expect_method};
use crate::newton::budget::Budget;
use crate::newton::equations::{Equations, Solve};
use crate::newton::inverse::Inverse;
use crate::newton::solver::Newton;
use crate::newton::start::Start;
use crate::options::SolverOptions;
use crate::schemes::accounts::{self, PotentialEnergies};
use crate::schemes::at_rest;
use crate::schemes::constraint::manifold::ConstraintManifold;
use crate::schemes::one_stage::end_damping::EndDampers;
use crate::schemes::one_stage::middle::StageForces;
use crate::schemes::one_stage::rule::Rule;
use crate::schemes::one_stage::stage::{Stage, StageEquations};
use crate::schemes::stepper::{StepError, StepReport, Stepper};
use crate::vectors;
use crate::work::Work;

/// Names of the stored accelerations.
const HISTORY: [&str; 3] = ["stage.last", "stage.older", "stage.oldest"];

/// Largest energy that the correction of a scheme may bring to a step that can be divided, relative to the energy to which
/// errors are relative. Such a step is inaccurate, and what it excites costs more later: a flag of cloth with h = 17 ms
/// took 25 s with steps that were corrected by up to 7 %.
const LARGEST_CORRECTION: f64 = 1e-2;

/// Largest energy that a scheme may add to a step that can be divided and was hard to solve, relative to the kinetic
/// energy. A flag of cloth by implicit midpoint with h = 10 ms gained 5 to 24 % in single steps of 9 to 17 iterations;
/// the motion that this excited doubled the cost of all later steps.
const LARGEST_GAIN: f64 = 2e-2;
/// Number of iterations from which on a step counts as hard to solve. Other steps are spared the energies.
const HARD: u32 = 8;

/// The stepper of a one-stage method.
pub(crate) struct OneStage<R> {
    rule: R,
    evaluator: Evaluator,
    inertia: Inertia,
    inverse: Inverse,
    newton: Newton,
    potential_energies: PotentialEnergies,
    /// The forces at the stage of the last step, if the ledger books those in the middle of steps.
    stage_forces: Option<StageForces>,
    ledger: bool,
    stage: Stage,
    after: State,
    x_start: Vec<f64>,
    dx: Vec<f64>,
    /// The constraints, if the scheme damps velocities at the end of a step.
    manifold: Option<ConstraintManifold>,
    /// Change of velocity over the step, if the mass is consistent.
    dv: Vec<f64>,
}

impl<R: Rule> OneStage<R> {
    pub(crate) fn new(rule: R, system: &System, options: &SolverOptions) -> Result<Self, SolverError> {
        let n = system.coordinates().free_count();
        let tolerance = rule.tolerance(options.tolerance);
        let inertia = Inertia::new(system);
        Ok(Self {
            evaluator: evaluator_of(&rule, system),
            inverse: Inverse::new(system, &inertia, options),
            inertia,
            newton: Newton::new(&SolverOptions { tolerance, ..options.clone() })?,
            potential_energies: PotentialEnergies::new(),
            stage_forces: (options.ledger && rule.books_in_middle()).then(StageForces::default),
            ledger: options.ledger,
            stage: Stage::new(system, &rule),
            manifold: if rule.damps_end() { ConstraintManifold::new(system) } else { None },
            rule,
            after: State { t: 0.0, q: vec![0.0; n], p: vec![0.0; n] },
            x_start: Vec::new(),
            dx: Vec::new(),
            dv: Vec::new(),
        })
    }

    fn advance(&mut self, system: &System, state: &State, h: f64) -> Result<(u32, StepEnergy), SolverError> {
        check_state(state, system)?;
        if self.ledger {
            self.potential_energies.open(system, &mut self.evaluator, &state.q, state.t);
        }
        self.inertia.open(system, &state.p, &mut self.evaluator.work);
        self.rule.open(system, &mut self.evaluator, &self.inertia, state, h)?;
        self.stage.open(system, &self.rule, &self.inertia, state, h);
        if self.rule.takes_mean_of_ends() {
            self.evaluator.set_middle(system, self.stage.t, [state.t, state.t + h]);
        }
        let span = self.rule.span(h);
        self.evaluator.open_step(system, &state.q, state.t, span)?;
        let iterations = self.solve(system)?;
        self.stage.project_end(system, state)?;
        let Self { rule, inertia, stage: Stage { w, scratch, .. }, dv, .. } = self;
        let (w, v, mass) = (&*w, inertia.velocity(system, &state.p), system.free_mass());
        let State { t, q, p } = &mut self.after;
        *t = state.t + h;
        if inertia.matrix().is_some() {
            dv.resize(w.len(), 0.0);
            vectors::fill(dv, |k| rule.change(k, v.at(k), w[k], h).1);
            let dp = inertia.momentum(system, dv, scratch);
            vectors::update_pair(q, p, |k, q, p| {
                *q = state.q[k] + rule.change(k, v.at(k), w[k], h).0;
                *p = state.p[k] + dp.at(k);
            });
        } else {
            vectors::update_pair(q, p, |k, q, p| {
                let (dq, dv) = rule.change(k, v.at(k), w[k], h);
                *q = state.q[k] + dq;
                *p = state.p[k] + mass[k] * dv;
            });
        }
        if let Some(multipliers) = &mut self.stage.multipliers {
            multipliers.close(system, q, p, *t)?;
        }
        check_finite(q, p, system)?;
        let outcome = self.evaluator.close_step(system, (&state.q, state.t), (q, *t))?;
        if self.newton.budget != Budget::Unlimited {
            check_narrowest(&outcome)?;
        }
        let stored = outcome.stored - self.stored_energy();
        self.check_gain(system, state, iterations)?;
        let mut energy = if self.ledger { self.account(system, state)? } else { StepEnergy::default() };
        energy.friction = -outcome.friction;
        energy.contact_damping = -outcome.damping;
        if self.ledger {
            // The stage has counted the work of these forces as work on the potential.
            energy.scheme += outcome.friction + outcome.damping + stored;
        }
        if span.damps_end && outcome.has_dampers {
            self.damp_end(system, h, &mut energy)?;
        }
        self.rule.close(system, state, &self.after, &self.stage.w, h);
        self.stage.close();
        self.inertia.close(&self.after.p, &self.dv);
        Ok((iterations, energy))
    }

    /// Returns an error if a step that can be divided was hard to solve and gained more energy than is accurate. Only schemes that
    /// conserve the energy of linear systems are judged, and only while nothing else can bring energy.
    fn check_gain(&mut self, system: &System, before: &State, iterations: u32) -> Result<(), SolverError> {
        let Self { rule, evaluator, newton, stage, after, inertia, potential_energies, .. } = self;
        let is_judged = rule.works_on_mean_velocity()
            && !rule.has_correction()
            && matches!(newton.budget, Budget::Seconds(_))
            && iterations >= HARD
            && inertia.matrix().is_none()
            && evaluator.is_autonomous()
            && !evaluator.has_live()
            && !evaluator.has_nonconservative();
        if !is_judged {
            return Ok(());
        }
        let mass = system.free_mass();
        let (first, p) = (0.5 * stage.twice_kinetic, &after.p);
        let last = 0.5 * vectors::sum(p.len(), |k| p[k] * p[k] / mass[k]);
        let start = match self.ledger {
            true => potential_energies.start,
            false => evaluator.energy(system, &before.q, before.t),
        };
        let stored = evaluator.energy(system, &after.q, after.t) - start;
        if last - first + stored > LARGEST_GAIN * first.max(last) {
            return Err(SolverError::Budget { iterations });
        }
        Ok(())
    }

    /// Lets the dampers and the friction of live terms act on the velocities at the end of the step.
    fn damp_end(&mut self, system: &System, h: f64, energy: &mut StepEnergy) -> Result<(), SolverError> {
        let Self { evaluator, inertia, after, dv, manifold, .. } = self;
        let velocity = match manifold {
            Some(manifold) => {
                manifold.set_directions(system, &after.q, after.t);
                // Impulses in the tangent space do work on the tangent part of velocities alone. With the rates of the other part,
                // which some schemes leave at the end of a step, dampers would add energy.
                let mut tangent = after.p.clone();
                manifold.project_momenta(system, &after.q, &mut tangent, after.t)?;
                system.velocity(&tangent)
            }
            None => {
                let mut velocity = inertia.velocity(system, &after.p).to_vec(after.p.len());
                if inertia.matrix().is_some() {
                    velocity.iter_mut().zip(&*dv).for_each(|(v, dv)| *v += dv);
                }
                velocity
            }
        };
        let mut x_dot = vec![0.0; system.coordinates().dof_count()];
        system.coordinates().embed_velocity(&velocity, after.t, &mut x_dot);
        let forces = evaluator.end_forces(&x_dot);
        if forces.dampers.is_empty() && forces.friction.is_empty() {
            return Ok(());
        }
        let ends =
            EndDampers { system, inertia, manifold: manifold.as_ref(), forces: &forces, t: after.t, h };
        let dissipated = -(energy.friction + energy.contact_damping);
        let damped = ends.damp(&velocity, &x_dot, dissipated, &mut evaluator.work)?;
        after.p.iter_mut().zip(&damped.momentum).for_each(|(p, change)| *p += change);
        if inertia.matrix().is_some() {
            dv.iter_mut().zip(&damped.velocity).for_each(|(dv, change)| *dv += change);
        }
        evaluator.add_impulses(&damped.impulses);
        evaluator.add_at_end(damped.nodal.into_iter());
        energy.contact_damping -= damped.dissipated;
        energy.friction -= damped.friction;
        energy.prescribed += damped.prescribed;
        Ok(())
    }

    /// Returns whether live terms have a memory.
    pub(crate) fn remembers(&self) -> bool {
        self.evaluator.remembers()
    }

    /// Returns the memory of live terms.
    pub(crate) fn live_state(&mut self) -> Option<LiveState> {
        self.evaluator.live_state()
    }

    /// Restores the memory of live terms.
    pub(crate) fn go_to_live(&mut self, state: &Option<LiveState>) {
        self.evaluator.go_to_live(state, &None);
    }

    /// Returns whether a step of h is free motion: nothing acts at its stage or blocks its path.
    pub(crate) fn is_free(&mut self, system: &System, state: &State, h: f64) -> bool {
        let Self { rule, evaluator, inertia, stage, .. } = self;
        inertia.open(system, &state.p, &mut evaluator.work);
        stage.open(system, rule, inertia, state, h);
        let mut equations = StageEquations { system, rule, inertia, stage };
        equations.start(Start::Inertial);
        equations.shorten_start(system, evaluator);
        let is_in_the_way = equations.stage.w.iter().any(|&w| w != 0.0);
        !is_in_the_way
            && equations.evaluate(system, evaluator).is_ok()
            && evaluator.gradient().iter().all(|&force| force == 0.0)
    }

    /// Solves the stage; 0 iterations if the body is at rest in equilibrium.
    fn solve(&mut self, system: &System) -> Result<u32, SolverError> {
        let Self { rule, evaluator, inertia, inverse, newton, stage, .. } = self;
        if stage.origin.is_empty() {
            return Ok(0);
        }
        if !stage.is_forced
            && stage.multipliers.is_none()
            && !evaluator.has_live()
            && at_rest::may_be_at_rest(stage.twice_kinetic, &stage.history[0], stage.history_count)
        {
            stage.w.fill(0.0);
            stage.configure();
            evaluator.evaluate(system, &stage.q, stage.t, false)?;
            if at_rest::is_at_rest(system, evaluator, newton.tolerance())? {
                evaluator.work.skipped += 1;
                return Ok(0);
            }
        }
        let mut equations = StageEquations { system, rule, inertia, stage };
        let meets_pairs = equations.meets_pairs(evaluator);
        let mut solve = Solve::new(system, evaluator, inverse, equations);
        let solved = match solve.equations.rule.solves() {
            Some(most) => newton.truncate(&mut solve, most),
            None if meets_pairs => newton.solve_pairs(&mut solve),
            None if solve.equations.is_mechanism() => newton.solve_mechanism(&mut solve),
            None => newton.solve(&mut solve),
        };
        solve.inverse.forget_simplified();
        let iterations = solved?.iterations;
        let StageEquations { rule, .. } = &solve.equations;
        if matches!(newton.budget, Budget::Seconds(_))
            && rule.corrected_energy() > LARGEST_CORRECTION * solve.equations.energy_scale()
        {
            return Err(SolverError::Budget { iterations });
        }
        Ok(iterations)
    }

    /// Computes the parts of the step's change of energy. With ΔT = Δp·v̄ and g = ∂V/∂x at the stage they are: the
    /// work g·Δx on prescribed coordinates (g includes the rule's addition), the work R·Δq/c of the residual, and the
    /// energy of the scheme, ΔV − g·Δx. With forces f without a potential, g is ∂V/∂x − f, and their work f·Δx is
    /// accounted separately. For schemes that do not balance energy by the work on the mean velocity, the energy of
    /// the scheme also contains Δp·v̄ + (g − R/c)·Δq.
    fn account(&mut self, system: &System, before: &State) -> Result<StepEnergy, SolverError> {
        let Self {
            rule,
            evaluator,
            inertia,
            stage,
            after,
            potential_energies,
            stage_forces,
            x_start,
            dx,
            dv,
            ..
        } = self;
        stage.evaluate(system, rule, evaluator)?;
        let (mass, free) = (system.free_mass(), system.coordinates().free());
        let coordinates = system.coordinates();
        x_start.resize(coordinates.dof_count(), 0.0);
        dx.resize(coordinates.dof_count(), 0.0);
        coordinates.embed(&before.q, before.t, x_start);
        coordinates.embed(&after.q, after.t, dx);
        vectors::update(dx, |k, dx| *dx -= x_start[k]);
        coordinates.to_own_axes(dx);
        let gradient = evaluator.gradient();
        let Stage { w, c, scratch, added, multipliers, .. } = stage;
        let (w, c, step) = (&*w, *c, &*dx);
        let inertial = inertia.momentum(system, w, scratch);
        let along = |k: usize| step[free[k] as usize];
        let mut prescribed = accounts::prescribed_work(system, gradient, step) + rule.prescribed_work();
        let (mut force, mut damping) = evaluator.nonconservative_work(step);
        if let Some(last) = stage_forces {
            let (times, works) = ([before.t, after.t], [prescribed, force, damping]);
            [prescribed, force, damping] = last.book(system, evaluator, times, step, works);
        }
        if let Some(multipliers) = multipliers {
            prescribed += multipliers.prescribed_work(step);
        }
        let elastic =
            accounts::free_work(system, gradient, along) + vectors::sum(w.len(), |k| added[k] * along(k));
        let residual = vectors::sum(w.len(), |k| {
            (inertial.at(k) / c + gradient[free[k] as usize] + added[k]) * along(k)
        });
        let v = inertia.velocity(system, &before.p);
        let kinetic = match inertia.matrix() {
            Some(_) => vectors::sum(w.len(), |k| (after.p[k] - before.p[k]) * (v.at(k) + 0.5 * dv[k])),
            None => vectors::sum(w.len(), |k| {
                (after.p[k] - before.p[k]) * 0.5 * (before.p[k] + after.p[k]) / mass[k]
            }),
        };
        let inertial = vectors::sum(w.len(), |k| inertial.at(k) / c * along(k));
        let (change, loads) = potential_energies.close(system, evaluator, &after.q, after.t);
        let mut scheme = change - loads - elastic - prescribed - force - damping;
        if !self.rule.works_on_mean_velocity() || multipliers.is_some() {
            scheme += kinetic - inertial;
        }
        Ok(StepEnergy {
            prescribed,
            force: force + loads,
            damping,
            scheme,
            residual,
            ..StepEnergy::default()
        })
    }
}

/// Returns the evaluator for the stage of a rule.
fn evaluator_of(rule: &impl Rule, system: &System) -> Evaluator {
    let evaluator = Evaluator::with_nonconservative(system);
    let dissipates = system.terms().live().iter().any(|term| term.dissipates());
    if rule.takes_discrete_gradients() || dissipates { evaluator.over_steps() } else { evaluator }
}

impl<R: Rule> Stepper for OneStage<R> {
    fn step(&mut self, system: &System, state: &mut State, h: f64) -> Result<StepReport, StepError> {
        let (before, searches) = (self.evaluator.work, self.evaluator.searches());
        let advanced = self.advance(system, state, h);
        self.evaluator.work.searches += self.evaluator.searches() - searches;
        let (iterations, energy) = advanced.map_err(|error| {
            self.potential_energies.forget();
            let cause = self.evaluator.explain(system, state, error);
            StepError { t: state.t, h, cause }
        })?;
        self.evaluator.accept_step();
        std::mem::swap(&mut self.after, state);
        self.evaluator.work.steps += 1;
        Ok(StepReport { iterations, energy, work: self.evaluator.work - before })
    }

    fn work(&self) -> Work {
        self.evaluator.work
    }

    fn unit_costs(&self, system: &System) -> UnitCosts {
        self.inverse.unit_costs(system)
    }

    fn linear_solver(&self) -> Option<&str> {
        self.inverse.reason()
    }

    fn analyses(&self) -> u64 {
        self.inverse.analyses()
    }

    fn velocity(&self, state: &State) -> Option<&[f64]> {
        self.inertia.known_velocity(state)
    }

    fn stored_energy(&self) -> f64 {
        self.evaluator.stored()
    }

    fn take_impulses(&mut self) -> Option<Vec<Impulse>> {
        let has_impulses = !self.rule.is_at_end() || self.rule.moves_by_end_forces();
        self.evaluator.acts_over_steps().then(|| match has_impulses {
            true => self.evaluator.take_impulses(),
            false => self.evaluator.take_last_forces(),
        })
    }

    fn see_live_forces(&self, see: &mut SeeForces<'_>) -> bool {
        self.evaluator.see_forces(see)
    }

    fn take_smallest_gap(&mut self) -> Option<f64> {
        self.evaluator.acts_over_steps().then(|| self.evaluator.take_smallest_gap())
    }

    fn mark(&mut self) {
        self.evaluator.mark();
    }

    fn return_to_mark(&mut self) {
        self.evaluator.return_to_mark();
    }

    fn set_budget(&mut self, budget: Budget) {
        self.newton.budget = budget;
    }

    fn memory(&self) -> StepperMemory {
        let mut memory = StepperMemory { method: self.rule.name().to_owned(), ..Default::default() };
        for (name, history) in HISTORY.iter().zip(&self.stage.history) {
            memory.arrays.push(((*name).to_owned(), history.clone()));
        }
        memory.counts.push(("stage.history".into(), self.stage.history_count as u64));
        self.evaluator.save(&mut memory);
        self.potential_energies.save(&mut memory);
        if let Some(last) = &self.stage_forces {
            last.save(&mut memory);
        }
        if let Some(multipliers) = &self.stage.multipliers {
            memory.arrays.push(("stage.multipliers".into(), multipliers.multipliers().to_vec()));
        }
        self.inertia.save(&mut memory);
        self.inverse.save(&mut memory);
        self.newton.save(&mut memory);
        self.rule.save(&mut memory);
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
        if let Some(multipliers) = &mut self.stage.multipliers {
            multipliers.restore(memory.array("stage.multipliers")?)?;
        }
        self.evaluator = evaluator_of(&self.rule, system);
        self.potential_energies = PotentialEnergies::restore(memory);
        if let Some(last) = &mut self.stage_forces {
            last.restore(system, memory)?;
        }
        self.newton.restore(memory)?;
        self.rule.restore(memory)?;
        self.inertia.restore(memory)?;
        self.inverse.restore(system, &mut self.evaluator, memory)?;
        self.evaluator.restore(memory)?;
        self.evaluator.work = Work::default();
        Ok(())
    }
}
