//! Generates meshes of simple shapes.

mod box_cells;
pub(crate) mod box_mesh;
mod box_part;
pub(crate) mod sheet_mesh;

pub use box_mesh::BoxMesh;
pub use sheet_mesh::{SheetMesh, SheetPattern};
