//! Steps with lagged friction: all live terms act by potentials at the end of the step, so that the step minimises a function.

use std::sync::Arc;

use vi_core::{Acting, Terms};

use super::LiveSum;
use crate::assemble::fixed::FixedSum;
use crate::assemble::hessian::HessianEvaluation;
use crate::linear::matrix::SymmetricMatrix;
use crate::vectors;

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

    /// Returns the potential of lagged friction alone, J; zero if friction is not lagged.
    pub(crate) fn lagged_energy(&mut self, x: &[f64], t: f64) -> f64 {
        self.lagged.as_mut().map_or(0.0, |lagged| lagged.energies(x, t).total())
    }

    /// Adds the gradient of lagged friction alone. Returns false if friction is not lagged.
    pub(crate) fn add_lagged_gradient(&mut self, x: &[f64], t: f64, out: &mut [f64]) -> bool {
        let Self { lagged: Some(lagged), buffer, .. } = self else { return false };
        lagged.gradient(x, t, buffer);
        vectors::update(out, |k, out| *out += buffer[k]);
        true
    }

    /// Returns the Hessian of lagged friction alone; `None` if friction is not lagged.
    pub(crate) fn lagged_hessian(&mut self, x: &[f64], t: f64) -> Option<&SymmetricMatrix> {
        self.lagged.as_mut().map(|lagged| lagged.hessian(x, t, HessianEvaluation::Exact))
    }

    /// Returns whether friction is lagged.
    pub(crate) fn is_lagged(&self) -> bool {
        self.lagged.is_some()
    }
}
