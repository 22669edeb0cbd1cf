//! Gauss collocation with s stages, order 2s, solved with one symmetric positive definite factor.
//!
//! With T = A² (A is Butcher's matrix) the stages Q_i = q₀ + c_i h v₀ + Z_i solve R_i = M Z_i + h² Σ_j T_ij
//! ∂V/∂q(Q_j) = 0. The iteration replaces QᵀTQ by a lower triangular L with constant diagonal θ (`collocation`), so
//! that all its blocks are A = M + h²θK. With r̃ = −QᵀR: ρ_i = r̃_i − Σ_{j<i} (L_ij/θ)(ρ_j − M Δ̃_j), A Δ̃_i = ρ_i, Z
//! += Q Δ̃, without any product with K. Where that converges slowly, the equations with QᵀTQ are solved instead
//! (`coupled`). For s ≥ 2 the stages do not minimise any function.

pub(crate) mod collocation;
mod coupled;
mod stages;

use vi_core::{Impulse, Scheme, State, StepEnergy, System};

use crate::assemble::evaluator::Evaluator;
use crate::assemble::finite::{check_finite, check_state};
use crate::assemble::inertia::Inertia;
use crate::error::SolverError;
use crate::linear::cost::UnitCosts;
use crate::memory::{StepperMemory, expect_method};
use crate::newton::budget::Budget;
use crate::newton::equations::Solve;
use crate::newton::inverse::Inverse;
use crate::newton::solver::Newton;
use crate::options::SolverOptions;
use crate::schemes::accounts::{self, PotentialEnergies};
use crate::schemes::at_rest;
use crate::schemes::gauss::collocation::{Collocation, combine};
use crate::schemes::gauss::stages::{GaussEquations, Stages};
use crate::schemes::live_impulses::LiveImpulses;
use crate::schemes::resolution::Resolution;
use crate::schemes::stepper::{StepError, StepReport, Stepper};
use crate::vectors;
use crate::work::Work;

/// The stepper of Gauss collocation.
pub(crate) struct Gauss {
    evaluator: Evaluator,
    inertia: Inertia,
    inverse: Inverse,
    newton: Newton,
    potential_energies: PotentialEnergies,
    ledger: bool,
    stages: Stages,
    after: State,
    x_dot: Vec<f64>,
    /// Change of velocity over the step, if the mass is consistent.
    dv: Vec<f64>,
    /// The impulses of live terms, which act by their gradient at the stages.
    live_impulses: LiveImpulses,
}

impl Gauss {
    const NAME: &str = "gauss";

    /// Returns the stepper of degree s × Gauss–Legendre with s points, s from 2 to 5.
    pub(crate) fn new(
        scheme: &Scheme,
        system: &System,
        options: &SolverOptions,
    ) -> Result<Self, SolverError> {
        let n = system.coordinates().free_count();
        let inertia = Inertia::new(system);
        Ok(Self {
            evaluator: Evaluator::with_nonconservative(system),
            inverse: Inverse::new(system, &inertia, options),
            inertia,
            newton: Newton::new(options)?,
            potential_energies: PotentialEnergies::new(),
            ledger: options.ledger,
            stages: Stages::new(Collocation::new(scheme)?, n),
            after: State { t: 0.0, q: vec![0.0; n], p: vec![0.0; n] },
            x_dot: Vec::new(),
            dv: Vec::new(),
            live_impulses: LiveImpulses::new(options.impulses),
        })
    }

