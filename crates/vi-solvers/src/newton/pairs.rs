//! Newton's method for steps in which live terms act pair by pair, with the complete tangents of the pairs: J = A + E,
//! where A is the symmetric model that has a factor, and E holds what A lacks: how friction follows pressure, and how
//! pairs have changed since A was factored. GMRES solves (I + A⁻¹E) δ = −A⁻¹R. Small systems need none of this: J, with the
//! exact K and the forces of constraints, is factored in every iteration. J is also factored in
//! later iterations of a step if GMRES needed more work than such a factor. While the error decreases fast enough, the factors of all but
//! the smallest systems are kept, and the iteration with the same factor is accelerated (`anderson`): what its tangents lack, such as how
//! friction turns with the surface, acts along few directions. Near a solution the tangents of pairs include the directions of normal forces.
//!
//! If a correction would move pairs through each other, the nodes of these pairs make only a part of it, and all others make
//! the whole correction. The iteration ends when the error is within the tolerance, or when the residual is no larger than
//! the round-off of positions times the tangents of the pairs: at rest no other criterion is ever met, because errors are
//! relative to the energy of the motion.
//!
//! The kink of friction is the subject of `soft_bristles`, and better starts of large systems that of `lagging`.

use crate::assemble::pairs::Pairs;
use crate::error::SolverError;
use crate::linear::perturbed::{self, Perturbed};
use crate::newton::attempt::{Solved, relative_error};
use crate::newton::budget::Budget;
use crate::newton::equations::{Equations, Solve};
use crate::newton::inverse::Reason;
use crate::newton::lagging;
use crate::newton::pair_equations::{PairEquations, begin_pairs};
use crate::newton::soft_bristles::{self, Aim, Attempt, Frictional, Iteration, Progress, Verdict};
use crate::newton::solver::Newton;
use crate::newton::start::Start;
use crate::vectors;

/// Relative error to which J δ = −R is solved.
const FORCING: f64 = 1e-4;
/// The largest number of equations and constraints whose complete tangent is factored. With 180 (ten rigid blocks) a step takes a
/// third of the time of GMRES. Scenes of `stress --contact`, at most about this size, gain in robustness; where time is lost was not
/// measured.
const MOST_DIRECT: usize = 1000;
/// The largest number of equations and constraints whose complete tangent is factored in every iteration. In systems of
/// up to `MOST_DIRECT` equations, factors are kept once the error is below `NEAR`; in larger systems, from the first
/// factor on. With this instead of factors in every iteration up to 1000, a sheet of 400 equations under a ball takes
/// 4.5 instead of 5.6 s, two sheets that are pulled between balls 9.8 instead of 12.3 s, twelve dominoes 5.7 instead of
/// 6.5 s. Without `NEAR`, a thin beam that folds takes .6 instead of .35 s, because more of its steps are divided; with
/// `NEAR` for all, two cloths that collide take 2.5 instead of 1.9 s. A stack of ten blocks (180) gains nothing, and
/// its forces at rest are off by 1.1e-8 instead of 9.7e-9 if its factors are kept.
const MOST_REFACTORED: usize = 200;
/// Cost of a factor of the complete tangent relative to one of the symmetric model, with which the products of GMRES are compared.
/// When one correction took more work in products, the later ones of the step are found by complete factors. They
/// are kept, and then need more iterations. Processor time of energy–momentum steps of 2 ms with friction (Xeon,
/// one thread) with 1.5, 3, 6, 12 and 25: cloth of 5043 equations on a ball 13.3, 13.0, 12.1, 10.8, 10.9 s; folding flag 12.9,
/// 13.3, 12.8, 14.0, 14.5 s; skirt 3.4, 3.0, 2.8, 2.5, 2.0 s. With general factors, jelly, cloth and ball together (1450
/// equations) took 58 s with GMRES alone and 15.5, 13.5 and 12.8 s with 3, 8 and 16.
const COMPLETE_FACTOR: f64 = 12.0;
/// The largest number of equations for which complete factors replace products. Factors by nested dissection take four times
/// the memory of one of the model in single precision. A cloth of 30 603 equations that falls on a ball takes 219 s for 40
/// energy–momentum steps of 2 ms, and 163 s for 16 steps of 5 ms by `backward-euler`; with products alone it had not ended after
/// 279 and 234 s.
const MOST_AFTER_PRODUCTS: usize = 100_000;
/// The same with constraints, whose general factors have more fill, and where the cost of a factor is not known, because the scene
/// demands conjugate gradients.
const MOST_IN_DOUBT: usize = 20_000;
/// Complete factors serve the next iteration too if the error decreased to less than this fraction. A cloth of
/// 5043 equations that falls on a ball takes 34, 24, 23 and 22 s of processor time for 70 steps with .1, .3, .5 and .7, and 1964,
/// 1620, 1699 and 1865 iterations.
const KEEPING: f64 = 0.3;
/// Relative errors below which the complete tangent contains the tangents of the directions of normal forces: if it is
/// factored, and if GMRES takes its products. The axis between a ball of .3 m and cells of 25 mm moves twelve times as
/// far over a cell as its nodes move, so without these tangents the iteration diverges near solutions. Seconds of
/// `backward-euler` for the cloth of 40 × 40 cells on that ball (μ = .1): 5 ms, .3 s of motion, 61 never, 45 with 3e-3,
/// 26 with .1; 10 ms, .2 s of motion, 22 with .1 and 29 with .3.
const NEAR: f64 = 3e-3;
const NEAR_BY_PRODUCTS: f64 = 0.1;
/// Largest number of iterations in a row without progress after passes with lagged friction. Series that converge need
/// two to six iterations.
const POLISHING: u32 = 10;
/// Smallest fraction of a correction that the line search tries.
const SHORTEST: f64 = 1.0 / 64.0;

