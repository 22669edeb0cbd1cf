//! Replaces linear cells by quadratic ones.

use std::collections::HashMap;

use crate::finer::FinerMesh;
use crate::mesh::{CellBlock, Mesh};

/// Returns the edges of the cells of a block with their midpoints; none for linear cells.
fn middles(block: &CellBlock) -> impl Iterator<Item = ([u32; 2], u32)> {
    let edges = if block.kind.is_linear() { &[] } else { block.kind.edges() };
    let corners = block.kind.corner_count();
    block.cells().flat_map(move |cell| {
        let of_edge = move |(k, &[a, b]): (usize, &[usize; 2])| ([cell[a], cell[b]], cell[corners + k]);
        edges.iter().enumerate().map(of_edge)
    })
}

impl Mesh {
    /// Returns the mesh with linear cells replaced by quadratic ones
    /// ([`CellKind::quadratic`](crate::CellKind::quadratic)). Every edge gets a new midpoint, numbered after the old
    /// nodes. Cell numbers, regions and quadratic cells stay as they are. If an edge also belongs to a quadratic
    /// cell, it takes the midpoint of that cell, so that curved boundaries stay curved.
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
            let Some(kind) = block.kind.quadratic().filter(|_| block.kind.is_linear()) else {
                blocks.push(block.clone());
                continue;
            };
            let mut nodes = Vec::with_capacity(block.cell_count() * kind.node_count());
            for corners in block.cells() {
                nodes.extend_from_slice(corners);
                nodes.extend(kind.edges().iter().map(|&[a, b]| {
                    let [a, b] = [corners[a], corners[b]];
                    *middle_of.entry(sorted([a, b])).or_insert_with(|| {
                        let (p, q) = (points[a as usize], points[b as usize]);
                        points.push([0, 1, 2].map(|i| 0.5 * (p[i] + q[i])));
                        parents.push(vec![(a, 0.5), (b, 0.5)]);
                        (points.len() - 1) as u32
                    })
                }));
            }
            blocks.push(CellBlock { kind, nodes });
        }
        let cells = (0..self.cell_count() as u32).collect();
        FinerMesh { mesh: Mesh { points, blocks, regions: self.regions.clone() }, parents, cells }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cell::CellKind;
    use crate::generate::box_mesh::BoxMesh;

    #[test]
    fn a_lifted_box_is_the_box_of_quadratic_elements() {
        for linear in [CellKind::Tet4, CellKind::Hex8, CellKind::Wedge6] {
            let quadratic = linear.quadratic().unwrap();
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

    /// A linear tetrahedron next to a curved quadratic facet takes the facet's midpoints.
    #[test]
    fn curved_edges_that_the_mesh_has_are_kept() {
        let mut points = vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [0.5, -0.1, 0.0]];
        points.extend([[0.5, 0.5, 0.0], [0.0, 0.5, 0.0]]);
        let blocks = vec![
            CellBlock { kind: CellKind::Tet4, nodes: vec![0, 1, 2, 3] },
            CellBlock { kind: CellKind::Tri6, nodes: vec![0, 1, 2, 4, 5, 6] },
        ];
        let lifted = Mesh { points, blocks, regions: vec![] }.lifted();
        assert_eq!(lifted.mesh.blocks[0].nodes[4..7], [4, 5, 6]);
        assert_eq!(lifted.mesh.points.len(), 10);
        assert_eq!(lifted.parents[9].len(), 2);
    }
}
