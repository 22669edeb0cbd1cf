//! The one error type of this crate, with facts.

use vi_mesh::{CellKind, MeshError};

/// What can be wrong with a mesh, a material, a region or a load.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum FemError {
    /// What is wrong with the mesh.
    #[error(transparent)]
    Mesh(#[from] MeshError),
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
