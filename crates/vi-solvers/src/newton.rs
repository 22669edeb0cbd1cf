//! Newton's method for the equations of an implicit step, with the cheapest factor that converges,
//! and the ladder by which it escalates: turned old factor → factor at the iterate → descent by full
//! Newton steps, with projected Hessians where they are needed (`descent`) → failure with the facts.
//! A halved step is the caller's to try, for it changes h. This room must not know which scheme the
//! equations come from.

mod anderson;
mod descent;
mod krylov;

use vi_core::System;

use crate::forces::Forces;
use crate::inverse::{Inverse, Reason};
use crate::policy::Policy;
use crate::{SolverError, SolverOptions, StepperMemory};
use anderson::Anderson;

/// Tolerances below this one mean: to round-off.
const ROUND_OFF: f64 = 1e-12;
/// Relative error above which steps are searched along a line; below, round-off would stall it.
const SEARCH_ABOVE: f64 = 1e-3;
/// A trial whose slope is below this part of the first one is accepted without an energy.
const SLOPE_KEPT: f64 = 0.9;
/// Relative error of a start above which the others are looked at.
const DOUBT_ABOVE: f64 = 0.05;
/// New factors that slow convergence may ask for inside one step before the descent begins.
const FACTORS_BEFORE_DESCENT: u32 = 2;

/// Where an iteration may start, from the best guess to the safest.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Start {
    /// Extrapolated from the last steps, for motions that the steps resolve.
    Predicted,
    /// Extrapolated so that oscillations far beyond the step, which a scheme turns into ones of a period of
    /// one or two steps, are continued too.
    Stiff,
    /// Without acceleration.
    Inertial,
    /// Where the step began.
    Still,
}

impl Start {
    const ALL: [Self; 4] = [Self::Predicted, Self::Stiff, Self::Inertial, Self::Still];

    pub(crate) fn number(self) -> u64 {
        self as u64
    }

    pub(crate) fn from_number(number: u64) -> Option<Self> {
        Self::ALL.into_iter().find(|start| start.number() == number)
    }
}

/// Equations R(w) = 0 with a symmetric positive definite model A ≈ ∂R/∂w.
pub(crate) trait Equations {
    /// c of the model A = M + cK.
    fn coefficient(&self) -> f64;
    /// Is A with K at the unknowns ∂R/∂w itself?
    fn model_is_exact(&self) -> bool {
        true
    }
    /// The unknowns, to be kept.
    fn unknowns(&self) -> &[f64];
    /// Sets the unknowns to ones that were kept.
    fn go_to(&mut self, unknowns: &[f64]);
    /// Sets the unknowns.
    fn start(&mut self, start: Start);
    /// Leaves out of R what keeps its solution from minimising the merit, or puts it back; false where
    /// there is no such part.
    fn simplify(&mut self, _simple: bool) -> bool {
        false
    }
    /// Goes where K is taken.
    fn linearize(&mut self, system: &System, forces: &mut Forces) -> Result<(), SolverError>;
    /// Evaluates −R at the unknowns.
    fn evaluate(&mut self, system: &System, forces: &mut Forces) -> Result<(), SolverError>;
    /// Solves for the correction δ = −A⁻¹R; returns its energy −Rᵀδ/c, J.
    fn correct(&mut self, inverse: &mut Inverse, forces: &mut Forces) -> Result<f64, SolverError>;
    /// δ of the last correction, and Aδ.
    fn correction(&mut self) -> (&mut [f64], &[f64]);
    /// Sets the unknowns to those of the last correction plus `fraction` of δ.
    fn advance(&mut self, fraction: f64);
    /// −R·δ/c at the unknowns, J: minus the slope of the merit along δ.
    fn slope(&self) -> f64;
    /// Is there a function that the solution minimises?
    fn has_merit(&self) -> bool;
    /// That function over c, J; none where there is no such.
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

/// What became of the cheap iteration.
enum Course {
    Solved(Solved),
    /// Given up after so many iterations, the last with this relative error.
    Stuck(u32),
}

pub(crate) struct Newton {
    tolerance: f64,
    max_iterations: u32,
    pub(crate) policy: Policy,
    anderson: Anderson,
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
        Ok(Self { tolerance, max_iterations, policy: Policy::default(), anderson: Anderson::default() })
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
        if self.policy.has_descended && !inverse.is_linear() {
            // Old factors did not serve the last step: the first trouble leads on at once.
            attempt.wanted = Some(Reason::Slow);
            attempt.troubles = FACTORS_BEFORE_DESCENT;
        }
        self.begin(system, forces, equations, self.policy.start)?;
        match self.iterate(system, forces, inverse, equations, attempt)? {
            Course::Solved(solved) => Ok(solved),
            Course::Stuck(iterations) => self.descend(system, forces, inverse, equations, iterations),
        }
    }

