//! Gauss collocation with s stages, order 2s, solved with one symmetric positive definite factor.
//!
//! With T = A² (A Butcher's matrix) the stages Q_i = q₀ + c_i h v₀ + Z_i solve
//! R_i = M Z_i + h² Σ_j T_ij ∂V/∂q(Q_j) = 0. The iteration replaces QᵀTQ by a lower triangular L of
//! constant diagonal θ (`splitting`), so that all its blocks are A = M + h²θK: with r̃ = −QᵀR,
//! ρ_i = r̃_i − Σ_{j<i} (L_ij/θ)(ρ_j − M Δ̃_j), A Δ̃_i = ρ_i, Z += Q Δ̃, and no product with K.
//! For s ≥ 2 the stages minimise no function. This room must not know how A is factored.

pub(crate) mod collocation;

use vi_core::{Scheme, State, StepEnergy, System};

use crate::assemble::evaluator::Evaluator;
use crate::assemble::finite::{check_finite, check_state};
use crate::assemble::inertia::Inertia;
use crate::error::SolverError;
use crate::linear::cost::UnitCosts;
use crate::memory::{StepperMemory, expect_method};
use crate::newton::equations::{Equations, Solve};
use crate::newton::inverse::Inverse;
use crate::newton::solver::Newton;
use crate::newton::start::Start;
use crate::options::SolverOptions;
use crate::schemes::accounts::{self, PotentialEnergies};
use crate::schemes::at_rest;
use crate::schemes::gauss::collocation::Collocation;
use crate::schemes::stepper::{StepError, StepReport, Stepper};
use crate::vectors;
use crate::work::Work;

/// The unknowns and buffers of the stages; stage vectors are stored one after the other.
struct Stages {
    coefficients: Collocation,
    h: f64,
    t: f64,
    twice_kinetic: f64,
    twice_origin: f64,
    origin: Vec<f64>,
    velocity: Vec<f64>,
    /// Z/h² of the last step, from which the next is extrapolated.
    history: Vec<f64>,
    has_history: bool,
    z: Vec<f64>,
    base: Vec<f64>,
    correction: Vec<f64>,
    /// r̃ and then ρ.
    residual: Vec<f64>,
    /// ∂V/∂q at the stages.
    gradients: Vec<f64>,
    /// M Z of the last evaluation, where mass is consistent.
    inertial: Vec<f64>,
    room: Vec<f64>,
    q: Vec<f64>,
}

impl Stages {
    fn new(coefficients: Collocation, n: usize) -> Self {
        let s = coefficients.stages();
        let zero = || vec![0.0; s * n];
        Self {
            coefficients,
            h: 0.0,
            t: 0.0,
            twice_kinetic: 0.0,
            twice_origin: 0.0,
            origin: vec![0.0; n],
            velocity: vec![0.0; n],
            history: zero(),
            has_history: false,
            z: zero(),
            base: zero(),
            correction: zero(),
            residual: zero(),
            gradients: zero(),
            inertial: Vec::new(),
            room: Vec::new(),
            q: vec![0.0; n],
        }
    }

    fn open(&mut self, system: &System, inertia: &Inertia, state: &State, h: f64) {
        let (mass, v) = (system.free_mass(), inertia.velocity(system, &state.p));
        (self.h, self.t) = (h, state.t);
        self.origin.copy_from_slice(&state.q);
        vectors::fill(&mut self.velocity, |k| v.at(k));
        self.twice_kinetic = match inertia.matrix() {
            Some(_) => vectors::sum(mass.len(), |k| state.p[k] * v.at(k)),
            None => vectors::sum(mass.len(), |k| state.p[k] * state.p[k] / mass[k]),
        };
        self.twice_origin = vectors::sum(mass.len(), |k| mass[k] * state.q[k] * state.q[k]);
    }

    fn model_coefficient(&self) -> f64 {
        self.h * self.h * self.coefficients.theta
    }

    /// Goes to stage i: sets `q` and returns its time.
    fn configure(&mut self, i: usize) -> f64 {
        let Self { coefficients, h, t, origin, velocity, z, q, .. } = self;
        let (n, offset) = (q.len(), coefficients.c[i] * *h);
        let z = &z[i * n..(i + 1) * n];
        vectors::fill(q, |k| origin[k] + (offset * velocity[k] + z[k]));
        *t + offset
    }

