//! Defines the error type of this crate.

use crate::cell::CellKind;

/// Describes an invalid mesh, region or shape of a generator.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum MeshError {
    /// Elements have a Jacobian that is not positive at every quadrature point.
    #[error(
        "{count} of {total} elements are inverted or have no volume; first: {}. \
         Number the nodes of an element in VTK's order (positive volume), or run the mesh through \
         the repair of its generator; `Mesh::repair` reverses mirrored elements",
        list_volumes(.first)
    )]
    Inverted {
        /// Number of such elements.
        count: usize,
        /// Number of all elements.
        total: usize,
        /// Index and volume (m³) of the first few.
        first: Vec<(usize, f64)>,
    },
    /// Nodes belong to no element, so that they would have no mass.
    #[error(
        "{count} of {total} nodes belong to no element (first: {first:?}) and would have no mass; \
         remove them from the mesh"
    )]
    Unused {
        /// Number of such nodes.
        count: usize,
        /// Number of all nodes.
        total: usize,
        /// The first few nodes.
        first: Vec<u32>,
    },
    /// Points have a coordinate that is NaN or infinite.
    #[error("{count} nodes have a coordinate that is not a finite number (first: {first:?})")]
    NotFinite {
        /// Number of such nodes.
        count: usize,
        /// The first few nodes.
        first: Vec<u32>,
    },
    /// An element names a node that does not exist, or a region names such an element.
    #[error("{what} {index}: {target} {value} is out of range (there are {available})")]
    OutOfRange {
        /// The object that names it, e.g. "element".
        what: &'static str,
        /// The index of this object.
        index: usize,
        /// The kind of object that is named, e.g. "node".
        target: &'static str,
        /// The index that is named.
        value: usize,
        /// The number of such objects that exist.
        available: usize,
    },
    /// The node list of a block of cells is not a whole number of cells.
    #[error("block {block} of {kind} cells: {length} node numbers are not a multiple of {arity}")]
    BlockLength {
        /// The index of the block.
        block: usize,
        /// The kind of its cells.
        kind: CellKind,
        /// The number of node numbers.
        length: usize,
        /// The number of nodes per cell.
        arity: usize,
    },
    /// The mesh has no cells of the dimension of the body.
    #[error(
        "the mesh has no elements of dimension {dimension}{}",
        if *.dimension == 3 {
            "; a solid needs volume elements (tetrahedra, hexahedra, wedges): mesh the volume too"
        } else {
            ""
        }
    )]
    NoElements {
        /// The dimension that the body needs.
        dimension: usize,
    },
    /// The mesh does not have the region.
    #[error("there is no region '{name}'; the mesh has {}", list_names(.available))]
    UnknownRegion {
        /// The requested name.
        name: String,
        /// The names of the regions that exist.
        available: Vec<String>,
    },
    /// The cell kind has no kernel for the requested use.
    #[error("{kind} cells cannot be {used}")]
    Unsupported {
        /// The cell kind.
        kind: CellKind,
        /// The requested use, e.g. "solid elements".
        used: &'static str,
    },
    /// A parameter lies outside its range.
    #[error("{key} = {value}: {requirement}")]
    Parameter {
        /// The key in the scene file.
        key: &'static str,
        /// The value that was given.
        value: f64,
        /// The range that the value must lie in, and what to write instead.
        requirement: &'static str,
    },
    /// A table, list or count is invalid.
    #[error("{what}: {problem}")]
    Invalid {
        /// The object that is invalid, e.g. "table".
        what: &'static str,
        /// The reason, in words.
        problem: String,
    },
}

fn list_volumes(first: &[(usize, f64)]) -> String {
    let items: Vec<String> =
        first.iter().map(|(element, volume)| format!("element {element} ({volume:.3e} m³)")).collect();
    items.join(", ")
}

fn list_names(names: &[String]) -> String {
    const FEW: usize = 12;
    match names.len() {
        0 => "no named regions".into(),
        count if count > FEW => format!("{} and {} more", names[..FEW].join(", "), count - FEW),
        _ => names.join(", "),
    }
}
