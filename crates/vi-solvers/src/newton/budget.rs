//! The largest cost of the solve of a step. A step that exceeds it is given up, so that the caller can divide the step
//! before more work is spent on it.

use crate::error::SolverError;
use crate::linear::cost::UnitCosts;
use crate::work::Work;

/// A step is not given up before it has made this many iterations and this many new factors. Of the steps of a flag of
/// cloth (h = 2.5 to 17 ms), those that two steps of half the length would not have made cheaper took at most 20
/// iterations and 6 factors; those that failed took 25 to 60 iterations and 20 to 30 factors. With half of this budget
/// the flag took 4 times as long at h = 17 ms, because substeps of .5 ms needed as many iterations each as whole steps.
const ITERATIONS: f64 = 20.0;
const FACTORS: u64 = 4;

/// The most that the solve of one step may cost.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub enum Budget {
    /// The solve uses every fallback before it fails, and any solution is accepted.
    #[default]
    Unlimited,
    /// The solve uses every fallback before it fails. A step is rejected if it ends with a gap so small that the next
    /// step would fail.
    Divisible,
    /// The solve is given up if it needs more than 4 new factors, more than the cost of these and 20 iterations, and
    /// more than this cost, in seconds of the reference core ([`UnitCosts::seconds`]). Fallbacks that cost more than two steps of
    /// half the length are not used.
    Seconds(f64),
}

impl Budget {
    /// Returns an error if the work `done` in a step exceeds the budget.
    pub(crate) fn check(self, costs: &UnitCosts, done: &Work) -> Result<(), SolverError> {
        match self {
            Self::Seconds(most)
                if done.factorizations_slow + done.factorizations_newton > FACTORS
                    && costs.seconds(done) > most.max(usual(costs)) =>
            {
                Err(SolverError::Budget { iterations: done.newton_iterations as u32 })
            }
            Self::Seconds(_) | Self::Divisible | Self::Unlimited => Ok(()),
        }
    }
}

fn usual(costs: &UnitCosts) -> f64 {
    ITERATIONS * (costs.gradient + costs.solve) + FACTORS as f64 * (costs.hessian + costs.factor)
}
