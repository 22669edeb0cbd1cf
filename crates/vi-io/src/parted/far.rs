//! The elements of a parted mesh as functions of their numbers, read from the files when they are needed.

use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom};
use std::ops::Range;
use std::path::PathBuf;
use std::sync::{Mutex, OnceLock, PoisonError};

use vi_mesh::{CellKind, FarElements, Piece, Runs};

use super::files::Files;
use super::sections::point;
use crate::error::IoError;

/// The elements of a parted mesh. Its whole mesh was read once to verify it; a later fault of the disk is kept, and the first element stands
/// for those that cannot be read.
#[derive(Debug)]
pub(super) struct FiledElements {
    files: Files,
    /// The whole mesh.
    file: Mutex<File>,
    blocks: Vec<Volumes>,
    /// The nodes of the first element.
    first: Vec<u32>,
    fault: OnceLock<String>,
}

/// A block of elements in the file of the whole mesh.
#[derive(Debug)]
struct Volumes {
    elements: Range<u32>,
    /// The number of its first element among all cells.
    first_cell: u32,
    /// Where its nodes begin in the file.
    offset: u64,
}

impl FiledElements {
    pub(super) fn new(files: Files, file: File) -> Result<Self, IoError> {
        let mut blocks = Vec::new();
        let (mut element, mut cell, mut offset) = (0, 0, 24 * files.index.node_count as u64);
        for &(kind, count) in &files.index.blocks {
            if kind.dimension() == 3 && count > 0 {
                let elements = element..element + count as u32;
                element = elements.end;
                blocks.push(Volumes { elements, first_cell: cell, offset });
            }
            cell += count as u32;
            offset += 4 * (kind.node_count() * count) as u64;
        }
        let (fault, file) = (OnceLock::new(), Mutex::new(file));
        let this = Self { files, file, blocks, first: Vec::new(), fault };
        let mut first = Vec::new();
        let failed = |source| IoError::System { file: this.path(), action: "read", source };
        this.read(0..1, &mut first).map_err(failed)?;
        Ok(Self { first, ..this })
    }

    /// Appends the nodes of some elements. Their numbers were checked when the file was opened.
    fn read(&self, elements: Range<u32>, nodes: &mut Vec<u32>) -> io::Result<()> {
        let width = 4 * self.kind().node_count();
        let mut file = self.file.lock().unwrap_or_else(PoisonError::into_inner);
        for block in &self.blocks {
            let own = elements.start.max(block.elements.start)..elements.end.min(block.elements.end);
            if own.is_empty() {
                continue;
            }
            let skipped = (own.start - block.elements.start) as usize * width;
            let mut bytes = vec![0; own.len() * width];
            file.seek(SeekFrom::Start(block.offset + skipped as u64))?;
            file.read_exact(&mut bytes)?;
            nodes.extend(bytes.as_chunks().0.iter().map(|bytes| u32::from_le_bytes(*bytes)));
        }
        Ok(())
    }

    /// Reads the position of a node at rest, m.
    fn read_point(&self, node: u32) -> io::Result<[f64; 3]> {
        let mut file = self.file.lock().unwrap_or_else(PoisonError::into_inner);
        let mut bytes = [0; 24];
        file.seek(SeekFrom::Start(24 * u64::from(node)))?;
        file.read_exact(&mut bytes)?;
        Ok(point(&bytes))
    }

    /// Returns an error if there is no node of one of these numbers.
    fn checked(&self, nodes: &[u32]) -> io::Result<()> {
        let is_known = nodes.iter().all(|node| (*node as usize) < self.files.index.node_count);
        is_known.then_some(()).ok_or_else(|| io::Error::other("it has changed since it was checked"))
    }

    /// Returns the path of the whole mesh.
    fn path(&self) -> PathBuf {
        self.files.path_of(&self.files.index.whole)
    }

    fn piece(&self, number: usize) -> Option<Piece> {
        self.files.piece(number).map_err(|error| self.record(&error.to_string())).ok()
    }

    fn record(&self, fault: &str) {
        self.fault.get_or_init(|| fault.to_owned());
    }
}

impl FarElements for FiledElements {
    fn kind(&self) -> CellKind {
        self.files.index.pieces.kind
    }

    fn count(&self) -> usize {
        self.files.index.pieces.element_count()
    }

    fn point(&self, node: u32) -> [f64; 3] {
        let read = self.read_point(node);
        read.map_err(|error| self.record(&format!("{}: {error}", self.path().display()))).unwrap_or_default()
    }

    fn add_nodes(&self, elements: Range<u32>, nodes: &mut Vec<u32>) {
        let (before, count) = (nodes.len(), elements.len());
        let read = self.read(elements, nodes).and_then(|()| self.checked(&nodes[before..]));
        if let Err(error) = read {
            self.record(&format!("{}: {error}", self.path().display()));
            nodes.truncate(before);
            nodes.extend(self.first.iter().cycle().take(count * self.first.len()));
        }
    }

    fn cell(&self, element: u32) -> u32 {
        let block = self.blocks.iter().find(|block| block.elements.contains(&element));
        block.map_or(element, |block| block.first_cell + (element - block.elements.start))
    }

    fn fault(&self) -> Option<String> {
        self.fault.get().cloned()
    }

    fn of_runs(&self, runs: &[usize], run_length: usize) -> Vec<u32> {
        let mut elements = Vec::new();
        let mut last: Option<(usize, Piece)> = None;
        for run in runs {
            let positions = run * run_length..((run + 1) * run_length).min(self.count());
            for (number, of_piece) in self.files.index.pieces.overlapping(positions) {
                if last.as_ref().is_none_or(|(other, _)| *other != number) {
                    last = self.piece(number).map(|piece| (number, piece));
                }
                let first = self.files.index.pieces.range(number).start;
                match &last {
                    Some((_, piece)) => {
                        elements.extend(&piece.elements[of_piece.start - first..of_piece.end - first]);
                    }
                    None => elements.extend(of_piece.map(|_| 0)),
                }
            }
        }
        elements
    }

    fn nodes_of_processes(&self, runs: &Runs) -> Vec<Vec<u32>> {
        let (pieces, arity) = (&self.files.index.pieces, self.kind().node_count());
        let nodes_of = |process: usize| {
            let mut nodes: Vec<u32> = Vec::new();
            let read = |number| self.files.piece(number);
            let see = |piece: &Piece, range: Range<usize>| nodes.extend(piece.nodes_at(range, arity));
            if let Err(error) = pieces.each_own((process, runs), read, see) {
                self.record(&error.to_string());
            }
            nodes.sort_unstable();
            nodes.dedup();
            nodes
        };
        (0..runs.process_count()).map(nodes_of).collect()
    }
}
