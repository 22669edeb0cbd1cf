//! Newton's method for the equations of an implicit step, with the cheapest factor that converges,
//! and the ladder by which it escalates: turned old factor → factor at the iterate → full Newton
//! with line search → projected Hessians → failure with the facts. A halved step is the caller's
//! to try, for it changes h. This room must not know which scheme the equations come from.

use vi_core::System;

use crate::forces::Forces;
use crate::inverse::{Inverse, Reason};
use crate::policy::Policy;
use crate::{SolverError, SolverOptions, StepperMemory};

/// Tolerances below this one mean: to round-off.
const ROUND_OFF: f64 = 1e-12;
/// Relative error above which steps are searched along a line; below, round-off would stall it.
const SEARCH_ABOVE: f64 = 1e-3;
/// A trial whose slope is below this part of the first one is accepted without an energy.
const SLOPE_KEPT: f64 = 0.9;
/// New factors inside one step after which every iteration makes its own.
const FACTORS_BEFORE_NEWTON: u32 = 2;

/// Where an iteration may start, from the best guess to the safest.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Start {
    /// Extrapolated from the last steps.
    Predicted,
    /// Without acceleration.
    Inertial,
    /// Where the step began.
    Still,
}

/// Equations R(w) = 0 with a symmetric positive definite model A ≈ ∂R/∂w.
pub(crate) trait Equations {
    /// c of the model A = M + cK.
    fn coefficient(&self) -> f64;
    /// Is A with K at the unknowns ∂R/∂w itself?
    fn model_is_exact(&self) -> bool {
        true
    }
    /// Sets the unknowns.
    fn start(&mut self, start: Start);
    /// Goes where K is taken.
    fn linearize(&mut self, system: &System, forces: &mut Forces) -> Result<(), SolverError>;
    /// Evaluates −R at the unknowns.
    fn evaluate(&mut self, system: &System, forces: &mut Forces) -> Result<(), SolverError>;
    /// Solves for the correction δ = −A⁻¹R; returns its energy −Rᵀδ/c, J.
    fn correct(&mut self, inverse: &mut Inverse, forces: &mut Forces) -> Result<f64, SolverError>;
    /// Sets the unknowns to those of the last correction plus `fraction` of δ.
    fn advance(&mut self, fraction: f64);
    /// −R·δ/c at the unknowns, J: minus the slope of the merit along δ.
    fn slope(&self) -> f64;
    /// A function that the solution minimises, over c, J; none where there is no such.
    fn merit(&mut self, system: &System, forces: &mut Forces) -> Option<f64>;
    /// The energy that errors are relative to, J.
    fn energy_scale(&self) -> f64;
    /// Is δ below the resolution of the numbers that hold the configuration?
    fn is_at_resolution(&self) -> bool;
}

/// A converged solve.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Solved {
    pub(crate) iterations: u32,
}

pub(crate) struct Newton {
    tolerance: f64,
    max_iterations: u32,
    pub(crate) policy: Policy,
}

impl Newton {
    pub(crate) fn new(options: &SolverOptions) -> Result<Self, SolverError> {
        let (tolerance, max_iterations) = (options.tolerance, options.max_iterations);
        if !(tolerance > 0.0 && tolerance < 1.0) {
            let allowed = "must be between 0 and 1";
            return Err(SolverError::Option { option: "tolerance", value: tolerance, allowed });
        }
        if max_iterations == 0 {
            let allowed = "must be at least 1";
            return Err(SolverError::Option { option: "max_iterations", value: 0.0, allowed });
        }
        Ok(Self { tolerance, max_iterations, policy: Policy::default() })
    }

    pub(crate) fn tolerance(&self) -> f64 {
        self.tolerance
    }

