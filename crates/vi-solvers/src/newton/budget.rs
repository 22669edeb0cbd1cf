//! The most that the solve of a step may cost. A step beyond it is given up, so that the caller can divide it before
//! more work is spent on it.

use crate::error::SolverError;
use crate::linear::cost::UnitCosts;
use crate::work::Work;

/// Number of new factors inside a step up to which the step may pay, whatever it costs. Of the steps of a flag of cloth
/// (h = 2.5 to 10 ms), those that halves did not beat took at most 3; those that failed took 20 to 30.
const FACTORS: u64 = 4;

/// The most that the solve of one step may cost.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub enum Budget {
    /// The solve uses every fallback before it fails.
    #[default]
    Unlimited,
    /// The solve is given up if it needs more than 4 new factors and more than this cost, in seconds of the reference
    /// core ([`UnitCosts::seconds`]).
    Seconds(f64),
}

impl Budget {
    /// Returns an error if the work `done` in a step exceeds the budget.
    pub(crate) fn check(self, costs: &UnitCosts, done: &Work) -> Result<(), SolverError> {
        match self {
            Self::Seconds(most)
                if done.factorizations_slow + done.factorizations_newton > FACTORS
                    && costs.seconds(done) > most =>
            {
                Err(SolverError::Budget { iterations: done.newton_iterations as u32 })
            }
            Self::Seconds(_) | Self::Unlimited => Ok(()),
        }
    }
}
