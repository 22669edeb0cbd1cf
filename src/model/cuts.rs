//! Finds the faces on which the model of a body is cut off: planes of symmetry and the seams of periodic bodies.

use std::collections::{BTreeMap, BTreeSet};

use nalgebra::Vector3;
use vi_core::Coordinates;
use vi_mesh::Bounds;

/// The largest sine squared of the angle between the normal of a face and the span of the directions along which its nodes are
/// held.
const ALONG: f64 = 1e-9;

/// Round-off of places, relative to the largest one.
const ROUND_OFF: f64 = 1e-9;

/// How a node is held.
#[derive(Default)]
struct Held {
    /// Orthonormal directions along which it never moves.
    still: Vec<Vector3<f64>>,
    /// The number of its coordinates whose motion is prescribed.
    driven: u8,
}

/// The nodes at which the bodies of a component continue beyond their models.
pub(super) struct Cuts {
    held: BTreeMap<u32, Held>,
    /// The nodes of each side of each periodic pair.
    seams: Vec<BTreeSet<u32>>,
}

impl Cuts {
    /// Finds the cuts from the prescribed coordinates, and from pairs of periodic nodes, each with the number of its
    /// table.
    pub(super) fn new(coordinates: &Coordinates, periodic: &[((u32, u32), usize)]) -> Self {
        // For each prescribed coordinate: whether it never moves.
        let mut is_still: BTreeMap<u32, bool> = BTreeMap::new();
        for group in coordinates.prescribed() {
            is_still.extend((0..).zip(&group.dofs).map(|(place, &dof)| (dof, group.path.is_still(place))));
        }
        // A node that follows prescribed ones, such as those of a rigid body that is moved, is prescribed too.
        for (node, terms) in coordinates.combinations() {
            for axis in 0..3 {
                let parts = terms.iter().map(|&(part, _)| is_still.get(&(3 * part + axis)).copied());
                if let Some(parts) = parts.collect::<Option<Vec<bool>>>() {
                    is_still.insert(3 * node + axis, parts.into_iter().all(|part| part));
                }
            }
        }
        let mut held: BTreeMap<u32, Held> = BTreeMap::new();
        for (dof, is_still) in is_still {
            let (node, axis) = (dof / 3, dof as usize % 3);
            let of_node = held.entry(node).or_default();
            of_node.driven += 1;
            if is_still {
                let own = coordinates.axes_of(node).map(|axes| Vector3::from(axes[axis]));
                of_node.still.push(own.unwrap_or_else(|| Vector3::ith(axis, 1.0)));
            }
        }
        let mut seams: BTreeMap<usize, [BTreeSet<u32>; 2]> = BTreeMap::new();
        for &((from, to), table) in periodic {
            let sides = seams.entry(table).or_default();
            sides[0].insert(from);
            sides[1].insert(to);
        }
        Self { held, seams: seams.into_values().flatten().collect() }
    }

    /// Returns whether all nodes of a triangle are on one side of a seam.
    pub(super) fn is_on_seam(&self, triangle: [u32; 3]) -> bool {
        self.seams.iter().any(|seam| triangle.iter().all(|node| seam.contains(node)))
    }

    /// Returns whether a triangle, which is oriented outward, may lie on a plane of symmetry at positions x (m). Three
    /// conditions must hold. All its nodes are held still along its normal. Not all of them are prescribed in all
    /// coordinates, as they are where a body is glued or driven. No box of `others`, around the surfaces that may meet
    /// the triangle, lies in front of it, as at a bearing.
    pub(super) fn is_on_mirror(&self, triangle: [u32; 3], x: &[f64], others: &[Bounds]) -> bool {
        let [Some(a), Some(b), Some(c)] = triangle.map(|node| self.held.get(&node)) else { return false };
        let held = [a, b, c];
        if held.iter().all(|held| held.driven == 3) {
            return false;
        }
        let [a, b, c] = triangle.map(|node| Vector3::from_column_slice(&x[3 * node as usize..][..3]));
        let Some(normal) = (b - a).cross(&(c - a)).try_normalize(0.0) else { return false };
        let along = |held: &Held| held.still.iter().map(|by| by.dot(&normal).powi(2)).sum::<f64>();
        held.iter().all(|held| along(held) > 1.0 - ALONG)
            && !others.iter().any(|other| is_before((a + b + c) / 3.0, normal, other))
    }
}

/// Returns whether the ray from `place` along `direction` meets a box, by more than round-off beyond `place`.
fn is_before(place: Vector3<f64>, direction: Vector3<f64>, other: &Bounds) -> bool {
    let mut range = [ROUND_OFF * place.amax(), f64::INFINITY];
    for k in 0..3 {
        let [low, high] = [other.low[k], other.high[k]].map(|side| side - place[k]);
        if direction[k].abs() < ROUND_OFF {
            if low > 0.0 || high < 0.0 {
                return false;
            }
            continue;
        }
        let [near, far] = [low.min(high), low.max(high)].map(|side| side / direction[k]);
        range = [range[0].max(near.min(far)), range[1].min(near.max(far))];
    }
    range[0] < range[1]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_ray_meets_what_lies_before_it() {
        let other = Bounds { low: [-1.0, -1.0, 2.0], high: [1.0, 1.0, 3.0] };
        let meets = |place: [f64; 3], direction: [f64; 3]| is_before(place.into(), direction.into(), &other);
        assert!(meets([0.5, 0.5, 0.0], [0.0, 0.0, 1.0]));
        assert!(meets([0.0, 0.0, 0.0], [0.2, 0.0, 0.98]));
        assert!(!meets([0.5, 0.5, 0.0], [0.0, 0.0, -1.0]));
        assert!(!meets([1.5, 0.5, 0.0], [0.0, 0.0, 1.0]));
        assert!(!meets([0.5, 0.5, 3.0], [0.0, 0.0, 1.0]), "it touches a box behind");
    }
}
