//! Implicit Euler for animation, with a fixed number of linear solves per step. If the solves converge, the scheme has
//! order 1; it loses energy. If they do not converge, bodies look softer and slower than they are.

use super::BackwardEuler;
use crate::error::SolverError;
use crate::schemes::one_stage::rule::{MultiplierDirections, Rule};

pub(crate) struct TruncatedEuler {
    solves: u32,
}

impl TruncatedEuler {
    /// Makes the rule with this number of linear solves per step.
    ///
    /// # Errors
    /// Returns [`SolverError::Option`] if there is none.
    pub(crate) fn new(solves: u32) -> Result<Self, SolverError> {
        if solves == 0 {
            return Err(SolverError::Option { option: "solves", value: 0.0, allowed: "must be at least 1" });
        }
        Ok(Self { solves })
    }
}

impl Rule for TruncatedEuler {
    fn name(&self) -> &'static str {
        "truncated-euler"
    }
    fn coefficient(&self, h: f64) -> f64 {
        BackwardEuler.coefficient(h)
    }
    fn time(&self) -> f64 {
        BackwardEuler.time()
    }
    fn offset(&self, k: usize, v: f64, h: f64) -> f64 {
        BackwardEuler.offset(k, v, h)
    }
    fn change(&self, k: usize, v: f64, w: f64, h: f64) -> (f64, f64) {
        BackwardEuler.change(k, v, w, h)
    }
    fn multiplier_directions(&self) -> Option<MultiplierDirections> {
        BackwardEuler.multiplier_directions()
    }
    fn solves(&self) -> Option<u32> {
        Some(self.solves)
    }
}
