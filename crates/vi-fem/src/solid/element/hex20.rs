//! The quadratic serendipity hexahedron, without nodes on faces or in the centre.

use vi_mesh::CellKind;

use super::contract::Element;
use super::rule::{GAUSS_3, cube};

/// The corners are those of `Hex8`; then follow the midpoints of the edges 01 12 23 30, 45 56 67 74, 04 15 26 37. N =
/// Π (1 + ξ ξ_a)/8 (ξ·ξ_a − 2) at corners, (1 − ξ²)(1 ± η)(1 ± ζ)/4 on edges along ξ. The rule has 27 points and is
/// exact to degree 5 in each coordinate.
#[derive(Debug, Clone, Copy)]
pub struct Hex20;

/// Returns the factor of one coordinate and its derivative: (1 + ξ ξ_a) at an end, (1 − ξ²) in the middle.
fn factor(node: f64, xi: f64) -> (f64, f64) {
    if node == 0.0 { (1.0 - xi * xi, -2.0 * xi) } else { (1.0 + node * xi, node) }
}

impl Element<20, 27> for Hex20 {
    const KIND: CellKind = CellKind::Hex20;
    const DEGREE: usize = 5;

    fn rule() -> [([f64; 3], f64); 27] {
        cube(GAUSS_3)
    }

    fn values(xi: [f64; 3]) -> [f64; 20] {
        Self::nodes().map(|node| {
            let product: f64 = (0..3).map(|i| factor(node[i], xi[i]).0).product();
            if node.contains(&0.0) {
                0.25 * product
            } else {
                0.125 * product * ((0..3).map(|i| node[i] * xi[i]).sum::<f64>() - 2.0)
            }
        })
    }

    fn gradients(xi: [f64; 3]) -> [[f64; 3]; 20] {
        Self::nodes().map(|node| {
            let factors = [0, 1, 2].map(|i| factor(node[i], xi[i]));
            let product: f64 = factors.iter().map(|(value, _)| value).product();
            let corner = !node.contains(&0.0);
            let sum = (0..3).map(|i| node[i] * xi[i]).sum::<f64>() - 2.0;
            [0, 1, 2].map(|j| {
                let slope = factors[j].1 * factors[(j + 1) % 3].0 * factors[(j + 2) % 3].0;
                if corner { 0.125 * (slope * sum + product * node[j]) } else { 0.25 * slope }
            })
        })
    }
}
