//! Finds the simplices of a body near a point, with inclusion–exclusion numbers, grouped by closest feature.

use super::crossing::Crossing;
use super::term::{PointTerm, feature};
use crate::distance::{Shape, at};
use crate::surface::{Gauge, Surface};

/// Scratch memory for the cells near one point.
#[derive(Debug, Default)]
pub(crate) struct Group<const ENDS: usize> {
    /// The terms of the point against one body; no two have the same closest features.
    pub(crate) terms: Vec<PointTerm<ENDS>>,
    edges: Vec<Shared<[u32; 2]>>,
    nodes: Vec<Shared<u32>>,
    order: Vec<u32>,
    /// What acts over a step in which the point passes from one cell to another.
    pub(super) crossing: Crossing,
}

/// A simplex of several cells, the sum of their numbers n, and the first of these cells.
type Shared<S> = (S, i32, u32);

/// Sums the numbers n of equal simplices. It sorts them, because a ball can be near thousands of cells at once.
fn sum<S: Copy + Ord>(shared: &mut Vec<Shared<S>>) {
    shared.sort_unstable();
    shared.dedup_by(|next, kept| {
        let is_same = next.0 == kept.0;
        if is_same {
            (kept.1, kept.2) = (kept.1 + next.1, kept.2.min(next.2));
        }
        is_same
    });
}

impl<const ENDS: usize> Group<ENDS> {
    pub(crate) fn new() -> Self {
        Self {
            terms: Vec::new(),
            edges: Vec::new(),
            nodes: Vec::new(),
            order: Vec::new(),
            crossing: Crossing::default(),
        }
    }

    /// Finds the terms of a point against cells of one body, at positions x of each end.
    ///
    /// Only cells within reach at some end are considered. That is enough: if an edge or node is within reach, so are
    /// all cells that contain it. Their number is counted here, without the cells that the surface excludes.
    pub(crate) fn gather(
        &mut self,
        surface: &Surface,
        node: u32,
        cells: &[u32],
        gauge: &Gauge,
        x: [&[f64]; ENDS],
    ) {
        self.terms.clear();
        let reach = gauge.reach_squared();
        for &home in cells {
            let cell = &surface.cells[home as usize];
            let [a, b, c] = cell.nodes;
            self.push(cell.shape(), [node, a, b, c], (1, home), reach, x);
        }
        if self.terms.len() > 1 {
            self.share(node, reach, x);
            self.merge();
        }
    }

    /// Adds a term if it is within reach at some end.
    #[inline]
    fn push(
        &mut self,
        shape: Shape,
        nodes: [u32; 4],
        (multiplicity, home): (i32, u32),
        reach: f64,
        x: [&[f64]; ENDS],
    ) {
        let x = x.map(|x| nodes.map(|node| at(x, node)));
        if let Some(closest) = shape.closest_if_nearer(&x, reach) {
            let features = closest.map(|closest| feature(&nodes, &closest));
            self.terms.push(PointTerm { shape, nodes, multiplicity, home, closest, features });
        }
    }

    /// Adds the edges and nodes that several cells share, with their numbers n. Over a step they are needed out of reach as well (see
    /// `crossing.rs`).
    fn share(&mut self, point: u32, reach: f64, x: [&[f64]; ENDS]) {
        let reach = if ENDS == 2 { f64::INFINITY } else { reach };
        let (mut edges, mut nodes) = (std::mem::take(&mut self.edges), std::mem::take(&mut self.nodes));
        edges.clear();
        nodes.clear();
        for term in self.terms.iter().filter(|term| term.shape == Shape::PointTriangle) {
            let [_, a, b, c] = term.nodes;
            edges.extend([[a, b], [a, c], [b, c]].map(|edge| (edge, -1, term.home)));
            nodes.extend([a, b, c].map(|node| (node, 1, term.home)));
        }
        sum(&mut edges);
        edges.iter_mut().for_each(|edge| edge.1 += 1);
        for term in self.terms.iter().filter(|term| term.shape == Shape::PointEdge) {
            // The edge of a wire is a cell, which already counts with n = 1.
            edges.push(([term.nodes[1], term.nodes[2]], 0, term.home));
        }
        for &(edge, _, home) in &edges {
            nodes.extend(edge.map(|node| (node, -1, home)));
        }
        sum(&mut nodes);
        for &([a, b], number, home) in edges.iter().filter(|edge| edge.1 != 0) {
            self.push(Shape::PointEdge, [point, a, b, b], (number, home), reach, x);
        }
        for &(node, number, home) in nodes.iter().filter(|node| node.1 != -1) {
            self.push(Shape::PointPoint, [point, node, node, node], (1 + number, home), reach, x);
        }
        (self.edges, self.nodes) = (edges, nodes);
    }

    /// Sums terms with the same closest features at every end: they have the same distances and hence the same
    /// energies.
    fn merge(&mut self) {
        let Self { terms, order, .. } = self;
        order.clear();
        order.extend(0..terms.len() as u32);
        order.sort_unstable_by_key(|&k| (terms[k as usize].features, k));
        let mut kept = order.first().map_or(0, |&k| k as usize);
        for k in order.iter().skip(1).map(|&k| k as usize) {
            if terms[k].features == terms[kept].features {
                terms[kept].multiplicity += std::mem::take(&mut terms[k].multiplicity);
            } else {
                kept = k;
            }
        }
        terms.retain(|term| term.multiplicity != 0);
    }
}
