//! Shape functions of every kind, derived from its reference nodes.
//!
//! Let r_a be the product, over the factors of the shape, of the lowest barycentric polynomial that is 1 at node a
//! and 0 at all nodes before it: b at a corner, 4 b b′ at the midpoint between two. Then N_a = r_a − Σ_{c > a}
//! r_a(ξ_c) N_c, because nodes are sorted by dimension: corners, edges, faces, cell. For the linear kinds N = r.
//!
//! Values at dyadic points ξ (as in refinement) are exact, because all products and sums are short binary fractions.
//! The exception is the interior of quadratic pyramids, whose functions are rational.

use crate::cell::CellKind;
use crate::cell::shape::Shape;

/// The shape functions of a kind.
pub(crate) struct ShapeFunctions {
    kind: CellKind,
    /// For each node a: the later nodes c with r_a(ξ_c) ≠ 0, and that value.
    later: Vec<Vec<(usize, f64)>>,
}

impl ShapeFunctions {
    pub(crate) fn of(kind: CellKind) -> Self {
        let nodes = kind.reference_nodes();
        let of_node = |a: usize| {
            let value = |c: usize| (c, lowest(kind.shape(), nodes[a], nodes[c]));
            (a + 1..nodes.len()).map(value).filter(|(_, value)| *value != 0.0).collect()
        };
        Self { kind, later: (0..nodes.len()).map(of_node).collect() }
    }

    /// Returns N_a(ξ) of all nodes; their sum is 1.
    pub(crate) fn values(&self, xi: [f64; 3]) -> Vec<f64> {
        let shape = self.kind.shape();
        let nodes = self.kind.reference_nodes();
        let mut values: Vec<f64> = nodes.iter().map(|&node| lowest(shape, node, xi)).collect();
        for a in (0..values.len()).rev() {
            values[a] -= self.later[a].iter().map(|&(c, value)| value * values[c]).sum::<f64>();
        }
        values
    }
}

/// Returns r(ξ) of the node at `node`.
fn lowest(shape: &Shape, node: [f64; 3], xi: [f64; 3]) -> f64 {
    if !shape.is_cone {
        return product(shape, node, xi);
    }
    // In a cone over the square, (ξ, η)/(1 − ζ) is the projection to the base.
    let width = 1.0 - xi[2];
    let flat = |[x, y, z]: [f64; 3]| if z == 1.0 { [0.0; 3] } else { [x / (1.0 - z), y / (1.0 - z), 0.0] };
    if node[2] == 1.0 {
        return xi[2];
    }
    let base = product(shape, flat(node), flat(xi));
    let is_corner = node[0] != 0.0 && node[1] != 0.0;
    match (node[2] == 0.0, is_corner) {
        (true, true) => width * base,
        (true, false) => width * width * base,
        _ => 4.0 * xi[2] * width * base,
    }
}

/// Returns the product over the factors of b (if the node is at a corner of the factor) or 4 b b′ (if it is midway
/// between two corners).
fn product(shape: &Shape, node: [f64; 3], xi: [f64; 3]) -> f64 {
    let low = shape.corners[0][0];
    let fraction = |x: f64| if low < 0.0 { 0.5 * (1.0 + x) } else { x };
    let mut product = 1.0;
    for axes in shape.factors {
        let barycentric = |point: [f64; 3], corner: usize| match corner.checked_sub(1) {
            Some(k) => fraction(point[axes[k]]),
            None => 1.0 - axes.iter().map(|&axis| fraction(point[axis])).sum::<f64>(),
        };
        let around: Vec<usize> = (0..=axes.len()).filter(|&corner| barycentric(node, corner) > 0.0).collect();
        for &corner in &around {
            product *= around.len() as f64 * barycentric(xi, corner);
        }
    }
    product
}
