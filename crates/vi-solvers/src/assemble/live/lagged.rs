//! Steps with lagged friction: all live terms act by potentials at the end of the step, so that the step minimises a function.

use std::sync::Arc;

use vi_core::{Acting, Terms};

use super::LiveSum;
use crate::assemble::fixed::FixedSum;

impl LiveSum {
    /// Returns whether all terms list the forces of their pairs, and these act at the end of the open step.
    pub(crate) fn pairs_act_at_end(&self) -> bool {
        self.lists_pairs() && self.passage.span().acts_at_end
    }

    /// Makes the terms act by potentials until [`LiveSum::end_lag`]. The potential of friction has the normal forces at
    /// `end` and the tractions that `acting` predicts.
    pub(crate) fn lag(&mut self, start: &[f64], end: &[f64], acting: &Acting) {
        self.follow(start, Some(end));
        let discrete = self.near.as_ref().map_or(&[][..], |near| &near.discrete);
        let friction = self.passage.lagged(discrete, [start, end], acting);
        // The nodes of friction are nodes of the terms, so this does not fail.
        let terms = Terms::new(Arc::clone(self.terms.shared_coordinates()), friction);
        self.lagged = terms.ok().map(|terms| FixedSum::new(terms, self.block));
    }

    /// Makes the terms act by their forces over the step again.
    pub(crate) fn end_lag(&mut self) {
        self.lagged = None;
    }

    /// Returns the lagged friction alone.
    pub(crate) fn lagged_friction(&mut self) -> Option<&mut FixedSum> {
        self.lagged.as_mut()
    }

    /// Returns whether friction is lagged.
    pub(crate) fn is_lagged(&self) -> bool {
        self.lagged.is_some()
    }
}
