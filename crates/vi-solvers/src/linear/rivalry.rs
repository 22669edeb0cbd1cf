//! Compares the linear solver that a run uses with its rival, by the counted work of the run so far. The first choice is
//! a guess, because the number of iterations of conjugate gradients, and the number of solves that share a factor, depend
//! on the motion. Nothing is timed, so equal runs choose equally.

use crate::error::SolverError;
use crate::linear::cost::UnitCosts;
use crate::memory::StepperMemory;

/// Number of solves after which the solvers are compared for the first time. Each further comparison follows after
/// twice as many solves as the last one.
const FIRST_LOOK: u64 = 12;
/// A rival must be cheaper by this factor.
const MARGIN: f64 = 1.15;
/// Number of solves that share the cost of one factor, as stale factors do.
pub(super) const SOLVES_PER_FACTOR: f64 = 25.0;

/// The work with the current solver, and the costs of a factor.
#[derive(Debug, Clone, Default)]
pub(super) struct Rivalry {
    /// Costs of a factor and of a solve with it, s of the reference core; zero if there is no choice.
    pub(super) factor: [f64; 2],
    /// Numbers of matrices and of solves since the current solver was chosen.
    pub(super) matrices: u64,
    pub(super) solves: u64,
    /// Number of solves before the next comparison.
    look: u64,
}

impl Rivalry {
    /// Begins to count the work of a new solver, with the costs of a factor; `None` if there is no choice.
    pub(super) fn begin(&mut self, factor: Option<&UnitCosts>) {
        let factor = factor.map_or([0.0; 2], |costs| [costs.factor, costs.solve]);
        *self = Self { factor, matrices: 1, solves: 0, look: FIRST_LOOK };
    }

    /// Returns whether the solvers should be compared.
    fn is_open(&self) -> bool {
        self.factor[0] > 0.0 && self.solves >= self.look
    }

    /// Records a new matrix; returns whether to compare the solvers before it is factored.
    pub(super) fn is_due(&mut self) -> bool {
        self.matrices += 1;
        let is_open = self.is_open();
        if is_open {
            self.look = 2 * self.solves;
        }
        is_open
    }

    /// Returns the cost of a solve that costs `solve` if a matrix costs `matrix`, s of the reference core.
    fn share(&self, [matrix, solve]: [f64; 2], most_matrices: f64) -> f64 {
        matrix * (self.matrices as f64 / self.solves as f64).min(most_matrices) + solve
    }

    /// Returns whether a comparison is due and a factor is cheaper than conjugate gradients with these costs of a
    /// preconditioner and a solve. Conjugate gradients renew their matrix more often than factors are made.
    pub(super) fn prefers_factor(&self, gradients: [f64; 2]) -> bool {
        self.is_open() && self.is_more_expensive(gradients)
    }

    /// Returns whether conjugate gradients are more expensive than a factor.
    pub(super) fn is_more_expensive(&self, gradients: [f64; 2]) -> bool {
        self.share(gradients, 1.0) > MARGIN * self.share(self.factor, 1.0 / SOLVES_PER_FACTOR)
    }

    /// Returns the largest cost of a solve by conjugate gradients that is still cheaper than a factor, if a
    /// preconditioner costs `preconditioner`.
    pub(super) fn largest_gradients(&self, preconditioner: f64) -> f64 {
        self.share(self.factor, 1.0) / MARGIN - self.share([preconditioner, 0.0], 1.0)
    }

    pub(super) fn save(&self, memory: &mut StepperMemory) {
        memory.arrays.push((NAMES[0].to_owned(), self.factor.to_vec()));
        for (name, count) in NAMES[1..].iter().zip([self.matrices, self.solves, self.look]) {
            memory.counts.push(((*name).to_owned(), count));
        }
    }

    pub(super) fn restore(memory: &StepperMemory) -> Result<Self, SolverError> {
        let &[factor, solve] = memory.array(NAMES[0])? else {
            return Err(SolverError::Memory { missing: NAMES[0] });
        };
        let [matrices, solves, look] = [NAMES[1], NAMES[2], NAMES[3]].map(|name| memory.count(name));
        Ok(Self { factor: [factor, solve], matrices: matrices?, solves: solves?, look: look? })
    }
}

const NAMES: [&str; 4] = ["linear.rival", "linear.matrices", "linear.solves_so_far", "linear.look"];

#[cfg(test)]
mod tests {
    use super::*;

    fn rivalry(matrices: u64, solves: u64) -> Rivalry {
        let mut rivalry = Rivalry::default();
        rivalry.begin(Some(&UnitCosts { factor: 100.0, solve: 1.0, ..UnitCosts::default() }));
        (1..matrices).for_each(|_| _ = rivalry.is_due());
        rivalry.solves = solves;
        rivalry
    }

    #[test]
    fn the_solver_that_is_cheaper_by_the_work_so_far_is_preferred() {
        // A factor that 25 solves share costs 100/25 + 1 = 5 per solve.
        let few = rivalry(2, 20);
        assert!(few.prefers_factor([0.1, 7.0]) && !few.prefers_factor([0.1, 5.0]));
        // Factors for every second solve cost 51 per solve.
        assert!(rivalry(10, 20).largest_gradients(0.0) > 40.0);
        assert!(!rivalry(2, 5).prefers_factor([0.1, 70.0]), "too early to tell");
    }

    #[test]
    fn comparisons_become_rarer() {
        let mut rivalry = rivalry(1, 0);
        let mut looks = 0;
        for solves in 1..1000 {
            rivalry.solves = solves;
            looks += u32::from(rivalry.is_due());
        }
        assert!((5..=8).contains(&looks), "{looks}");
    }
}