    fn advance(&mut self, system: &System, state: &State, h: f64) -> Result<(u32, StepEnergy), SolverError> {
        check_state(state, system)?;
        if self.ledger {
            self.potential_energies.open(system, &mut self.evaluator, &state.q, state.t);
        }
        self.inertia.open(system, &state.p, &mut self.evaluator.work);
        self.stages.open(system, &self.inertia, state, h);
        if self.evaluator.has_live() {
            let v = &self.stages.velocity;
            self.resolution().open(system, &mut self.evaluator, (&state.q, state.t), |k| v[k]);
        }
        let iterations = self.solve(system)?;
        let Stages { coefficients, z, velocity, scratch, .. } = &mut self.stages;
        let (n, mass, z) = (state.q.len(), system.free_mass(), &*z);
        let State { t, q, p } = &mut self.after;
        *t = state.t + h;
        let position = |k: usize| h * velocity[k] + combine(&coefficients.position, z, n, k);
        let change = |k: usize| combine(&coefficients.velocity, z, n, k) / h;
        if self.inertia.matrix().is_some() {
            self.dv.resize(n, 0.0);
            vectors::fill(&mut self.dv, change);
            let dp = self.inertia.momentum(system, &self.dv, scratch);
            vectors::update_pair(q, p, |k, q, p| {
                *q = state.q[k] + position(k);
                *p = state.p[k] + dp.at(k);
            });
        } else {
            vectors::update_pair(q, p, |k, q, p| {
                *q = state.q[k] + position(k);
                *p = state.p[k] + mass[k] * change(k);
            });
        }
        check_finite(q, p, system)?;
        self.check_resolution(system, state)?;
        let Stages { z, history, has_history, .. } = &mut self.stages;
        vectors::fill(history, |k| z[k] / (h * h));
        *has_history = true;
        let energy = if self.ledger { self.account(system)? } else { StepEnergy::default() };
        self.inertia.close(&self.after.p, &self.dv);
        Ok((iterations, energy))
    }

    fn resolution(&self) -> Resolution {
        Resolution { scheme: Self::NAME, h: self.stages.h }
    }

    /// Checks that the stages resolve live terms, and that nothing meets on the way through them to the end of the step. Sums the
    /// impulses of the stages, h b_i f_i.
    fn check_resolution(&mut self, system: &System, before: &State) -> Result<(), SolverError> {
        let resolution = self.resolution();
        let Self { evaluator, stages, after, live_impulses, .. } = self;
        live_impulses.open();
        if !evaluator.has_live() {
            return Ok(());
        }
        let (mut q, mut t) = (before.q.clone(), before.t);
        for i in 0..stages.coefficients.stages() {
            let t_stage = stages.configure(i);
            resolution.check_path(system, evaluator, (&q, t), (&stages.q, t_stage))?;
            resolution.check_forces(system, evaluator, (&stages.q, t_stage))?;
            live_impulses.add(evaluator, stages.h * stages.coefficients.b[i]);
            (q, t) = (stages.q.clone(), t_stage);
        }
        resolution.check_path(system, evaluator, (&q, t), (&after.q, after.t))
    }

    fn solve(&mut self, system: &System) -> Result<u32, SolverError> {
        let Self { evaluator, inertia, inverse, newton, stages, .. } = self;
        if stages.origin.is_empty() {
            return Ok(0);
        }
        let steps = usize::from(stages.has_history);
        if !evaluator.has_nonconservative()
            && !evaluator.has_live()
            && at_rest::may_be_at_rest(stages.twice_kinetic, &stages.history, steps)
        {
            stages.z.fill(0.0);
            let mut is_at_rest = true;
            for i in 0..stages.coefficients.stages() {
                let t = stages.configure(i);
                evaluator.evaluate(system, &stages.q, t, false)?;
                is_at_rest &= at_rest::is_at_rest(system, evaluator, newton.tolerance())?;
            }
            if is_at_rest {
                evaluator.work.skipped += 1;
                return Ok(0);
            }
        }
        let equations = GaussEquations { system, inertia, stages };
        Ok(newton.solve(&mut Solve::new(system, evaluator, inverse, equations))?.iterations)
    }

