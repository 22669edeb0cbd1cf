//! The stages of a Gauss step, and their coupled equations for Newton's method.

use vi_core::{State, System};

use crate::assemble::evaluator::Evaluator;
use crate::assemble::inertia::Inertia;
use crate::error::SolverError;
use crate::newton::equations::Equations;
use crate::newton::inverse::Inverse;
use crate::newton::start::Start;
use crate::schemes::gauss::collocation::{Collocation, combine};
use crate::schemes::gauss::coupled::CoupledStages;
use crate::vectors;

/// The unknowns and buffers of the stages; stage vectors are stored one after another.
pub(super) struct Stages {
    pub(super) coefficients: Collocation,
    pub(super) h: f64,
    pub(super) t: f64,
    pub(super) twice_kinetic: f64,
    pub(super) twice_origin: f64,
    pub(super) origin: Vec<f64>,
    pub(super) velocity: Vec<f64>,
    /// Z/h² of the last step, from which the next is extrapolated.
    pub(super) history: Vec<f64>,
    pub(super) has_history: bool,
    pub(super) z: Vec<f64>,
    pub(super) base: Vec<f64>,
    pub(super) correction: Vec<f64>,
    /// r̃, and then ρ.
    pub(super) residual: Vec<f64>,
    /// ∂V/∂q at the stages.
    pub(super) gradients: Vec<f64>,
    /// M Z of the last evaluation, if the mass is consistent.
    pub(super) inertial: Vec<f64>,
    pub(super) scratch: Vec<f64>,
    pub(super) q: Vec<f64>,
}

impl Stages {
    pub(super) fn new(coefficients: Collocation, n: usize) -> Self {
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
            scratch: Vec::new(),
            q: vec![0.0; n],
        }
    }

    pub(super) fn open(&mut self, system: &System, inertia: &Inertia, state: &State, h: f64) {
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

    pub(super) fn model_coefficient(&self) -> f64 {
        self.h * self.h * self.coefficients.theta
    }

    /// Goes to stage i: sets `q` and returns the time of the stage.
    pub(super) fn configure(&mut self, i: usize) -> f64 {
        let Self { coefficients, h, t, origin, velocity, z, q, .. } = self;
        let (n, offset) = (q.len(), coefficients.c[i] * *h);
        let z = &z[i * n..(i + 1) * n];
        vectors::fill(q, |k| origin[k] + (offset * velocity[k] + z[k]));
        *t + offset
    }

    /// Returns the velocity of coordinate k at stage i.
    pub(super) fn stage_velocity(&self, i: usize, k: usize) -> f64 {
        let Self { coefficients, z, velocity, h, q, .. } = self;
        velocity[k] + combine(&coefficients.stage_velocity[i], z, q.len(), k) / h
    }

    /// Evaluates the forces at stage i; those without a potential at the velocity of the stage.
    pub(super) fn evaluate_stage(
        &mut self,
        i: usize,
        system: &System,
        evaluator: &mut Evaluator,
    ) -> Result<(), SolverError> {
        let t = self.configure(i);
        if evaluator.has_nonconservative() {
            let q_dot: Vec<f64> = (0..self.q.len()).map(|k| self.stage_velocity(i, k)).collect();
            // With this rate the model has h√θ in place of the stages' eigenvalues of h A.
            evaluator.set_velocities(system, &q_dot, t, 1.0 / self.model_coefficient().sqrt());
        }
        evaluator.evaluate(system, &self.q, t, false)
    }

    pub(super) fn evaluate(
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

    /// Returns Σ_j row_j M Z_j of the last evaluation for coordinate k.
    pub(super) fn combine_inertial(&self, mass: &[f64], row: &[f64], k: usize) -> f64 {
        match self.inertial.is_empty() {
            true => mass[k] * combine(row, &self.z, self.q.len(), k),
            false => combine(row, &self.inertial, self.q.len(), k),
        }
    }
}

pub(super) struct GaussEquations<'a> {
    pub(super) system: &'a System,
    pub(super) inertia: &'a Inertia,
    pub(super) stages: &'a mut Stages,
}

impl Equations for GaussEquations<'_> {
    fn coefficient(&self) -> f64 {
        self.stages.model_coefficient()
    }

    fn model_is_exact(&self) -> bool {
        false
    }

    fn least_contraction(&self) -> f64 {
        self.stages.coefficients.rate
    }

    fn transient_iterations(&self) -> u64 {
        // A steel fork with long steps by two stages contracts by .8 and then by .1 with exact factors. Judged by the first ratio, they were
        // made anew in every step (131 instead of 1 in 50 steps); a strip of cloth (h = 1 ms, .3 s) needs 33 instead of 260.
        1
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
                    vectors::fill(z, |k| *h * *h * combine(row, history, n, k));
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
        // Use one K for all stages, that of the middle stage.
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
                -(inertial + *h * *h * combine(weights, gradients, n, k))
            });
        }
        self.stages.residual = residual;
        Ok(())
    }

    fn correct(&mut self, inverse: &mut Inverse, evaluator: &mut Evaluator) -> Result<f64, SolverError> {
        let Stages { coefficients, correction, residual, z, base, q, scratch, .. } = &mut *self.stages;
        let (system, inertia, n) = (self.system, self.inertia, q.len());
        let mut coupled = CoupledStages { system, inertia, coefficients, inverse, evaluator, scratch, n };
        let delta = coupled.sweep(residual.clone())?;
        let (values, loads) = delta.split_at(residual.len());
        correction.copy_from_slice(values);
        residual.copy_from_slice(loads);
        base.copy_from_slice(z);
        Ok(vectors::dot(correction, residual) / self.coefficient())
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
            vectors::fill(z, |k| base[k] + fraction * combine(row, correction, n, k));
        }
    }

    fn slope(&self) -> f64 {
        // There is no merit, hence no slope.
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
