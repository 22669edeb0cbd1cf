//! Parts a mesh: writes its pieces, the whole mesh, and the index that lists both.

use std::io::{self, Write};
use std::path::{Path, PathBuf};

use flate2::Crc;
use vi_mesh::CutMesh;

use super::index::{Index, Listed};
use super::numbers::{put_integers, put_points, put_reals};
use super::piece;
use crate::error::IoError;
use crate::mesh::MeshFile;
use crate::replace::replace_file;

/// Writes a mesh of volumes of one kind as a parted mesh of `count` pieces with the index `path`; returns all files. The pieces consist
/// of runs of `run_length` elements. Arrays over cells are left out. The index is written last.
///
/// # Errors
/// Returns [`IoError::BadOutput`] if the mesh cannot be parted or has a name with control characters, or [`IoError::System`].
pub fn write_parted(
    path: &Path,
    file: &MeshFile,
    count: usize,
    run_length: usize,
) -> Result<Vec<PathBuf>, IoError> {
    let bad = |what: String| IoError::BadOutput { file: path.into(), what };
    let stem = path.file_stem().and_then(|stem| stem.to_str()).unwrap_or_default();
    let names = file.mesh.regions.iter().map(|region| region.name.as_str());
    let names = names.chain(file.point_data.iter().map(|array| array.name.as_str()));
    if let Some(name) = names.chain([stem]).find(|name| name.is_empty() || name.contains(char::is_control)) {
        return Err(bad(format!("the name {name:?} is empty or has control characters; choose another")));
    }
    let cut = CutMesh::new(&file.mesh, count, run_length).map_err(|error| bad(error.to_string()))?;
    let of_piece = |number| {
        let piece = cut.piece(number);
        write_listed(path, format!("{stem}_p{number:03}.bin"), |out| piece::encode(&piece, out))
    };
    let files = (0..count).map(of_piece).collect::<Result<Vec<_>, _>>()?;
    let whole = write_listed(path, format!("{stem}_whole.bin"), |out| encode_whole(file, out))?;
    let index = Index {
        pieces: cut.pieces().clone(),
        node_count: file.mesh.points.len(),
        blocks: file.mesh.blocks.iter().map(|block| (block.kind, block.cell_count())).collect(),
        region_cells: file.mesh.regions.iter().map(|region| region.cells.len()).collect(),
        arrays: file.point_data.iter().map(|array| (array.name.clone(), array.components)).collect(),
        notes: file.notes.iter().map(|note| note.replace(char::is_control, " ")).collect(),
        whole,
        files,
    };
    replace_file(path, |out| out.write_all(index.text().as_bytes()))?;
    let listed = index.files.iter().chain([&index.whole]).map(|listed| path.with_file_name(&listed.name));
    Ok(listed.chain([path.to_owned()]).collect())
}

/// Writes a file beside the index, by the function `encode`; returns how the index lists it.
fn write_listed(
    index: &Path,
    name: String,
    encode: impl FnOnce(&mut Summed<'_>) -> io::Result<()>,
) -> Result<Listed, IoError> {
    let (mut bytes, mut sum) = (0, Crc::new());
    replace_file(&index.with_file_name(&name), |out| {
        let mut summed = Summed { out, bytes: 0, sum: Crc::new() };
        encode(&mut summed)?;
        (bytes, sum) = (summed.bytes, summed.sum);
        Ok(())
    })?;
    Ok(Listed { name, bytes, sum: sum.sum() })
}

/// A file that counts and sums the bytes that are written to it.
struct Summed<'a> {
    out: &'a mut dyn Write,
    bytes: u64,
    /// CRC-32 of the bytes.
    sum: Crc,
}

impl Write for Summed<'_> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let written = self.out.write(bytes)?;
        self.bytes += written as u64;
        self.sum.update(&bytes[..written]);
        Ok(written)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.out.flush()
    }
}

/// Writes points, the nodes of all blocks, the cells of all regions, and the arrays over the points.
fn encode_whole(file: &MeshFile, out: &mut impl Write) -> io::Result<()> {
    let mesh = &file.mesh;
    put_points(&mesh.points, out)?;
    mesh.blocks.iter().try_for_each(|block| put_integers(&block.nodes, out))?;
    mesh.regions.iter().try_for_each(|region| put_integers(&region.cells, out))?;
    file.point_data.iter().try_for_each(|array| put_reals(&array.values, out))
}
