//! Books what contact exchanges over a step: impulses between bodies, the work of friction, and the stretched bristles.

use std::collections::BTreeMap;

use vi_core::{Impulse, StepOutcome};

use crate::distance::Vec3;
use crate::friction::{Anchor, Anchors, Step};
use crate::surface::Surface;

/// The entries of one step.
pub(super) struct Book {
    duration: f64,
    impulses: BTreeMap<[u32; 2], Vec3>,
    work: f64,
    anchors: Vec<Anchor>,
}

impl Book {
    /// Opens the book of a step; without a step, impulses are zero. Between equilibria they are those of one second.
    pub(super) fn new(step: Option<&Step>) -> Self {
        let duration = step.map_or(0.0, |step| step.settings.duration);
        let duration = if duration.is_infinite() { 1.0 } else { duration };
        Self { duration, impulses: BTreeMap::new(), work: 0.0, anchors: Vec::new() }
    }

    /// Adds the force on the first of two bodies, N.
    pub(super) fn push_force(&mut self, [first, second]: [u32; 2], force: Vec3) {
        let sign = if first <= second { 1.0 } else { -1.0 };
        let between = [first.min(second), first.max(second)];
        *self.impulses.entry(between).or_insert_with(Vec3::zeros) += force * (sign * self.duration);
    }

    /// Adds work of friction at one node, J.
    pub(super) fn push_work(&mut self, work: f64) {
        self.work += work;
    }

    /// Adds the bristle of a pair at the end of the step.
    pub(super) fn push_anchor(&mut self, anchor: Anchor) {
        self.anchors.push(anchor);
    }

    /// Closes the book of a step that began with the bristles of `step`.
    pub(super) fn close(mut self, surface: &Surface, step: Option<&Step>) -> StepOutcome {
        self.anchors.sort_by_key(|anchor| anchor.partners);
        let anchors = Anchors::stretched(self.anchors.into_iter());
        let before = step.map_or(0.0, |step| step.anchors.energy(surface));
        let stored = anchors.energy(surface);
        let exchanged = |(between, value): ([u32; 2], Vec3)| Impulse { between, value: value.into() };
        StepOutcome {
            memory: anchors.to_numbers(),
            stored,
            // Include the energy of bristles whose pair has opened.
            friction: self.work - (stored - before),
            impulses: self.impulses.into_iter().map(exchanged).collect(),
            ..StepOutcome::default()
        }
    }
}
