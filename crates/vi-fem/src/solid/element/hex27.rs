//! The triquadratic hexahedron.

use vi_mesh::CellKind;

use super::contract::Element;
use super::rule::{GAUSS_3, cube};

/// The nodes are those of `Hex20`; then follow the centres of the faces x−, x+, y−, y+, z−, z+ and the centre. N is a
/// product of quadratic Lagrange polynomials. The rule has 27 points and is exact to degree 5 in each coordinate. The
/// nodes are Lobatto points, so lumping the mass keeps the order.
#[derive(Debug, Clone, Copy)]
pub struct Hex27;

/// Returns the quadratic Lagrange polynomial of a node at −1, 0 or 1, and its derivative.
fn lagrange(node: f64, xi: f64) -> (f64, f64) {
    if node == 0.0 { (1.0 - xi * xi, -2.0 * xi) } else { (0.5 * xi * (xi + node), xi + 0.5 * node) }
}

impl Element<27, 27> for Hex27 {
    const KIND: CellKind = CellKind::Hex27;
    const DEGREE: usize = 5;

    fn rule() -> [([f64; 3], f64); 27] {
        cube(GAUSS_3)
    }

    fn values(xi: [f64; 3]) -> [f64; 27] {
        Self::nodes().map(|node| (0..3).map(|i| lagrange(node[i], xi[i]).0).product())
    }

    fn gradients(xi: [f64; 3]) -> [[f64; 3]; 27] {
        Self::nodes().map(|node| {
            let factors = [0, 1, 2].map(|i| lagrange(node[i], xi[i]));
            [0, 1, 2].map(|j| factors[j].1 * factors[(j + 1) % 3].0 * factors[(j + 2) % 3].0)
        })
    }
}
