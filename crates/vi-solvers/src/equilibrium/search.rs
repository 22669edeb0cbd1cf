//! A search for equilibria in progress: the body, the options, and the results so far.

use vi_core::{State, System};

use crate::assemble::hessian::HessianEvaluation;
use crate::equilibrium::balance::Balance;
use crate::equilibrium::constrained::ConstraintForces;
use crate::equilibrium::newton::{PREDICTION, Stop};
use crate::equilibrium::options::{LoadStep, StaticOptions, StaticReport};
use crate::equilibrium::release;
use crate::equilibrium::trust_region;
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
    /// Whether the start is stable, as far as is known: what is not brought to equilibrium here counts as stable.
    pub(super) start_is_stable: bool,
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
            start_is_stable: true,
            watch,
        }
    }

    /// Brings the start to equilibrium at its own load factor. If that fails, returns false and leaves the state
    /// unchanged.
    ///
    /// # Errors
    /// Returns [`SolverError::Interrupted`], or [`SolverError::MovesAway`] if there is no such equilibrium.
    pub(super) fn release(&mut self, state: &mut State) -> Result<bool, SolverError> {
        if self.can_descend() {
            match self.descend(state, state.t) {
                Ok(()) => return Ok(true),
                Err(error @ SolverError::MovesAway { .. }) => return Err(error),
                Err(error) if error.is_interruption() => return Err(error),
                Err(_) => {}
            }
        }
        match release::release(&mut self.balance, &mut state.q, state.t, &self.stop) {
            Ok(halvings) => {
                self.report.halvings += halvings;
                Ok(true)
            }
            Err(error) if error.is_interruption() => Err(error),
            Err(_) => Ok(false),
        }
    }

    /// If the start is a mechanism, moves it to a minimum of V at load factor `t`; there it gets stiffness from its tension. No
    /// path of equilibria begins at a mechanism: the smallest load moves cloth that is not taut as far as the largest. Returns
    /// whether the state was moved.
    ///
    /// # Errors
    /// Returns [`SolverError::Interrupted`].
    pub(super) fn leave_mechanism(&mut self, state: &mut State, t: f64) -> Result<bool, SolverError> {
        if !self.can_descend() {
            return Ok(false);
        }
        let increment = self.options.smallest_increment.copysign(t - state.t);
        let moved = match self.response(state, state.t + increment) {
            Ok(step) if !self.balance.is_too_long(&step) => return Ok(false),
            Ok(_) | Err(SolverError::NotFactored) => self.descend(state, t),
            Err(error) => Err(error),
        };
        match moved {
            Err(error) if error.is_interruption() => Err(error),
            moved => Ok(moved.is_ok()),
        }
    }

    /// Returns −K⁻¹ r of the start at load factor `t`.
    fn response(&mut self, state: &State, t: f64) -> Result<Vec<f64>, SolverError> {
        let mut step = vec![0.0; state.q.len()];
        self.balance.residual(&state.q, t, &mut step)?;
        step.iter_mut().for_each(|step| *step = -*step);
        if self.balance.factorize(&state.q, t, HessianEvaluation::Exact, 0.0)?.is_err() {
            return Err(SolverError::NotFactored);
        }
        self.balance.solve(&mut step, PREDICTION)?;
        Ok(step)
    }

    /// Returns whether equilibria are minima of V, and bodies have an extent by which corrections can be limited.
    fn can_descend(&self) -> bool {
        self.balance.is_conservative() && self.constraints.is_none() && self.balance.extent() > 0.0
    }

    /// Moves a state to a minimum of V at load factor `t`.
    fn descend(&mut self, state: &mut State, t: f64) -> Result<(), SolverError> {
        let balance = &mut self.balance;
        let mut q = state.q.clone();
        trust_region::minimise(balance, &mut q, t, &mut { self.stop })?;
        state.q = q;
        balance.accept(&state.q, t)?;
        self.start_is_stable = !balance.judges_stability() || balance.is_stable(&state.q, t)?;
        Ok(())
    }
}
