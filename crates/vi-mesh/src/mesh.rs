//! Points, cells of all dimensions, and named regions.

use crate::cell::CellKind;
use crate::error::MeshError;

/// Points, blocks of cells of one kind each, and named sets of cells.
///
/// Cells are numbered consecutively through all blocks: the first cell of block b follows the last of block b − 1.
/// The volume cells of a body and the facets, edges and points of its boundary are all cells.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Mesh {
    /// Positions at rest, m.
    pub points: Vec<[f64; 3]>,
    /// The blocks of cells.
    pub blocks: Vec<CellBlock>,
    /// Named sets of cells; a cell may be in several.
    pub regions: Vec<Region>,
}

/// Cells of one kind.
#[derive(Debug, Clone, PartialEq)]
pub struct CellBlock {
    /// The kind of the cells.
    pub kind: CellKind,
    /// Node numbers in VTK's order, `kind.node_count()` per cell.
    pub nodes: Vec<u32>,
}

impl CellBlock {
    /// Returns the number of cells.
    pub fn cell_count(&self) -> usize {
        self.nodes.len() / self.kind.node_count()
    }

    /// Returns the nodes of each cell.
    pub fn cells(&self) -> impl ExactSizeIterator<Item = &[u32]> {
        self.nodes.chunks_exact(self.kind.node_count())
    }
}

/// A named set of cells of one dimension: a material region or a part of the boundary.
#[derive(Debug, Clone, PartialEq)]
pub struct Region {
    /// The name by which scenes refer to it.
    pub name: String,
    /// 3 for volumes, 2 for surfaces, 1 for curves, 0 for points.
    pub dimension: usize,
    /// Cell numbers. Readers give them ascending, each once.
    pub cells: Vec<u32>,
}

/// Returns the distance (m) below which points cannot be told apart because of the round-off of coordinates: four
/// units in the last place of the largest coordinate.
pub fn resolution(points: &[[f64; 3]]) -> f64 {
    4.0 * f64::EPSILON * points.as_flattened().iter().fold(0.0_f64, |reach, x| reach.max(x.abs()))
}

impl Mesh {
    /// Returns the number of cells of all kinds.
    pub fn cell_count(&self) -> usize {
        self.blocks.iter().map(CellBlock::cell_count).sum()
    }

    /// Returns kind and nodes of every cell, in order.
    pub fn cells(&self) -> impl Iterator<Item = (CellKind, &[u32])> {
        self.blocks.iter().flat_map(|block| block.cells().map(|nodes| (block.kind, nodes)))
    }

    /// Appends one cell, to the last block if its kind matches.
    ///
    /// # Panics
    /// If `nodes` does not hold `kind.node_count()` nodes.
    pub fn push_cell(&mut self, kind: CellKind, nodes: &[u32]) {
        assert_eq!(nodes.len(), kind.node_count());
        match self.blocks.last_mut() {
            Some(block) if block.kind == kind => block.nodes.extend_from_slice(nodes),
            _ => self.blocks.push(CellBlock { kind, nodes: nodes.to_vec() }),
        }
    }

    /// Returns kind and nodes of the cell `element`; `what` names its user in an error.
    ///
    /// # Errors
    /// Returns [`MeshError::OutOfRange`] for a cell that does not exist.
    pub fn element(&self, element: u32, what: &'static str) -> Result<(CellKind, &[u32]), MeshError> {
        let index = element as usize;
        let available = self.cell_count();
        self.cell(index).ok_or(MeshError::OutOfRange { what, index, target: "cell", value: index, available })
    }

    /// Returns kind and nodes of a cell.
    pub fn cell(&self, index: usize) -> Option<(CellKind, &[u32])> {
        let mut index = index;
        for block in &self.blocks {
            let (count, arity) = (block.cell_count(), block.kind.node_count());
            if index < count {
                return Some((block.kind, &block.nodes[index * arity..][..arity]));
            }
            index -= count;
        }
        None
    }

    /// Returns the numbers of all cells of a dimension.
    pub fn cells_of_dimension(&self, dimension: usize) -> Vec<u32> {
        let mut first = 0;
        let mut cells = Vec::new();
        for block in &self.blocks {
            let next = first + block.cell_count() as u32;
            if block.kind.dimension() == dimension {
                cells.extend(first..next);
            }
            first = next;
        }
        cells
    }

