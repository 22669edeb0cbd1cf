//! The linear wedge.

use vi_mesh::CellKind;

use super::contract::Element;
use super::rule::{GAUSS_2, TRIANGLE_3, prism};

/// The triangle (0,0) (1,0) (0,1) at ζ = 0, then at ζ = 1. N = b_a (1 − ζ) and b_a ζ with the barycentric coordinates
/// b. The rule has six points and is exact to degree 2.
#[derive(Debug, Clone, Copy)]
pub struct Wedge6;

/// Gradients of the barycentric coordinates of the triangle.
pub(super) const SLOPES: [[f64; 2]; 3] = [[-1.0, -1.0], [1.0, 0.0], [0.0, 1.0]];

impl Element<6, 6> for Wedge6 {
    const KIND: CellKind = CellKind::Wedge6;
    const DEGREE: usize = 2;

    fn rule() -> [([f64; 3], f64); 6] {
        prism(TRIANGLE_3, GAUSS_2)
    }

    fn values([x, y, z]: [f64; 3]) -> [f64; 6] {
        let b = [1.0 - x - y, x, y];
        std::array::from_fn(|a| b[a % 3] * if a < 3 { 1.0 - z } else { z })
    }

    fn gradients([x, y, z]: [f64; 3]) -> [[f64; 3]; 6] {
        let b = [1.0 - x - y, x, y];
        std::array::from_fn(|a| {
            let (height, slope) = if a < 3 { (1.0 - z, -1.0) } else { (z, 1.0) };
            [SLOPES[a % 3][0] * height, SLOPES[a % 3][1] * height, b[a % 3] * slope]
        })
    }
}
