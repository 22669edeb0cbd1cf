//! The discrete gradient of contact, stencil by stencil.

use std::ops::Range;

use vi_core::{DiscreteGradient, packed_len};

use super::{ContactPotential, PACKED, SIZE, add_packed};
use crate::pairs::{Group, StepPair, StepSettings};

/// Without damping, which is a force of its own.
const UNDAMPED: StepSettings = StepSettings { duration: f64::INFINITY };

impl ContactPotential {
    /// Calls `each` with the pairs of the stencils in `range` that act between x₀ and x₁, and the places of their nodes.
    fn for_each_step(
        &self,
        range: Range<usize>,
        x: [&[f64]; 2],
        mut each: impl FnMut(usize, &StepPair, [usize; 4]),
    ) {
        let contact = self.contact();
        let cells = self.neighbours.cells.len();
        let (mut group, mut pairs) = (Group::new(), Vec::new());
        for point in self.points_from(&range) {
            pairs.clear();
            contact.step_of_point(point, x, &UNDAMPED, &mut group, &mut pairs);
            for pair in &pairs {
                if let Some(stencil) = self.home(point, &pair.nodes).filter(|stencil| range.contains(stencil))
                {
                    each(stencil, pair, self.places(stencil, &pair.nodes));
                }
            }
        }
        for stencil in range.start.max(cells)..range.end {
            let number = stencil - cells;
            let edges = self.neighbours.edges.len();
            let pair = if number < edges {
                contact.step_of_edges(number, x, &UNDAMPED)
            } else {
                contact.step_of_plane(number - edges, x, &UNDAMPED)
            };
            if let Some(pair) = pair {
                each(stencil, &pair, [0, 1, 2, 3]);
            }
        }
    }
}

/// The sum over the stencils of a point does its work exactly; which of them carries a group that several share is
/// chosen by the features at both ends.
impl DiscreteGradient for ContactPotential {
    fn gradients(&self, range: Range<usize>, start: &[f64], end: &[f64], out: &mut [f64]) {
        out.fill(0.0);
        let first = range.start;
        self.for_each_step(range, [start, end], |stencil, pair, places| {
            let out = &mut out[(stencil - first) * SIZE..(stencil - first + 1) * SIZE];
            for (place, gradient) in places.into_iter().zip(pair.gradient).take(pair.arity) {
                (0..3).for_each(|k| out[3 * place + k] += gradient[k]);
            }
        });
    }

    fn tangents(&self, range: Range<usize>, start: &[f64], end: &[f64], out: &mut [f64]) {
        out.fill(0.0);
        let first = range.start;
        self.for_each_step(range, [start, end], |stencil, pair, places| {
            let size = 3 * pair.arity;
            let mut block = [0.0; PACKED];
            pair.packed_stiffness(&mut block[..packed_len(size)]);
            add_packed(
                &block,
                size,
                places,
                &mut out[(stencil - first) * PACKED..(stencil - first + 1) * PACKED],
            );
        });
    }
}
