//! Elements of a large mesh that no process holds as a whole.

use std::fmt::Debug;
use std::ops::Range;
use std::sync::Arc;

use crate::cell::CellKind;
use crate::mesh::{CellBlock, Mesh};
use crate::runs::Runs;

/// Number of elements that are processed together.
const WINDOW: usize = 1 << 14;

/// The elements of a mesh, all of one kind, as functions of their numbers. They are in runs along Morton's curve, as
/// [`sort_by_place`](crate::sort_by_place) orders them.
pub trait FarElements: Debug + Send + Sync {
    /// Returns the kind of all elements.
    fn kind(&self) -> CellKind;

    /// Returns the number of elements.
    fn count(&self) -> usize;

    /// Returns the position of a node at rest, m. The position may be read from a file, which is slow: call this for a
    /// few nodes only, or if no positions are in memory.
    fn point(&self, node: u32) -> [f64; 3];

    /// Appends the nodes of some elements.
    fn add_nodes(&self, elements: Range<u32>, nodes: &mut Vec<u32>);

    /// Returns the number of an element among all cells of the mesh.
    fn cell(&self, element: u32) -> u32 {
        element
    }

    /// Returns why elements could not be read since the start, if they come from a file. Elements that were returned
    /// after the fault are invalid.
    fn fault(&self) -> Option<String> {
        None
    }

    /// Returns the elements of some runs of `run_length` elements (ascending), run after run.
    fn of_runs(&self, runs: &[usize], run_length: usize) -> Vec<u32>;

    /// Returns the nodes (ascending) of the runs of each process.
    fn nodes_of_processes(&self, runs: &Runs) -> Vec<Vec<u32>>;
}

/// A mesh without its elements, and the elements.
pub type FarMesh = (Mesh, Arc<dyn FarElements>);

/// A block of elements that are not held in memory, in a frame that also has the elements of other meshes.
#[derive(Debug, Clone)]
pub struct FarBlock {
    /// The elements.
    pub elements: Arc<dyn FarElements>,
    /// The number in the frame of the first node of the mesh of these elements.
    pub first_node: u32,
}

impl FarBlock {
    /// Returns the nodes of all elements, in order.
    pub fn nodes(&self) -> impl Iterator<Item = u32> {
        self.elements.ranges().flat_map(move |range| {
            let mut nodes = Vec::with_capacity(range.len() * self.elements.kind().node_count());
            self.elements.add_nodes(range, &mut nodes);
            nodes.into_iter().map(move |node| node + self.first_node)
        })
    }
}

/// Some elements of a large mesh.
pub struct Window {
    /// The elements in order, with their nodes alone.
    pub mesh: Mesh,
    /// The number of each node in the large mesh, ascending.
    pub nodes: Vec<u32>,
}

impl dyn FarElements + '_ {
    /// Returns some of the elements. `point` gives the position of a node at rest, m, as [`FarElements::point`] does.
    pub fn window(&self, elements: impl Iterator<Item = u32>, point: impl Fn(u32) -> [f64; 3]) -> Window {
        let mut corners = Vec::new();
        let mut next = 0..0;
        // Read consecutive elements together.
        for element in elements {
            if element != next.end {
                self.add_nodes(std::mem::replace(&mut next, element..element), &mut corners);
            }
            next.end = element + 1;
        }
        self.add_nodes(next, &mut corners);
        let mut nodes = corners.clone();
        nodes.sort_unstable();
        nodes.dedup();
        corners.iter_mut().for_each(|node| *node = nodes.partition_point(|other| other < node) as u32);
        let points = nodes.iter().map(|&node| point(node)).collect();
        let blocks = vec![CellBlock { kind: self.kind(), nodes: corners }];
        Window { mesh: Mesh { points, blocks, regions: Vec::new() }, nodes }
    }

    /// Returns ranges that together are all elements, each small enough for a [`Window`].
    pub fn ranges(&self) -> impl Iterator<Item = Range<u32>> + use<> {
        let count = self.count();
        (0..count).step_by(WINDOW).map(move |first| first as u32..count.min(first + WINDOW) as u32)
    }
}
