//! What is seen of contact: pairs that act, the smallest gap, and forces between bodies. It must not change a state.

use std::sync::Arc;

use vi_contact::{ContactPotential, ContactTerm};

use crate::model::ContactModel;
use crate::record::record;

/// What is seen of contact.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ContactFacts {
    /// Pairs that press on each other.
    pub pairs: u64,
    /// The smallest gap of these pairs, m; infinite where there are none.
    pub smallest_gap: f64,
    /// Work of friction between bodies since the start, J (≤ 0).
    pub friction: f64,
    /// Work of the damping of contact since the start, J (≤ 0).
    pub damping: f64,
}

impl Default for ContactFacts {
    fn default() -> Self {
        Self { pairs: 0, smallest_gap: f64::INFINITY, friction: 0.0, damping: 0.0 }
    }
}

impl ContactFacts {
    /// Adds the pairs of a component at positions x.
    pub(crate) fn add(&mut self, watch: &mut ContactWatch, x: &[f64]) {
        let (pairs, gap) = watch.pairs_and_gap(x);
        self.pairs += pairs;
        self.smallest_gap = self.smallest_gap.min(gap);
    }
}

/// What has been of contact until now: kept from step to step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct ContactTotals {
    /// The smallest gap after any step, m.
    pub(crate) smallest_gap: f64,
    /// Work of friction and of the damping of contact, J.
    pub(crate) friction: f64,
    pub(crate) damping: f64,
}

record!(ContactTotals { smallest_gap: f64, friction: f64, damping: f64 });

impl Default for ContactTotals {
    fn default() -> Self {
        Self { smallest_gap: f64::INFINITY, friction: 0.0, damping: 0.0 }
    }
}

/// Looks at the contact of a component.
pub(crate) struct ContactWatch {
    term: Arc<ContactTerm>,
    /// The candidates that were found last.
    near: Option<ContactPotential>,
}

impl ContactWatch {
    pub(crate) fn new(model: ContactModel) -> Self {
        Self { term: model.term, near: None }
    }

    /// Number of pairs that act at positions x of the component, and the smallest gap of them, m.
    fn pairs_and_gap(&mut self, x: &[f64]) -> (u64, f64) {
        let serves = |near: &ContactPotential| near.neighbours().covers(near.surface(), x);
        let near = match self.near.take().filter(serves) {
            Some(near) => near,
            None => self.term.at(x),
        };
        let active = near.contact().active(x);
        let smallest_gap = active.iter().map(|pair| pair.gap).fold(f64::INFINITY, f64::min);
        self.near = Some(near);
        (active.len() as u64, smallest_gap)
    }
}
