//! Explicit Euler: q += h M⁻¹p and p −= h ∂V/∂q, both evaluated at the start of the step. Order 1, unstable for every
//! oscillation: each step grows the phase area by the factor 1 + z².

use vi_core::{State, StepEnergy, System};

use crate::assemble::evaluator::Evaluator;
use crate::assemble::finite::{check_finite, check_state};
use crate::error::SolverError;
use crate::memory::{StepperMemory, expect_method};
use crate::options::SolverOptions;
use crate::schemes::accounts::{self, PotentialEnergies};
use crate::schemes::stepper::{StepError, StepReport, Stepper};
use crate::vectors;
use crate::work::Work;

pub(crate) struct ForwardEuler {
    evaluator: Evaluator,
    potential_energies: PotentialEnergies,
    ledger: bool,
    q: Vec<f64>,
    p: Vec<f64>,
    x_dot: Vec<f64>,
}

impl ForwardEuler {
    const NAME: &str = "forward-euler";

    pub(crate) fn new(system: &System, options: &SolverOptions) -> Self {
        let n = system.coordinates().free_count();
        Self {
            evaluator: Evaluator::new(system),
            potential_energies: PotentialEnergies::new(),
            ledger: options.ledger,
            q: vec![0.0; n],
            p: vec![0.0; n],
            x_dot: vec![0.0; system.coordinates().dof_count()],
        }
    }

    fn advance(&mut self, system: &System, state: &State, h: f64) -> Result<StepEnergy, SolverError> {
        check_state(state, system)?;
        if self.ledger {
            self.potential_energies.open(system, &mut self.evaluator, &state.q, state.t);
        }
        self.evaluator.evaluate(system, &state.q, state.t, true)?;
        let (gradient, mass) = (self.evaluator.gradient(), system.free_mass());
        let free = system.coordinates().free();
        self.q.copy_from_slice(&state.q);
        self.p.copy_from_slice(&state.p);
        vectors::update_pair(&mut self.q, &mut self.p, |k, q, p| {
            *q += h * (*p / mass[k]);
            *p -= h * gradient[free[k] as usize];
        });
        check_finite(&self.q, &self.p, system)?;
        let mut energy = StepEnergy::default();
        if self.ledger {
            // ΔT = Δp·(v₀ + v₁)/2 with Δp = −h ∂V/∂q.
            let (p0, p1) = (&state.p, &self.p);
            let mean_velocity = |k: usize| 0.5 * (p0[k] + p1[k]) / mass[k];
            let work_of_forces = h * accounts::free_work(system, gradient, mean_velocity);
            if system.coordinates().is_moving() {
                system.coordinates().embed_velocity(&self.p, state.t, &mut self.x_dot);
                system.coordinates().to_own_axes(&mut self.x_dot);
                energy.prescribed = h * accounts::prescribed_work(system, gradient, &self.x_dot);
            }
            let t = state.t + h;
            let (change, loads) = self.potential_energies.close(system, &mut self.evaluator, &self.q, t);
            energy.force = loads;
            energy.scheme = change - loads - work_of_forces - energy.prescribed;
        }
        Ok(energy)
    }
}

impl Stepper for ForwardEuler {
    fn step(&mut self, system: &System, state: &mut State, h: f64) -> Result<StepReport, StepError> {
        let before = self.evaluator.work;
        let energy = self.advance(system, state, h).map_err(|cause| StepError { t: state.t, h, cause })?;
        std::mem::swap(&mut state.q, &mut self.q);
        std::mem::swap(&mut state.p, &mut self.p);
        state.t += h;
        self.evaluator.work.steps += 1;
        Ok(StepReport { iterations: 0, energy, work: self.evaluator.work - before })
    }

    fn work(&self) -> Work {
        self.evaluator.work
    }

    fn memory(&self) -> StepperMemory {
        let mut memory = StepperMemory { method: Self::NAME.to_owned(), ..Default::default() };
        self.evaluator.save(&mut memory);
        self.potential_energies.save(&mut memory);
        memory
    }

    fn restore(&mut self, system: &System, memory: &StepperMemory) -> Result<(), SolverError> {
        expect_method(memory, Self::NAME)?;
        self.evaluator = Evaluator::new(system);
        self.potential_energies = PotentialEnergies::restore(memory);
        self.evaluator.restore(memory)
    }
}
