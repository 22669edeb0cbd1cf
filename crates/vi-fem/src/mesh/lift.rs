//! Quadratic elements in the place of linear ones. It must not know where the mesh came from.

use std::collections::HashMap;

use super::Mesh;
use crate::{ElementBlock, ElementKind};

const EDGE: &[[usize; 2]] = &[[0, 1]];
const TRIANGLE: &[[usize; 2]] = &[[0, 1], [1, 2], [2, 0]];
const QUADRILATERAL: &[[usize; 2]] = &[[0, 1], [1, 2], [2, 3], [3, 0]];
const TETRAHEDRON: &[[usize; 2]] = &[[0, 1], [1, 2], [2, 0], [0, 3], [1, 3], [2, 3]];
const WEDGE: &[[usize; 2]] = &[[0, 1], [1, 2], [2, 0], [3, 4], [4, 5], [5, 3], [0, 3], [1, 4], [2, 5]];
const HEXAHEDRON: &[[usize; 2]] =
    &[[0, 1], [1, 2], [2, 3], [3, 0], [4, 5], [5, 6], [6, 7], [7, 4], [0, 4], [1, 5], [2, 6], [3, 7]];

/// The quadratic kind of a linear one, and the edges whose middles are its new nodes, in order.
fn lifted(kind: ElementKind) -> Option<(ElementKind, &'static [[usize; 2]])> {
    match kind {
        ElementKind::Line2 => Some((ElementKind::Line3, EDGE)),
        ElementKind::Tri3 => Some((ElementKind::Tri6, TRIANGLE)),
        ElementKind::Quad4 => Some((ElementKind::Quad8, QUADRILATERAL)),
        ElementKind::Tet4 => Some((ElementKind::Tet10, TETRAHEDRON)),
        ElementKind::Wedge6 => Some((ElementKind::Wedge15, WEDGE)),
        ElementKind::Hex8 => Some((ElementKind::Hex20, HEXAHEDRON)),
        _ => None,
    }
}

impl Mesh {
    /// The mesh with quadratic cells (Tet10, Hex20, Wedge15, Tri6, Quad8, Line3) in the place of
    /// linear ones: a new node in the middle of every edge, numbered after the old ones; cells,
    /// regions and cells that are quadratic already stay as they are.
    pub fn lifted(&self) -> Mesh {
        let mut points = self.points.clone();
        let mut middles: HashMap<[u32; 2], u32> = HashMap::new();
        let mut middle_of = |a: u32, b: u32| {
            *middles.entry([a.min(b), a.max(b)]).or_insert_with(|| {
                let (p, q) = (points[a as usize], points[b as usize]);
                points.push([0, 1, 2].map(|i| 0.5 * (p[i] + q[i])));
                (points.len() - 1) as u32
            })
        };
        let mut blocks = Vec::with_capacity(self.blocks.len());
        for block in &self.blocks {
            let Some((kind, edges)) = lifted(block.kind) else {
                blocks.push(block.clone());
                continue;
            };
            let mut nodes = Vec::with_capacity(block.count() * kind.node_count());
            for corners in block.nodes.chunks_exact(block.kind.node_count()) {
                nodes.extend_from_slice(corners);
                nodes.extend(edges.iter().map(|&[a, b]| middle_of(corners[a], corners[b])));
            }
            blocks.push(ElementBlock { kind, nodes });
        }
        Mesh { points, blocks, regions: self.regions.clone() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::BoxMesh;

    #[test]
    fn a_lifted_box_is_the_box_of_quadratic_elements() {
        for (linear, quadratic) in [
            (ElementKind::Tet4, ElementKind::Tet10),
            (ElementKind::Hex8, ElementKind::Hex20),
            (ElementKind::Wedge6, ElementKind::Wedge15),
        ] {
            let build = |element| {
                BoxMesh { size: [1.0, 2.0, 0.5], cells: [2, 3, 2], element, origin: [0.0; 3] }
                    .build()
                    .unwrap()
            };
            let (lifted, direct) = (build(linear).lifted(), build(quadratic));
            lifted.check(3).unwrap();
            assert_eq!(lifted.points.len(), direct.points.len());
            for (a, b) in lifted.blocks.iter().zip(&direct.blocks) {
                assert_eq!(a.kind, b.kind);
                for (a, b) in a.nodes.iter().zip(&b.nodes) {
                    let (p, q) = (lifted.points[*a as usize], direct.points[*b as usize]);
                    assert!((0..3).all(|i| (p[i] - q[i]).abs() < 1e-15), "{linear}: {p:?} {q:?}");
                }
            }
        }
    }
}
