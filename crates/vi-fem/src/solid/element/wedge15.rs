//! The quadratic serendipity wedge, without nodes on faces.

use vi_mesh::CellKind;

use super::contract::Element;
use super::rule::{GAUSS_3, TRIANGLE_6, prism};
use super::wedge6::SLOPES;

/// The corners are those of `Wedge6`; then follow the midpoints of the edges 01 12 20, 34 45 53, 03 14 25. With
/// barycentric coordinates b and h = 1 − ζ or ζ: N = b h (2b + 2h − 3) at corners, 4 b_a b_b h on the edges of the
/// triangles, 4 b ζ (1 − ζ) on the upright edges. The rule has 18 points and is exact to degree 4.
#[derive(Debug, Clone, Copy)]
pub struct Wedge15;

/// Returns h = 1 − ζ or ζ for a corner, and its derivative.
fn height(corner: usize, z: f64) -> (f64, f64) {
    if corner < 3 { (1.0 - z, -1.0) } else { (z, 1.0) }
}

impl Element<15, 18> for Wedge15 {
    const KIND: CellKind = CellKind::Wedge15;
    const DEGREE: usize = 4;

    fn rule() -> [([f64; 3], f64); 18] {
        prism(TRIANGLE_6, GAUSS_3)
    }

    fn values([x, y, z]: [f64; 3]) -> [f64; 15] {
        let b = [1.0 - x - y, x, y];
        std::array::from_fn(|a| match a.checked_sub(6) {
            None => {
                let (h, _) = height(a, z);
                b[a % 3] * h * (2.0 * b[a % 3] + 2.0 * h - 3.0)
            }
            Some(edge @ 0..6) => {
                let [p, q] = Self::KIND.edges()[edge];
                4.0 * b[p % 3] * b[q % 3] * height(p, z).0
            }
            Some(edge) => 4.0 * b[edge - 6] * z * (1.0 - z),
        })
    }

    fn gradients([x, y, z]: [f64; 3]) -> [[f64; 3]; 15] {
        let b = [1.0 - x - y, x, y];
        std::array::from_fn(|a| match a.checked_sub(6) {
            None => {
                let ((h, slope), b, db) = (height(a, z), b[a % 3], SLOPES[a % 3]);
                let by_b = h * (4.0 * b + 2.0 * h - 3.0);
                [by_b * db[0], by_b * db[1], slope * b * (2.0 * b + 4.0 * h - 3.0)]
            }
            Some(edge @ 0..6) => {
                let [p, q] = Self::KIND.edges()[edge].map(|corner| corner % 3);
                let (h, slope) = height(Self::KIND.edges()[edge][0], z);
                let across = [0, 1].map(|i| 4.0 * h * (SLOPES[p][i] * b[q] + b[p] * SLOPES[q][i]));
                [across[0], across[1], 4.0 * b[p] * b[q] * slope]
            }
            Some(edge) => {
                let corner = edge - 6;
                let bubble = 4.0 * z * (1.0 - z);
                [SLOPES[corner][0] * bubble, SLOPES[corner][1] * bubble, 4.0 * b[corner] * (1.0 - 2.0 * z)]
            }
        })
    }
}
