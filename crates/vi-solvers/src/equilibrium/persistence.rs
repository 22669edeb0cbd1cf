//! Load factors between which no load changes: equilibria persist and are not solved for again.

use vi_core::State;

use crate::equilibrium::options::LoadStep;
use crate::equilibrium::search::Search;
use crate::error::SolverError;

impl Search<'_> {
    /// Returns whether an equilibrium is one at the end of the load factor too, because no load changes.
    pub(super) fn persists(&mut self, state: &State) -> bool {
        self.loads_are_equal(&state.q, [state.t, self.options.end])
    }

    /// Returns whether no force on the bodies at `q` and no prescribed coordinate differs between two load factors.
    pub(super) fn loads_are_equal(&mut self, q: &[f64], [first, second]: [f64; 2]) -> bool {
        let mut force = |t: f64| {
            let mut force = vec![0.0; q.len()];
            self.balance.residual(q, t, &mut force).map(|()| force)
        };
        match [force(first), force(second)] {
            [Ok(here), Ok(there)] if here == there => {
                self.balance.positions(q, first) == self.balance.positions(q, second)
            }
            _ => false,
        }
    }

    /// Accepts an equilibrium that persists at the end of the load factor.
    pub(super) fn keep(&mut self, state: &mut State, is_stable: bool) -> Result<(), SolverError> {
        state.t = self.options.end;
        self.balance.accept(&state.q, state.t)?;
        self.balance.work.skipped += 1;
        let step = LoadStep { load_factor: state.t, iterations: 0, is_stable };
        self.report.steps.push(step);
        (self.watch)(state, &step);
        Ok(())
    }
}
