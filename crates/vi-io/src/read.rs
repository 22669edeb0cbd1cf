//! Which reader a file gets: by what it begins with, then by its name.

use std::path::Path;

use crate::cursor::excerpt;
use crate::error::IoError;
use crate::gmsh::parse_msh;
use crate::mesh::MeshFile;

/// Reads a mesh file of any format known here.
///
/// # Errors
/// [`IoError::System`] if it cannot be opened or read, [`IoError::UnknownFormat`], or what is wrong in it.
pub fn read_mesh(path: &Path) -> Result<MeshFile, IoError> {
    let bytes = std::fs::read(path).map_err(|source| IoError::System {
        file: path.into(),
        action: "read",
        source,
    })?;
    parse_mesh(&bytes, path)
}

/// Reads a mesh of any format known here from memory; `file` gives the extension, and stands in the messages.
///
/// # Errors
/// [`IoError::UnknownFormat`], or what is wrong in it.
pub fn parse_mesh(bytes: &[u8], file: &Path) -> Result<MeshFile, IoError> {
    let extension =
        file.extension().and_then(|extension| extension.to_str()).unwrap_or_default().to_ascii_lowercase();
    match extension.as_str() {
        "msh" => parse_msh(bytes, file),
        _ => {
            let found = format!("it begins with {}", excerpt(&bytes[..bytes.len().min(40)]));
            Err(IoError::UnknownFormat { file: file.into(), found })
        }
    }
}