    /// Solves the equations. On return the unknowns hold the solution; `forces` may stand one
    /// correction before it.
    pub(crate) fn solve<E: Equations>(
        &mut self,
        system: &System,
        forces: &mut Forces,
        inverse: &mut Inverse,
        equations: &mut E,
    ) -> Result<Solved, SolverError> {
        let mut attempt = Attempt::new(self.tolerance <= ROUND_OFF);
        self.begin(system, forces, equations, Start::Predicted)?;
        if !inverse.is_for(equations.coefficient()) {
            attempt.wanted = Some(Reason::New);
        } else if !inverse.is_linear() && self.policy.is_stale(inverse.costs()) {
            attempt.wanted = Some(Reason::Stale);
        } else {
            inverse.turn(system, forces);
        }
        let mut last_residual = f64::INFINITY;
        for iteration in 1..=self.max_iterations {
            if let Some(reason) = attempt.wanted.take() {
                equations.linearize(system, forces)?;
                inverse.make(system, forces, equations.coefficient(), reason)?;
                equations.evaluate(system, forces)?;
                self.policy.renew();
                attempt.renew();
            }
            let decrement = equations.correct(inverse, forces)?;
            forces.work.newton_iterations += 1;
            attempt.with_factor += 1;
            equations.advance(1.0);
            let scale = equations.energy_scale();
            let eta = if decrement > 0.0 { (decrement / scale).sqrt() } else { 0.0 };
            let contraction = attempt.enter(eta);
            last_residual = eta;
            if self.is_converged(inverse, equations, &attempt, eta, contraction) {
                self.policy.enter(attempt.with_factor, attempt.mean_contraction());
                return Ok(Solved { iterations: iteration });
            }
            if contraction.is_some_and(|theta| theta > 2.0) || !eta.is_finite() {
                // Diverging: begin again with a factor of where we are.
                attempt.escalate(Reason::Slow);
                self.begin(system, forces, equations, attempt.safer_start())?;
                continue;
            }
            let trial = self.accept(system, forces, equations, eta, decrement);
            match trial {
                Ok(()) => {}
                Err(error) if attempt.is_fresh() => return Err(self.explain(error, iteration, eta)),
                Err(_) => {
                    attempt.escalate(Reason::Slow);
                    self.begin(system, forces, equations, attempt.safer_start())?;
                    continue;
                }
            }
            self.consider_new_factor(inverse, equations, &mut attempt, eta);
        }
        Err(SolverError::NoConvergence {
            iterations: self.max_iterations,
            residual: last_residual,
            tolerance: self.tolerance,
        })
    }

    /// Starts at the best of the places from `first` on where the residual is finite.
    fn begin<E: Equations>(
        &self,
        system: &System,
        forces: &mut Forces,
        equations: &mut E,
        first: Start,
    ) -> Result<(), SolverError> {
        let all = [Start::Predicted, Start::Inertial, Start::Still];
        let from = all.iter().position(|&start| start == first).unwrap_or(0);
        let mut outcome = Ok(());
        for &start in &all[from..] {
            equations.start(start);
            outcome = equations.evaluate(system, forces);
            if outcome.is_ok() {
                break;
            }
        }
        outcome
    }

    fn is_converged<E: Equations>(
        &self,
        inverse: &Inverse,
        equations: &E,
        attempt: &Attempt,
        eta: f64,
        contraction: Option<f64>,
    ) -> bool {
        if eta == 0.0 || equations.is_at_resolution() {
            return true;
        }
        if attempt.to_round_off {
            // Until nothing more is gained.
            let stalled = if equations.model_is_exact() { 0.5 } else { 0.9 };
            return eta < 1e-9 && contraction.is_some_and(|theta| theta > stalled);
        }
        if inverse.is_linear() && equations.model_is_exact() {
            // One solve of a linear system with its own factor is exact.
            return true;
        }
        let theta = contraction.or_else(|| self.policy.expected_contraction());
        match theta {
            Some(theta) if theta < 1.0 => theta / (1.0 - theta) * eta <= self.tolerance,
            _ => eta <= 0.1 * self.tolerance,
        }
    }

    /// Evaluates at the full correction, or at a part of it where that is too far.
    fn accept<E: Equations>(
        &self,
        system: &System,
        forces: &mut Forces,
        equations: &mut E,
        eta: f64,
        decrement: f64,
    ) -> Result<(), SolverError> {
        let outcome = equations.evaluate(system, forces);
        if outcome.is_ok() && (eta <= SEARCH_ABOVE || equations.slope().abs() <= SLOPE_KEPT * decrement) {
            return Ok(());
        }
        equations.advance(0.0);
        let Some(before) = equations.merit(system, forces) else {
            // No merit: only keep inside the domain of the terms.
            let mut fraction = 1.0;
            let mut outcome = outcome;
            while outcome.is_err() && fraction > 1e-6 {
                fraction *= 0.5;
                equations.advance(fraction);
                forces.work.line_searches += 1;
                outcome = equations.evaluate(system, forces);
            }
            if outcome.is_ok() && fraction == 1.0 {
                equations.advance(1.0);
                return equations.evaluate(system, forces);
            }
            return outcome;
        };
        let mut fraction = 1.0;
        let mut last = outcome.err();
        while fraction > 1e-12 {
            equations.advance(fraction);
            forces.work.line_searches += 1;
            let after = equations.merit(system, forces).unwrap_or(f64::INFINITY);
            // Armijo's condition; energies are only good to their round-off.
            if after <= before - 1e-4 * fraction * decrement + 1e-15 * before.abs() {
                match equations.evaluate(system, forces) {
                    Ok(()) => return Ok(()),
                    Err(error) => last = Some(error),
                }
            }
            let parabola = 0.5 * fraction * fraction * decrement / (after - before + fraction * decrement);
            let kept = if parabola.is_finite() { parabola } else { 0.0 };
            fraction = kept.clamp(0.1 * fraction, 0.5 * fraction);
        }
        Err(last.unwrap_or(SolverError::NoConvergence {
            iterations: 0,
            residual: eta,
            tolerance: self.tolerance,
        }))
    }