    /// Iterates from where the equations were evaluated last, with the factor at hand, and with a few new
    /// ones.
    fn iterate<E: Equations>(
        &mut self,
        system: &System,
        forces: &mut Forces,
        inverse: &mut Inverse,
        equations: &mut E,
        mut attempt: Attempt,
    ) -> Result<Course, SolverError> {
        self.anderson.restart();
        if attempt.wanted.is_some() {
            // It begins with a new factor.
        } else if !inverse.is_for(equations.coefficient()) {
            attempt.wanted = Some(Reason::New);
        } else if !inverse.is_linear() && self.policy.is_stale(inverse.costs()) {
            attempt.wanted = Some(Reason::Stale);
        } else {
            inverse.turn(system, forces);
        }
        let has_merit = equations.has_merit();
        for iteration in 1..=self.max_iterations {
            if let Some(reason) = attempt.wanted.take() {
                if attempt.troubles > FACTORS_BEFORE_DESCENT {
                    return Ok(Course::Stuck(iteration - 1));
                }
                equations.linearize(system, forces)?;
                inverse.make(system, forces, equations.coefficient(), reason)?;
                equations.evaluate(system, forces)?;
                self.policy.renew();
                self.anderson.restart();
                attempt.renew();
            }
            let mut decrement = equations.correct(inverse, forces)?;
            forces.work.newton_iterations += 1;
            attempt.with_factor += 1;
            let doubtful = |equations: &E| decrement > DOUBT_ABOVE * DOUBT_ABOVE * equations.energy_scale();
            if iteration == 1 && self.policy.is_hard() && !inverse.is_linear() && doubtful(equations) {
                decrement = self.choose_start(system, forces, inverse, equations, decrement)?;
            }
            if !inverse.is_linear() || !equations.model_is_exact() {
                // Where a merit is searched along, the correction must point down it.
                let small = decrement <= SEARCH_ABOVE * SEARCH_ABOVE * equations.energy_scale();
                let (delta, load) = equations.correction();
                self.anderson.enter(delta, load, small || !has_merit);
            }
            equations.advance(1.0);
            let scale = equations.energy_scale();
            let eta = if decrement > 0.0 { (decrement / scale).sqrt() } else { 0.0 };
            let contraction = attempt.enter(eta);
            if self.is_converged(inverse, equations, attempt.to_round_off, eta, contraction) {
                self.policy.enter(attempt.with_factor, attempt.mean_contraction());
                return Ok(Course::Solved(Solved { iterations: iteration }));
            }
            let diverges = contraction.is_some_and(|theta| theta > 2.0) || !eta.is_finite();
            let gone =
                if diverges { None } else { self.accept(system, forces, equations, eta, decrement).ok() };
            let Some(fraction) = gone else {
                // Begin again with a factor of where we are.
                attempt.escalate(Reason::Slow);
                self.begin(system, forces, equations, attempt.safer_start())?;
                self.anderson.restart();
                continue;
            };
            self.anderson.advance(equations.correction().0, fraction);
            self.consider_new_factor(inverse, equations, &mut attempt, eta);
        }
        Ok(Course::Stuck(self.max_iterations))
    }

    /// Begins again at the start with the smallest correction, `decrement` that of the one in use, and
    /// corrects there.
    fn choose_start<E: Equations>(
        &mut self,
        system: &System,
        forces: &mut Forces,
        inverse: &mut Inverse,
        equations: &mut E,
        decrement: f64,
    ) -> Result<f64, SolverError> {
        let (used, mut least) = (self.policy.start, decrement);
        let mut last = used;
        for start in Start::ALL.into_iter().filter(|&start| start != used) {
            equations.start(start);
            last = start;
            if equations.evaluate(system, forces).is_ok() {
                let decrement = equations.correct(inverse, forces)?;
                forces.work.newton_iterations += 1;
                if decrement < least {
                    (self.policy.start, least) = (start, decrement);
                }
            }
        }
        if last != self.policy.start {
            equations.start(self.policy.start);
            equations.evaluate(system, forces)?;
            least = equations.correct(inverse, forces)?;
        }
        Ok(least)
    }

    /// Starts at the best of the places from `first` on where the residual is finite.
    fn begin<E: Equations>(
        &self,
        system: &System,
        forces: &mut Forces,
        equations: &mut E,
        first: Start,
    ) -> Result<(), SolverError> {
        let from = Start::ALL.iter().position(|&start| start == first).unwrap_or(0);
        let mut outcome = Ok(());
        for &start in Start::ALL[from..].iter().chain(&Start::ALL[..from]) {
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
        to_round_off: bool,
        eta: f64,
        contraction: Option<f64>,
    ) -> bool {
        if eta == 0.0 || equations.is_at_resolution() {
            return true;
        }
        if to_round_off {
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

    /// Evaluates at the full correction, or at a part of it where that is too far; returns the part.
    fn accept<E: Equations>(
        &self,
        system: &System,
        forces: &mut Forces,
        equations: &mut E,
        eta: f64,
        decrement: f64,
    ) -> Result<f64, SolverError> {
        let outcome = equations.evaluate(system, forces);
        if outcome.is_ok() && (eta <= SEARCH_ABOVE || equations.slope().abs() <= SLOPE_KEPT * decrement) {
            return Ok(1.0);
        }
        equations.advance(0.0);
        if let Some(before) = equations.merit(system, forces) {
            descent::search(system, forces, equations, before, decrement)
        } else {
            // No merit: only keep inside the domain of the terms.
            equations.advance(1.0);
            descent::keep_inside(system, forces, equations)
        }
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
    /// How often it converged slowly, or not at all.
    troubles: u32,
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
            troubles: 0,
            restarts: 0,
            with_factor: 0,
            first_eta: 0.0,
            last_eta: None,
        }
    }

    /// One that begins with a factor of where it begins.
    fn with_new_factor(tolerance: f64) -> Self {
        Self { wanted: Some(Reason::Newton), ..Self::new(tolerance <= ROUND_OFF) }
    }

    fn renew(&mut self) {
        self.with_factor = 0;
        self.last_eta = None;
    }

    fn escalate(&mut self, reason: Reason) {
        self.troubles += 1;
        self.wanted = Some(reason);
        self.last_eta = None;
    }

    fn safer_start(&mut self) -> Start {
        self.restarts += 1;
        match self.restarts {
            1 => Start::Stiff,
            2 => Start::Inertial,
            _ => Start::Still,
        }
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