    /// Returns the nodes of some cells, cell by cell.
    pub(crate) fn corners_of(&self, cells: &[u32]) -> impl Iterator<Item = u32> {
        let nodes_of = |&cell: &u32| self.cell(cell as usize).map_or(&[][..], |(_, nodes)| nodes);
        cells.iter().flat_map(nodes_of).copied()
    }

    /// Returns the nodes of some cells, ascending, each once.
    pub(crate) fn nodes_of(&self, cells: &[u32]) -> Vec<u32> {
        let mut nodes: Vec<u32> = self.corners_of(cells).collect();
        nodes.sort_unstable();
        nodes.dedup();
        nodes
    }

    /// Returns the region of this name.
    ///
    /// # Errors
    /// Returns [`MeshError::UnknownRegion`] with the names that exist.
    pub fn region(&self, name: &str) -> Result<&Region, MeshError> {
        self.regions.iter().find(|region| region.name == name).ok_or_else(|| MeshError::UnknownRegion {
            name: name.into(),
            available: self.regions.iter().map(|region| region.name.clone()).collect(),
        })
    }

    /// Returns the nodes of all cells of the regions with this name (a volume and a surface may share a name),
    /// ascending, each once.
    ///
    /// # Errors
    /// Returns [`MeshError::UnknownRegion`] with the names that exist.
    pub fn region_nodes(&self, name: &str) -> Result<Vec<u32>, MeshError> {
        self.region(name)?;
        let regions = self.regions.iter().filter(|region| region.name == name);
        let mut nodes: Vec<u32> = regions.flat_map(|region| self.corners_of(&region.cells)).collect();
        nodes.sort_unstable();
        nodes.dedup();
        Ok(nodes)
    }

    /// Returns the nodes in a box, ascending. The box includes its faces, to the round-off of coordinates.
    pub fn nodes_in_box(&self, min: [f64; 3], max: [f64; 3]) -> Vec<u32> {
        let near = resolution(&self.points);
        let inside =
            |point: &[f64; 3]| (0..3).all(|i| min[i] - near <= point[i] && point[i] <= max[i] + near);
        (0..self.points.len()).filter(|&node| inside(&self.points[node])).map(|node| node as u32).collect()
    }

    /// Returns the nodes whose distance from the plane through a point is at most `reach` (m), ascending. The normal
    /// may have any length but zero.
    pub fn nodes_near_plane(&self, point: [f64; 3], normal: [f64; 3], reach: f64) -> Vec<u32> {
        // Scale first: squares of very short and very long normals would underflow or overflow.
        let largest = normal.iter().fold(0.0_f64, |largest, n| largest.max(n.abs()));
        let normal = normal.map(|n| n / largest);
        let length = normal.iter().map(|n| n * n).sum::<f64>().sqrt();
        let distance =
            |x: &[f64; 3]| (0..3).map(|i| normal[i] / length * (x[i] - point[i])).sum::<f64>().abs();
        (0..self.points.len() as u32).filter(|&node| distance(&self.points[node as usize]) <= reach).collect()
    }

    /// Returns the nodes in a ball, ascending. The ball includes its surface, to the round-off of coordinates.
    pub fn nodes_in_ball(&self, centre: [f64; 3], radius: f64) -> Vec<u32> {
        let radius = radius + resolution(&self.points);
        let distance = |x: &[f64; 3]| (0..3).map(|i| (x[i] - centre[i]).powi(2)).sum::<f64>().sqrt();
        (0..self.points.len() as u32)
            .filter(|&node| distance(&self.points[node as usize]) <= radius)
            .collect()
    }

    /// Returns the node nearest to a point (the first of several); `None` for a mesh without points.
    pub fn nearest_node(&self, point: [f64; 3]) -> Option<u32> {
        let distance = |node: &[f64; 3]| -> f64 { (0..3).map(|i| (node[i] - point[i]).powi(2)).sum() };
        let nodes = 0..self.points.len();
        nodes
            .min_by(|&a, &b| distance(&self.points[a]).total_cmp(&distance(&self.points[b])))
            .map(|node| node as u32)
    }
}
