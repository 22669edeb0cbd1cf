//! Surfaces of the shapes of rigid bodies: triangles for viewing, and triangles or skeletons for contact.

use std::f64::consts::{PI, TAU};

use nalgebra::Matrix3;

use crate::scene::RigidShape;

/// Number of points around a round shape, and from pole to pole, for viewing; contact uses the exact shape.
const AROUND: u32 = 24;
const ALONG: u32 = 12;
/// Number of points around a cylinder, which is a prism in contact. The faces of the prism lie inside the cylinder, by
/// at most R (1 − cos(π/96)) = 5.4e-4 R.
const AROUND_CYLINDER: u32 = 96;

/// The form of a rigid body: its surface, and its volume with moments.
#[derive(Debug, Clone)]
pub(crate) struct Form {
    /// Points of the surface in the body's local axes from its centre of mass, m.
    pub(crate) points: Vec<[f64; 3]>,
    /// Triangles of the surface, with normals outward.
    pub(crate) triangles: Vec<[u32; 3]>,
    /// The point of a ball or the ends of a capsule, used by contact with `radius`; empty for other shapes.
    pub(crate) skeleton: Vec<[f64; 3]>,
    /// Radius of a ball or capsule, m; 0 for other shapes.
    pub(crate) radius: f64,
    /// Volume, m³; infinite for a half-space.
    pub(crate) volume: f64,
    /// Centre of mass from the body's position in its local axes, m.
    pub(crate) centre: [f64; 3],
    /// Mean of r rᵀ over the volume from the centre of mass, m²: Euler's tensor per unit mass.
    pub(crate) squares: Matrix3<f64>,
    /// Smallest thickness of the shape, m.
    pub(crate) thickness: f64,
}

/// Returns the form of a shape given by lengths; that of a mesh is read from its file (`rigid_mesh.rs`).
pub(crate) fn form(shape: &RigidShape) -> Form {
    let (skeleton, radius) = match *shape {
        RigidShape::Sphere { radius } => (vec![[0.0; 3]], radius),
        RigidShape::Capsule { length, radius } => {
            ([-0.5, 0.5].map(|end| [end * length, 0.0, 0.0]).to_vec(), radius)
        }
        _ => (Vec::new(), 0.0),
    };
    let (points, triangles) = surface(shape);
    Form {
        points,
        triangles,
        skeleton,
        radius,
        volume: shape.volume(),
        centre: [0.0; 3],
        squares: Matrix3::from_diagonal(&shape.mean_squares().into()),
        thickness: shape.thickness(),
    }
}

impl Form {
    /// Returns the surface for contact: points with triangles, or a skeleton.
    pub(crate) fn outside(&self) -> (&[[f64; 3]], &[[u32; 3]]) {
        if self.radius > 0.0 { (&self.skeleton, &[]) } else { (&self.points, &self.triangles) }
    }
}

/// Returns points (m) in the body's local axes from its centre, and triangles with outward normals.
fn surface(shape: &RigidShape) -> (Vec<[f64; 3]>, Vec<[u32; 3]>) {
    match *shape {
        RigidShape::Box { size } => cuboid(size),
        RigidShape::Sphere { radius } => {
            let rings: Vec<[f64; 2]> = (1..ALONG)
                .map(|k| PI * f64::from(k) / f64::from(ALONG))
                .map(|angle| [-radius * angle.cos(), radius * angle.sin()])
                .collect();
            revolved(-radius, &rings, radius, AROUND)
        }
        RigidShape::Rod { length, radius } | RigidShape::Cylinder { length, radius } => {
            let (a, b) = (-0.5 * length, 0.5 * length);
            revolved(a, &[[a, radius], [b, radius]], b, AROUND_CYLINDER)
        }
        RigidShape::Capsule { length, radius } => {
            let end =
                |sign: f64, angle: f64| [sign * (0.5 * length + radius * angle.cos()), radius * angle.sin()];
            let angle = |k: u32| 0.5 * PI * f64::from(k) / f64::from(ALONG / 2);
            let first = (1..=ALONG / 2).map(|k| end(-1.0, angle(k)));
            let last = (1..=ALONG / 2).rev().map(|k| end(1.0, angle(k)));
            let (rings, pole) = (first.chain(last).collect::<Vec<_>>(), 0.5 * length + radius);
            revolved(-pole, &rings, pole, AROUND)
        }
        RigidShape::Plane { .. } | RigidShape::Mesh { .. } => (Vec::new(), Vec::new()),
    }
}

