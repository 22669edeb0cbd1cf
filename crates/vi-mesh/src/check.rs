//! Finds all problems of a mesh at once, and reverses mirrored tetrahedra.

use crate::cell::CellKind;
use crate::error::MeshError;
use crate::mesh::Mesh;
use crate::vector::determinant;

/// Number of offending nodes that a message lists.
const NAMED: usize = 5;

impl Mesh {
    /// Checks that the cells of `dimension` can form a body: 3 for a solid, 2 for a sheet.
    ///
    /// # Errors
    /// Returns every problem found: node numbers out of range, coordinates that are not finite, no cells, nodes without
    /// a cell.
    pub fn check(&self, dimension: usize) -> Result<(), Vec<MeshError>> {
        let mut problems = self.index_problems();
        problems.extend(self.coordinate_problems());
        if self.cells_of_dimension(dimension).is_empty() {
            problems.push(MeshError::NoElements { dimension });
        }
        if problems.is_empty() {
            problems.extend(self.unused_nodes(dimension));
        }
        if problems.is_empty() { Ok(()) } else { Err(problems) }
    }

    /// Returns the first two cells of a dimension that have the same corners, in any order.
    pub fn doubled_cells(&self, dimension: usize) -> Option<[u32; 2]> {
        let corners = |&cell: &u32| {
            let (kind, nodes) = self.cell(cell as usize)?;
            let mut corners = nodes.get(..kind.corner_count())?.to_vec();
            corners.sort_unstable();
            Some(corners)
        };
        // Cells with the same corners have the same sum of them, which takes less memory than the corners.
        let sum = |cell: u32| {
            let (kind, nodes) = self.cell(cell as usize)?;
            Some((nodes.iter().take(kind.corner_count()).map(|&node| u64::from(node)).sum::<u64>(), cell))
        };
        let mut sums: Vec<(u64, u32)> =
            self.cells_of_dimension(dimension).into_iter().filter_map(sum).collect();
        sums.sort_unstable();
        let in_group = |group: &[(u64, u32)]| {
            let mut cells: Vec<(Vec<u32>, u32)> =
                group.iter().filter_map(|(_, cell)| Some((corners(cell)?, *cell))).collect();
            cells.sort_unstable();
            let doubles = cells.windows(2).filter(|pair| pair[0].0 == pair[1].0);
            doubles.map(|pair| [pair[0].1, pair[1].1]).min()
        };
        let groups = sums.chunk_by(|a, b| a.0 == b.0).filter(|group| group.len() > 1);
        groups.filter_map(in_group).min()
    }

    /// Reverses the linear tetrahedra that are mirrored (negative volume), and returns how many.
    pub fn repair(&mut self) -> usize {
        let mut turned = 0;
        for block in self.blocks.iter_mut().filter(|block| block.kind == CellKind::Tet4) {
            for nodes in block.nodes.as_chunks_mut::<4>().0 {
                let x = nodes.map(|node| self.points[node as usize]);
                if determinant([0, 1, 2].map(|i| [1, 2, 3].map(|a| x[a][i] - x[0][i]))) < 0.0 {
                    nodes.swap(1, 2);
                    turned += 1;
                }
            }
        }
        turned
    }

    pub(crate) fn index_problems(&self) -> Vec<MeshError> {
        let mut problems = Vec::new();
        for (index, block) in self.blocks.iter().enumerate() {
            let arity = block.kind.node_count();
            if !block.nodes.len().is_multiple_of(arity) {
                let length = block.nodes.len();
                problems.push(MeshError::BlockLength { block: index, kind: block.kind, length, arity });
            }
        }
        let mut first = 0;
        for block in &self.blocks {
            let available = self.points.len();
            if let Some(at) = block.nodes.iter().position(|&node| node as usize >= available) {
                problems.push(MeshError::OutOfRange {
                    what: "element",
                    index: first + at / block.kind.node_count(),
                    target: "node",
                    value: block.nodes[at] as usize,
                    available,
                });
            }
            first += block.cell_count();
        }
        for (index, region) in self.regions.iter().enumerate() {
            if let Some(&cell) = region.cells.iter().find(|&&cell| cell as usize >= first) {
                problems.push(MeshError::OutOfRange {
                    what: "region",
                    index,
                    target: "element",
                    value: cell as usize,
                    available: first,
                });
            }
        }
        problems
    }

