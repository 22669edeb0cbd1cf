//! The linear solver of an implicit step: a Cholesky factor or preconditioned conjugate gradients. The user or the counted work
//! decides between them (`decision`).

mod decision;

use std::sync::Arc;

use vi_core::{SharedSolve, SharedTerms, SolverFacts, System};

use crate::error::{NotPositiveDefinite, SolverError};
use crate::interrupt::Interrupt;
use crate::linear::cost::{self, UnitCosts};
use crate::linear::factor::{Factor, FactorFacts, SingleFactor};
use crate::linear::matrix::SymmetricMatrix;
use crate::linear::model::Model;
use crate::linear::pcg::{Pcg, usable};
use crate::linear::rivalry::Rivalry;
use crate::linear::trial::{describe, load_of_all_frequencies};
use crate::memory::StepperMemory;
use crate::options::{LinearSolver, SolverOptions};
use crate::work::Work;

/// Relative error of a solve by conjugate gradients in the energy norm. Newton's method corrects it.
const FORCING: f64 = 0.05;
/// Relative error of a solve while the caller subtracts solutions from each other.
const TIGHT: f64 = 1e-8;
/// Relative error of a solve that nothing corrects.
const EXACT: f64 = 1e-13;
/// Assumed iterations of a solve before the first one.
const FIRST_GUESS: f64 = 20.0;
/// Largest relative error of a solve with a factor in single precision; above it the factor is replaced by one in
/// double precision.
const SINGLE_LIMIT: f64 = 1e-2;
/// Smallest tolerance of Newton's method for which single precision is used.
const SINGLE_TOLERANCE: f64 = 1e-9;
/// Cost of a factor in single precision relative to one in double precision.
const SINGLE_COST: f64 = 0.55;
const NAMES: [&str; 4] = ["linear.pcg", "linear.single", "linear.iterations", "linear.solves"];
/// Name of the reason in a memory.
pub(crate) const REASON: &str = "linear.reason";
/// Largest number of iterations of a solve that Newton's method corrects.
const LONGEST: u32 = 400;
const LONGEST_EXACT: u32 = 20_000;

/// The way in which A⁻¹ is applied.
enum Path {
    Undecided,
    /// A factor in double precision.
    Factor(Box<Factor>),
    /// A factor in single precision.
    Single(Box<SingleFactor>),
    Gradients(Box<Pcg>),
    /// Conjugate gradients of several processes.
    Shared(Arc<dyn SharedTerms>),
}

/// The solver that was chosen, with its matrix A = M + cK.
pub(crate) struct ChosenSolver {
    choice: LinearSolver,
    path: Path,
    /// Whether single precision is allowed.
    may_be_single: bool,
    /// Whether a solve must be exact because nothing corrects its error.
    is_exact: bool,
    /// For a continued run: whether the earlier run used conjugate gradients, and whether it used single precision.
    continued: Option<[bool; 2]>,
    /// Whether the caller subtracts solutions from each other, so that solves need the tolerance `TIGHT`.
    is_tight: bool,
    costs: UnitCosts,
    /// The reason for this path, in words.
    reason: String,
    x: Vec<f64>,
    /// Total iterations of all solves by conjugate gradients, and the number of these solves.
    iterations: [u64; 2],
    pcg: SolverFacts,
    rivalry: Rivalry,
    /// Number of times that ordering and layout were computed.
    analyses: u64,
    interrupt: Interrupt,
}

impl ChosenSolver {
    /// Returns a solver without a matrix. Set `is_exact` if nothing corrects the error of a solve.
    pub(crate) fn new(options: &SolverOptions, is_exact: bool) -> Self {
        Self {
            choice: options.linear,
            may_be_single: !is_exact && options.tolerance >= SINGLE_TOLERANCE,
            path: Path::Undecided,
            is_exact,
            continued: None,
            is_tight: false,
            costs: UnitCosts::default(),
            reason: String::new(),
            x: Vec::new(),
            iterations: [0; 2],
            pcg: SolverFacts::default(),
            rivalry: Rivalry::default(),
            analyses: 0,
            interrupt: options.interrupt.clone(),
        }
    }

    pub(crate) fn costs(&self) -> &UnitCosts {
        &self.costs
    }

    /// Returns the cost of a factor, s of the reference core, whatever solver was chosen; `None` if it is not known.
    pub(crate) fn factor_cost(&self) -> Option<f64> {
        match self.path {
            Path::Factor(_) | Path::Single(_) => Some(self.costs.factor),
            Path::Gradients(_) => Some(self.rivalry.factor[0]).filter(|cost| *cost > 0.0),
            Path::Undecided | Path::Shared(_) => None,
        }
    }

    /// Returns which solver was chosen and why; empty before the first A.
    pub(crate) fn reason(&self) -> &str {
        &self.reason
    }

    /// Returns whether a factor of a new matrix would be cheaper than to go on with conjugate gradients.
    pub(crate) fn has_cheaper_solver(&self) -> bool {
        matches!(self.path, Path::Gradients(_))
            && self.rivalry.prefers_factor([self.costs.factor, self.costs.solve])
    }