fn cuboid(size: [f64; 3]) -> (Vec<[f64; 3]>, Vec<[u32; 3]>) {
    let corner = |c: u32| [0, 1, 2].map(|k| (f64::from(c >> k & 1) - 0.5) * size[k]);
    let points = (0..8).map(corner).collect();
    let faces = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    (points, faces.into_iter().flat_map(|[a, b, c, d]| [[a, b, c], [a, c, d]]).collect())
}

/// Returns the surface of revolution about the first axis through `rings` (axial position, radius), each of `around`
/// points. `first` and `last` are the positions of the poles, which are single points.
fn revolved(first: f64, rings: &[[f64; 2]], last: f64, around: u32) -> (Vec<[f64; 3]>, Vec<[u32; 3]>) {
    let angle = |k: u32| TAU * f64::from(k) / f64::from(around);
    let point = |[x, r]: [f64; 2], k: u32| [x, r * angle(k).cos(), r * angle(k).sin()];
    let mut points: Vec<[f64; 3]> =
        rings.iter().flat_map(|&ring| (0..around).map(move |k| point(ring, k))).collect();
    let count = points.len() as u32;
    points.extend([[first, 0.0, 0.0], [last, 0.0, 0.0]]);
    let mut triangles = Vec::new();
    for k in 0..around {
        let next = (k + 1) % around;
        triangles.push([count, next, k]);
        for start in (around..count).step_by(around as usize) {
            let [a, b] = [start - around + k, start - around + next];
            let [c, d] = [start + k, start + next];
            triangles.extend([[a, b, c], [b, d, c]]);
        }
        triangles.push([count + 1, count - around + k, count - around + next]);
    }
    (points, triangles)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns the enclosed volume, m³, positive if normals point outward.
    fn volume(shape: &RigidShape) -> f64 {
        let (x, triangles) = surface(shape);
        let of = |[a, b, c]: [u32; 3]| {
            let [a, b, c] = [a, b, c].map(|k| x[k as usize]);
            let normal = [b[1] * c[2] - b[2] * c[1], b[2] * c[0] - b[0] * c[2], b[0] * c[1] - b[1] * c[0]];
            (0..3).map(|k| a[k] * normal[k]).sum::<f64>() / 6.0
        };
        triangles.into_iter().map(of).sum()
    }

    #[test]
    fn surfaces_are_closed_and_look_outward() {
        for (shape, part) in [
            (RigidShape::Box { size: [1.0, 2.0, 3.0] }, 1e-12),
            (RigidShape::Sphere { radius: 0.7 }, 0.05),
            (RigidShape::Rod { length: 2.0, radius: 0.1 }, 0.02),
            (RigidShape::Capsule { length: 2.0, radius: 0.3 }, 0.03),
        ] {
            let ratio = volume(&shape) / shape.volume();
            assert!((ratio - 1.0).abs() < part, "{shape:?}: {ratio}");
            // Every edge belongs to two triangles with opposite directions along it. No edge is as short as round-off.
            let (x, triangles) = surface(&shape);
            let edges: Vec<[u32; 2]> =
                triangles.iter().flat_map(|&[a, b, c]| [[a, b], [b, c], [c, a]]).collect();
            assert!(edges.iter().all(|&[a, b]| edges.iter().filter(|&&edge| edge == [b, a]).count() == 1));
            let length = |[a, b]: [u32; 2]| {
                (0..3).map(|k| (x[a as usize][k] - x[b as usize][k]).powi(2)).sum::<f64>().sqrt()
            };
            assert!(edges.iter().all(|&edge| length(edge) > 0.005), "{shape:?}");
        }
    }
}
