//! A simplex of a body near a point, with its inclusion–exclusion number and its closest points.

use crate::distance::{Closest, Shape, Vec3, at};

/// The nodes of the part of a simplex on which a closest point lies; missing ones are `NONE`.
pub(super) type Feature = [u32; 3];

/// A simplex near a point at `ENDS` configurations: one, or both ends of a step.
#[derive(Debug, Clone, Copy)]
pub(crate) struct PointTerm<const ENDS: usize> {
    /// The kind of pair.
    pub(crate) shape: Shape,
    /// The point and the nodes of the simplex; the last one is repeated.
    pub(crate) nodes: [u32; 4],
    /// Sum n of the inclusion–exclusion numbers.
    pub(crate) multiplicity: i32,
    /// The first of the point's cells that contains the simplex.
    pub(crate) home: u32,
    /// Closest points at each end.
    pub(crate) closest: [Closest; ENDS],
    /// The closest feature at each end.
    pub(super) features: [Feature; ENDS],
}

/// Marks a missing node.
pub(super) const NONE: u32 = u32::MAX;

/// Returns the nodes of the simplex that determine the closest point.
#[inline]
pub(super) fn feature(nodes: &[u32; 4], closest: &Closest) -> Feature {
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
