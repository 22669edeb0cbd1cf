//! The forces of live terms stencil by stencil, over the last step or in a configuration, for observers. They are evaluated only on request.

use std::ops::Range;
use std::sync::Arc;

use vi_core::{DiscreteGradient, Potential, StepSpan};

/// Receives the forces of one stencil: the positions (m, all coordinates) at which they act, the nodes, and the forces with
/// the opposite sign (N, three per node), like a gradient.
pub type SeeForces<'a> = dyn FnMut(&[f64], &[u32], &[f64]) + 'a;

/// The terms and impulses that act in a step.
#[derive(Clone, Default)]
pub(crate) struct ActingTerms {
    /// The terms with a discrete gradient, by their numbers.
    terms: Vec<(usize, Arc<dyn Potential>)>,
    /// The impulses at the end of the step: nodes, and impulses with the sign of a gradient, N s.
    at_end: Vec<(Vec<u32>, Vec<f64>)>,
}

impl ActingTerms {
    pub(crate) fn new(discrete: &[(usize, Arc<dyn Potential>)]) -> Self {
        Self { terms: discrete.to_vec(), at_end: Vec::new() }
    }

    /// Adds impulses on nodes at the end of the step.
    pub(crate) fn add_at_end(&mut self, nodal: impl Iterator<Item = (Vec<u32>, Vec<f64>)>) {
        self.at_end.extend(nodal);
    }

    /// Passes the forces over a step from `start` to `end` to `see`. `over` returns the discrete gradient of a term
    /// over that step, or `None` to use the one of the term itself.
    pub(crate) fn see(
        &self,
        over: impl Fn(usize, &Arc<dyn Potential>) -> Option<Arc<dyn DiscreteGradient>>,
        span: StepSpan,
        [start, end]: [&[f64]; 2],
        see: &mut SeeForces<'_>,
    ) {
        let middle = |(a, b): (&f64, &f64)| 0.5 * (a + b);
        let place: Vec<f64> = match span.acts_at_end {
            true => end.to_vec(),
            false => start.iter().zip(end).map(middle).collect(),
        };
        for (number, term) in &self.terms {
            let over = over(*number, term);
            if let Some(discrete) = over.as_deref().or(term.discrete_gradient()) {
                let gradients = |range, out: &mut [f64]| discrete.gradients(range, start, end, out);
                each(term.as_ref(), &place, gradients, see);
            }
        }
        for (nodes, impulses) in &self.at_end {
            let forces: Vec<f64> = impulses.iter().map(|impulse| impulse / span.duration).collect();
            see(end, nodes, &forces);
        }
    }
}

/// The forces of stencils in a configuration.
#[derive(Debug, Clone, Default, PartialEq)]
pub(crate) struct ListedForces {
    /// Positions of all coordinates, m.
    x: Vec<f64>,
    /// The nodes of each stencil, and the forces on them as [`SeeForces`] receives them, N.
    blocks: Vec<(Vec<u32>, Vec<f64>)>,
}

impl ListedForces {
    /// Returns the list of the forces that `all` shows, which act at positions x.
    pub(crate) fn new(x: &[f64], all: impl FnOnce(&mut SeeForces<'_>)) -> Self {
        let mut blocks = Vec::new();
        all(&mut |_, nodes, forces| blocks.push((nodes.to_vec(), forces.to_vec())));
        Self { x: x.to_vec(), blocks }
    }

    /// Shows the forces. Returns false if nothing was listed.
    pub(crate) fn see(&self, see: &mut SeeForces<'_>) -> bool {
        self.blocks.iter().for_each(|(nodes, forces)| see(&self.x, nodes, forces));
        !self.x.is_empty()
    }
}

/// Number of stencils that are evaluated together.
const TOGETHER: usize = 4096;

/// Calls `see` with the gradients of a term at positions x.
pub(crate) fn at(term: &dyn Potential, x: &[f64], t: f64, see: &mut SeeForces<'_>) {
    let located = term.at(x);
    let term = located.as_deref().unwrap_or(term);
    each(term, x, |range, out| term.gradients(range, x, t, out), see);
}

fn each(
    term: &dyn Potential,
    place: &[f64],
    gradients: impl Fn(Range<usize>, &mut [f64]),
    see: &mut SeeForces<'_>,
) {
    let (count, stencils) = (term.stencil_count(), term.stencils());
    let size = stencils.size();
    let mut blocks = vec![0.0; size * TOGETHER.min(count)];
    for first in (0..count).step_by(TOGETHER) {
        let range = first..(first + TOGETHER).min(count);
        let blocks = &mut blocks[..size * range.len()];
        gradients(range.clone(), blocks);
        for (stencil, block) in range.zip(blocks.chunks_exact(size)) {
            if block.iter().any(|&force| force != 0.0) {
                see(place, stencils.of(stencil), block);
            }
        }
    }
}
