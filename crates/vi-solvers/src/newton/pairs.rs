//! Newton's method for steps in which live terms act pair by pair, with the complete tangents of the pairs: J = A + E,
//! where A is the symmetric model that has a factor, and E holds what A lacks: how friction follows pressure, and how
//! pairs have changed since A was factored. GMRES solves (I + A⁻¹E) δ = −A⁻¹R. If a correction would move pairs through
//! each other, the nodes of these pairs make only a part of it, and all others make the whole correction.
//!
//! Newton's method can alternate without end between states in which friction slides to and fro. Three measures prevent it:
//! a pair whose direction of sliding reverses from one iteration to the next is taken to stick in that iteration
//! ([`vi_core::Acting::reverses`]). If this is not enough, a second attempt begins with soft bristles, which stick over
//! a wide range of slip, and makes them stiffer from stage to stage; and a third does so from the free motion.

use crate::assemble::evaluator::Evaluator;
use crate::assemble::pairs::Pairs;
use crate::error::SolverError;
use crate::linear::gmres;
use crate::newton::attempt::{ROUND_OFF, Solved, is_within};
use crate::newton::equations::{Equations, Solve};
use crate::newton::inverse::{Inverse, Reason};
use crate::newton::solver::Newton;
use crate::newton::start::Start;
use crate::vectors;

/// Relative error to which J δ = −R is solved.
const FORCING: f64 = 1e-4;
/// Largest number of products with J per iteration.
const MOST_PRODUCTS: usize = 60;
/// Largest number of iterations of a plain attempt. Those that converge need two to eight, and more if paths cut
/// corrections short.
const PLAIN_ITERATIONS: u32 = 30;
/// The stiffness of bristles in the first stage of the second attempt, and the ratio of that of a stage to the one before
/// it; after a failed stage the ratio is smaller.
const SOFT: f64 = 1e-2;
const SOFTEST: f64 = 1e-4;
/// Stages that need no more iterations than this did not change the state of friction.
const SAME: u32 = 2;
const LARGEST_RATIO: f64 = 10.0;
const SMALLEST_RATIO: f64 = 1.2;
/// The error to which a stage is solved, and its largest number of iterations. Those that converge need two to five.
const STAGE_TOLERANCE: f64 = 1e-3;
const STAGE_ITERATIONS: u32 = 15;
/// A series ends without success after this many iterations whose errors and residuals are not below the fraction `GAIN`
/// of the least ones before.
const IDLE: u32 = 4;
const GAIN: f64 = 0.5;
/// Smallest fraction of a correction that the line search tries.
const SHORTEST: f64 = 1.0 / 64.0;
/// Equations in which live terms act pair by pair.
pub(crate) trait PairEquations: Equations {
    /// Returns E v at the last evaluation, where A is the model that `inverse` holds; `None` if E is zero.
    fn pair_defect(&self, inverse: &Inverse, evaluator: &Evaluator, v: &[f64]) -> Option<Vec<f64>>;
    /// Computes the change of δ that a change v of −R causes, v ← A⁻¹v, without a change of the equations.
    fn solve_change(
        &mut self,
        inverse: &mut Inverse,
        evaluator: &mut Evaluator,
        v: &mut [f64],
    ) -> Result<(), SolverError>;
    /// Adds to the last correction δ the change that a change r of −R causes. Returns the energy δᵀAδ/c, J.
    fn add_change(
        &mut self,
        inverse: &mut Inverse,
        evaluator: &mut Evaluator,
        r: &[f64],
    ) -> Result<f64, SolverError>;
    /// Shortens the last correction node by node: to the length `longest` (m), and until no pair meets on its path.
    /// Returns whether it was not shortened.
    fn limit_nodes(&mut self, evaluator: &mut Evaluator, longest: f64) -> bool;
    /// Moves the start of the iteration, node by node, to where no pair meets on the path from the beginning of the
    /// step.
    fn limit_start(&mut self, evaluator: &mut Evaluator);
    /// Returns a bound on the length of sensible corrections, m. Much longer ones would make candidates of all pairs.
    fn longest_correction(&self, evaluator: &Evaluator) -> f64;
}

/// The aim of a series of iterations.
#[derive(Clone, Copy)]
struct Aim {
    tolerance: f64,
    most: u32,
    /// Whether the solution is only a start for the next stage.
    is_stage: bool,
}

