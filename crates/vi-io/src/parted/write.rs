//! Parts a mesh: writes its pieces, the whole mesh, and the index that lists both.

use std::io::{self, Write};
use std::path::{Path, PathBuf};

use flate2::Crc;
use vi_mesh::CutMesh;

use super::index::{Index, Listed};
use super::piece;
use super::sections::sum_of;
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
    let mut files = Vec::with_capacity(count);
    let mut written = Vec::with_capacity(count + 2);
    for number in 0..count {
        let bytes = piece::encode(&cut.piece(number));
        let name = format!("{stem}_p{number:03}.bin");
        let own = path.with_file_name(&name);
        replace_file(&own, |out| out.write_all(&bytes))?;
        files.push(Listed { name, bytes: bytes.len() as u64, sum: sum_of(&bytes) });
        written.push(own);
    }
    let name = format!("{stem}_whole.bin");
    let own = path.with_file_name(&name);
    let mut sum = Crc::new();
    replace_file(&own, |out| write_whole(file, out, &mut sum))?;
    written.push(own);
    let bytes = whole_length(file);
    let index = Index {
        pieces: cut.pieces().clone(),
        node_count: file.mesh.points.len(),
        blocks: file.mesh.blocks.iter().map(|block| (block.kind, block.cell_count())).collect(),
        region_cells: file.mesh.regions.iter().map(|region| region.cells.len()).collect(),
        arrays: file.point_data.iter().map(|array| (array.name.clone(), array.components)).collect(),
        notes: file.notes.iter().map(|note| note.replace(char::is_control, " ")).collect(),
        whole: Listed { name, bytes, sum: sum.sum() },
        files,
    };
    replace_file(path, |out| out.write_all(index.text().as_bytes()))?;
    written.push(path.to_owned());
    Ok(written)
}

/// Returns the length of the whole mesh in bytes.
fn whole_length(file: &MeshFile) -> u64 {
    let mesh = &file.mesh;
    let words = mesh.blocks.iter().map(|block| block.nodes.len()).sum::<usize>()
        + mesh.regions.iter().map(|region| region.cells.len()).sum::<usize>();
    let reals = 3 * mesh.points.len() + file.point_data.iter().map(|array| array.values.len()).sum::<usize>();
    4 * words as u64 + 8 * reals as u64
}

/// Writes points, the nodes of all blocks, the cells of all regions, and the arrays over the points.
fn write_whole(file: &MeshFile, out: &mut impl Write, sum: &mut Crc) -> io::Result<()> {
    let mut put = |bytes: &[u8]| {
        sum.update(bytes);
        out.write_all(bytes)
    };
    let mesh = &file.mesh;
    mesh.points.as_flattened().iter().try_for_each(|x| put(&x.to_le_bytes()))?;
    let lists = mesh.blocks.iter().map(|block| &block.nodes);
    let lists = lists.chain(mesh.regions.iter().map(|region| &region.cells));
    lists.flatten().try_for_each(|number| put(&number.to_le_bytes()))?;
    file.point_data.iter().flat_map(|array| &array.values).try_for_each(|value| put(&value.to_le_bytes()))
}