    /// Velocity of coordinate k at stage i.
    fn stage_velocity(&self, i: usize, k: usize) -> f64 {
        let Self { coefficients, z, velocity, h, q, .. } = self;
        velocity[k] + Self::combine(&coefficients.stage_velocity[i], z, q.len(), k) / h
    }

    /// Evaluates the forces at stage i, those without a potential at its velocity.
    fn evaluate_stage(
        &mut self,
        i: usize,
        system: &System,
        evaluator: &mut Evaluator,
    ) -> Result<(), SolverError> {
        let t = self.configure(i);
        if evaluator.has_nonconservative() {
            let q_dot: Vec<f64> = (0..self.q.len()).map(|k| self.stage_velocity(i, k)).collect();
            // With this rate the model has h√θ where the stages have the eigenvalues of h A.
            evaluator.set_velocities(system, &q_dot, t, 1.0 / self.model_coefficient().sqrt());
        }
        evaluator.evaluate(system, &self.q, t, false)
    }

    fn evaluate(
        &mut self,
        system: &System,
        inertia: &Inertia,
        evaluator: &mut Evaluator,
    ) -> Result<(), SolverError> {
        let n = self.q.len();
        if let Some(mass) = inertia.matrix() {
            self.inertial.resize(self.z.len(), 0.0);
            for (z, inertial) in self.z.chunks_exact(n).zip(self.inertial.chunks_exact_mut(n)) {
                mass.multiply(z, inertial);
            }
        }
        for i in 0..self.coefficients.stages() {
            self.evaluate_stage(i, system, evaluator)?;
            system.coordinates().restrict(evaluator.gradient(), &mut self.gradients[i * n..(i + 1) * n]);
        }
        Ok(())
    }

    /// Σ_j matrix_ij M Z_j of the last evaluation, for coordinate k.
    fn combine_inertial(&self, mass: &[f64], row: &[f64], k: usize) -> f64 {
        match self.inertial.is_empty() {
            true => mass[k] * Self::combine(row, &self.z, self.q.len(), k),
            false => Self::combine(row, &self.inertial, self.q.len(), k),
        }
    }

    /// Σ_j matrix_ij of the stage vectors, for coordinate k.
    fn combine(row: &[f64], vectors: &[f64], n: usize, k: usize) -> f64 {
        row.iter().enumerate().map(|(j, a)| a * vectors[j * n + k]).sum()
    }
}

struct GaussEquations<'a> {
    system: &'a System,
    inertia: &'a Inertia,
    stages: &'a mut Stages,
}