    /// ΔT = h Σ b_i M a_i·V_i with stage velocities V_i = v₀ + h Σ A_ij a_j, because the method conserves quadratic
    /// invariants. So the work on prescribed coordinates is h Σ b_i g_i·ẋ_i, that of the residual is h Σ b_i (M a_i +
    /// g_i)·V_i, and the energy of the scheme is ΔV − h Σ b_i g_i·V_i over all coordinates. With forces f without a
    /// potential, g is ∂V/∂x − f, and their work h Σ b_i f_i·ẋ_i is accounted separately.
    fn account(&mut self, system: &System) -> Result<StepEnergy, SolverError> {
        let Self { evaluator, inertia, stages, after, potential_energies, x_dot, .. } = self;
        stages.evaluate(system, inertia, evaluator)?;
        let (h, n, mass) = (stages.h, stages.q.len(), system.free_mass());
        x_dot.resize(system.coordinates().dof_count(), 0.0);
        let (mut prescribed, mut residual, mut free) = (0.0, 0.0, 0.0);
        let (mut force, mut damping) = (0.0, 0.0);
        let counts_work = PotentialEnergies::counts_work(system, evaluator);
        for i in 0..stages.coefficients.stages() {
            let weight = h * stages.coefficients.b[i];
            if system.coordinates().is_moving() || evaluator.has_nonconservative() || counts_work {
                stages.evaluate_stage(i, system, evaluator)?;
                let q_dot: Vec<f64> = (0..n).map(|k| stages.stage_velocity(i, k)).collect();
                system.coordinates().embed_velocity(&q_dot, evaluator.time(), x_dot);
                if counts_work {
                    potential_energies.add_work(system, evaluator, weight, x_dot);
                }
                system.coordinates().to_own_axes(x_dot);
                prescribed += weight * accounts::prescribed_work(system, evaluator.gradient(), x_dot);
                let (by_force, by_damping) = evaluator.nonconservative_work(x_dot);
                force += weight * by_force;
                damping += weight * by_damping;
            }
            let stages = &*stages;
            let gradient = &stages.gradients[i * n..(i + 1) * n];
            let acceleration = &stages.coefficients.acceleration[i];
            let inertial = |k: usize| stages.combine_inertial(mass, acceleration, k) / (h * h);
            free += weight * vectors::sum(n, |k| gradient[k] * stages.stage_velocity(i, k));
            residual +=
                weight * vectors::sum(n, |k| (inertial(k) + gradient[k]) * stages.stage_velocity(i, k));
        }
        let (change, loads) = potential_energies.close_with_work(system, evaluator, &after.q, after.t);
        let scheme = change - loads - free - prescribed - force - damping;
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

impl Stepper for Gauss {
    fn step(&mut self, system: &System, state: &mut State, h: f64) -> Result<StepReport, StepError> {
        let (before, searches) = (self.evaluator.work, self.evaluator.searches());
        let advanced = self.advance(system, state, h);
        self.evaluator.work.searches += self.evaluator.searches() - searches;
        let (iterations, energy) = advanced.map_err(|error| {
            let cause = self.evaluator.explain(system, state, error);
            StepError { t: state.t, h, cause }
        })?;
        self.live_impulses.accept();
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

    fn velocity(&self, state: &State) -> Option<&[f64]> {
        self.inertia.known_velocity(state)
    }

    fn take_impulses(&mut self) -> Option<Vec<Impulse>> {
        self.live_impulses.take()
    }

    fn mark(&mut self) {
        self.live_impulses.mark();
    }

    fn return_to_mark(&mut self) {
        self.live_impulses.return_to_mark();
    }

    fn set_budget(&mut self, budget: Budget) {
        self.newton.budget = budget;
    }

    fn memory(&self) -> StepperMemory {
        let mut memory = StepperMemory { method: Self::NAME.to_owned(), ..Default::default() };
        memory.arrays.push(("stages.last".into(), self.stages.history.clone()));
        memory.counts.push(("stages.history".into(), u64::from(self.stages.has_history)));
        self.evaluator.save(&mut memory);
        self.potential_energies.save(&mut memory);
        self.inertia.save(&mut memory);
        self.inverse.save(&mut memory);
        self.newton.save(&mut memory);
        memory
    }

    fn restore(&mut self, system: &System, memory: &StepperMemory) -> Result<(), SolverError> {
        expect_method(memory, Self::NAME)?;
        let history = memory.array("stages.last")?;
        if history.len() != self.stages.history.len() {
            return Err(SolverError::Memory { missing: "stages.last" });
        }
        self.stages.history.copy_from_slice(history);
        self.stages.has_history = memory.count("stages.history")? == 1;
        self.evaluator = Evaluator::with_nonconservative(system);
        self.potential_energies = PotentialEnergies::restore(memory);
        self.live_impulses.clear();
        self.newton.restore(memory)?;
        self.inertia.restore(memory)?;
        self.inverse.restore(system, &mut self.evaluator, memory)?;
        self.evaluator.restore(memory)?;
        self.evaluator.work = Work::default();
        Ok(())
    }
}
