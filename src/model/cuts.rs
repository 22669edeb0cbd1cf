//! Finds the faces on which the model of a body is cut off: planes of symmetry and the seams of periodic bodies.

use std::collections::{BTreeMap, BTreeSet};

use nalgebra::Vector3;
use vi_core::Coordinates;

/// The largest sine squared of the angle between the normal of a face and the span of the directions along which its nodes are
/// held.
const ALONG: f64 = 1e-9;

/// Where the bodies of a component continue beyond their models.
pub(super) struct Cuts {
    /// The directions along which nodes are held still, in rising order of nodes.
    held: BTreeMap<u32, Vec<Vector3<f64>>>,
    /// The nodes of each side of each periodic pair.
    seams: Vec<BTreeSet<u32>>,
}

impl Cuts {
    /// Finds them from the prescribed coordinates, and from pairs of periodic nodes, each with the number of its table.
    pub(super) fn new(coordinates: &Coordinates, periodic: &[((u32, u32), usize)]) -> Self {
        let mut held: BTreeMap<u32, Vec<Vector3<f64>>> = BTreeMap::new();
        let still = coordinates.prescribed().iter().filter(|group| group.path.is_fixed());
        for &dof in still.flat_map(|group| &group.dofs) {
            let (node, axis) = (dof / 3, dof as usize % 3);
            let own = coordinates.axes_of(node).map(|axes| Vector3::from(axes[axis]));
            held.entry(node).or_default().push(own.unwrap_or_else(|| Vector3::ith(axis, 1.0)));
        }
        let mut seams: BTreeMap<usize, [BTreeSet<u32>; 2]> = BTreeMap::new();
        for &((from, to), table) in periodic {
            let sides = seams.entry(table).or_default();
            sides[0].insert(from);
            sides[1].insert(to);
        }
        Self { held, seams: seams.into_values().flatten().collect() }
    }

    /// Returns whether a triangle is a face of a cut, with positions at rest (m): all its nodes are on one side of a seam, or are held
    /// along its normal but not all held wholly, as on a plane of symmetry and not as where the body is glued.
    pub(super) fn contain(&self, triangle: [u32; 3], rest: &[[f64; 3]]) -> bool {
        if self.seams.iter().any(|seam| triangle.iter().all(|node| seam.contains(node))) {
            return true;
        }
        let [Some(a), Some(b), Some(c)] = triangle.map(|node| self.held.get(&node)) else { return false };
        let held = [a, b, c];
        if held.iter().all(|directions| directions.len() == 3) {
            return false;
        }
        let [a, b, c] = triangle.map(|node| Vector3::from(rest[node as usize]));
        let Some(normal) = (b - a).cross(&(c - a)).try_normalize(0.0) else { return false };
        // The directions of a node are orthonormal.
        let along =
            |directions: &[Vector3<f64>]| directions.iter().map(|by| by.dot(&normal).powi(2)).sum::<f64>();
        held.iter().all(|directions| along(directions) > 1.0 - ALONG)
    }
}
