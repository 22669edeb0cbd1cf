//! The data read from an Abaqus input file: nodes, elements, and the definitions of sets and surfaces.

use std::collections::{BTreeMap, BTreeSet, HashSet};

use crate::mesh::MeshFile;
use vi_mesh::CellKind;

/// The data read so far.
#[derive(Default)]
pub(super) struct Reading<'a> {
    pub(super) out: MeshFile,
    pub(super) node_tags: Vec<u64>,
    pub(super) elements: Vec<Element>,
    /// Tags of the nodes of all elements, concatenated.
    pub(super) corners: Vec<u64>,
    /// Tags of elements that have no shape.
    pub(super) shapeless: HashSet<u64>,
    /// Numbers of an element whose nodes are not yet complete, and the offset of its line.
    pub(super) unfinished: Vec<u64>,
    pub(super) unfinished_at: usize,
    pub(super) definitions: Vec<Definition<'a>>,
    pub(super) parts: usize,
    pub(super) instances: usize,
    pub(super) left_out: BTreeSet<String>,
    /// Numbers of elements of each type that the reader ignores.
    pub(super) lines: BTreeMap<String, usize>,
}

/// An element that becomes a cell.
pub(super) struct Element {
    pub(super) tag: u64,
    pub(super) at: usize,
    pub(super) kind: CellKind,
    /// If true, the sides S1 … are its edges (plane problems); otherwise its two faces (shells).
    pub(super) is_plane: bool,
}

/// The kind of the members of a set.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) enum Of {
    Nodes,
    Elements,
    /// Sides of elements.
    Faces,
}

impl Of {
    /// Returns the suffix for a name that several kinds of sets share.
    pub(super) fn ending(self) -> &'static str {
        match self {
            Self::Nodes => "nodes",
            Self::Elements => "elements",
            Self::Faces => "surface",
        }
    }
}

/// A set or surface as one keyword defines or extends it.
pub(super) struct Definition<'a> {
    pub(super) of: Of,
    pub(super) name: &'a [u8],
    pub(super) at: usize,
    /// Whether the set is internal to the program that wrote it; no group is made of it.
    pub(super) is_internal: bool,
    pub(super) numbers: Vec<u64>,
    /// Each range is first, last, increment.
    pub(super) ranges: Vec<[u64; 3]>,
    /// Names of sets. In a surface: sets or element numbers, each with its side.
    pub(super) names: Vec<(&'a [u8], &'a [u8])>,
}