impl Newton {
    /// Solves the equations; see the head of this file. On return the unknowns hold the solution.
    pub(crate) fn solve_pairs<E: PairEquations>(
        &mut self,
        solve: &mut Solve<'_, E>,
    ) -> Result<Solved, SolverError> {
        let mut done = 0;
        let outcome = self.plain_then_softened(solve, &mut done);
        solve.evaluator.end_pairs();
        outcome.map(|()| Solved { iterations: done })
    }

    fn plain_then_softened<E: PairEquations>(
        &mut self,
        solve: &mut Solve<'_, E>,
        done: &mut u32,
    ) -> Result<(), SolverError> {
        let tolerance = self.tolerance;
        let plain = Aim { tolerance, most: PLAIN_ITERATIONS.min(self.max_iterations), is_stage: false };
        if !self.renewal.has_descended {
            self.begin_pairs(solve, self.renewal.start);
            if self.iterate_pairs(solve, plain, done).is_ok() {
                return Ok(());
            }
        }
        solve.evaluator.work.softenings += 1;
        let first = self.renewal.start;
        let outcome = self
            .stiffen(solve, first, SOFT, done)
            .or_else(|_| self.stiffen(solve, first, SOFTEST, done))
            .or_else(|_| self.stiffen(solve, Start::Inertial, SOFTEST, done));
        // If friction was as soft as it is stiff, the next step begins without softening.
        self.renewal.has_descended = !outcome?;
        Ok(())
    }

    /// Solves with bristles that become stiffer from stage to stage, from the fraction `softest` on. Returns whether the
    /// stages made no difference.
    fn stiffen<E: PairEquations>(
        &mut self,
        solve: &mut Solve<'_, E>,
        start: Start,
        softest: f64,
        done: &mut u32,
    ) -> Result<bool, SolverError> {
        let most = STAGE_ITERATIONS.min(self.max_iterations);
        self.begin_pairs(solve, start);
        // Stiffness of the last solution, and the ratio of the next to it.
        let (mut reached, mut ratio) = (softest / LARGEST_RATIO, LARGEST_RATIO);
        let mut is_same = true;
        loop {
            let stiffness = (ratio * reached).min(1.0);
            solve.evaluator.set_bristle_stiffness(stiffness);
            let is_stage = stiffness < 1.0;
            let tolerance = if is_stage { STAGE_TOLERANCE } else { self.tolerance };
            let place = solve.equations.unknowns().to_vec();
            let before = *done;
            let outcome = self.iterate_pairs(solve, Aim { tolerance, most, is_stage }, done);
            is_same &= reached < softest || *done - before <= SAME;
            match outcome {
                Ok(()) if !is_stage => return Ok(is_same),
                Ok(()) => (reached, ratio) = (stiffness, (ratio * ratio).min(LARGEST_RATIO)),
                Err(_) if reached >= softest && ratio > SMALLEST_RATIO => {
                    solve.equations.go_to(&place);
                    ratio = ratio.sqrt();
                }
                Err(error) => return Err(error),
            }
        }
    }

    fn begin_pairs<E: PairEquations>(&self, solve: &mut Solve<'_, E>, start: Start) {
        solve.evaluator.begin_pairs(solve.system);
        solve.equations.start(start);
        solve.equations.limit_start(solve.evaluator);
    }

