//! Meshes of simple shapes.

mod box_cells;
mod box_mesh;
mod sheet_mesh;

pub use box_mesh::BoxMesh;
pub use sheet_mesh::{SheetMesh, SheetPattern};
