//! The trilinear hexahedron.

use vi_mesh::CellKind;

use super::contract::Element;
use super::rule::{GAUSS_2, cube};

/// The reference cell is [−1, 1]³: the bottom face ζ = −1 counter-clockwise from (−1, −1), then the top face. N = Π
/// (1 ± ξ)/2. The rule has eight points and is exact to degree 3 in each coordinate.
#[derive(Debug, Clone, Copy)]
pub struct Hex8;

impl Element<8, 8> for Hex8 {
    const KIND: CellKind = CellKind::Hex8;
    const DEGREE: usize = 3;

    fn rule() -> [([f64; 3], f64); 8] {
        cube(GAUSS_2)
    }

    fn values(xi: [f64; 3]) -> [f64; 8] {
        Self::nodes().map(|corner| (0..3).map(|i| 0.5 * (1.0 + corner[i] * xi[i])).product())
    }

    fn gradients(xi: [f64; 3]) -> [[f64; 3]; 8] {
        Self::nodes().map(|corner| {
            let factor = [0, 1, 2].map(|i| 0.5 * (1.0 + corner[i] * xi[i]));
            [0, 1, 2].map(|j| 0.5 * corner[j] * factor[(j + 1) % 3] * factor[(j + 2) % 3])
        })
    }
}
