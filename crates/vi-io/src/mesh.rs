//! A mesh as files hold it: points, cells, named groups, arrays. Knows no format and no physics.

use crate::cell::CellKind;

/// A mesh as a file holds it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct MeshFile {
    /// Coordinates, all finite, in the order of the file. Points that no cell uses are kept.
    pub points: Vec<[f64; 3]>,
    /// Cells in the order of the file, consecutive cells of one kind together.
    pub blocks: Vec<CellBlock>,
    /// Named groups. A cell may be in several, or in none.
    pub groups: Vec<Group>,
    /// Arrays over the points.
    pub point_data: Vec<DataArray>,
    /// Arrays over all cells, in the order of the blocks.
    pub cell_data: Vec<DataArray>,
    /// Time of the data in seconds, where the file has it (`TimeValue` of VTK files).
    pub time: Option<f64>,
    /// Notes of the reader: repairs and omissions, one line each.
    pub notes: Vec<String>,
}

/// Consecutive cells of one kind.
#[derive(Clone, Debug, PartialEq)]
pub struct CellBlock {
    /// The kind of all its cells.
    pub kind: CellKind,
    /// Point indices, `kind.node_count()` a cell, in VTK's order; all below the number of points.
    pub nodes: Vec<u32>,
}

impl CellBlock {
    /// Number of cells.
    pub fn cell_count(&self) -> usize {
        self.nodes.len() / self.kind.node_count()
    }

    /// The nodes of each cell.
    pub fn cells(&self) -> impl ExactSizeIterator<Item = &[u32]> {
        self.nodes.chunks_exact(self.kind.node_count())
    }
}

/// A named group of cells of one dimension: a material region (volumes) or a boundary region (surfaces, curves, points).
#[derive(Clone, Debug, PartialEq)]
pub struct Group {
    /// The name; for an unnamed physical group of Gmsh its number.
    pub name: String,
    /// Dimension of its cells.
    pub dimension: usize,
    /// Cells, counted through all blocks in order; ascending, without repetition.
    pub cells: Vec<u32>,
}

/// A named array of tuples over points or cells.
#[derive(Clone, Debug, PartialEq)]
pub struct DataArray {
    /// The name.
    pub name: String,
    /// Values per point or cell, at least 1.
    pub components: usize,
    /// The values, tuple after tuple. They may be NaN or infinite where the file has them so.
    pub values: Vec<f64>,
}

impl MeshFile {
    /// Number of cells in all blocks.
    pub fn cell_count(&self) -> usize {
        self.blocks.iter().map(CellBlock::cell_count).sum()
    }

    /// Kind and nodes of every cell, in order.
    pub fn cells(&self) -> impl Iterator<Item = (CellKind, &[u32])> {
        self.blocks.iter().flat_map(|block| block.cells().map(|nodes| (block.kind, nodes)))
    }

    /// The point array of this name.
    pub fn point_array(&self, name: &str) -> Option<&DataArray> {
        self.point_data.iter().find(|array| array.name == name)
    }

    /// The cell array of this name.
    pub fn cell_array(&self, name: &str) -> Option<&DataArray> {
        self.cell_data.iter().find(|array| array.name == name)
    }

    /// The group of this name; of several, the one of the highest dimension.
    pub fn group(&self, name: &str) -> Option<&Group> {
        self.groups.iter().filter(|group| group.name == name).max_by_key(|group| group.dimension)
    }

    /// Appends one cell, to the last block if that is of its kind.
    pub(crate) fn push_cell(&mut self, kind: CellKind, nodes: &[u32]) {
        debug_assert_eq!(nodes.len(), kind.node_count());
        match self.blocks.last_mut() {
            Some(block) if block.kind == kind => block.nodes.extend_from_slice(nodes),
            _ => self.blocks.push(CellBlock { kind, nodes: nodes.to_vec() }),
        }
    }
}
