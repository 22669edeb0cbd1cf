//! The impulses between parts of live terms that act by their gradient at the stages of a step: Σ b_i h f(x_i) with the weights b_i
//! of the scheme. With the impulses of all other forces, they are the change of momentum over the step.

use vi_core::Impulse;

use crate::assemble::evaluator::Evaluator;
use crate::assemble::passage::add_impulses;

/// The impulses of the steps since they were taken.
pub(crate) struct LiveImpulses {
    is_kept: bool,
    /// The impulses of the open step, N s.
    open: Vec<Impulse>,
    /// The sums over the accepted steps, and their values at the mark, N s.
    sums: Vec<Impulse>,
    marked: Vec<Impulse>,
}

impl LiveImpulses {
    pub(crate) fn new(is_kept: bool) -> Self {
        Self { is_kept, open: Vec::new(), sums: Vec::new(), marked: Vec::new() }
    }

    /// Opens a step.
    pub(crate) fn open(&mut self) {
        self.open.clear();
    }

    /// Adds the impulses of the forces at the last configuration of an evaluator, which act for `duration` (s; negative in a kick
    /// backwards).
    pub(crate) fn add(&mut self, evaluator: &mut Evaluator, duration: f64) {
        if self.is_kept {
            let mut forces = evaluator.live_forces();
            forces.iter_mut().flat_map(|force| &mut force.value).for_each(|value| *value *= duration);
            add_impulses(&mut self.open, &forces);
        }
    }

    /// Accepts the open step.
    pub(crate) fn accept(&mut self) {
        add_impulses(&mut self.sums, &self.open);
        self.open.clear();
    }

    /// Returns the impulses since the last call; `None` if they are not kept.
    pub(crate) fn take(&mut self) -> Option<Vec<Impulse>> {
        self.is_kept.then(|| std::mem::take(&mut self.sums))
    }

    /// Forgets all steps.
    pub(crate) fn clear(&mut self) {
        *self = Self::new(self.is_kept);
    }

    /// Marks the present sums.
    pub(crate) fn mark(&mut self) {
        self.marked.clone_from(&self.sums);
    }

    /// Takes back the steps since the mark.
    pub(crate) fn return_to_mark(&mut self) {
        self.sums.clone_from(&self.marked);
    }
}