    fn consider_new_factor<E: Equations>(
        &self,
        inverse: &Inverse,
        equations: &E,
        attempt: &mut Attempt,
        eta: f64,
    ) {
        if inverse.is_linear() {
            return;
        }
        if attempt.to_round_off && equations.model_is_exact() {
            // The last iterations keep the factor of a nearly converged iterate.
            if eta > 1e-7 {
                attempt.wanted = Some(Reason::Newton);
            }
            return;
        }
        if attempt.new_factors > FACTORS_BEFORE_NEWTON {
            attempt.wanted = Some(Reason::Newton);
            return;
        }
        let Some(theta) = attempt.mean_contraction() else { return };
        let remaining = if theta < 1.0 {
            ((self.tolerance * (1.0 - theta) / eta).ln() / theta.ln()).max(0.0)
        } else {
            f64::INFINITY
        };
        if self.policy.is_slow(inverse.costs(), attempt.with_factor, remaining) {
            attempt.escalate(Reason::Slow);
        }
    }

    fn explain(&self, error: SolverError, iterations: u32, residual: f64) -> SolverError {
        match error {
            SolverError::NoConvergence { .. } => {
                SolverError::NoConvergence { iterations, residual, tolerance: self.tolerance }
            }
            other => other,
        }
    }

    pub(crate) fn remember(&self, memory: &mut StepperMemory) {
        self.policy.remember(memory);
    }

    pub(crate) fn restore(&mut self, memory: &StepperMemory) -> Result<(), SolverError> {
        self.policy = Policy::from_memory(memory)?;
        Ok(())
    }
}

/// The course of one solve.
struct Attempt {
    to_round_off: bool,
    wanted: Option<Reason>,
    new_factors: u32,
    restarts: u32,
    /// Iterations with the current factor.
    with_factor: u64,
    first_eta: f64,
    last_eta: Option<f64>,
}

impl Attempt {
    fn new(to_round_off: bool) -> Self {
        Self {
            to_round_off,
            wanted: None,
            new_factors: 0,
            restarts: 0,
            with_factor: 0,
            first_eta: 0.0,
            last_eta: None,
        }
    }

    fn renew(&mut self) {
        self.new_factors += 1;
        self.with_factor = 0;
        self.last_eta = None;
    }

    fn escalate(&mut self, reason: Reason) {
        let newton = self.new_factors >= FACTORS_BEFORE_NEWTON;
        self.wanted = Some(if newton { Reason::Newton } else { reason });
        self.last_eta = None;
    }

    fn safer_start(&mut self) -> Start {
        self.restarts += 1;
        match self.restarts {
            1 => Start::Predicted,
            2 => Start::Inertial,
            _ => Start::Still,
        }
    }

    /// Is the factor in use that of the last configuration?
    fn is_fresh(&self) -> bool {
        self.new_factors > FACTORS_BEFORE_NEWTON
    }

    /// Enters the error of an iteration; returns its ratio to the one before.
    fn enter(&mut self, eta: f64) -> Option<f64> {
        let contraction = self.last_eta.map(|last| eta / last);
        if self.last_eta.is_none() {
            self.first_eta = eta;
        }
        self.last_eta = Some(eta);
        contraction
    }

    /// Mean ratio of errors since the factor was made or the step began.
    fn mean_contraction(&self) -> Option<f64> {
        let steps = self.with_factor.checked_sub(1).filter(|&steps| steps > 0)?;
        let ratio = self.last_eta? / self.first_eta;
        (ratio > 0.0).then(|| ratio.powf(1.0 / steps as f64))
    }
}
