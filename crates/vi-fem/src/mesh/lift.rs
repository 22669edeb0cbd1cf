//! Quadratic elements in the place of linear ones. It must not know where the mesh came from.

use std::collections::HashMap;

use super::{FinerMesh, Mesh};
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

/// The edges of a quadratic cell and the nodes in their middles.
fn middles(block: &ElementBlock) -> impl Iterator<Item = ([u32; 2], u32)> {
    let linear = [
        ElementKind::Line2,
        ElementKind::Tri3,
        ElementKind::Quad4,
        ElementKind::Tet4,
        ElementKind::Wedge6,
        ElementKind::Hex8,
    ];
    let is_of = |low: &ElementKind| match block.kind {
        ElementKind::Quad9 => *low == ElementKind::Quad4,
        ElementKind::Hex27 => *low == ElementKind::Hex8,
        ElementKind::Wedge18 => *low == ElementKind::Wedge6,
        kind => lifted(*low).is_some_and(|(high, _)| high == kind),
    };
    let low = linear.into_iter().find(is_of);
    let edges = low.and_then(lifted).map_or(&[][..], |(_, edges)| edges);
    let corners = low.map_or(0, ElementKind::node_count);
    let cells = block.nodes.chunks_exact(block.kind.node_count());
    cells.flat_map(move |cell| {
        let of_edge = move |(k, &[a, b]): (usize, &[usize; 2])| ([cell[a], cell[b]], cell[corners + k]);
        edges.iter().enumerate().map(of_edge)
    })
}

impl Mesh {
    /// The mesh with quadratic cells (Tet10, Hex20, Wedge15, Tri6, Quad8, Line3) in the place of
    /// linear ones: a new node in the middle of every edge, numbered after the old ones; cells,
    /// regions and cells that are quadratic already stay as they are. Where an edge belongs to a
    /// quadratic cell too, its middle node is that cell's: curved boundaries stay curved.
    pub fn lifted(&self) -> FinerMesh {
        let mut points = self.points.clone();
        let mut parents: Vec<Vec<(u32, f64)>> =
            (0..points.len() as u32).map(|node| vec![(node, 1.0)]).collect();
        let sorted = |[a, b]: [u32; 2]| [a.min(b), a.max(b)];
        let known = self.blocks.iter().flat_map(middles);
        let mut middle_of: HashMap<[u32; 2], u32> =
            known.map(|(edge, middle)| (sorted(edge), middle)).collect();
        let mut blocks = Vec::with_capacity(self.blocks.len());
        for block in &self.blocks {
            let Some((kind, edges)) = lifted(block.kind) else {
                blocks.push(block.clone());
                continue;
            };
            let mut nodes = Vec::with_capacity(block.count() * kind.node_count());
            for corners in block.nodes.chunks_exact(block.kind.node_count()) {
                nodes.extend_from_slice(corners);
                nodes.extend(edges.iter().map(|&[a, b]| {
                    let [a, b] = [corners[a], corners[b]];
                    *middle_of.entry(sorted([a, b])).or_insert_with(|| {
                        let (p, q) = (points[a as usize], points[b as usize]);
                        points.push([0, 1, 2].map(|i| 0.5 * (p[i] + q[i])));
                        parents.push(vec![(a, 0.5), (b, 0.5)]);
                        (points.len() - 1) as u32
                    })
                }));
            }
            blocks.push(ElementBlock { kind, nodes });
        }
        let cells = (0..self.cell_count() as u32).collect();
        FinerMesh { mesh: Mesh { points, blocks, regions: self.regions.clone() }, parents, cells }
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
            let (lifted, direct) = (build(linear).lifted().mesh, build(quadratic));
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

    /// A linear tetrahedron beside a curved quadratic facet takes its middle nodes.
    #[test]
    fn curved_edges_that_the_mesh_has_are_kept() {
        let mut points = vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [0.5, -0.1, 0.0]];
        points.extend([[0.5, 0.5, 0.0], [0.0, 0.5, 0.0]]);
        let blocks = vec![
            ElementBlock { kind: ElementKind::Tet4, nodes: vec![0, 1, 2, 3] },
            ElementBlock { kind: ElementKind::Tri6, nodes: vec![0, 1, 2, 4, 5, 6] },
        ];
        let lifted = Mesh { points, blocks, regions: vec![] }.lifted();
        assert_eq!(lifted.mesh.blocks[0].nodes[4..7], [4, 5, 6]);
        assert_eq!(lifted.mesh.points.len(), 10);
        assert_eq!(lifted.parents[9].len(), 2);
    }
}
