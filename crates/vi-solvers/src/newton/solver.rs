//! Newton's method for the equations of an implicit step, with the cheapest factor that converges. It escalates in
//! this order: the rotated old factor; a factor at the iterate; descent by full Newton steps, with projected Hessians if
//! needed (`descent`); an error with the facts. The caller may then halve the step; this file does not, because that
//! changes h.

use crate::error::SolverError;
use crate::memory::StepperMemory;
use crate::newton::anderson::Anderson;
use crate::newton::attempt::{Attempt, Course, ROUND_OFF, Solved, is_within, relative_error};
use crate::newton::budget::Budget;
use crate::newton::equations::{Equations, Solve};
use crate::newton::inverse::Reason;
use crate::newton::line_search::{self, SLOPE_KEPT};
use crate::newton::renewal::{LEAST_CONTRACTION, Renewal};
use crate::newton::start::Start;
use crate::options::SolverOptions;

/// Relative error above which steps use a line search; below it, round-off would stall the search.
const SEARCH_ABOVE: f64 = 1e-3;
/// Relative error of a start above which the other starts are compared.
const DOUBT_ABOVE: f64 = 0.05;
/// Contraction per iteration below which a fresh factor of a partial model, or of several stages, is kept. A block that sticks on a slope
/// contracts by 0.2; renewing its factor led to 70 failed iterations per step, keeping it to 3.
const STEADY: f64 = 0.5;
/// Number of new factors without a gain that slow convergence may request inside one step before the descent begins.
const FACTORS_BEFORE_DESCENT: u32 = 2;

