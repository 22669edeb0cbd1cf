//! Meshes that were parted beforehand, so that each of several processes reads only what it needs.

use vi_io::{IoError, PartedMesh};
use vi_mesh::{CellKind, Runs};

use crate::scene::Body;

/// The kinds of elements of which a process can build a part alone.
pub(super) const IN_PARTS: [CellKind; 3] = [CellKind::Tet4, CellKind::Hex8, CellKind::Wedge6];

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

/// Returns the runs in which the forces of elements are summed, and those that each of `count` processes computes.
pub(crate) fn runs(kind: CellKind, element_count: usize, count: usize) -> Runs {
    let length = vi_core::run_length(element_count, 3 * kind.node_count());
    Runs::new(element_count, length, vi_core::runs_of_ranks(element_count.div_ceil(length), count))
}
