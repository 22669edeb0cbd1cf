//! What is read of an Abaqus input file: nodes, elements, and sets and surfaces as their keywords define them.

use std::collections::{BTreeMap, BTreeSet, HashSet};

use crate::mesh::MeshFile;
use vi_mesh::CellKind;

/// Everything read so far.
#[derive(Default)]
pub(super) struct Reading<'a> {
    pub(super) out: MeshFile,
    pub(super) node_tags: Vec<u64>,
    pub(super) elements: Vec<Element>,
    /// Tags of the nodes of all elements, one after the other.
    pub(super) corners: Vec<u64>,
    /// Tags of elements that have no shape.
    pub(super) shapeless: HashSet<u64>,
    /// Numbers of an element whose nodes are not complete, and where it begins.
    pub(super) unfinished: Vec<u64>,
    pub(super) unfinished_at: usize,
    pub(super) definitions: Vec<Definition<'a>>,
    pub(super) parts: usize,
    pub(super) instances: usize,
    pub(super) left_out: BTreeSet<String>,
    /// Elements by the types that carry nothing here.
    pub(super) lines: BTreeMap<String, usize>,
}

/// One element that is a cell.
pub(super) struct Element {
    pub(super) tag: u64,
    pub(super) at: usize,
    pub(super) kind: CellKind,
    /// If true, its sides S1 … are its edges (plane problems); otherwise its two faces (shells).
    pub(super) is_plane: bool,
}

/// Members of a set.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) enum Of {
    Nodes,
    Elements,
    /// Sides of elements.
    Faces,
}

impl Of {
    /// Remark appended to a name that stands for several sets.
    pub(super) fn ending(self) -> &'static str {
        match self {
            Self::Nodes => "nodes",
            Self::Elements => "elements",
            Self::Faces => "surface",
        }
    }
}

/// A set or surface as one keyword defines it, or adds to it.
pub(super) struct Definition<'a> {
    pub(super) of: Of,
    pub(super) name: &'a [u8],
    pub(super) at: usize,
    /// A program made it for itself: no group becomes of it.
    pub(super) is_internal: bool,
    pub(super) numbers: Vec<u64>,
    /// First, last, increment.
    pub(super) ranges: Vec<[u64; 3]>,
    /// Names of sets; of a surface, sets or numbers with the side.
    pub(super) names: Vec<(&'a [u8], &'a [u8])>,
}
