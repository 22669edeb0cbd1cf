//! A mesh with its arrays over points and cells, as files hold it.

use vi_mesh::{Mesh, Region};

/// A mesh with the data that its file holds.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct MeshFile {
    /// Points, all finite, and cells in the order of the file, in blocks of consecutive cells of one kind. Points that
    /// no cell uses are kept. Named groups of the file are regions, each of one dimension. An unnamed physical group of
    /// Gmsh is named by its number.
    pub mesh: Mesh,
    /// Arrays over the points.
    pub point_data: Vec<DataArray>,
    /// Arrays over all cells, in the order of the blocks.
    pub cell_data: Vec<DataArray>,
    /// Time of the data in seconds, if the file has it (`TimeValue` of VTK files).
    pub time: Option<f64>,
    /// Notes of the reader: repairs and omissions, one line each.
    pub notes: Vec<String>,
}

/// A named array of tuples over points or cells.
#[derive(Clone, Debug, PartialEq)]
pub struct DataArray {
    /// The name.
    pub name: String,
    /// Values per point or cell, at least 1.
    pub components: usize,
    /// The values, tuple after tuple. They may be NaN or infinite if they are so in the file.
    pub values: Vec<f64>,
}

impl MeshFile {
    /// Returns the point array of this name.
    pub fn point_array(&self, name: &str) -> Option<&DataArray> {
        self.point_data.iter().find(|array| array.name == name)
    }

    /// Returns the cell array of this name.
    pub fn cell_array(&self, name: &str) -> Option<&DataArray> {
        self.cell_data.iter().find(|array| array.name == name)
    }

    /// Returns the region of this name; of several, the one of the highest dimension.
    pub fn region(&self, name: &str) -> Option<&Region> {
        self.mesh.regions.iter().filter(|region| region.name == name).max_by_key(|region| region.dimension)
    }
}
