//! The index of a parted mesh: a text of one fact per line.

use std::fmt::Write;
use std::path::Path;
use std::str::FromStr;

use vi_mesh::{CellKind, MeshPieces};

use crate::cursor::Cursor;
use crate::error::IoError;

/// The first bytes of an index.
pub(super) const START: &[u8] = b"variational parted mesh ";
/// Number of the format; increased with every change of the files.
pub(super) const FORMAT: u32 = 1;

/// The lines of an index. The last word of a line may have spaces in it.
const LINES: [(&str, &str); 9] = [
    ("nodes", "nodes COUNT"),
    ("extent", "extent and six finite numbers"),
    ("block", "block KIND CELLS"),
    ("region", "region DIMENSION CELLS NAME"),
    ("array", "array COMPONENTS NAME"),
    ("note", "note TEXT"),
    ("whole", "whole BYTES CHECKSUM FILE"),
    ("piece", "piece ELEMENTS NEIGHBOURS BYTES CHECKSUM FILE"),
    ("end", "end"),
];

/// Contents of the index of a parted mesh.
#[derive(Debug, Clone)]
pub(super) struct Index {
    pub(super) pieces: MeshPieces,
    pub(super) node_count: usize,
    /// Kind and number of the cells of each block of the whole mesh.
    pub(super) blocks: Vec<(CellKind, usize)>,
    /// The number of cells of each region.
    pub(super) region_cells: Vec<usize>,
    /// Names and numbers of components of the arrays over the points.
    pub(super) arrays: Vec<(String, usize)>,
    /// Notes of the reader of the source.
    pub(super) notes: Vec<String>,
    /// The file with the whole mesh.
    pub(super) whole: Listed,
    /// The files of the pieces.
    pub(super) files: Vec<Listed>,
}

/// A file beside the index.
#[derive(Debug, Clone, Default)]
pub(super) struct Listed {
    pub(super) name: String,
    pub(super) bytes: u64,
    /// CRC-32 of its bytes.
    pub(super) sum: u32,
}