    pub(crate) fn is_ready(&self) -> bool {
        !matches!(self.path, Path::Undecided)
    }

    /// Returns whether the solver is chosen, by this run or by the run that it continues.
    pub(crate) fn is_chosen(&self) -> bool {
        self.is_ready() || self.continued.is_some()
    }

    /// Tightens the tolerance while solutions are differenced.
    pub(crate) fn tighten(&mut self, tight: bool) {
        self.is_tight = tight;
    }

    pub(crate) fn save(&self, memory: &mut StepperMemory) {
        let made = || {
            let gradients = matches!(self.path, Path::Gradients(_) | Path::Shared(_));
            [gradients, matches!(self.path, Path::Single(_))]
        };
        let [gradients, single] = self.continued.unwrap_or_else(made).map(u64::from);
        for (name, value) in
            NAMES.into_iter().zip([gradients, single, self.iterations[0], self.iterations[1]])
        {
            memory.counts.push((name.to_owned(), value));
        }
        memory.texts.push((REASON.to_owned(), self.reason.clone()));
        self.rivalry.save(memory);
    }

    /// Discards the choice of a solver and its data, as before the first matrix A.
    pub(crate) fn forget(&mut self) {
        let Self { choice, may_be_single, is_exact, .. } = *self;
        let interrupt = std::mem::take(&mut self.interrupt);
        let options = SolverOptions { linear: choice, interrupt, ..Default::default() };
        *self = Self { may_be_single, ..Self::new(&options, is_exact) };
    }

    /// Returns whether the run with this memory had chosen its solver.
    pub(crate) fn is_in(memory: &StepperMemory) -> bool {
        memory.count(NAMES[0]).is_ok()
    }

    /// Takes the path that an earlier run took.
    pub(crate) fn restore(&mut self, memory: &StepperMemory) -> Result<(), SolverError> {
        let [gradients, single, total, solves] = NAMES.map(|name| memory.count(name));
        self.path = Path::Undecided;
        self.continued = Some([gradients? == 1, single? == 1]);
        self.iterations = [total?, solves?];
        memory.text(REASON)?.clone_into(&mut self.reason);
        self.rivalry = Rivalry::restore(memory)?;
        Ok(())
    }

    /// Takes a matrix A = M + cK.
    pub(crate) fn make(
        &mut self,
        system: &System,
        model: Model<'_>,
        work: &mut Work,
    ) -> Result<(), SolverError> {
        let Model { mass, c, k, positions } = model;
        if !self.is_ready() {
            self.decide(system, model, work)?;
            self.analyses += 1;
        } else if self.rivalry.is_due() && self.choice == LinearSolver::Auto && !self.is_exact {
            self.compare(system, model, work)?;
        }
        if !self.has_pattern_of(k) {
            self.analyze(k)?;
            self.analyses += 1;
        }
        let made = match &mut self.path {
            Path::Undecided | Path::Shared(_) => Err(SolverError::NotFactored),
            Path::Factor(factor) => return Ok(factor.factorize(mass, c, k)?),
            Path::Single(factor) => {
                factor.factorize(mass, c, k)?;
                work.solves += 1;
                let left = factor.relative_residual(&load_of_all_frequencies(system.free_mass()))?;
                if left <= SINGLE_LIMIT {
                    return Ok(());
                }
                work.factorizations += 1;
                self.double(&format!("in single precision a solve has a relative error of {left:.1e}"));
                return self.make(system, model, work);
            }
            Path::Gradients(pcg) => {
                let made = pcg.prepare(mass, c, k, positions).map(|_| ()).map_err(SolverError::from);
                self.pcg = pcg.facts();
                self.costs.factor = cost::preparation(&self.pcg);
                made
            }
        };
        match made {
            Err(SolverError::NotPositiveDefinite(_)) if self.choice == LinearSolver::Auto => {
                // A pivot of the preconditioner failed. A factor shows whether A itself is indefinite.
                self.take_factor(system, k, "conjugate gradients found no preconditioner")?;
                self.make(system, model, work)
            }
            other => other,
        }
    }

    /// Recomputes ordering and layout for the pattern of k with the same solver.
    fn analyze(&mut self, k: &SymmetricMatrix) -> Result<(), SolverError> {
        self.path = match &self.path {
            Path::Undecided => Path::Undecided,
            Path::Factor(_) => Path::Factor(Box::new(Factor::new(k)?)),
            Path::Single(_) => Path::Single(Box::new(Factor::new(k)?.into_precision())),
            Path::Gradients(_) => Path::Gradients(Box::new(self.gradients(k))),
            Path::Shared(shared) => Path::Shared(Arc::clone(shared)),
        };
        Ok(())
    }

    /// Returns whether ordering and layout belong to the pattern of k.
    fn has_pattern_of(&self, k: &SymmetricMatrix) -> bool {
        match &self.path {
            Path::Undecided => false,
            Path::Factor(factor) => factor.has_pattern_of(k),
            Path::Single(factor) => factor.has_pattern_of(k),
            Path::Gradients(pcg) => pcg.has_pattern_of(k),
            Path::Shared(_) => true,
        }
    }

