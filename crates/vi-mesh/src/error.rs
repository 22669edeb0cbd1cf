//! The one error type of this crate, with facts.

use crate::cell::CellKind;

/// What can be wrong with a mesh, a region or the shape of a generator.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum MeshError {
    /// Elements whose Jacobian is not positive at every quadrature point.
    #[error(
        "{count} of {total} elements are inverted or have no volume; first: {}. \
         Number the nodes of an element in VTK's order (positive volume), or run the mesh through \
         its generator's repair; `Mesh::repair` turns mirrored elements over",
        list_volumes(.first)
    )]
    Inverted {
        /// How many such elements.
        count: usize,
        /// Of how many elements in all.
        total: usize,
        /// Index and volume (m³) of the first few.
        first: Vec<(usize, f64)>,
    },
    /// Nodes that no element touches: they would have no mass.
    #[error(
        "{count} of {total} nodes belong to no element (first: {first:?}) and would have no mass; \
         remove them from the mesh"
    )]
    Unused {
        /// How many such nodes.
        count: usize,
        /// Of how many nodes in all.
        total: usize,
        /// The first few.
        first: Vec<u32>,
    },
    /// Points with a coordinate that is NaN or infinite.
    #[error("{count} nodes have a coordinate that is not a finite number (first: {first:?})")]
    NotFinite {
        /// How many such nodes.
        count: usize,
        /// The first few.
        first: Vec<u32>,
    },
    /// An element names a node, or a region an element, that is not there.
    #[error("{what} {index}: {target} {value} is out of range (there are {available})")]
    OutOfRange {
        /// Who names it.
        what: &'static str,
        /// Its index.
        index: usize,
        /// What is named.
        target: &'static str,
        /// The index named.
        value: usize,
        /// How many there are.
        available: usize,
    },
    /// A block of cells whose node list is not a whole number of cells.
    #[error("block {block} of {kind} cells: {length} node numbers are not a multiple of {arity}")]
    BlockLength {
        /// The block's index.
        block: usize,
        /// Its kind.
        kind: CellKind,
        /// How many node numbers.
        length: usize,
        /// Nodes a cell.
        arity: usize,
    },
    /// The mesh has no cells of the body's dimension.
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
    /// A region that the mesh does not have.
    #[error("there is no region '{name}'; the mesh has {}", list_names(.available))]
    UnknownRegion {
        /// The name asked for.
        name: String,
        /// The names there are.
        available: Vec<String>,
    },
    /// An element kind that has no kernel for the use it is put to.
    #[error("{kind} cells cannot be {used}")]
    Unsupported {
        /// The kind.
        kind: CellKind,
        /// The use, e.g. "solid elements".
        used: &'static str,
    },
    /// A parameter outside its range.
    #[error("{key} = {value}: {requirement}")]
    Parameter {
        /// The key in the scene file.
        key: &'static str,
        /// Its value.
        value: f64,
        /// What it must be, with the way out.
        requirement: &'static str,
    },
    /// A table, list or count that makes no sense, in words.
    #[error("{what}: {problem}")]
    Invalid {
        /// The thing in question.
        what: &'static str,
        /// What is wrong with it.
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
