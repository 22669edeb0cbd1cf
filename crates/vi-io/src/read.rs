//! Chooses the reader of a file by its first bytes, then by its name.

use std::path::Path;

use crate::cursor::excerpt;
use crate::error::{IoError, Place};
use crate::gmsh::parse_msh;
use crate::inp::parse_inp;
use crate::legacy::parse_vtk;
use crate::mesh::MeshFile;
use crate::obj::parse_obj;
use crate::parted::PartedMesh;
use crate::pvtu_read::{is_pvtu, read_pvtu};
use crate::stl::parse_stl;
use crate::vtu::parse_vtu;

/// Reads a mesh file of any supported format, the whole of a parted mesh, whose index is given, or all pieces of a PVTU file.
///
/// # Errors
/// Returns [`IoError::System`] if it cannot be opened or read, [`IoError::UnknownFormat`], or the fault in its content.
pub fn read_mesh(path: &Path) -> Result<MeshFile, IoError> {
    if let Some(parted) = PartedMesh::open(path)? {
        return parted.read();
    }
    let bytes = std::fs::read(path).map_err(|source| IoError::System {
        file: path.into(),
        action: "read",
        source,
    })?;
    if is_pvtu(&bytes) {
        return read_pvtu(&bytes, path);
    }
    parse_mesh(&bytes, path)
}

/// Reads a mesh of any supported format from memory; `file` gives the extension and is used in messages.
///
/// # Errors
/// Returns [`IoError::UnknownFormat`], or the fault in the content.
pub fn parse_mesh(bytes: &[u8], file: &Path) -> Result<MeshFile, IoError> {
    if bytes.starts_with(PartedMesh::START) {
        let what = "the index of a parted mesh".to_owned();
        let remedy = "give its path, so that the files beside it can be read";
        return Err(IoError::Unsupported { file: file.into(), place: Place::Line(1), what, remedy });
    }
    let extension =
        file.extension().and_then(|extension| extension.to_str()).unwrap_or_default().to_ascii_lowercase();
    // Editors put a byte order mark of UTF-8 before a text. The header of a binary STL file may begin with any bytes.
    let bytes = match bytes.strip_prefix(b"\xEF\xBB\xBF") {
        Some(text) if extension != "stl" || text.starts_with(b"solid") => text,
        _ => bytes,
    };
    let start = bytes.trim_ascii_start();
    let is_xml = start.starts_with(b"<?xml") || start.starts_with(b"<VTKFile");
    if start.starts_with(b"$MeshFormat") || start.starts_with(b"$Comments") || start.starts_with(b"$NOD") {
        return parse_msh(bytes, file);
    }
    if start.starts_with(b"# vtk DataFile") {
        return parse_vtk(bytes, file);
    }
    match extension.as_str() {
        _ if is_xml => parse_vtu(bytes, file),
        "msh" => parse_msh(bytes, file),
        "vtk" => parse_vtk(bytes, file),
        "vtu" | "vtp" => parse_vtu(bytes, file),
        "inp" => parse_inp(bytes, file),
        "obj" => parse_obj(bytes, file),
        "stl" => parse_stl(bytes, file),
        _ => {
            let found = format!("it begins with {}", excerpt(&bytes[..bytes.len().min(40)]));
            Err(IoError::UnknownFormat { file: file.into(), found })
        }
    }
}
