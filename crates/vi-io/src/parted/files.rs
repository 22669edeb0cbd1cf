//! The index of a parted mesh with its path, which leads to the files beside it.

use std::path::PathBuf;

use vi_mesh::Piece;

use super::index::{Index, Listed};
use super::piece;
use super::sections::Sections;
use crate::error::IoError;

/// The files of a parted mesh.
#[derive(Debug, Clone)]
pub(super) struct Files {
    /// The path of the index.
    pub(super) path: PathBuf,
    pub(super) index: Index,
}

impl Files {
    /// Returns the path of a file beside the index.
    pub(super) fn path_of(&self, listed: &Listed) -> PathBuf {
        self.path.with_file_name(&listed.name)
    }

    /// Reads a piece.
    ///
    /// # Errors
    /// Returns [`IoError::System`], [`IoError::OtherPiece`], or the fault in the piece.
    pub(super) fn piece(&self, number: usize) -> Result<Piece, IoError> {
        let listed = &self.index.files[number];
        let path = self.path_of(listed);
        piece::decode(Sections::open(&path, &self.path, listed)?, (&self.index, number))
    }
}