/// A solve of equations with friction.
struct PairSeries<'a, 'b, E> {
    newton: &'a mut Newton,
    solve: &'a mut Solve<'b, E>,
    done: u32,
    /// Whether corrections are found by factors of the complete tangent from now on.
    becomes_direct: bool,
}

impl Newton {
    /// Solves the equations; see the head of this file. On return the unknowns hold the solution.
    pub(crate) fn solve_pairs<E: PairEquations>(
        &mut self,
        solve: &mut Solve<'_, E>,
    ) -> Result<Solved, SolverError> {
        let mut series = PairSeries { newton: self, solve, done: 0, becomes_direct: false };
        let outcome = series.solve();
        let iterations = series.done;
        solve.evaluator.end_pairs();
        outcome.map(|()| Solved { iterations })
    }

    /// Solves the equations of rigid bodies and joints alone, which have no pairs, with complete tangents, whose iteration is quadratic. If
    /// that fails, as it does where constraints depend on each other, solves them with the symmetric model.
    ///
    /// The symmetric model omits the curvature of the constraints, so that the error falls by (ωh)² per iteration, and stops falling at
    /// about 1e-9 with bodies that turn by .2 rad and more per step. A chain of 20 links and its first .5 s in steps of 5 ms take 1.1
    /// instead of 6.5 s, one of 40 links and .3 s 4.3 instead of 28.8 s. Where an elastic body is attached, its factor of 27 cells costs more
    /// than the iterations that it saves: 1.2 instead of .24 s.
    pub(crate) fn solve_mechanism<E: PairEquations>(
        &mut self,
        solve: &mut Solve<'_, E>,
    ) -> Result<Solved, SolverError> {
        match self.solve_pairs(solve) {
            Err(error) if !error.is_interruption() => self.solve(solve),
            outcome => outcome,
        }
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

impl<E: PairEquations> PairSeries<'_, '_, E> {
    /// Returns the extrapolation with the smaller residual. Accelerations may alternate from step to step: those of a body at
    /// rest in a stiff layer, and those along constraints.
    fn best_start(&mut self) -> Start {
        let Self { solve, .. } = self;
        let mut size = |start: Start| {
            begin_pairs(solve);
            solve.equations.start(start);
            solve.equations.limit_start(solve.evaluator);
            solve.evaluate().map_or(f64::INFINITY, |()| solve.equations.residual_size())
        };
        if size(Start::Stiff) < size(Start::Predicted) { Start::Stiff } else { Start::Predicted }
    }

    /// Solves from where passes with lagged friction end.
    fn solve_by_lagging(&mut self) -> Result<(), SolverError> {
        self.done += lagging::approach(self.newton, self.solve)?;
        let most = POLISHING.min(self.newton.max_iterations);
        self.iterate(Aim { tolerance: self.newton.tolerance, most, stiffness: 1.0, is_uniform: false })
    }

    /// Solves plainly or with lagged friction first, whichever solved the last step, and then in the other way.
    /// Equations that neither way solves are solved in stages.
    fn solve(&mut self) -> Result<(), SolverError> {
        let (start, tolerance) = (self.newton.renewal.start, self.newton.tolerance);
        let most = self.newton.max_iterations;
        let may_lag = !is_direct(self.solve) && self.solve.equations.can_lag(self.solve.evaluator);
        let ways: &[bool] = match (may_lag, self.newton.renewal.has_lagged) {
            (false, _) => &[false],
            (true, false) => &[false, true],
            (true, true) => &[true, false],
        };
        let mut failed = SolverError::NoConvergence { iterations: 0, residual: f64::INFINITY, tolerance };
        for &lags in ways {
            let outcome = match lags {
                true => self.solve_by_lagging(),
                false => soft_bristles::solve_plainly(self, start, tolerance, most),
            };
            match outcome {
                Ok(()) => {
                    self.newton.renewal.has_lagged = lags;
                    return Ok(());
                }
                Err(error) if error.is_interruption() => return Err(error),
                Err(error) if !lags => failed = error,
                Err(_) => {}
            }
        }
        let has_friction = self.solve.evaluator.pairs().is_some_and(Pairs::has_friction);
        let can_be_divided = matches!(self.newton.budget, Budget::Seconds(_));
        let attempts = Attempt::after_plain(start, can_be_divided, has_friction);
        self.solve.evaluator.work.softenings += u64::from(!attempts.is_empty());
        soft_bristles::solve_in_stages(self, &attempts, failed, tolerance, most)
    }
}

impl<E: PairEquations> Frictional for PairSeries<'_, '_, E> {
    fn begin(&mut self, start: Start) {
        let is_extrapolated = matches!(start, Start::Predicted | Start::Stiff);
        let start = if is_extrapolated && is_direct(self.solve) { self.best_start() } else { start };
        let Self { solve, .. } = self;
        begin_pairs(solve);
        solve.equations.start(start);
        solve.equations.limit_start(solve.evaluator);
    }

    fn unknowns(&self) -> Vec<f64> {
        self.solve.equations.unknowns().to_vec()
    }

    fn go_to(&mut self, unknowns: &[f64]) {
        self.solve.equations.go_to(unknowns);
    }

    fn iterate(&mut self, aim: Aim) -> Result<(), SolverError> {
        let Self { newton, solve, done, becomes_direct } = self;
        solve.evaluator.set_bristle_stiffness(aim.stiffness);
        let mut progress = Progress::towards(aim);
        let keeps_below = keeps_below(solve);
        let may_keep = keeps_below > 0.0;
        let mut is_direct = *becomes_direct || is_direct(solve);
        let mut wanted = if is_direct { None } else { newton.factor_for_pairs(solve) };
        // Whether the next iteration uses the same factors as the last one, so that it can be accelerated.
        let mut is_steady = false;
        let (mut solves, mut products, mut eta) = (0, 0, f64::INFINITY);
        // The number of products with a new factor of the model.
        let mut with_new = None;
        solve.evaluator.set_turns(false);
        solve.evaluator.set_penalty(progress.penalty());
        solve.evaluate()?;
        let longest = solve.equations.longest_correction(solve.evaluator);
        loop {
            // Solves with factors of the complete tangent do not check for an interruption, unlike those with the
            // inverse.
            solve.inverse.check_interrupt()?;
            let energy;
            let was_direct = is_direct;
            if is_direct {
                if !is_steady {
                    solve.linearize()?;
                    solve.equations.factor_completely(solve.evaluator)?;
                }
                energy = solve.equations.correct_completely(solve.evaluator)?;
            } else {
                if let Some(reason) = wanted.take() {
                    solve.linearize()?;
                    solve.factorize(reason)?;
                    newton.renewal.renew();
                    (solves, with_new, is_steady) = (0, None, false);
                }
                let first = solve.correct()?;
                (energy, products) = complete(solve, first)?;
                if solves == 0 {
                    with_new = Some(products);
                }
                solves += products + 1;
                if is_direct_cheaper(solve, products) {
                    (*becomes_direct, is_direct) = (true, true);
                }
            }
            let size = solve.equations.load_size();
            *done += 1;
            solve.evaluator.work.newton_iterations += 1;
            if may_keep {
                if !is_steady {
                    newton.anderson.restart();
                }
                let (delta, load) = solve.equations.correction();
                newton.anderson.mix(delta, load, true);
            }
            let round_off = solve.equations.round_off(solve.evaluator);
            let is_whole = solve.equations.limit(solve.evaluator, longest, aim.is_uniform);
            solve.equations.advance(1.0);
            let scale = solve.equations.energy_scale();
            let last = std::mem::replace(&mut eta, relative_error(energy, scale));
            let unlawful = solve.evaluator.pairs().and_then(Pairs::unlawful);
            let needs_forces = progress.needs_forces(eta, unlawful);
            let forces = if needs_forces { solve.equations.forces_size(solve.evaluator) } else { 0.0 };
            let verdict = progress.judge(&Iteration {
                eta,
                size,
                is_whole,
                unlawful,
                forces,
                round_off,
                is_at_resolution: solve.equations.is_at_resolution(),
            });
            match verdict {
                Verdict::Solved => {
                    if !is_direct {
                        newton.renewal.record(solves as u64, None);
                    }
                    newton.renewal.has_descended = false;
                    return Ok(());
                }
                Verdict::Hopeless => break,
                Verdict::Continue => {}
            }
            solve.evaluator.set_penalty(progress.penalty());
            solve.evaluator.set_turns(eta < if is_direct { NEAR } else { NEAR_BY_PRODUCTS });
            let end_per_stage = solve.equations.end_per_stage();
            let (delta, _) = solve.equations.correction();
            newton.anderson.advance(delta, 1.0);
            solve.evaluator.predict_tractions(end_per_stage, delta);
            let contracts = eta < KEEPING * last;
            let is_made = approach(solve, progress.part())? == 1.0;
            if !is_made {
                progress.interrupt();
            }
            let is_lawful = |unlawful: Option<usize>| unlawful.is_none_or(|count| count == 0);
            let remain = solve.evaluator.pairs().and_then(Pairs::unlawful);
            let is_smooth = is_whole && is_made && is_lawful(unlawful) && is_lawful(remain);
            is_steady = eta < keeps_below && contracts && is_smooth && is_direct == was_direct;
            let may_gain = !contracts || with_new.is_none_or(|with_new| products > 2 * with_new);
            if solves as f64 > 2.0 + solve.inverse.costs().refactor() && products > 4 && may_gain {
                wanted = Some(Reason::Slow);
            }
        }
        Err(SolverError::NoConvergence { iterations: aim.most, residual: eta, tolerance: aim.tolerance })
    }
}

/// Returns the error below which factors of the complete tangent may serve the next iteration too.
fn keeps_below<E: PairEquations>(solve: &Solve<'_, E>) -> f64 {
    match solve.equations.complete_size() {
        // Such factors cost little more than an evaluation of the residual.
        Some(size) if size <= MOST_REFACTORED => 0.0,
        Some(size) if size <= MOST_DIRECT => NEAR,
        _ => f64::INFINITY,
    }
}

/// Returns whether corrections are found by factors of the complete tangent: those of few equations, and of mechanisms of any size, whose
/// factors stay sparse.
fn is_direct<E: PairEquations>(solve: &Solve<'_, E>) -> bool {
    let has_pairs = solve.evaluator.acts_over_steps();
    solve.equations.complete_size().is_some_and(|size| size <= MOST_DIRECT || !has_pairs)
}

/// Returns whether a factor of the complete tangent costs less than a correction that took this number of products.
fn is_direct_cheaper<E: PairEquations>(solve: &Solve<'_, E>, products: usize) -> bool {
    let (known, costs, size) =
        (solve.inverse.factor_cost(), solve.inverse.costs(), solve.equations.complete_size());
    let Some(size) = size else { return false };
    let is_constrained = size > solve.equations.unknowns().len();
    let most = if is_constrained || known.is_none() { MOST_IN_DOUBT } else { MOST_AFTER_PRODUCTS };
    size <= most && products as f64 * costs.solve > COMPLETE_FACTOR * known.unwrap_or(costs.factor)
}

/// Makes the given fraction of the correction, or a smaller one if that leaves the domain of a term, and evaluates the
/// residual there. Returns the fraction.
fn approach<E: Equations>(solve: &mut Solve<'_, E>, part: f64) -> Result<f64, SolverError> {
    let mut fraction = part;
    if fraction < 1.0 {
        solve.equations.advance(fraction);
    }
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

/// The equations of a correction δ, and the energy −R·δ/c of the part of δ that is solved so far, J.
struct Correction<'a, 'b, E> {
    solve: &'a mut Solve<'b, E>,
    energy: f64,
}

impl<E: PairEquations> Perturbed for Correction<'_, '_, E> {
    type Error = SolverError;

    fn defect(&mut self, v: &[f64]) -> Option<Vec<f64>> {
        let Solve { evaluator, inverse, equations, .. } = &*self.solve;
        equations.pair_defect(inverse, evaluator, v)
    }

    fn invert(&mut self, v: &mut [f64]) -> Result<(), SolverError> {
        let Solve { evaluator, inverse, equations, .. } = &mut *self.solve;
        equations.solve_change(inverse, evaluator, v)
    }

    fn add(&mut self, r: &[f64]) -> Result<(), SolverError> {
        let Solve { evaluator, inverse, equations, .. } = &mut *self.solve;
        self.energy = equations.add_change(inverse, evaluator, r)?;
        Ok(())
    }

    fn solution(&mut self) -> &[f64] {
        self.solve.equations.correction().0
    }
}

/// Replaces the correction −A⁻¹R, whose energy is `first`, by δ = −(A + E)⁻¹R. Returns the energy δᵀJδ/c, J, and the
/// number of products.
fn complete<E: PairEquations>(solve: &mut Solve<'_, E>, first: f64) -> Result<(f64, usize), SolverError> {
    let size = vectors::norm(solve.equations.correction().1);
    let mut correction = Correction { solve, energy: first };
    let products = perturbed::solve(&mut correction, size, FORCING)?;
    Ok((correction.energy, products))
}
