//! Generalised-α (J. Chung, G. M. Hulbert, J. Appl. Mech. 60 (1993) 371–375) with the forces at the mean
//! configuration: M((1 − α_m) a₁ + α_m a₀) + ∂V/∂q((1 − α_f) q₁ + α_f q₀) = 0, with Newmark's formulas for q₁ and v₁.
//! All parameters follow from the spectral radius ρ at infinite frequency: α_m = (2ρ − 1)/(ρ + 1), α_f = ρ/(ρ + 1), γ
//! = ½ − α_m + α_f, β = ¼(1 − α_m + α_f)².

use vi_core::{State, System};

use crate::assemble::evaluator::Evaluator;
use crate::assemble::inertia::Inertia;
use crate::error::SolverError;
use crate::memory::StepperMemory;
use crate::schemes::comparison::carried::CarriedAcceleration;
use crate::schemes::one_stage::rule::Rule;

pub(crate) struct GeneralizedAlpha {
    alpha_m: f64,
    alpha_f: f64,
    beta: f64,
    gamma: f64,
    carried: CarriedAcceleration,
}

impl GeneralizedAlpha {
    /// Returns the rule for 0 ≤ ρ ≤ 1.
    pub(crate) fn new(spectral_radius: f64) -> Result<Self, SolverError> {
        let rho = spectral_radius;
        if !(0.0..=1.0).contains(&rho) {
            let (option, allowed) = ("spectral_radius", "must be from 0 to 1");
            return Err(SolverError::Option { option, value: rho, allowed });
        }
        let (alpha_m, alpha_f) = ((2.0 * rho - 1.0) / (rho + 1.0), rho / (rho + 1.0));
        let excess = 1.0 - alpha_m + alpha_f;
        let (beta, gamma) = (0.25 * excess * excess, excess - 0.5);
        Ok(Self { alpha_m, alpha_f, beta, gamma, carried: CarriedAcceleration::default() })
    }

    /// Returns a₁ from the mean acceleration s = (1 − α_m) a₁ + α_m a₀ of the stage.
    fn next(&self, a: f64, s: f64) -> f64 {
        (s - self.alpha_m * a) / (1.0 - self.alpha_m)
    }
}

impl Rule for GeneralizedAlpha {
    fn name(&self) -> &'static str {
        "generalized-alpha"
    }
    fn coefficient(&self, h: f64) -> f64 {
        (1.0 - self.alpha_f) / (1.0 - self.alpha_m) * self.beta * h * h
    }
    fn books_in_middle(&self) -> bool {
        true
    }
    fn time(&self) -> f64 {
        1.0 - self.alpha_f
    }
    fn offset(&self, k: usize, v: f64, h: f64) -> f64 {
        // The mean configuration for s = 0.
        let a = self.carried.a[k];
        let end = h * (v + h * ((0.5 - self.beta) * a + self.beta * self.next(a, 0.0)));
        (1.0 - self.alpha_f) * end
    }
    fn change(&self, k: usize, v: f64, w: f64, h: f64) -> (f64, f64) {
        let a = self.carried.a[k];
        let next = self.next(a, w / self.coefficient(h));
        (
            h * (v + h * ((0.5 - self.beta) * a + self.beta * next)),
            h * ((1.0 - self.gamma) * a + self.gamma * next),
        )
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
        let (c, alpha_m) = (self.coefficient(h), self.alpha_m);
        self.carried.close(after, |k, a| (w[k] / c - alpha_m * a) / (1.0 - alpha_m));
    }
    fn save(&self, memory: &mut StepperMemory) {
        self.carried.save(memory);
    }
    fn restore(&mut self, memory: &StepperMemory) -> Result<(), SolverError> {
        self.carried.restore(memory);
        Ok(())
    }
}
