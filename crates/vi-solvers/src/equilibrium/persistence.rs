//! Equilibria that persist because no load changes: they are not solved for again.

use vi_core::State;

use crate::equilibrium::options::LoadStep;
use crate::equilibrium::search::Search;
use crate::error::SolverError;

impl Search<'_> {
    /// Returns whether an equilibrium is one at the end of the load factor too, because no force on it and no prescribed coordinate is another
    /// there.
    pub(super) fn persists(&mut self, state: &State) -> bool {
        let (q, end) = (&state.q, self.options.end);
        let mut force = |t: f64| {
            let mut force = vec![0.0; q.len()];
            self.balance.residual(q, t, &mut force).map(|()| force)
        };
        match [force(state.t), force(end)] {
            [Ok(here), Ok(there)] if here == there => {
                self.balance.positions(q, state.t) == self.balance.positions(q, end)
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
