//! Finds the simplices of a body near a point, with inclusion–exclusion numbers, grouped by closest feature.

use crate::distance::{Closest, Shape, Vec3, at};
use crate::surface::{Gauge, Surface};

/// A simplex near a point at `ENDS` configurations: one, or both ends of a step.
#[derive(Debug, Clone, Copy)]
pub(crate) struct PointTerm<const ENDS: usize> {
    /// The kind of pair.
    pub(crate) shape: Shape,
    /// The point and the nodes of the simplex; the last one is repeated.
    pub(crate) nodes: [u32; 4],
    /// Sum n of the inclusion–exclusion numbers.
    pub(crate) multiplicity: i32,
    /// Closest points at each end.
    pub(crate) closest: [Closest; ENDS],
    /// Nodes of the closest feature at each end.
    features: [[u32; 3]; ENDS],
}

/// Scratch memory for the cells near one point.
#[derive(Debug, Default)]
pub(crate) struct Group<const ENDS: usize> {
    /// The terms of the point against one body; no two have the same closest features.
    pub(crate) terms: Vec<PointTerm<ENDS>>,
    edges: Vec<([u32; 2], i32)>,
    nodes: Vec<(u32, i32)>,
}

/// Marks a missing node.
const NONE: u32 = u32::MAX;

impl<const ENDS: usize> Group<ENDS> {
    pub(crate) fn new() -> Self {
        Self { terms: Vec::new(), edges: Vec::new(), nodes: Vec::new() }
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
        for &cell in cells {
            let cell = &surface.cells[cell as usize];
            let [a, b, c] = cell.nodes;
            self.push(cell.shape(), [node, a, b, c], 1, reach, x);
        }
        if self.terms.len() > 1 {
            self.share(node, reach, x);
            self.merge();
        }
    }

    /// Adds a term if it is within reach at some end.
    #[inline]
    fn push(&mut self, shape: Shape, nodes: [u32; 4], multiplicity: i32, reach: f64, x: [&[f64]; ENDS]) {
        let closest = x.map(|x| shape.closest(&nodes.map(|node| at(x, node))));
        if closest.iter().any(|closest| closest.squared < reach) {
            let features = closest.map(|closest| feature(&nodes, &closest));
            self.terms.push(PointTerm { shape, nodes, multiplicity, closest, features });
        }
    }

    /// Adds the edges and nodes that several cells share, with their numbers n.
    fn share(&mut self, point: u32, reach: f64, x: [&[f64]; ENDS]) {
        self.edges.clear();
        self.nodes.clear();
        for term in &self.terms {
            match term.shape {
                Shape::PointTriangle => {
                    let [_, a, b, c] = term.nodes;
                    for edge in [[a, b], [a, c], [b, c]] {
                        match self.edges.iter_mut().find(|(other, _)| *other == edge) {
                            Some((_, number)) => *number -= 1,
                            None => self.edges.push((edge, 0)),
                        }
                    }
                    [a, b, c].into_iter().for_each(|node| add(&mut self.nodes, node, 1));
                }
                // The edge of a wire is a cell, which already counts with n = 1.
                Shape::PointEdge => self.edges.push(([term.nodes[1], term.nodes[2]], 0)),
                _ => {}
            }
        }
        for &([a, b], _) in &self.edges {
            add(&mut self.nodes, a, -1);
            add(&mut self.nodes, b, -1);
        }
        let (edges, nodes) = (std::mem::take(&mut self.edges), std::mem::take(&mut self.nodes));
        for &([a, b], number) in edges.iter().filter(|&&(_, number)| number != 0) {
            self.push(Shape::PointEdge, [point, a, b, b], number, reach, x);
        }
        for &(node, number) in nodes.iter().filter(|&&(_, number)| number != -1) {
            self.push(Shape::PointPoint, [point, node, node, node], 1 + number, reach, x);
        }
        (self.edges, self.nodes) = (edges, nodes);
    }

    /// Sums terms with the same closest features at every end: they have the same distances and hence the same
    /// energies.
    fn merge(&mut self) {
        let terms = &mut self.terms;
        let mut kept = 0;
        for k in 0..terms.len() {
            let term = terms[k];
            match terms[..kept].iter_mut().find(|other| other.features == term.features) {
                Some(other) => other.multiplicity += term.multiplicity,
                None => {
                    terms[kept] = term;
                    kept += 1;
                }
            }
        }
        terms.truncate(kept);
        terms.retain(|term| term.multiplicity != 0);
    }
}

fn add(nodes: &mut Vec<(u32, i32)>, node: u32, number: i32) {
    match nodes.iter_mut().find(|(other, _)| *other == node) {
        Some((_, sum)) => *sum += number,
        None => nodes.push((node, number)),
    }
}

/// Returns the nodes of the simplex that determine the closest point.
#[inline]
fn feature(nodes: &[u32; 4], closest: &Closest) -> [u32; 3] {
    let mut feature = [NONE; 3];
    let mut count = 0;
    for a in 1..4 {
        if closest.weights[a] != 0.0 {
            feature[count] = nodes[a];
            count += 1;
        }
    }
    feature
}

impl<const ENDS: usize> PointTerm<ENDS> {
    /// Returns the positions of the nodes at each end.
    pub(crate) fn positions(&self, x: [&[f64]; ENDS]) -> [[Vec3; 4]; ENDS] {
        x.map(|x| self.nodes.map(|node| at(x, node)))
    }
}
