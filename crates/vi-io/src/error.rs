//! Errors of reading and writing files. Each names the file, the place and the remedy.

use std::fmt;
use std::path::PathBuf;

/// A place in a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Place {
    /// Line of a text, counted from 1.
    Line(usize),
    /// Byte offset in binary data, counted from 0.
    Byte(usize),
    /// Piece of a grid in memory, counted from 0.
    Piece(usize),
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Line(line) => write!(f, "line {line}"),
            Self::Byte(byte) => write!(f, "byte {byte}"),
            Self::Piece(piece) => write!(f, "piece {piece}"),
        }
    }
}

/// Why a file could not be read or written. Every message names the file, the place in it and the remedy.
#[non_exhaustive]
#[derive(Debug, thiserror::Error)]
pub enum IoError {
    /// The operating system refused the operation.
    #[error("{}: cannot {action}: {source}", file.display())]
    System {
        /// The file concerned.
        file: PathBuf,
        /// Action that failed, as a verb: "open", "write", …
        action: &'static str,
        /// Error of the operating system.
        source: std::io::Error,
    },
    /// Neither the name nor the content identify the format.
    #[error("{}: the format of the mesh file is not known ({found}); give a Gmsh .msh (2.2 or 4.1), .vtk, .vtu, .inp, .obj or .stl file", file.display())]
    UnknownFormat {
        /// The file concerned.
        file: PathBuf,
        /// Text found instead.
        found: String,
    },
    /// The file or one of its sections ends before the announced data.
    #[error("{}: {place}: the file ends inside {what}; it is truncated: write or copy it again", file.display())]
    Truncated {
        /// The file concerned.
        file: PathBuf,
        /// Where the data end.
        place: Place,
        /// Section that was being read.
        what: String,
    },
    /// The file has something other than the format requires.
    #[error("{}: {place}: expected {expected}, found {found}; the file is damaged or of another format: write it again", file.display())]
    Syntax {
        /// The file concerned.
        file: PathBuf,
        /// Where it was found.
        place: Place,
        /// Text that the format requires.
        expected: String,
        /// Text found there, shortened.
        found: String,
    },
    /// A header claims more than the rest of the file could hold. Nothing was allocated for it.
    #[error("{}: {place}: {count} {what} are announced, but the {room} bytes left cannot hold them; the header is wrong or the file is truncated: write it again", file.display())]
    CountTooLarge {
        /// The file concerned.
        file: PathBuf,
        /// Where the count was found.
        place: Place,
        /// Name of the counted entries.
        what: String,
        /// The count claimed.
        count: u64,
        /// Bytes left in the file.
        room: u64,
    },
    /// Parts of the file contradict each other.
    #[error("{}: {place}: {what}; the file is damaged: write it again", file.display())]
    Inconsistent {
        /// The file concerned.
        file: PathBuf,
        /// Where the contradiction was found.
        place: Place,
        /// Contradiction, as a sentence.
        what: String,
    },
    /// A cell names a node that does not exist.
    #[error("{}: {place}: cell {cell} uses node {node}, which is not among the {node_count} nodes of the file; write the mesh again, with all its nodes", file.display())]
    UnknownNode {
        /// The file concerned.
        file: PathBuf,
        /// Where the cell (or its array) begins.
        place: Place,
        /// The cell, by its number or tag in the file.
        cell: u64,
        /// The node, by its number or tag in the file.
        node: i64,
        /// Number of nodes in the file.
        node_count: usize,
    },
    /// A coordinate is NaN or infinite.
    #[error("{}: {place}: node {node} has the coordinates {x:?}, which are not all finite; correct the mesh in the program that made it", file.display())]
    NotFinite {
        /// The file concerned.
        file: PathBuf,
        /// Where the node (or the array of points) begins.
        place: Place,
        /// The node, by its number or tag in the file.
        node: u64,
        /// Coordinates of the node, m.
        x: [f64; 3],
    },
    /// A kind of cell that is not supported.
    #[error("{}: {place}: cell {cell} is of the unsupported {format} type {code}{name}; mesh with {supported}", file.display())]
    UnsupportedCell {
        /// The file concerned.
        file: PathBuf,
        /// Where the cell (or its array) begins.
        place: Place,
        /// The cell, by its number or tag in the file.
        cell: u64,
        /// "Gmsh" or "VTK".
        format: &'static str,
        /// The type's number in that format.
        code: i64,
        /// Name of the type in parentheses with a space before it, or empty if unknown.
        name: &'static str,
        /// The kinds that are supported.
        supported: &'static str,
    },
    /// A feature of the format that is not supported.
    #[error("{}: {place}: {what} cannot be read here; {remedy}", file.display())]
    Unsupported {
        /// The file concerned.
        file: PathBuf,
        /// Where it was found.
        place: Place,
        /// The feature.
        what: String,
        /// The remedy.
        remedy: &'static str,
    },
    /// A file of a parted mesh is not the one that its index lists.
    #[error("{}: it has {found}, but {} lists {listed}; it is damaged or belongs to another mesh: part the mesh again, or copy all its files together", file.display(), index.display())]
    OtherPiece {
        /// The file concerned.
        file: PathBuf,
        /// The index of the parted mesh.
        index: PathBuf,
        /// Length or checksum of the file.
        found: String,
        /// Length or checksum that the index lists.
        listed: String,
    },
    /// An index of a parted mesh has a format that this version does not know.
    #[error("{}: its format is {found:?}, and this version of the program reads format {known}; part the mesh again with this version", file.display())]
    OtherFormat {
        /// The index of the parted mesh.
        file: PathBuf,
        /// Format that the index states.
        found: String,
        /// Format that is read here.
        known: u32,
    },
    /// The data to write is inconsistent.
    #[error("{}: cannot write: {what}", file.display())]
    BadOutput {
        /// The file concerned.
        file: PathBuf,
        /// Inconsistency, and what to pass instead.
        what: String,
    },
}