    /// Returns the number of times that ordering and layout were computed.
    pub(crate) fn analyses(&self) -> u64 {
        self.analyses
    }

    /// Switches from single to double precision for all later solves; returns whether it was single.
    pub(crate) fn double(&mut self, why: &str) -> bool {
        match std::mem::replace(&mut self.path, Path::Undecided) {
            Path::Single(factor) => self.path = Path::Factor(Box::new(factor.into_precision())),
            other => {
                self.path = other;
                return false;
            }
        }
        let facts = self.facts();
        self.costs.factor /= SINGLE_COST;
        self.costs.solve = cost::substitution(&facts);
        self.reason = format!("{}; {why}", describe(&facts, false));
        true
    }

    fn facts(&self) -> FactorFacts {
        match &self.path {
            Path::Factor(factor) => factor.facts(),
            Path::Single(factor) => factor.facts(),
            Path::Undecided | Path::Gradients(_) | Path::Shared(_) => FactorFacts::default(),
        }
    }

    /// Returns an error if the step in progress is to be abandoned.
    pub(crate) fn check_interrupt(&self) -> Result<(), SolverError> {
        self.interrupt.check()
    }

    /// Computes v ← A⁻¹v.
    ///
    /// # Errors
    /// Returns the error of the solver, or [`SolverError::Interrupted`]: each iteration of a step solves.
    pub(crate) fn apply(&mut self, v: &mut [f64], work: &mut Work) -> Result<(), SolverError> {
        self.check_interrupt()?;
        let Self { path, x, is_exact, is_tight, .. } = self;
        let (tolerance, longest) = match (*is_exact, *is_tight) {
            (true, _) => (EXACT, LONGEST_EXACT),
            (false, true) => (TIGHT, LONGEST),
            (false, false) => (FORCING, LONGEST),
        };
        self.rivalry.solves += 1;
        let made = match path {
            Path::Undecided => return Err(SolverError::NotFactored),
            Path::Factor(factor) if *is_exact => return factor.solve(v).map(|_| ()),
            // Newton's own residual serves as the check.
            Path::Factor(factor) => return factor.solve_unchecked(v),
            Path::Single(factor) if *is_tight => {
                work.solves += factor.solve_refined(v, TIGHT)? - 1;
                return Ok(());
            }
            Path::Single(factor) => return factor.solve_unchecked(v),
            Path::Gradients(pcg) => {
                x.resize(v.len(), 0.0);
                let made = pcg.solve(v, x, tolerance, longest).map(|report| report.iterations);
                let made = usable(made, *is_exact)?;
                v.copy_from_slice(x);
                made
            }
            Path::Shared(shared) => {
                let made = match shared.solve(v, tolerance, longest) {
                    SharedSolve::Converged { iterations } => Ok(iterations),
                    SharedSolve::Negative { iterations, curvature } => {
                        Err(SolverError::NegativeCurvature { iterations, curvature })
                    }
                    SharedSolve::TooMany { iterations, residual } => {
                        Err(SolverError::ConjugateGradients { iterations, residual, tolerance })
                    }
                };
                usable(made, *is_exact)?
            }
        };
        self.count_iterations(made, work);
        Ok(())
    }

    /// Counts a solve by conjugate gradients.
    fn count_iterations(&mut self, made: u32, work: &mut Work) {
        work.pcg_iterations += u64::from(made);
        self.iterations[0] += u64::from(made);
        self.iterations[1] += 1;
        self.costs.solve = self.mean_solve();
    }

    /// Takes A = M + cK of terms that several processes share and solve with together, at positions `x` (m, all
    /// coordinates) and time t. If `is_projected`, K is.
    pub(crate) fn make_shared(
        &mut self,
        (system, shared): (&System, &Arc<dyn SharedTerms>),
        (x, t): (&[f64], f64),
        c: f64,
        is_projected: bool,
    ) -> Result<(), SolverError> {
        let (facts, indefinite) = shared.prepare(x, t, [1.0, c], is_projected);
        self.pcg = facts;
        if self.is_ready() {
            self.rivalry.is_due();
            self.costs.factor = cost::preparation(&self.pcg);
        } else {
            let earlier = self.continued.take().map(|_| std::mem::take(&mut self.reason));
            self.enter_gradients(system, "asked for");
            self.reason = earlier.unwrap_or_else(|| std::mem::take(&mut self.reason));
            self.path = Path::Shared(Arc::clone(shared));
            self.analyses += 1;
        }
        indefinite.map_or(Ok(()), |free| Err(NotPositiveDefinite { free }.into()))
    }

    /// Returns the mean cost of a solve by conjugate gradients so far.
    fn mean_solve(&self) -> f64 {
        let mean = match self.iterations {
            [_, 0] => FIRST_GUESS,
            [total, solves] => total as f64 / solves as f64,
        };
        (mean + 1.0) * cost::iteration(&self.pcg)
    }
}