impl Equations for GaussEquations<'_> {
    fn coefficient(&self) -> f64 {
        self.stages.model_coefficient()
    }

    fn model_is_exact(&self) -> bool {
        false
    }

    fn splits_stages(&self) -> bool {
        true
    }

    fn unknowns(&self) -> &[f64] {
        &self.stages.z
    }

    fn go_to(&mut self, unknowns: &[f64]) {
        let Stages { z, base, .. } = &mut *self.stages;
        z.copy_from_slice(unknowns);
        base.copy_from_slice(unknowns);
    }

    fn start(&mut self, start: Start) {
        let Stages { coefficients, h, origin, velocity, history, has_history, z, base, .. } = self.stages;
        let n = origin.len();
        for (i, z) in z.chunks_exact_mut(n).enumerate() {
            match start {
                Start::Predicted if *has_history => {
                    let row = &coefficients.prediction[i];
                    vectors::fill(z, |k| *h * *h * Stages::combine(row, history, n, k));
                }
                Start::Stiff if *has_history => {
                    let last = &history[i * n..(i + 1) * n];
                    vectors::fill(z, |k| *h * *h * last[k]);
                }
                Start::Predicted | Start::Stiff | Start::Inertial => z.fill(0.0),
                Start::Still => vectors::fill(z, |k| -coefficients.c[i] * *h * velocity[k]),
            }
        }
        base.copy_from_slice(z);
    }

    fn linearize(&mut self, system: &System, evaluator: &mut Evaluator) -> Result<(), SolverError> {
        // One K for all stages: that of the middle one.
        let middle = self.stages.coefficients.stages() / 2;
        self.stages.evaluate_stage(middle, system, evaluator)
    }

    fn evaluate(&mut self, system: &System, evaluator: &mut Evaluator) -> Result<(), SolverError> {
        self.stages.evaluate(system, self.inertia, evaluator)?;
        let mut residual = std::mem::take(&mut self.stages.residual);
        let stages = &*self.stages;
        let Stages { coefficients, h, gradients, q, .. } = stages;
        let (n, mass) = (q.len(), system.free_mass());
        // r̃ = −QᵀR = −(Qᵀ M Z + h² (QᵀT) g).
        for (i, residual) in residual.chunks_exact_mut(n).enumerate() {
            let (rotation, weights) = (&coefficients.q_transposed[i], &coefficients.q_transposed_t[i]);
            vectors::fill(residual, |k| {
                let inertial = stages.combine_inertial(mass, rotation, k);
                -(inertial + *h * *h * Stages::combine(weights, gradients, n, k))
            });
        }
        self.stages.residual = residual;
        Ok(())
    }

    fn correct(&mut self, inverse: &mut Inverse, evaluator: &mut Evaluator) -> Result<f64, SolverError> {
        let Stages { coefficients, correction, residual, z, base, q, room, .. } = &mut *self.stages;
        let n = q.len();
        let mut energy = 0.0;
        for i in 0..coefficients.stages() {
            let (done, delta) = correction.split_at_mut(i * n);
            let (rho, current) = residual.split_at_mut(i * n);
            let (delta, current) = (&mut delta[..n], &mut current[..n]);
            for j in 0..i {
                let coupling = coefficients.l[i][j] / coefficients.theta;
                let (rho, done) = (&rho[j * n..(j + 1) * n], &done[j * n..(j + 1) * n]);
                let inertial = self.inertia.momentum(self.system, done, room);
                vectors::update(current, |k, r| *r -= coupling * (rho[k] - inertial.at(k)));
            }
            delta.copy_from_slice(current);
            inverse.apply(evaluator, delta)?;
            energy += vectors::sum(n, |k| current[k] * delta[k]);
        }
        base.copy_from_slice(z);
        Ok(energy / self.coefficient())
    }

    fn correction(&mut self) -> (&mut [f64], &[f64]) {
        (&mut self.stages.correction, &self.stages.residual)
    }

    fn has_merit(&self) -> bool {
        false
    }

    fn advance(&mut self, fraction: f64) {
        let Stages { coefficients, correction, z, base, q, .. } = &mut *self.stages;
        let n = q.len();
        for (i, z) in z.chunks_exact_mut(n).enumerate() {
            let (row, base) = (&coefficients.q[i], &base[i * n..(i + 1) * n]);
            vectors::fill(z, |k| base[k] + fraction * Stages::combine(row, correction, n, k));
        }
    }

    fn slope(&self) -> f64 {
        // There is no merit whose slope this were.
        0.0
    }

    fn merit(&mut self, _system: &System, _evaluator: &mut Evaluator) -> Option<f64> {
        None
    }

    fn energy_scale(&self) -> f64 {
        let (z, n, mass) = (&self.stages.z, self.stages.q.len(), self.system.free_mass());
        let square = vectors::sum(z.len(), |k| mass[k % n] * z[k] * z[k]);
        0.5 * self.stages.twice_kinetic + square / self.coefficient()
    }

    fn is_at_resolution(&self) -> bool {
        let (d, n, mass) = (&self.stages.correction, self.stages.q.len(), self.system.free_mass());
        let square = vectors::sum(d.len(), |k| mass[k % n] * d[k] * d[k]);
        square <= f64::EPSILON * f64::EPSILON * self.stages.twice_origin
    }
}

/// The stepper.
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
    /// Change of velocity over the step, where mass is consistent.
    dv: Vec<f64>,
}

impl Gauss {
    const NAME: &str = "gauss";

