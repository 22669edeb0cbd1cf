//! Decides between a factor and conjugate gradients: before the first solve by the size of the factor and one trial solve, later
//! by the work of the run so far. Records the costs of the chosen solver and the reason for it.

use vi_core::System;

use super::{ChosenSolver, FORCING, Path, SINGLE_COST};
use crate::error::SolverError;
use crate::linear::cost::{self, UnitCosts};
use crate::linear::factor::{Factor, FactorFacts};
use crate::linear::matrix::SymmetricMatrix;
use crate::linear::model::Model;
use crate::linear::pcg::Pcg;
use crate::linear::pcg::block::Preconditioner;
use crate::linear::rivalry::SOLVES_PER_FACTOR;
use crate::linear::trial::{CONSIDER_FLOPS, describe, too_large, try_gradients};
use crate::options::LinearSolver;
use crate::work::Work;

impl ChosenSolver {
    /// Chooses by counted work: the cost of a factor, shared by the solves that use it, against that of conjugate
    /// gradients. One trial solve finds their number of iterations.
    pub(super) fn decide(
        &mut self,
        system: &System,
        model: Model<'_>,
        work: &mut Work,
    ) -> Result<(), SolverError> {
        let k = model.k;
        if let Some([gradients, _]) = self.continued {
            // The reason is that of the run that this one continues.
            let reason = std::mem::take(&mut self.reason);
            if gradients {
                self.continued = None;
                self.take_gradients(system, k, String::new());
            } else {
                self.take_factor(system, k, "")?;
            }
            self.reason = reason;
            return Ok(());
        }
        match self.choice {
            LinearSolver::Pcg => {
                self.take_gradients(system, k, "asked for".to_owned());
                return Ok(());
            }
            LinearSolver::Cholesky | LinearSolver::CholeskyDouble => {
                return self.take_factor(system, k, "asked for");
            }
            LinearSolver::Petsc => return Err(SolverError::no_petsc()),
            LinearSolver::Auto => {}
        }
        match Factor::new(k) {
            Ok(factor) => self.keep_factor(system, factor),
            Err(error @ SolverError::Symbolic { .. }) => {
                self.take_gradients(system, k, format!("a factor is not possible: {error}"));
                return Ok(());
            }
            Err(error) => return Err(error),
        }
        // Facts and costs of the factor if it were made.
        let (facts, costs) = (self.facts(), self.costs);
        self.rivalry.begin(Some(&costs));
        if let Some(why) = too_large(&facts) {
            self.rivalry.begin(None);
            self.take_gradients(system, k, why);
            return Ok(());
        }
        if facts.flops <= CONSIDER_FLOPS || self.is_exact {
            self.rivalry.begin(None);
            return Ok(());
        }
        let direct = costs.factor / SOLVES_PER_FACTOR + costs.solve;
        let flops = 1e-9 * facts.flops;
        if let Some([iterations, gradients]) = try_gradients(model, system.free_mass(), FORCING, direct, work)
        {
            let (gradients, direct) = (1e3 * gradients, 1e3 * direct);
            let why = format!(
                "a solve takes {iterations} iterations, {gradients:.1} ms of the reference core, against {direct:.1} ms \
                 with a factor of {flops:.0} Gflop"
            );
            self.take_gradients(system, k, why);
        }
        Ok(())
    }

    /// Compares the current solver with its rival by the work so far, and changes to it if it is cheaper.
    pub(super) fn compare(
        &mut self,
        system: &System,
        model: Model<'_>,
        work: &mut Work,
    ) -> Result<(), SolverError> {
        let k = model.k;
        let factor = self.rivalry.factor;
        let (matrices, solves) = (self.rivalry.matrices - 1, self.rivalry.solves);
        let costs = UnitCosts { factor: factor[0], solve: factor[1], ..self.costs };
        if matches!(self.path, Path::Gradients(_)) {
            if self.rivalry.is_more_expensive([self.costs.factor, self.costs.solve]) {
                let [total, count] = self.iterations;
                let mean = total as f64 / count as f64;
                let why = format!(
                    "conjugate gradients took {mean:.0} iterations per solve, with {matrices} matrices for {solves} solves"
                );
                self.take_factor(system, k, &why)?;
                self.rivalry.begin(Some(&costs));
            }
        } else {
            let preconditioner =
                cost::preparation(&Pcg::new(k, Preconditioner::BlockIncompleteCholesky).facts());
            let most = self.rivalry.largest_gradients(preconditioner);
            if most > 0.0
                && let Some([iterations, _]) = try_gradients(model, system.free_mass(), FORCING, most, work)
            {
                let why = format!(
                    "a solve takes {iterations} iterations, and factors were made for {matrices} matrices in {solves} solves"
                );
                self.iterations = [0; 2];
                self.take_gradients(system, k, why);
                self.rivalry.begin(Some(&costs));
            }
        }
        Ok(())
    }

    pub(super) fn take_factor(
        &mut self,
        system: &System,
        k: &SymmetricMatrix,
        why: &str,
    ) -> Result<(), SolverError> {
        self.keep_factor(system, Factor::new(k)?);
        self.reason = format!("{}; {why}", self.reason);
        Ok(())
    }

    /// Returns whether to use single precision: only if something corrects its error cheaply. It is not used for
    /// exact solves, for solves that find multipliers of constraints, or for tolerances near round-off, where it
    /// would cost one more iteration.
    fn prefers_single(&self, system: &System) -> bool {
        self.may_be_single && system.constraints().is_empty() && self.choice != LinearSolver::CholeskyDouble
    }

    /// Takes the path of a factor with its costs, in the precision that suits.
    fn keep_factor(&mut self, system: &System, factor: Factor) {
        let single = match self.continued.take() {
            Some([_, single]) => single,
            None => self.prefers_single(system),
        };
        self.path = if single {
            Path::Single(Box::new(factor.into_precision()))
        } else {
            Path::Factor(Box::new(factor))
        };
        let facts = self.facts();
        self.costs = UnitCosts::new(system, &facts);
        if single {
            self.costs.factor *= SINGLE_COST;
        }
        self.reason = describe(&facts, single);
    }

    fn take_gradients(&mut self, system: &System, k: &SymmetricMatrix, why: String) {
        let pcg = self.gradients(k);
        self.pcg = pcg.facts();
        self.enter_gradients(system, &why);
        self.path = Path::Gradients(Box::new(pcg));
    }

    /// Returns conjugate gradients for the pattern of k.
    pub(super) fn gradients(&self, k: &SymmetricMatrix) -> Pcg {
        Pcg::new(k, Preconditioner::BlockIncompleteCholesky).interruptible(self.interrupt.clone())
    }

    /// Records the costs of conjugate gradients and the reason for them.
    pub(super) fn enter_gradients(&mut self, system: &System, why: &str) {
        self.costs = UnitCosts::new(system, &FactorFacts::default());
        self.costs.solve = self.mean_solve();
        self.costs.factor = cost::preparation(&self.pcg);
        let name = if self.choice == LinearSolver::Petsc { self.choice } else { LinearSolver::Pcg }.name();
        self.reason = format!("{name}: {why}");
    }
}