    /// Iterates from the unknowns to the aim.
    fn iterate_pairs<E: PairEquations>(
        &mut self,
        solve: &mut Solve<'_, E>,
        aim: Aim,
        done: &mut u32,
    ) -> Result<(), SolverError> {
        let mut last: Option<f64> = None;
        let mut wanted = self.factor_for_pairs(solve);
        let (mut solves, mut eta) = (0, f64::INFINITY);
        let (mut least, mut idle) = ([f64::INFINITY; 2], 0);
        solve.evaluate()?;
        let longest = solve.equations.longest_correction(solve.evaluator);
        for _ in 0..aim.most {
            if let Some(reason) = wanted.take() {
                solve.linearize()?;
                solve.factorize(reason)?;
                self.renewal.renew();
                solves = 0;
            }
            let size = solve.correct()?;
            let (energy, products) = complete(solve, size)?;
            solves += products + 1;
            *done += 1;
            solve.evaluator.work.newton_iterations += 1;
            let is_whole = solve.equations.limit_nodes(solve.evaluator, longest);
            solve.equations.advance(1.0);
            let scale = solve.equations.energy_scale();
            eta = if energy == 0.0 { 0.0 } else { (energy.abs() / scale).sqrt() };
            if !eta.is_finite() {
                break;
            }
            let contraction = last.map(|last| eta / last);
            let reverses = solve.evaluator.pairs().is_some_and(Pairs::has_reversals);
            let is_met = match aim.is_stage {
                true => eta <= aim.tolerance,
                false => is_close(eta, contraction, aim.tolerance),
            };
            let is_met = is_met || solve.equations.is_at_resolution();
            if is_whole && !reverses && is_met {
                self.renewal.record(solves as u64, None);
                return Ok(());
            }
            // Out of a stiff layer, corrections grow at first while the residual decreases.
            let gains = eta < GAIN * least[0] || size < GAIN * least[1];
            least = [least[0].min(eta), least[1].min(size)];
            // An iteration that a path cut short may lead far away from the solution without harm.
            idle = if gains { 0 } else { idle + u32::from(is_whole) };
            if idle == IDLE {
                break;
            }
            let fraction = approach(solve)?;
            last = (is_whole && !reverses && fraction == 1.0).then_some(eta);
            if solves as f64 > 2.0 + solve.inverse.costs().refactor() && products > 4 {
                wanted = Some(Reason::Slow);
            }
        }
        Err(SolverError::NoConvergence { iterations: aim.most, residual: eta, tolerance: aim.tolerance })
    }

    /// Returns why a new factor is needed before the first iteration; otherwise rotates the present one.
    fn factor_for_pairs<E: Equations>(&self, solve: &mut Solve<'_, E>) -> Option<Reason> {
        if !solve.inverse.is_for(solve.equations.coefficient()) {
            return Some(Reason::New);
        }
        if self.renewal.is_stale(solve.inverse.costs()) {
            return Some(Reason::Stale);
        }
        solve.inverse.rotate(solve.evaluator);
        None
    }
}

/// Evaluates at the end of the correction, or at less of it if that is outside the domain of a term. Returns the fraction.
fn approach<E: Equations>(solve: &mut Solve<'_, E>) -> Result<f64, SolverError> {
    let mut fraction = 1.0;
    loop {
        let outcome = solve.evaluate();
        if outcome.is_ok() || fraction <= SHORTEST {
            return outcome.map(|()| fraction);
        }
        fraction *= 0.5;
        solve.evaluator.work.line_searches += 1;
        solve.equations.advance(fraction);
    }
}

/// Returns whether an error, with the ratio to that of the iteration before, meets the tolerance.
fn is_close(eta: f64, contraction: Option<f64>, tolerance: f64) -> bool {
    // To round-off: until there is no more improvement.
    let has_stalled =
        tolerance <= ROUND_OFF && eta < 1e-9 && contraction.is_some_and(|theta| theta > 0.5 && theta < 1.0);
    eta == 0.0 || has_stalled || is_within(tolerance, eta, contraction)
}

/// Replaces the correction −A⁻¹R, whose energy is `first`, by δ = −(A + E)⁻¹R. Returns the energy δᵀJδ/c, J, and the
/// number of products.
fn complete<E: PairEquations>(solve: &mut Solve<'_, E>, first: f64) -> Result<(f64, usize), SolverError> {
    let Solve { evaluator, inverse, equations, .. } = solve;
    let b = equations.correction().0.to_vec();
    let product = |v: &[f64]| {
        let mut image = v.to_vec();
        if let Some(mut change) = equations.pair_defect(inverse, evaluator, v) {
            equations.solve_change(inverse, evaluator, &mut change)?;
            vectors::update(&mut image, |k, value| *value += change[k]);
        }
        Ok::<_, SolverError>(image)
    };
    let (delta, products) = gmres::solve(product, &b, FORCING, MOST_PRODUCTS)?;
    match equations.pair_defect(inverse, evaluator, &delta) {
        Some(mut change) => {
            vectors::update(&mut change, |_, value| *value = -*value);
            let by_model = equations.add_change(inverse, evaluator, &change)?;
            let c = equations.coefficient();
            let delta = equations.correction().0;
            // δᵀJδ = δᵀAδ + δᵀEδ. The model alone may be much too soft where pairs have come closer.
            Ok((by_model - vectors::dot(&change, delta) / c, products + 1))
        }
        None => Ok((first, products)),
    }
}
