//! Meshes of volumes that were parted beforehand: an index (text), one file with the whole mesh in the order of its source, and
//! pieces of its elements along Morton's curve. A process reads the pieces that it needs; `docs/files.md` describes the files.

mod far;
mod files;
mod index;
mod numbers;
mod piece;
mod sections;
pub(crate) mod write;

use std::fs::File;
use std::io::Read;
use std::path::Path;
use std::sync::Arc;

use vi_mesh::{CellBlock, FarElements, Mesh, MeshPart, MeshPieces, Region, Runs};

use crate::error::IoError;
use crate::mesh::{DataArray, MeshFile};
use far::FiledElements;
use files::Files;
use index::Index;
use sections::Sections;

/// A parted mesh on disk.
#[derive(Debug, Clone)]
pub struct PartedMesh {
    files: Files,
}

impl PartedMesh {
    /// The first bytes of an index.
    pub(crate) const START: &'static [u8] = index::START;

    /// Opens a parted mesh by the path of its index; returns `None` for a file of another kind.
    ///
    /// # Errors
    /// Returns [`IoError::System`], [`IoError::OtherFormat`] or the fault in the index.
    pub fn open(path: &Path) -> Result<Option<Self>, IoError> {
        let failed = |action| move |source| IoError::System { file: path.into(), action, source };
        let mut file = File::open(path).map_err(failed("read"))?;
        let mut bytes = Vec::new();
        file.by_ref().take(Self::START.len() as u64).read_to_end(&mut bytes).map_err(failed("read"))?;
        if bytes != Self::START {
            return Ok(None);
        }
        file.read_to_end(&mut bytes).map_err(failed("read"))?;
        Ok(Some(Self { files: Files { path: path.into(), index: Index::parse(&bytes, path)? } }))
    }

    /// Returns the description of the mesh, without the pieces themselves.
    pub fn pieces(&self) -> &MeshPieces {
        &self.files.index.pieces
    }

    /// Reads the whole mesh, as it was parted.
    ///
    /// # Errors
    /// Returns [`IoError::System`] or [`IoError::OtherPiece`].
    pub fn read(&self) -> Result<MeshFile, IoError> {
        self.read_whole(|_| true).map(|(file, _)| file)
    }

    /// Reads the part that process number `process` needs, from the pieces that have it.
    ///
    /// # Errors
    /// Returns [`IoError::System`], [`IoError::OtherPiece`], or the fault in a piece.
    pub fn part(&self, process: usize, runs: &Runs) -> Result<MeshPart, IoError> {
        self.pieces().part(process, runs, |number| self.files.piece(number))
    }

    /// Reads everything but the elements and the regions of volumes, which are left out, and returns the elements as functions of
    /// their numbers. They are read from the files when they are needed.
    ///
    /// # Errors
    /// Returns [`IoError::System`] or [`IoError::OtherPiece`].
    pub fn without_elements(&self) -> Result<(MeshFile, Arc<dyn FarElements>), IoError> {
        let (file, opened) = self.read_whole(|dimension| dimension < 3)?;
        let far = FiledElements::new(self.files.clone(), opened)?;
        Ok((file, Arc::new(far)))
    }

    /// Reads the blocks and regions of some dimensions, the points, and the arrays over them.
    fn read_whole(&self, is_wanted: impl Fn(usize) -> bool) -> Result<(MeshFile, File), IoError> {
        let whole = &self.files.index.whole;
        let path = self.files.path_of(whole);
        let mut sections = Sections::open(&path, &self.files.path, whole)?;
        let read = self.lists(&mut sections, is_wanted);
        sections.finish(read)
    }

    /// Reads the lists of the whole mesh.
    fn lists(&self, sections: &mut Sections, is_wanted: impl Fn(usize) -> bool) -> Result<MeshFile, IoError> {
        let Index { pieces, node_count, blocks, region_cells, arrays, notes, .. } = &self.files.index;
        let mut mesh = Mesh { points: sections.points(*node_count)?, ..Mesh::default() };
        let cell_count = blocks.iter().map(|(_, count)| count).sum();
        // The cells that were left out before each block, by its first cell.
        let (mut first, mut left_out, mut moved) = (0, 0, Vec::new());
        for &(kind, count) in blocks {
            moved.push((first, left_out));
            first += count as u32;
            let of_block = (kind.node_count() * count, *node_count);
            if is_wanted(kind.dimension()) {
                let nodes = sections.integers(of_block, "the nodes of cells")?;
                mesh.blocks.push(CellBlock { kind, nodes });
            } else {
                sections.pass_integers(of_block, "the nodes of cells")?;
                left_out += count as u32;
            }
        }
        let number = |cell: u32| {
            let block = moved.partition_point(|&(first, _)| first <= cell);
            cell - block.checked_sub(1).map_or(0, |block| moved[block].1)
        };
        for ((name, dimension), &count) in pieces.regions.iter().zip(region_cells) {
            if is_wanted(*dimension) {
                let cells = sections.integers((count, cell_count), name)?.into_iter().map(number).collect();
                mesh.regions.push(Region { name: name.clone(), dimension: *dimension, cells });
            } else {
                sections.pass_integers((count, cell_count), name)?;
            }
        }
        let mut file = MeshFile { mesh, notes: notes.clone(), ..MeshFile::default() };
        for (name, components) in arrays {
            let values = sections.reals(components * node_count, name)?;
            file.point_data.push(DataArray { name: name.clone(), components: *components, values });
        }
        Ok(file)
    }
}