    pub(crate) fn coordinate_problems(&self) -> Option<MeshError> {
        let bad = |node: &usize| self.points[*node].iter().any(|value| !value.is_finite());
        let nodes: Vec<u32> = (0..self.points.len()).filter(bad).map(|node| node as u32).collect();
        let first = nodes.iter().copied().take(NAMED).collect();
        (!nodes.is_empty()).then_some(MeshError::NotFinite { count: nodes.len(), first })
    }

    fn unused_nodes(&self, dimension: usize) -> Option<MeshError> {
        let mut used = vec![false; self.points.len()];
        for block in self.blocks.iter().filter(|block| block.kind.dimension() == dimension) {
            for &node in &block.nodes {
                used[node as usize] = true;
            }
        }
        let count = used.iter().filter(|used| !**used).count();
        let first = (0..used.len()).filter(|&node| !used[node]).map(|node| node as u32).take(NAMED).collect();
        (count > 0).then_some(MeshError::Unused { count, total: used.len(), first })
    }
}

/// Returns the volume (m³) below which an element with these nodes cannot be told from one without volume: the
/// round-off of products of its size, and that of its coordinates, which may be much larger.
pub fn volume_of_round_off(mut nodes: impl Iterator<Item = [f64; 3]>) -> f64 {
    let Some(origin) = nodes.next() else { return 0.0 };
    let largest = |v: [f64; 3]| v.iter().fold(0.0_f64, |largest, v| largest.max(v.abs()));
    let (mut size, mut reach) = (0.0_f64, largest(origin));
    for x in nodes {
        size = size.max(largest([0, 1, 2].map(|i| x[i] - origin[i])));
        reach = reach.max(largest(x));
    }
    (1e-14 * size + f64::EPSILON * reach) * size * size
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;
    use crate::generate::box_mesh::BoxMesh;
    use crate::mesh::CellBlock;

    fn cube() -> Mesh {
        BoxMesh { size: [1.0; 3], cells: [1; 3], element: CellKind::Tet4, origin: [0.0; 3] }.build().unwrap()
    }

    #[test]
    fn all_problems_are_reported_at_once() {
        let mut mesh = cube();
        mesh.points[3][1] = f64::NAN;
        mesh.blocks.push(CellBlock { kind: CellKind::Tet4, nodes: vec![0, 1, 2, 99] });
        mesh.regions[0].cells.push(4000);
        let problems = mesh.check(3).unwrap_err();
        assert_eq!(problems.len(), 3, "{problems:?}");
        assert!(problems.iter().any(|problem| problem.to_string().contains("node 99 is out of range")));
    }

    #[test]
    fn mirrored_tetrahedra_are_turned_over_and_unused_nodes_named() {
        let mut mesh = cube();
        mesh.blocks[0].nodes.swap(1, 2);
        mesh.points.push([0.5; 3]);
        let problems = mesh.check(3).unwrap_err();
        assert!(matches!(&problems[..], [MeshError::Unused { count: 1, first, .. }] if first == &[8]));
        mesh.points.pop();
        assert_eq!(mesh.repair(), 1);
        assert_eq!(mesh, cube());
    }

    #[test]
    fn a_cell_that_exists_twice_is_found() {
        let mut mesh = cube();
        assert_eq!(mesh.doubled_cells(3), None);
        let last = mesh.cell_count() as u32;
        let [a, b, c, d] = mesh.blocks[0].nodes.as_chunks::<4>().0[1];
        mesh.push_cell(CellKind::Tet4, &[b, c, a, d]);
        let [first, second] = mesh.doubled_cells(3).unwrap();
        let corners =
            |cell: u32| mesh.cell(cell as usize).unwrap().1.iter().copied().collect::<BTreeSet<u32>>();
        assert!(first < second && second <= last, "{first} {second}");
        assert_eq!(corners(first), corners(second));
        assert_eq!(mesh.doubled_cells(2), None);
    }

    #[test]
    fn a_surface_is_no_solid() {
        let mesh = Mesh {
            points: vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]],
            blocks: vec![CellBlock { kind: CellKind::Tri3, nodes: vec![0, 1, 2] }],
            regions: vec![],
        };
        assert!(mesh.check(3).unwrap_err()[0].to_string().contains("volume elements"));
        mesh.check(2).unwrap();
    }

    #[test]
    fn an_unknown_region_lists_those_there_are() {
        let message = cube().region_nodes("clamp").unwrap_err().to_string();
        assert!(message.contains("'clamp'") && message.contains("x-min"), "{message}");
    }
}
