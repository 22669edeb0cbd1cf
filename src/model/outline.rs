//! Surfaces of bodies as triangles in one configuration, with exact tests of whether they cross or enclose each other.

use vi_core::DisjointSets;

use super::{BodyModel, RigidModel};
use crate::intersections::{intersections_where, is_inside};
use crate::scene::RigidShape;

/// Round-off of heights over a half-space, relative to the largest coordinate: far more than that of the normal and of the
/// difference of two places.
const ROUND_OFF: f64 = 64.0 * f64::EPSILON;

/// The surface of a body.
#[derive(Debug, Clone, Default)]
pub(crate) struct Outline {
    /// Positions, m.
    pub(crate) points: Vec<[f64; 3]>,
    pub(crate) triangles: Vec<[u32; 3]>,
    /// Whether the body fills this surface. A sheet does not.
    pub(crate) is_filled: bool,
    /// A point on the face of a half-space (m), and its outward normal.
    pub(crate) face: Option<[[f64; 3]; 2]>,
    /// A point on each connected piece of the surface.
    pieces: Vec<u32>,
}

impl Outline {
    fn new(points: Vec<[f64; 3]>, triangles: Vec<[u32; 3]>, is_filled: bool) -> Self {
        let pieces = pieces(points.len(), &triangles);
        Self { points, triangles, is_filled, face: None, pieces }
    }

    /// Makes the outline of a deformable body with nodes at `points`.
    pub(crate) fn of_body(body: &BodyModel, points: Vec<[f64; 3]>) -> Self {
        // The elements were accepted as those of a body when it was built, so they have faces.
        let surface = vi_mesh::Surface::of_body(&body.mesh, body.dimension);
        let triangles = surface.map(|surface| surface.triangles()).unwrap_or_default();
        Self::new(points, triangles, body.dimension == 3)
    }

    /// Makes the outline of a rigid body at positions x of the nodes of its component; that of a half-space has only its face.
    pub(crate) fn of_rigid(rigid: &RigidModel, x: &[f64]) -> Self {
        let Some(form) = &rigid.form else { return Self::default() };
        if let Some(RigidShape::Plane { normal }) = rigid.shape {
            let [a, b] = [[0.0; 3], normal].map(|end| rigid.carry(x, &[end])[0]);
            return Self { face: Some([a, [0, 1, 2].map(|k| b[k] - a[k])]), ..Self::default() };
        }
        Self::new(rigid.carry(x, &form.points), form.triangles.clone(), true)
    }

    /// Returns a point of a piece of `other` that lies wholly within this body, provided that their surfaces do not cross;
    /// `None` if there is none.
    pub(crate) fn enclosed_point(&self, other: &Self) -> Option<u32> {
        let within = |&piece: &u32| is_inside(other.points[piece as usize], &self.points, &self.triangles);
        other.pieces.iter().copied().find(|piece| self.is_filled && within(piece))
    }

    /// Returns the points of the surface of `other` that lie in this half-space, by more than round-off; none if this is no
    /// half-space.
    pub(crate) fn sunk_points(&self, other: &Self) -> Vec<u32> {
        let Some([origin, normal]) = self.face else { return Vec::new() };
        let is_sunk = |point: &u32| {
            let place = other.points[*point as usize];
            let height: f64 = (0..3).map(|k| normal[k] * (place[k] - origin[k])).sum();
            let largest = |vector: [f64; 3]| vector.iter().fold(0.0_f64, |largest, x| largest.max(x.abs()));
            height < -ROUND_OFF * largest(normal) * largest(place).max(largest(origin))
        };
        let mut points: Vec<u32> = other.triangles.as_flattened().to_vec();
        points.sort_unstable();
        points.dedup();
        points.retain(is_sunk);
        points
    }

    /// Returns the point nearest to `place`, and its distance (m).
    pub(crate) fn nearest_point(&self, place: [f64; 3]) -> Option<(usize, f64)> {
        let distance =
            |point: &[f64; 3]| point.iter().zip(place).map(|(a, b)| (a - b).powi(2)).sum::<f64>().sqrt();
        let on_surface = self.triangles.iter().flatten().map(|&point| point as usize);
        on_surface.map(|point| (point, distance(&self.points[point]))).min_by(|a, b| a.1.total_cmp(&b.1))
    }

    /// Returns whether the boxes around the surfaces of two bodies overlap.
    pub(crate) fn is_near(&self, other: &Self) -> bool {
        let ends = |outline: &Self, axis: usize| {
            let values = || outline.points.iter().map(|point| point[axis]);
            (values().fold(f64::INFINITY, f64::min), values().fold(f64::NEG_INFINITY, f64::max))
        };
        (0..3).all(|axis| {
            let ((low, high), (least, most)) = (ends(self, axis), ends(other, axis));
            low <= most && least <= high
        })
    }

    /// Returns whether the surfaces of two bodies cross, or one lies within the other.
    pub(crate) fn meets(&self, other: &Self) -> bool {
        if self.enclosed_point(other).is_some() || other.enclosed_point(self).is_some() {
            return true;
        }
        let first = self.points.len() as u32;
        let mut points = self.points.clone();
        points.extend(&other.points);
        let mut triangles = self.triangles.clone();
        triangles.extend(other.triangles.iter().map(|triangle| triangle.map(|node| first + node)));
        let are_of_both = |a: u32, b: u32| (a < first) != (b < first);
        !intersections_where(&points, &triangles, &[], are_of_both).is_empty()
    }
}

/// Returns the outline of body number `number` of a scene at positions x of the nodes of its component.
pub(super) fn outline(number: usize, bodies: &[BodyModel], rigids: &[RigidModel], x: &[f64]) -> Outline {
    match number.checked_sub(bodies.len()) {
        Some(rigid) => Outline::of_rigid(&rigids[rigid], x),
        None => {
            let (body, (all, _)) = (&bodies[number], x.as_chunks::<3>());
            Outline::of_body(body, (0..body.mesh.points.len()).map(|node| all[body.node(node)]).collect())
        }
    }
}

/// Returns a node of each connected piece of a surface.
fn pieces(count: usize, triangles: &[[u32; 3]]) -> Vec<u32> {
    let mut sets = DisjointSets::new(count);
    for &[a, b, c] in triangles {
        sets.join(a, b);
        sets.join(a, c);
    }
    let mut roots: Vec<u32> = triangles.iter().map(|triangle| sets.root(triangle[0])).collect();
    roots.sort_unstable();
    roots.dedup();
    roots
}
