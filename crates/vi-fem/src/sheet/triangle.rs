//! A triangle at rest: its frame, its plane, and the gradients of its barycentric coordinates.

use crate::small::tensor::{cross, dot};

/// An orthonormal frame of a triangle at rest: two axes in its plane, and the normal.
pub(crate) type Frame = [[f64; 3]; 3];

/// Returns the frame of a triangle. Its first axis is `direction`, a unit vector in the plane, or else the first
/// edge.
pub(crate) fn frame(corners: &[[f64; 3]; 3], direction: Option<[f64; 3]>) -> Frame {
    let edge = |k: usize| [0, 1, 2].map(|i| corners[k][i] - corners[0][i]);
    let unit = |v: [f64; 3]| {
        let length = dot(v, v).sqrt();
        v.map(|c| c / length)
    };
    let normal = unit(cross(edge(1), edge(2)));
    let first = direction.unwrap_or_else(|| unit(edge(1)));
    [first, cross(normal, first), normal]
}

/// Returns the corners in the plane of a frame, relative to the first corner, m.
pub(crate) fn flatten(corners: &[[f64; 3]; 3], frame: &Frame) -> [[f64; 2]; 3] {
    corners.map(|corner| {
        let d = [0, 1, 2].map(|i| corner[i] - corners[0][i]);
        [dot(d, frame[0]), dot(d, frame[1])]
    })
}

/// Returns the gradients of the three barycentric coordinates (1/m) and the area (m²).
pub(crate) fn barycentric_gradients(p: &[[f64; 2]; 3]) -> ([[f64; 2]; 3], f64) {
    let twice = (p[1][0] - p[0][0]) * (p[2][1] - p[0][1]) - (p[1][1] - p[0][1]) * (p[2][0] - p[0][0]);
    let gradient = |k: usize| {
        let (q, r) = (p[(k + 1) % 3], p[(k + 2) % 3]);
        [(q[1] - r[1]) / twice, (r[0] - q[0]) / twice]
    };
    ([gradient(0), gradient(1), gradient(2)], 0.5 * twice)
}
