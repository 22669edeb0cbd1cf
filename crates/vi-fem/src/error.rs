//! Defines the error type of this crate.

use vi_mesh::{CellKind, MeshError};

/// Describes an invalid mesh, material, region or load.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum FemError {
    /// The mesh is invalid.
    #[error(transparent)]
    Mesh(#[from] MeshError),
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
