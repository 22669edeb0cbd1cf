//! Saves and restores the place of an evaluator, so that a continued run has the bits of an uninterrupted one.

use super::Evaluator;
use crate::assemble::live::LiveState;
use crate::error::SolverError;
use crate::memory::StepperMemory;

impl Evaluator {
    /// Records the place of the last evaluation, so that a continued run evaluates no more than one that was never
    /// interrupted.
    pub(crate) fn save(&self, memory: &mut StepperMemory) {
        if self.t.is_nan() {
            return;
        }
        if let Some(live) = self.assembler.shared_live() {
            live.state().save("forces.live", memory);
        }
        memory.arrays.push(("forces.x".into(), self.x.clone()));
        memory.arrays.push(("forces.t".into(), vec![self.t]));
        if !self.q.is_empty() {
            memory.arrays.push(("forces.q".into(), self.q.clone()));
        }
        let knows_gradient = self.gradient_is_of_x && self.nonconservative.is_none();
        memory.counts.push(("forces.gradient".into(), u64::from(knows_gradient)));
    }

    /// Restores the place that [`Evaluator::save`] recorded.
    ///
    /// # Errors
    /// Returns [`SolverError::Memory`] if the memory belongs to another system.
    pub(crate) fn restore(&mut self, memory: &StepperMemory) -> Result<(), SolverError> {
        let Ok(x) = memory.array("forces.x") else { return Ok(()) };
        let &[t] = memory.array("forces.t")? else {
            return Err(SolverError::Memory { missing: "forces.t" });
        };
        if x.len() != self.x.len() {
            return Err(SolverError::Memory { missing: "forces.x" });
        }
        let live = LiveState::restore("forces.live", memory, x.len());
        self.go_to_live(&live, &None);
        self.go_to_positions(x, t);
        if let Ok(q) = memory.array("forces.q") {
            self.q.extend_from_slice(q);
        }
        if memory.count("forces.gradient")? == 1 {
            self.assembler.gradient(&self.x, t, &mut self.gradient);
            self.gradient_is_of_x = true;
        }
        Ok(())
    }
}