pub(crate) struct Newton {
    pub(super) tolerance: f64,
    pub(super) max_iterations: u32,
    pub(super) renewal: Renewal,
    pub(super) anderson: Anderson,
    pub(crate) budget: Budget,
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
        Ok(Self {
            tolerance,
            max_iterations,
            renewal: Renewal::default(),
            anderson: Anderson::default(),
            budget: Budget::Unlimited,
        })
    }

    pub(crate) fn tolerance(&self) -> f64 {
        self.tolerance
    }

    /// Solves the equations. On return the unknowns hold the solution; the last evaluation of the forces may be one
    /// correction before it.
    pub(crate) fn solve<E: Equations>(&mut self, solve: &mut Solve<'_, E>) -> Result<Solved, SolverError> {
        let attempt = Attempt::new(self.tolerance <= ROUND_OFF);
        self.begin(solve, self.renewal.start)?;
        match self.iterate(solve, attempt)? {
            Course::Solved(solved) => Ok(solved),
            Course::Stuck(iterations) => self.descend(solve, iterations),
        }
    }

    /// Iterates from the last evaluation of the equations with the current factor and, if needed, a few new ones.
    pub(super) fn iterate<E: Equations>(
        &mut self,
        solve: &mut Solve<'_, E>,
        mut attempt: Attempt,
    ) -> Result<Course, SolverError> {
        self.anderson.restart();
        if attempt.wanted.is_some() {
            // The attempt begins with a new factor.
        } else if !solve.inverse.is_for(solve.equations.coefficient()) {
            attempt.wanted = Some(Reason::New);
        } else if !solve.inverse.is_linear()
            && (self.renewal.is_stale(solve.inverse.costs()) || solve.inverse.has_cheaper_solver())
        {
            attempt.wanted = Some(Reason::Stale);
        } else {
            solve.inverse.rotate(solve.evaluator);
        }
        let has_merit = solve.equations.has_merit();
        for iteration in 1..=self.max_iterations {
            solve.check(self.budget)?;
            if let Some(reason) = attempt.wanted.take() {
                if attempt.troubles > FACTORS_BEFORE_DESCENT {
                    return Ok(Course::Stuck(iteration - 1));
                }
                solve.linearize()?;
                solve.factorize(reason)?;
                solve.evaluate()?;
                self.renewal.renew();
                self.anderson.restart();
                attempt.renew();
            }
            let mut decrement = solve.correct()?;
            solve.evaluator.work.newton_iterations += 1;
            attempt.with_factor += 1;
            let is_doubtful =
                |equations: &E| decrement > DOUBT_ABOVE * DOUBT_ABOVE * equations.energy_scale();
            if iteration == 1
                && self.renewal.is_hard()
                && !solve.inverse.is_linear()
                && is_doubtful(&solve.equations)
            {
                decrement = self.choose_start(solve, decrement)?;
            }
            if !solve.inverse.is_linear() || !solve.equations.model_is_exact() {
                // If the merit is searched along the correction, the correction must be a descent direction.
                let small = decrement <= SEARCH_ABOVE * SEARCH_ABOVE * solve.equations.energy_scale();
                let (delta, load) = solve.equations.correction();
                self.anderson.mix(delta, load, small || !has_merit);
            }
            if !attempt.is_renewed && solve.is_correction_too_long() {
                // The factor was made before the pairs that act here. To examine the path would take longer than a new one.
                attempt.escalate(Reason::Slow);
                continue;
            }
            let longest = solve.largest_step();
            solve.equations.advance(longest);
            let scale = solve.equations.energy_scale();
            let eta = relative_error(decrement, scale);
            let contraction = attempt.record(eta, solve.equations.transient_iterations());
            if longest == 1.0 && self.is_converged(solve, attempt.to_round_off, eta, contraction) {
                self.renewal.record(attempt.with_factor, attempt.mean_contraction());
                return Ok(Course::Solved(Solved { iterations: iteration }));
            }
            let diverges = contraction.is_some_and(|theta| theta > 2.0) || !eta.is_finite();
            let gone = if diverges { None } else { self.accept(solve, eta, decrement, longest).ok() };
            let Some(fraction) = gone else {
                // Start again, with a factor at the new place.
                attempt.escalate(Reason::Slow);
                self.begin(solve, attempt.safer_start())?;
                self.anderson.restart();
                continue;
            };
            self.anderson.advance(solve.equations.correction().0, fraction);
            self.consider_new_factor(solve, &mut attempt, eta);
        }
        Ok(Course::Stuck(self.max_iterations))
    }

    /// Restarts from the start with the smallest correction and corrects there; `decrement` is that of the current
    /// start.
    fn choose_start<E: Equations>(
        &mut self,
        solve: &mut Solve<'_, E>,
        decrement: f64,
    ) -> Result<f64, SolverError> {
        let (used, mut least) = (self.renewal.start, decrement);
        let mut last = used;
        for start in Start::ALL.into_iter().filter(|&start| start != used) {
            solve.start(start);
            last = start;
            if solve.evaluate().is_ok() {
                let decrement = solve.correct()?;
                solve.evaluator.work.newton_iterations += 1;
                if decrement.abs() < least.abs() {
                    (self.renewal.start, least) = (start, decrement);
                }
            }
        }
        if last != self.renewal.start {
            solve.start(self.renewal.start);
            solve.evaluate()?;
            least = solve.correct()?;
        }
        Ok(least)
    }

    /// Goes to the first start, from `first` on, at which the residual is finite.
    pub(super) fn begin<E: Equations>(
        &self,
        solve: &mut Solve<'_, E>,
        first: Start,
    ) -> Result<(), SolverError> {
        let from = Start::ALL.iter().position(|&start| start == first).unwrap_or(0);
        let mut outcome = Ok(());
        for &start in Start::ALL[from..].iter().chain(&Start::ALL[..from]) {
            solve.start(start);
            outcome = solve.evaluate();
            if outcome.is_ok() {
                break;
            }
        }
        outcome
    }

    pub(super) fn is_converged<E: Equations>(
        &self,
        solve: &Solve<'_, E>,
        to_round_off: bool,
        eta: f64,
        contraction: Option<f64>,
    ) -> bool {
        if eta == 0.0 || solve.equations.is_at_resolution() {
            return true;
        }
        if to_round_off {
            // Iterate until there is no more improvement.
            let stalled = if solve.equations.model_is_exact() { 0.5 } else { 0.9 };
            return eta < 1e-9 && contraction.is_some_and(|theta| theta > stalled);
        }
        if solve.inverse.is_linear() && solve.equations.model_is_exact() {
            // A solve of a linear system with its own factor is exact.
            return true;
        }
        let expected = self.renewal.expected_contraction();
        let contraction = match contraction {
            // A box that turns freely contracts by 1e-4, 1.4e-3 and 4e-5; by the first ratio alone, its energy was off by
            // 4e-11 in every step, always with the same sign.
            Some(last) if solve.equations.omits_curvature() => {
                Some(last.max(expected.unwrap_or(LEAST_CONTRACTION)))
            }
            last => last.or(expected),
        };
        is_within(self.tolerance, eta, contraction)
    }

    /// Evaluates at the fraction `longest` of the correction, or at less if that is too far; returns the fraction.
    fn accept<E: Equations>(
        &self,
        solve: &mut Solve<'_, E>,
        eta: f64,
        decrement: f64,
        longest: f64,
    ) -> Result<f64, SolverError> {
        let outcome = solve.evaluate();
        if outcome.is_ok() && (eta <= SEARCH_ABOVE || solve.equations.slope().abs() <= SLOPE_KEPT * decrement)
        {
            return Ok(longest);
        }
        solve.equations.advance(0.0);
        if let Some(before) = solve.merit() {
            line_search::search(solve, before, decrement, longest)
        } else {
            // Without a merit, only stay inside the domain of the terms.
            solve.equations.advance(longest);
            line_search::keep_inside(solve, longest)
        }
    }

    fn consider_new_factor<E: Equations>(&self, solve: &Solve<'_, E>, attempt: &mut Attempt, eta: f64) {
        if solve.inverse.is_linear() {
            // A new factor would be the same.
            return;
        }
        if attempt.to_round_off && solve.equations.model_is_exact() {
            // The last iterations keep the factor of a nearly converged iterate.
            if eta > 1e-7 {
                attempt.wanted = Some(Reason::Newton);
            }
            return;
        }
        let Some(theta) = attempt.mean_contraction() else { return };
        let least = solve.equations.least_contraction();
        if theta <= least {
            return;
        }
        if solve.equations.model_is_partial() && attempt.is_renewed && theta < STEADY {
            // A new factor would omit the same parts.
            return;
        }
        let remaining = if theta < 1.0 {
            ((self.tolerance * (1.0 - theta) / eta).ln() / theta.ln()).max(0.0)
        } else {
            f64::INFINITY
        };
        if !self.renewal.is_slow(solve.inverse.costs(), attempt.with_factor, remaining) {
            return;
        }
        let is_near = attempt.first_eta <= DOUBT_ABOVE || theta < STEADY;
        if least > 0.0 && attempt.is_renewed && is_near && theta < 1.0 {
            // For stages with one K, a factor made near the solution is as good as any.
            return;
        }
        attempt.escalate(Reason::Slow);
    }

    pub(crate) fn save(&self, memory: &mut StepperMemory) {
        self.renewal.save(memory);
    }

    pub(crate) fn restore(&mut self, memory: &StepperMemory) -> Result<(), SolverError> {
        self.renewal = Renewal::restore(memory)?;
        Ok(())
    }
}
