//! Newmark's family (N. M. Newmark, J. Eng. Mech. Div. ASCE 85 (1959) 67–94): q₁ = q₀ + h v₀ + h²((½ − β) a₀ + β a₁),
//! v₁ = v₀ + h((1 − γ) a₀ + γ a₁), M a₁ = −∂V/∂q at the end.

use vi_core::{State, System};

use crate::assemble::evaluator::Evaluator;
use crate::assemble::inertia::Inertia;
use crate::error::SolverError;
use crate::memory::StepperMemory;
use crate::schemes::comparison::carried::CarriedAcceleration;
use crate::schemes::one_stage::rule::Rule;

pub(crate) struct Newmark {
    beta: f64,
    gamma: f64,
    carried: CarriedAcceleration,
}

impl Newmark {
    /// Returns the rule for 0 < β ≤ ½ and ½ ≤ γ ≤ 1 (γ < ½ gains energy at every step; β = 0 is explicit).
    pub(crate) fn new(beta: f64, gamma: f64) -> Result<Self, SolverError> {
        if !(beta > 0.0 && beta <= 0.5) {
            let allowed = "must be above 0 (0 is stormer-verlet) and at most 1/2";
            return Err(SolverError::Option { option: "beta", value: beta, allowed });
        }
        if !(0.5..=1.0).contains(&gamma) {
            return Err(SolverError::Option {
                option: "gamma",
                value: gamma,
                allowed: "must be from 1/2 to 1",
            });
        }
        Ok(Self { beta, gamma, carried: CarriedAcceleration::default() })
    }
}

impl Rule for Newmark {
    fn name(&self) -> &'static str {
        "newmark"
    }
    fn coefficient(&self, h: f64) -> f64 {
        self.beta * h * h
    }
    fn books_in_middle(&self) -> bool {
        true
    }
    fn time(&self) -> f64 {
        1.0
    }
    fn offset(&self, k: usize, v: f64, h: f64) -> f64 {
        h * (v + h * (0.5 - self.beta) * self.carried.a[k])
    }
    fn change(&self, k: usize, v: f64, w: f64, h: f64) -> (f64, f64) {
        let a = w / self.coefficient(h);
        (self.offset(k, v, h) + w, h * ((1.0 - self.gamma) * self.carried.a[k] + self.gamma * a))
    }
    fn open(
        &mut self,
        system: &System,
        evaluator: &mut Evaluator,
        inertia: &Inertia,
        state: &State,
        h: f64,
    ) -> Result<(), SolverError> {
        let span = self.span(h);
        self.carried.open(system, evaluator, inertia, state, span)
    }
    fn close(&mut self, _: &System, _before: &State, after: &State, w: &[f64], h: f64) {
        let c = self.coefficient(h);
        self.carried.close(after, |k, _| w[k] / c);
    }
    fn save(&self, memory: &mut StepperMemory) {
        self.carried.save(memory);
    }
    fn restore(&mut self, memory: &StepperMemory) -> Result<(), SolverError> {
        self.carried.restore(memory);
        Ok(())
    }
}
