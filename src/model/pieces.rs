//! Parts meshes beforehand, so that each of several processes reads only what it needs.

use std::path::{Path, PathBuf};

use vi_fem::check_body;
use vi_io::IoError;
use vi_mesh::CellKind;

use super::parted::{kind_in_parts, runs};

/// Error that prevents a mesh from being parted.
#[derive(Debug, thiserror::Error)]
pub(crate) enum PartError {
    /// A file cannot be read or written, or the mesh cannot be cut into so many pieces.
    #[error(transparent)]
    File(#[from] IoError),
    /// The mesh cannot form a body.
    #[error("{}: {}", .path.display(), .problems.join("; "))]
    Mesh {
        /// The file of the mesh.
        path: PathBuf,
        /// All problems.
        problems: Vec<String>,
    },
}

/// A mesh that was parted.
#[derive(Debug)]
pub(crate) struct PartFacts {
    pub(crate) kind: CellKind,
    pub(crate) elements: usize,
    pub(crate) nodes: usize,
    /// The files that were written; the last one is the index.
    pub(crate) files: Vec<PathBuf>,
}

/// Parts the mesh of a file, with its coordinates multiplied by `scale`, into `count` pieces with an index.
///
/// # Errors
/// Returns all problems of the mesh, or an error of reading or writing.
pub(crate) fn part(source: &Path, count: usize, scale: f64, index: &Path) -> Result<PartFacts, PartError> {
    let mut file = vi_io::read_mesh(source)?;
    let wrong = |problems: Vec<String>| PartError::Mesh { path: source.to_owned(), problems };
    // As bodies do; a sum of zero has no sign.
    file.mesh.points.as_flattened_mut().iter_mut().for_each(|x| *x = scale * *x + 0.0);
    for array in file.point_data.iter_mut().filter(|array| array.name == "displacement") {
        array.values.iter_mut().for_each(|u| *u *= scale);
    }
    check_body(&file.mesh, 3).map_err(|errors| wrong(errors.iter().map(ToString::to_string).collect()))?;
    let kind =
        kind_in_parts(file.mesh.blocks.iter().map(|block| block.kind)).map_err(|why| wrong(vec![why]))?;
    let elements = file.mesh.cells_of_dimension(3).len();
    let files = vi_io::write_parted(index, &file, count, runs(kind, elements, 1).length())?;
    Ok(PartFacts { kind, elements, nodes: file.mesh.points.len(), files })
}