    /// Of degree s × Gauss–Legendre with s points, s from 2 to 5.
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
        })
    }

    fn advance(&mut self, system: &System, state: &State, h: f64) -> Result<(u32, StepEnergy), SolverError> {
        check_state(state, system)?;
        if self.ledger {
            self.potential_energies.open(system, &mut self.evaluator, &state.q, state.t);
        }
        self.inertia.open(system, &state.p, &mut self.evaluator.work);
        self.stages.open(system, &self.inertia, state, h);
        let iterations = self.solve(system)?;
        let Stages { coefficients, z, velocity, history, has_history, room, .. } = &mut self.stages;
        let (n, mass, z) = (state.q.len(), system.free_mass(), &*z);
        let State { t, q, p } = &mut self.after;
        *t = state.t + h;
        let position = |k: usize| h * velocity[k] + Stages::combine(&coefficients.position, z, n, k);
        let change = |k: usize| Stages::combine(&coefficients.velocity, z, n, k) / h;
        if self.inertia.matrix().is_some() {
            self.dv.resize(n, 0.0);
            vectors::fill(&mut self.dv, change);
            let dp = self.inertia.momentum(system, &self.dv, room);
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
        vectors::fill(history, |k| z[k] / (h * h));
        *has_history = true;
        let energy = if self.ledger { self.account(system)? } else { StepEnergy::default() };
        self.inertia.close(&self.after.p, &self.dv);
        Ok((iterations, energy))
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
                is_at_rest &= at_rest::is_at_rest(system, evaluator, newton.tolerance());
            }
            if is_at_rest {
                evaluator.work.skipped += 1;
                return Ok(0);
            }
        }
        let equations = GaussEquations { system, inertia, stages };
        Ok(newton.solve(&mut Solve { system, evaluator, inverse, equations })?.iterations)
    }

    /// ΔT = h Σ b_i M a_i·V_i with stage velocities V_i = v₀ + h Σ A_ij a_j, for the method conserves
    /// quadratic invariants. So the work on prescribed coordinates is h Σ b_i g_i·ẋ_i, the residual's
    /// h Σ b_i (M a_i + g_i)·V_i, and the scheme's part ΔV − h Σ b_i g_i·V_i over all coordinates. With forces f
    /// that have no potential g is ∂V/∂x − f, and their work h Σ b_i f_i·ẋ_i has its own parts.
    fn account(&mut self, system: &System) -> Result<StepEnergy, SolverError> {
        let Self { evaluator, inertia, stages, after, potential_energies, x_dot, .. } = self;
        stages.evaluate(system, inertia, evaluator)?;
        let (h, n, mass) = (stages.h, stages.q.len(), system.free_mass());
        x_dot.resize(system.coordinates().dof_count(), 0.0);
        let (mut prescribed, mut residual, mut free) = (0.0, 0.0, 0.0);
        let (mut force, mut damping) = (0.0, 0.0);
        for i in 0..stages.coefficients.stages() {
            let weight = h * stages.coefficients.b[i];
            if system.coordinates().is_moving() || evaluator.has_nonconservative() {
                stages.evaluate_stage(i, system, evaluator)?;
                let q_dot: Vec<f64> = (0..n).map(|k| stages.stage_velocity(i, k)).collect();
                system.coordinates().embed_velocity(&q_dot, evaluator.time(), x_dot);
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
        let (change, loads) = potential_energies.close(system, evaluator, &after.q, after.t);
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
        let before = self.evaluator.work;
        let (iterations, energy) = self.advance(system, state, h).map_err(|error| {
            let cause = self.evaluator.explain(system, state, error);
            StepError { t: state.t, h, cause }
        })?;
        std::mem::swap(&mut self.after, state);
        self.evaluator.work.steps += 1;
        Ok(StepReport { iterations, energy, work: self.evaluator.work - before })
    }

    fn work(&self) -> Work {
        self.evaluator.work
    }

    fn unit_costs(&self, system: &System) -> UnitCosts {
        if self.inverse.is_ready() { *self.inverse.costs() } else { UnitCosts::explicit(system) }
    }

    fn linear_solver(&self) -> Option<&str> {
        Some(self.inverse.reason()).filter(|reason| !reason.is_empty())
    }

    fn velocity(&self, state: &State) -> Option<&[f64]> {
        self.inertia.known_velocity(state)
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
        self.newton.restore(memory)?;
        self.inertia.restore(memory)?;
        self.inverse.restore(system, &mut self.evaluator, memory)?;
        self.evaluator.restore(memory)?;
        self.evaluator.work = Work::default();
        Ok(())
    }
}
