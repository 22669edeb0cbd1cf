//! Errors of reading and writing files. Each names the file, the place and the way out.

use std::fmt;
use std::path::PathBuf;

/// A place in a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Place {
    /// Line of a text, counted from 1.
    Line(usize),
    /// Byte offset in binary data, counted from 0.
    Byte(usize),
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Line(line) => write!(f, "line {line}"),
            Self::Byte(byte) => write!(f, "byte {byte}"),
        }
    }
}

/// Why a file could not be read or written. Every message names the file, the place in it and the way out.
#[non_exhaustive]
#[derive(Debug, thiserror::Error)]
pub enum IoError {
    /// The operating system refused.
    #[error("{}: cannot {action}: {source}", file.display())]
    System {
        /// The file it is about.
        file: PathBuf,
        /// Action that failed, as a verb: "open", "write", …
        action: &'static str,
        /// Error of the operating system.
        source: std::io::Error,
    },
    /// Neither name nor content tell the format.
    #[error("{}: not a mesh file known here ({found}); give a Gmsh .msh (2.2 or 4.1), .vtk, .vtu, .inp, .obj or .stl file", file.display())]
    UnknownFormat {
        /// The file it is about.
        file: PathBuf,
        /// Text found instead.
        found: String,
    },
    /// The file ends, or a section of it ends, before what it announced.
    #[error("{}: {place}: the file ends inside {what}; it is truncated: write or copy it again", file.display())]
    Truncated {
        /// The file it is about.
        file: PathBuf,
        /// Where the data end.
        place: Place,
        /// Section that was being read.
        what: String,
    },
    /// Something else stands where the format asks for a certain thing.
    #[error("{}: {place}: expected {expected}, found {found}; the file is damaged or of another format: write it again", file.display())]
    Syntax {
        /// The file it is about.
        file: PathBuf,
        /// Where it stands.
        place: Place,
        /// Text that the format requires.
        expected: String,
        /// Text found there, shortened.
        found: String,
    },
    /// A header claims more than the rest of the file could hold. Nothing was allocated for it.
    #[error("{}: {place}: {count} {what} are announced, but the {room} bytes left cannot hold them; the header is wrong or the file is truncated: write it again", file.display())]
    CountTooLarge {
        /// The file it is about.
        file: PathBuf,
        /// Where the count stands.
        place: Place,
        /// Name of the counted entries.
        what: String,
        /// The count claimed.
        count: u64,
        /// Bytes that are left in the file.
        room: u64,
    },
    /// Parts of the file contradict each other.
    #[error("{}: {place}: {what}; the file is damaged: write it again", file.display())]
    Inconsistent {
        /// The file it is about.
        file: PathBuf,
        /// Where it shows.
        place: Place,
        /// Contradiction, as a sentence.
        what: String,
    },
    /// A cell names a node that does not exist.
    #[error("{}: {place}: cell {cell} uses node {node}, which is not among the {node_count} nodes of the file; write the mesh again, with all its nodes", file.display())]
    UnknownNode {
        /// The file it is about.
        file: PathBuf,
        /// Where the cell (or its array) stands.
        place: Place,
        /// The cell, as the file counts or tags it.
        cell: u64,
        /// The node, as the file counts or tags it.
        node: i64,
        /// Nodes there are.
        node_count: usize,
    },
    /// A coordinate is NaN or infinite.
    #[error("{}: {place}: node {node} has the coordinates {x:?}, which are not all finite; mend the mesh where it was made", file.display())]
    NotFinite {
        /// The file it is about.
        file: PathBuf,
        /// Where the node (or the array of points) stands.
        place: Place,
        /// The node, as the file counts or tags it.
        node: u64,
        /// Coordinates of the node, m.
        x: [f64; 3],
    },
    /// A kind of cell that no element here stands for.
    #[error("{}: {place}: cell {cell} is of the unsupported {format} type {code}{name}; mesh with {supported}", file.display())]
    UnsupportedCell {
        /// The file it is about.
        file: PathBuf,
        /// Where the cell (or its array) stands.
        place: Place,
        /// The cell, as the file counts or tags it.
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
    /// A feature of the format that is not read here.
    #[error("{}: {place}: {what} cannot be read here; {remedy}", file.display())]
    Unsupported {
        /// The file it is about.
        file: PathBuf,
        /// Where it stands.
        place: Place,
        /// The feature.
        what: String,
        /// The way out.
        remedy: &'static str,
    },
    /// The data to write is inconsistent.
    #[error("{}: cannot write: {what}", file.display())]
    BadOutput {
        /// The file it is about.
        file: PathBuf,
        /// Inconsistency, and what to pass instead.
        what: String,
    },
}
