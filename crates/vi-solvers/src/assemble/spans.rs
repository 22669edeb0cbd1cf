//! Runs of stencils that are summed together, and the mobility of their coordinates.

use std::ops::Range;

use vi_core::{Potential, Terms};

/// Returns the number of coordinates per node of the nodal arrays: the largest of 3, 2, 1 that divides the block of
/// every fixed term. Terms with larger blocks are treated as stencils of more, smaller nodes.
pub(crate) fn common_block(terms: &Terms) -> usize {
    let has_ties = !terms.coordinates().is_plain();
    let divides = |block: usize| {
        // Ties and axes belong to nodes of three coordinates.
        if has_ties && block == 2 {
            return false;
        }
        terms.coordinates().dof_count().is_multiple_of(block)
            && terms.fixed().iter().all(|term| term.stencils().block.is_multiple_of(block))
    };
    [3, 2].into_iter().find(|&block| divides(block)).unwrap_or(1)
}

/// Whether a coordinate is solved for, is prescribed and moves, or is fixed; in this order.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Mobility {
    Free,
    Moving,
    Fixed,
}

/// Returns the mobility of every coordinate.
pub(crate) fn mobilities(terms: &Terms) -> Vec<Mobility> {
    let mut mobility = vec![Mobility::Free; terms.coordinates().dof_count()];
    for group in terms.coordinates().prescribed() {
        let kind = if group.path.is_fixed() { Mobility::Fixed } else { Mobility::Moving };
        for &dof in &group.dofs {
            mobility[dof as usize] = kind;
        }
    }
    // Along the axes of space, all coordinates of a node with its own axes are as mobile as its most mobile one.
    for own in terms.coordinates().node_axes() {
        let of_node = &mut mobility[3 * own.node as usize..][..3];
        let freest = of_node.iter().copied().min().unwrap_or(Mobility::Fixed);
        of_node.fill(freest);
    }
    // A tied node is as mobile as the most mobile of the nodes to which it is tied.
    for (node, terms) in terms.coordinates().combinations() {
        for axis in 0..3 {
            let of = terms.iter().map(|term| mobility[3 * term.0 as usize + axis]);
            mobility[3 * node as usize + axis] = of.min().unwrap_or(Mobility::Fixed);
        }
    }
    mobility
}

/// A run of stencils of one term.
#[derive(Clone)]
pub(crate) struct Span {
    /// Index of the term.
    pub(crate) term: usize,
    /// The range of its stencils.
    pub(crate) stencils: Range<usize>,
}

/// Cuts a term into spans, in order.
pub(crate) fn spans(term: usize, potential: &dyn Potential) -> impl Iterator<Item = Span> {
    let (count, length) = (potential.stencils().count(), potential.run_length());
    (0..count.div_ceil(length))
        .map(move |chunk| Span { term, stencils: chunk * length..count.min((chunk + 1) * length) })
}

/// Returns which mobilities occur among the coordinates of a span: (any free, any moving).
pub(crate) fn mobility_of(span: &Span, potential: &dyn Potential, mobility: &[Mobility]) -> (bool, bool) {
    let stencils = potential.stencils();
    let block = stencils.block;
    let nodes = &stencils.nodes[span.stencils.start * stencils.arity..span.stencils.end * stencils.arity];
    let mut found = (false, false);
    for &node in nodes {
        for &kind in &mobility[node as usize * block..(node as usize + 1) * block] {
            found.0 |= kind == Mobility::Free;
            found.1 |= kind == Mobility::Moving;
        }
    }
    found
}

/// Returns the `split` smaller nodes of which a node consists.
pub(crate) fn parts(node: u32, split: usize) -> Range<u32> {
    node * split as u32..(node + 1) * split as u32
}
