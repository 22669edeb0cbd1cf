//! Meshes that were parted beforehand, so that each of several processes reads only what it needs.

use std::path::{Path, PathBuf};

use vi_fem::check_body;
use vi_io::{IoError, PartedMesh};
use vi_mesh::CellKind;

use crate::scene::Body;

/// The kinds of elements of which a process can build a part alone.
pub(super) const IN_PARTS: [CellKind; 3] = [CellKind::Tet4, CellKind::Hex8, CellKind::Wedge6];

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

/// Opens the mesh of a body if processes can read parts of it: a parted mesh that the body takes as it is. One that it scales, moves
/// or takes a group of has another curve and is read whole.
pub(super) fn open(body: &Body) -> Option<Result<PartedMesh, IoError>> {
    let is_scaled = body.scale.is_some_and(|scale| scale != 1.0);
    let is_moved = body.translate.is_some_and(|by| by != [0.0; 3]);
    if is_scaled || is_moved || body.part.is_some() {
        return None;
    }
    PartedMesh::open(body.mesh.as_ref()?).transpose()
}

/// Returns the kind of the elements of a mesh whose cells are of these kinds, if processes can build parts of it.
///
/// # Errors
/// Returns what else there is.
pub(super) fn kind_in_parts(cells: impl Iterator<Item = CellKind>) -> Result<CellKind, String> {
    let mut kinds: Vec<CellKind> = cells.filter(|kind| kind.dimension() == 3).collect();
    kinds.dedup();
    match kinds[..] {
        [kind] if IN_PARTS.contains(&kind) => Ok(kind),
        _ => {
            let found = kinds.iter().map(|kind| kind.name()).collect::<Vec<_>>().join(", ");
            let known = IN_PARTS.map(CellKind::name).join(", ");
            Err(format!(
                "elements of several processes must all be of one of the kinds {known}; there are: {found}"
            ))
        }
    }
}

/// Returns the number of elements of the runs in which their forces are summed.
pub(super) fn run_length(kind: CellKind, element_count: usize) -> usize {
    vi_core::run_length(element_count, 3 * kind.node_count())
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
    let files = vi_io::write_parted(index, &file, count, run_length(kind, elements))?;
    Ok(PartFacts { kind, elements, nodes: file.mesh.points.len(), files })
}
