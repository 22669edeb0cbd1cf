//! A search for equilibria in progress: the body, the options, and the results so far.

use vi_core::{State, System};

use crate::equilibrium::balance::Balance;
use crate::equilibrium::constrained::ConstraintForces;
use crate::equilibrium::newton::Stop;
use crate::equilibrium::options::{LoadStep, StaticOptions, StaticReport};
use crate::equilibrium::release;
use crate::error::SolverError;
use crate::options::LinearSolver;

/// A search for equilibria in progress.
pub(crate) struct Search<'a> {
    pub(crate) balance: Balance<'a>,
    /// The constraints, if there are any; the balance then has potentials in place of them.
    pub(super) constraints: Option<ConstraintForces>,
    pub(super) options: &'a StaticOptions,
    pub(super) stop: Stop,
    pub(crate) report: StaticReport,
    pub(super) watch: &'a mut dyn FnMut(&State, &LoadStep) -> bool,
}

impl<'a> Search<'a> {
    pub(crate) fn new(
        system: &'a System,
        options: &'a StaticOptions,
        watch: &'a mut dyn FnMut(&State, &LoadStep) -> bool,
    ) -> Self {
        let stop = Stop { tolerance: options.tolerance, max_iterations: options.max_iterations, scale: 0.0 };
        let linear = if options.arc_steps.is_some() { LinearSolver::Cholesky } else { options.linear };
        Self {
            balance: Balance::new(system, linear, &options.interrupt),
            constraints: None,
            options,
            stop,
            report: StaticReport::default(),
            watch,
        }
    }

    /// Brings the start to equilibrium at its own load factor. If that fails, returns false and leaves the state
    /// unchanged.
    ///
    /// # Errors
    /// Returns [`SolverError::Interrupted`].
    pub(super) fn release(&mut self, state: &mut State) -> Result<bool, SolverError> {
        match release::release(&mut self.balance, &mut state.q, state.t, &self.stop) {
            Ok(halvings) => {
                self.report.halvings += halvings;
                Ok(true)
            }
            Err(error) if error.is_interruption() => Err(error),
            Err(_) => Ok(false),
        }
    }
}