impl Index {
    /// Returns the text of the index.
    pub(super) fn text(&self) -> String {
        let mut text = format!("{}{FORMAT}\n", String::from_utf8_lossy(START));
        let mut line = |arguments: std::fmt::Arguments<'_>| {
            // Writing to a string does not fail.
            let _ = writeln!(text, "{arguments}");
        };
        line(format_args!("nodes {}", self.node_count));
        let [[a, b, c], [d, e, f]] = self.pieces.extent;
        line(format_args!("extent {a:?} {b:?} {c:?} {d:?} {e:?} {f:?}"));
        for (kind, cells) in &self.blocks {
            line(format_args!("block {} {cells}", kind.name()));
        }
        for ((name, dimension), cells) in self.pieces.regions.iter().zip(&self.region_cells) {
            line(format_args!("region {dimension} {cells} {name}"));
        }
        for (name, components) in &self.arrays {
            line(format_args!("array {components} {name}"));
        }
        for note in &self.notes {
            line(format_args!("note {note}"));
        }
        let Listed { name, bytes, sum } = &self.whole;
        line(format_args!("whole {bytes} {sum:08x} {name}"));
        let pieces = self.pieces.neighbours.iter().zip(&self.files).enumerate();
        for (piece, (neighbours, Listed { name, bytes, sum })) in pieces {
            let elements = self.pieces.range(piece).len();
            let neighbours: Vec<String> = neighbours.iter().map(ToString::to_string).collect();
            line(format_args!("piece {elements} {} {bytes} {sum:08x} {name}", neighbours.join(",")));
        }
        line(format_args!("end"));
        text
    }

    /// Parses the text of an index.
    ///
    /// # Errors
    /// Returns [`IoError::OtherFormat`], or the fault in the text.
    pub(super) fn parse(bytes: &[u8], file: &Path) -> Result<Self, IoError> {
        let mut cursor = Cursor::new(bytes, file);
        let first = cursor.line().unwrap_or_default();
        let format = first.strip_prefix(START).unwrap_or_default();
        if format != FORMAT.to_string().as_bytes() {
            let found = String::from_utf8_lossy(&format[..format.len().min(40)]).into_owned();
            return Err(IoError::OtherFormat { file: file.into(), found, known: FORMAT });
        }
        let pieces = MeshPieces {
            kind: CellKind::Tet4,
            extent: [[0.0; 3]; 2],
            regions: Vec::new(),
            ends: Vec::new(),
            neighbours: Vec::new(),
        };
        let mut this = Self {
            pieces,
            node_count: 0,
            blocks: Vec::new(),
            region_cells: Vec::new(),
            arrays: Vec::new(),
            notes: Vec::new(),
            whole: Listed::default(),
            files: Vec::new(),
        };
        loop {
            let at = cursor.position();
            let line = cursor.line().ok_or_else(|| cursor.truncated("the index of a parted mesh"))?;
            let text = std::str::from_utf8(line).unwrap_or_default();
            let (key, rest) = text.split_once(' ').unwrap_or((text, ""));
            let Some((key, form)) = LINES.iter().find(|(name, _)| *name == key) else {
                return Err(cursor.syntax_at(at, "a line of the index of a parted mesh", line));
            };
            this.enter(key, rest).ok_or_else(|| cursor.syntax_at(at, *form, line))?;
            if *key == "end" {
                return this.problem().map_or(Ok(this), |problem| Err(cursor.inconsistent_at(at, problem)));
            }
        }
    }

    /// Enters a line; returns `None` if it has another form.
    fn enter(&mut self, key: &str, rest: &str) -> Option<()> {
        let pieces = &mut self.pieces;
        match key {
            "nodes" => self.node_count = small(rest)?,
            "extent" => {
                let numbers: Vec<f64> = rest.split(' ').map_while(|word| word.parse().ok()).collect();
                let numbers: [f64; 6] = numbers.try_into().ok()?;
                numbers.iter().all(|number| number.is_finite()).then_some(())?;
                pieces.extent = [[numbers[0], numbers[1], numbers[2]], [numbers[3], numbers[4], numbers[5]]];
            }
            "block" => {
                let [kind, cells] = words(rest)?;
                let kind = CellKind::ALL.iter().find(|known| known.name() == kind)?;
                if kind.dimension() == 3 {
                    pieces.kind = *kind;
                }
                self.blocks.push((*kind, small(cells)?));
            }
            "region" => {
                let [dimension, cells, name] = words(rest)?;
                let dimension: usize = number(dimension).filter(|dimension| *dimension <= 3)?;
                pieces.regions.push((name.to_owned(), dimension));
                self.region_cells.push(small(cells)?);
            }
            "array" => {
                let [components, name] = words(rest)?;
                let components = small(components).filter(|components| (1..1000).contains(components))?;
                self.arrays.push((name.to_owned(), components));
            }
            "note" => self.notes.push(rest.to_owned()),
            "whole" => self.whole = listed(rest)?,
            "piece" => {
                let [elements, neighbours, rest] = words(rest)?;
                let elements = small(elements).filter(|elements| *elements > 0)?;
                pieces.ends.push(pieces.element_count() + elements);
                pieces.neighbours.push(neighbours.split(',').map(small).collect::<Option<_>>()?);
                self.files.push(listed(rest)?);
            }
            _ => rest.is_empty().then_some(())?,
        }
        Some(())
    }

    /// Returns the first contradiction.
    fn problem(&self) -> Option<String> {
        let solids = || self.blocks.iter().filter(|(kind, _)| kind.dimension() == 3);
        if solids().any(|(kind, _)| *kind != self.pieces.kind) {
            return Some("there are volumes of several kinds".to_owned());
        }
        if self.blocks.iter().map(|(_, cells)| *cells).sum::<usize>() > u32::MAX as usize {
            return Some("there are more cells than 32 bits can number".to_owned());
        }
        let (elements, of_pieces) =
            (solids().map(|(_, cells)| cells).sum::<usize>(), self.pieces.element_count());
        if elements != of_pieces || elements == 0 {
            return Some(format!("the pieces have {of_pieces} elements, and the mesh has {elements}"));
        }
        let count = self.files.len();
        let wrong = self.pieces.neighbours.iter().flatten().find(|piece| **piece >= count);
        if let Some(piece) = wrong {
            return Some(format!("a neighbour is piece {piece}, and there are {count} pieces"));
        }
        let cells = self.blocks.iter().map(|(kind, cells)| 4 * (kind.node_count() * cells) as u64);
        let regions = self.region_cells.iter().map(|cells| 4 * *cells as u64);
        let arrays = self.arrays.iter().map(|(_, components)| 8 * (components * self.node_count) as u64);
        let bytes = 24 * self.node_count as u64 + cells.chain(regions).chain(arrays).sum::<u64>();
        let listed = self.whole.bytes;
        (bytes != listed).then(|| format!("the whole mesh takes {bytes} bytes, and its file has {listed}"))
    }
}

fn number<T: FromStr>(word: &str) -> Option<T> {
    word.parse().ok()
}

/// Returns a number that fits 32 bits.
fn small(word: &str) -> Option<usize> {
    number::<u32>(word).map(|number| number as usize)
}

/// Returns words between single spaces; the last one is the rest of the line.
fn words<const N: usize>(rest: &str) -> Option<[&str; N]> {
    rest.splitn(N, ' ').collect::<Vec<_>>().try_into().ok()
}

/// Returns a file in the directory of the index.
fn listed(rest: &str) -> Option<Listed> {
    let [bytes, sum, name] = words(rest)?;
    let is_plain = Path::new(name).file_name().is_some_and(|own| own == name);
    let sum = u32::from_str_radix(sum, 16).ok()?;
    is_plain.then_some(Listed { name: name.to_owned(), bytes: number(bytes)?, sum })
}
