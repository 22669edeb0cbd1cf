//! Pieces of a mesh along Morton's curve, and elements that are selected from them.

use std::ops::Range;

use crate::cell::CellKind;
use crate::mesh::{CellBlock, Mesh, Region};

/// Elements that follow each other along Morton's curve, with their nodes.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Piece {
    /// The elements, in the order of the curve.
    pub elements: Vec<u32>,
    /// The nodes of each element, as places in `nodes`.
    pub corners: Vec<u32>,
    /// The numbers of the nodes in the mesh, ascending.
    pub nodes: Vec<u32>,
    /// The positions of these nodes at rest, m.
    pub points: Vec<[f64; 3]>,
    /// The members of each region in the piece, ascending: elements of a region of volumes, nodes of other regions.
    pub regions: Vec<Vec<u32>>,
}

impl Piece {
    /// Returns the nodes of its elements at some positions from its first one, ascending.
    pub fn nodes_at(&self, positions: Range<usize>, arity: usize) -> impl Iterator<Item = u32> {
        let mut is_used = vec![false; self.nodes.len()];
        let corners = &self.corners[arity * positions.start..arity * positions.end];
        corners.iter().for_each(|&corner| is_used[corner as usize] = true);
        self.nodes.iter().zip(is_used).filter(|(_, is_used)| *is_used).map(|(&node, _)| node)
    }
}

/// The elements of a part in the order of the curve, with their nodes and the regions of the whole mesh.
pub(crate) struct Selected {
    kind: CellKind,
    /// Elements of the whole mesh, in the order of the curve.
    pub(crate) elements: Vec<u32>,
    /// The nodes of these elements, by their numbers in the whole mesh.
    pub(crate) corners: Vec<u32>,
    /// These nodes and their positions at rest, m; a node may be there several times.
    pub(crate) nodes: Vec<(u32, [f64; 3])>,
    /// Names and dimensions of the regions.
    regions: Vec<(String, usize)>,
    /// Elements of regions of volumes and nodes of others, with or without those that are not in the part.
    pub(crate) members: Vec<Vec<u32>>,
}

impl Selected {
    pub(crate) fn new(kind: CellKind, regions: &[(String, usize)]) -> Self {
        let members = vec![Vec::new(); regions.len()];
        let regions = regions.to_vec();
        Self { kind, elements: Vec::new(), corners: Vec::new(), nodes: Vec::new(), regions, members }
    }

    /// Adds those elements of a piece that are needed.
    pub(crate) fn add(&mut self, piece: &Piece, is_needed: impl Iterator<Item = bool>) {
        let mut is_used = vec![false; piece.nodes.len()];
        let elements = piece.elements.iter().zip(piece.corners.chunks_exact(self.kind.node_count()));
        for ((&element, corners), _) in elements.zip(is_needed).filter(|(_, is_needed)| *is_needed) {
            self.elements.push(element);
            self.corners.extend(corners.iter().map(|&corner| piece.nodes[corner as usize]));
            corners.iter().for_each(|&corner| is_used[corner as usize] = true);
        }
        let nodes = piece.nodes.iter().copied().zip(piece.points.iter().copied());
        self.nodes.extend(nodes.zip(is_used).filter(|(_, is_used)| *is_used).map(|(node, _)| node));
        for (members, of_piece) in self.members.iter_mut().zip(&piece.regions) {
            members.extend(of_piece);
        }
    }

    /// Returns the mesh of the elements in their order in the whole mesh, and its elements in the order of the curve. Regions of
    /// facets, edges and points become regions of points.
    pub(crate) fn into_mesh(mut self) -> (Mesh, Vec<u32>) {
        self.nodes.sort_unstable_by_key(|(node, _)| *node);
        self.nodes.dedup_by_key(|(node, _)| *node);
        let (nodes, points): (Vec<u32>, Vec<[f64; 3]>) = self.nodes.into_iter().unzip();
        let mut sorted = self.elements.clone();
        sorted.sort_unstable();
        let place = |all: &[u32], one: &u32| all.binary_search(one).ok().map(|place| place as u32);
        let order: Vec<u32> = self.elements.iter().filter_map(|element| place(&sorted, element)).collect();
        drop(self.elements);
        let arity = self.kind.node_count();
        let mut corners = vec![0; self.corners.len()];
        for (&element, of_element) in order.iter().zip(self.corners.chunks_exact(arity)) {
            let own = &mut corners[arity * element as usize..][..arity];
            own.iter_mut()
                .zip(of_element.iter().filter_map(|node| place(&nodes, node)))
                .for_each(|(own, of)| *own = of);
        }
        drop(self.corners);
        let blocks = vec![CellBlock { kind: self.kind, nodes: corners }];
        let mut mesh = Mesh { points, blocks, regions: Vec::new() };
        let mut next = sorted.len() as u32;
        for ((name, dimension), mut members) in self.regions.into_iter().zip(self.members) {
            members.sort_unstable();
            members.dedup();
            if dimension == 3 {
                let cells = members.iter().filter_map(|element| place(&sorted, element)).collect();
                mesh.regions.push(Region { name, dimension, cells });
                continue;
            }
            let first = next;
            for node in members.iter().filter_map(|node| place(&nodes, node)) {
                mesh.push_cell(CellKind::Point, &[node]);
                next += 1;
            }
            mesh.regions.push(Region { name, dimension: 0, cells: (first..next).collect() });
        }
        (mesh, order)
    }
}
