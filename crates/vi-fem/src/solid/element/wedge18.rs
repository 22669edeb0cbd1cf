//! The biquadratic wedge, which Gmsh generates next to triquadratic hexahedra.

use vi_mesh::CellKind;

use super::contract::Element;
use super::rule::{GAUSS_3, TRIANGLE_6, prism};
use super::wedge6::SLOPES;

/// The nodes are those of `Wedge15`; then follow the centres of the faces 0143, 1254, 2035. N is the product of a
/// quadratic polynomial on the triangle and one along ζ. The rule has 18 points and is exact to degree 4.
#[derive(Debug, Clone, Copy)]
pub struct Wedge18;

/// For each node: the node of the quadratic triangle (corners, then the midpoints of 01 12 20), and twice its ζ.
const PLACES: [(usize, usize); 18] = [
    (0, 0),
    (1, 0),
    (2, 0),
    (0, 2),
    (1, 2),
    (2, 2),
    (3, 0),
    (4, 0),
    (5, 0),
    (3, 2),
    (4, 2),
    (5, 2),
    (0, 1),
    (1, 1),
    (2, 1),
    (3, 1),
    (4, 1),
    (5, 1),
];

/// Returns the value and the derivatives of the shape function of a node of the quadratic triangle.
fn triangle(node: usize, [x, y]: [f64; 2]) -> (f64, [f64; 2]) {
    let b = [1.0 - x - y, x, y];
    match node.checked_sub(3) {
        None => (b[node] * (2.0 * b[node] - 1.0), SLOPES[node].map(|slope| (4.0 * b[node] - 1.0) * slope)),
        Some(p) => {
            let q = (p + 1) % 3;
            (4.0 * b[p] * b[q], [0, 1].map(|i| 4.0 * (SLOPES[p][i] * b[q] + b[p] * SLOPES[q][i])))
        }
    }
}

/// Returns the value and the derivative of the shape function of the node at ζ = `twice`/2 of the quadratic line on
/// [0, 1].
fn line(twice: usize, z: f64) -> (f64, f64) {
    match twice {
        0 => ((1.0 - z) * (1.0 - 2.0 * z), 4.0 * z - 3.0),
        1 => (4.0 * z * (1.0 - z), 4.0 - 8.0 * z),
        _ => (z * (2.0 * z - 1.0), 4.0 * z - 1.0),
    }
}

impl Element<18, 18> for Wedge18 {
    const KIND: CellKind = CellKind::Wedge18;
    const DEGREE: usize = 4;

    fn rule() -> [([f64; 3], f64); 18] {
        prism(TRIANGLE_6, GAUSS_3)
    }

    fn values([x, y, z]: [f64; 3]) -> [f64; 18] {
        PLACES.map(|(node, twice)| triangle(node, [x, y]).0 * line(twice, z).0)
    }

    fn gradients([x, y, z]: [f64; 3]) -> [[f64; 3]; 18] {
        PLACES.map(|(node, twice)| {
            let ((value, slopes), (height, slope)) = (triangle(node, [x, y]), line(twice, z));
            [slopes[0] * height, slopes[1] * height, value * slope]
        })
    }
}
