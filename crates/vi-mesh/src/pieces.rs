//! A mesh in pieces along Morton's curve. A process makes the part that it computes from a few of them, without the others.

use std::collections::BTreeSet;
use std::ops::Range;

use crate::cell::CellKind;
use crate::error::MeshError;
use crate::mesh::Mesh;
use crate::order::{Curve, Numbering, sort_by_place};
use crate::part::MeshPart;
use crate::piece::{Piece, Selected};
use crate::runs::Runs;

/// The description of a mesh of volumes of one kind that is cut into pieces, without the pieces themselves. An
/// *element* is a volume; elements are numbered in the order of the mesh, without other cells.
#[derive(Debug, Clone, PartialEq)]
pub struct MeshPieces {
    /// The kind of all elements.
    pub kind: CellKind,
    /// Smallest and largest coordinates of the nodes, m.
    pub extent: [[f64; 3]; 2],
    /// Names and dimensions of the regions.
    pub regions: Vec<(String, usize)>,
    /// The position on the curve behind the last element of each piece.
    pub ends: Vec<usize>,
    /// The pieces that share nodes with each piece, ascending; itself is one of them.
    pub neighbours: Vec<Vec<usize>>,
}

/// A mesh that is cut into pieces.
pub struct CutMesh<'a> {
    mesh: &'a Mesh,
    /// The volumes in the order of the mesh.
    volumes: Vec<u32>,
    /// The volumes in the order of the curve.
    on_curve: Vec<u32>,
    /// The members of each region, ascending: volumes of a region of volumes, nodes of other regions.
    members: Vec<Vec<u32>>,
    pieces: MeshPieces,
}

impl<'a> CutMesh<'a> {
    /// Cuts a mesh into `count` pieces of runs of `run_length` elements: run k belongs to the piece ⌊k · `count` / number of runs⌋.
    ///
    /// # Errors
    /// Returns [`MeshError::Invalid`] if there are no volumes, volumes of several kinds, or fewer runs than pieces.
    pub fn new(mesh: &'a Mesh, count: usize, run_length: usize) -> Result<Self, MeshError> {
        let invalid = |problem: String| MeshError::Invalid { what: "pieces", problem };
        let mut kinds: Vec<CellKind> = mesh.blocks.iter().map(|block| block.kind).collect();
        kinds.retain(|kind| kind.dimension() == 3);
        kinds.dedup();
        let [kind] = kinds[..] else {
            let names: Vec<&str> = kinds.iter().map(|kind| kind.name()).collect();
            let found = if names.is_empty() { "none".to_owned() } else { names.join(", ") };
            return Err(invalid(format!("all volumes must be of one kind; there are: {found}")));
        };
        let volumes = mesh.cells_of_dimension(3);
        // A piece has the elements of one of `count` processes.
        let run_count = volumes.len().div_ceil(run_length);
        if count == 0 || count > run_count {
            return Err(invalid(format!(
                "{count} pieces cannot be cut from {} elements, which are summed in {run_count} runs of {run_length}; \
                 choose 1 to {run_count}",
                volumes.len()
            )));
        }
        let runs = Runs::in_equal_shares(volumes.len(), run_length, count);
        let mut on_curve = volumes.clone();
        sort_by_place(mesh, &mut on_curve);
        let ends = (0..count).map(|piece| runs.positions_of(piece).end).collect();
        let bound = |start: f64, pick: fn(f64, f64) -> f64| {
            [0, 1, 2].map(|k| mesh.points.iter().map(|x| x[k]).fold(start, pick))
        };
        let extent = [bound(f64::INFINITY, f64::min), bound(f64::NEG_INFINITY, f64::max)];
        let regions = mesh.regions.iter().map(|region| (region.name.clone(), region.dimension)).collect();
        let members = mesh.regions.iter().map(|region| match region.dimension {
            3 => region.cells.clone(),
            _ => mesh.nodes_of(&region.cells),
        });
        let members = members.collect();
        let pieces = MeshPieces { kind, extent, regions, ends, neighbours: Vec::new() };
        let mut this = Self { mesh, volumes, on_curve, members, pieces };
        this.pieces.neighbours = this.neighbours();
        Ok(this)
    }

    /// Returns the description of the mesh, without the pieces themselves.
    pub fn pieces(&self) -> &MeshPieces {
        &self.pieces
    }

    /// Returns a piece.
    pub fn piece(&self, number: usize) -> Piece {
        let cells = self.cells(number);
        let nodes = self.mesh.nodes_of(cells);
        let place = |all: &[u32], one: u32| all.partition_point(|&other| other < one) as u32;
        let corners = self.mesh.corners_of(cells).map(|node| place(&nodes, node)).collect();
        let mut sorted = cells.to_vec();
        sorted.sort_unstable();
        let kinds = self.pieces.regions.iter().map(|(_, dimension)| *dimension);
        let regions = self.members.iter().zip(kinds).map(|(members, dimension)| match dimension {
            3 => common(members, &sorted).map(|cell| place(&self.volumes, cell)).collect(),
            _ => common(members, &nodes).collect(),
        });
        Piece {
            elements: cells.iter().map(|&cell| place(&self.volumes, cell)).collect(),
            corners,
            points: nodes.iter().map(|&node| self.mesh.points[node as usize]).collect(),
            regions: regions.collect(),
            nodes,
        }
    }

    /// Returns the cells of a piece, in the order of the curve.
    fn cells(&self, piece: usize) -> &[u32] {
        &self.on_curve[self.pieces.range(piece)]
    }

    fn neighbours(&self) -> Vec<Vec<usize>> {
        let count = self.pieces.ends.len();
        let mut users: Vec<(u32, u32)> = Vec::new();
        for piece in 0..count {
            users.extend(self.mesh.nodes_of(self.cells(piece)).into_iter().map(|node| (node, piece as u32)));
        }
        users.sort_unstable();
        let mut found: Vec<BTreeSet<usize>> = (0..count).map(|piece| BTreeSet::from([piece])).collect();
        for of_node in users.chunk_by(|a, b| a.0 == b.0) {
            for &(_, piece) in of_node {
                found[piece as usize].extend(of_node.iter().map(|&(_, other)| other as usize));
            }
        }
        found.into_iter().map(|pieces| pieces.into_iter().collect()).collect()
    }
}

impl MeshPieces {
    /// Returns the number of all elements.
    pub fn element_count(&self) -> usize {
        self.ends.last().copied().unwrap_or(0)
    }

    /// Returns the positions of a piece's elements on the curve.
    pub fn range(&self, piece: usize) -> Range<usize> {
        piece.checked_sub(1).map_or(0, |before| self.ends[before])..self.ends[piece]
    }

    /// Returns the pieces that have elements at some positions on the curve, with these positions of each.
    pub fn overlapping(&self, positions: Range<usize>) -> impl Iterator<Item = (usize, Range<usize>)> {
        let first = self.ends.partition_point(|&end| end <= positions.start);
        let within = move |piece: usize| {
            let of_piece = self.range(piece);
            (piece, of_piece.start.max(positions.start)..of_piece.end.min(positions.end))
        };
        (first..self.ends.len()).map(within).take_while(|(_, range)| !range.is_empty())
    }

    /// Reads the pieces with elements of the runs that process number `process` computes. Calls `see` with each piece and the
    /// positions of these elements from its first one.
    ///
    /// # Errors
    /// Returns the errors of `read`, which returns a piece.
    pub fn each_own<E>(
        &self,
        (process, runs): (usize, &Runs),
        mut read: impl FnMut(usize) -> Result<Piece, E>,
        mut see: impl FnMut(&Piece, Range<usize>),
    ) -> Result<(), E> {
        for (number, positions) in self.overlapping(runs.positions_of(process)) {
            let first = self.range(number).start;
            see(&read(number)?, positions.start - first..positions.end - first);
        }
        Ok(())
    }

    /// Returns the part that process number `process` needs, as [`MeshPart::of_mesh`] cuts it out of the whole mesh. `read`
    /// returns a piece; it is called for pieces of the process and their neighbours, one after the other.
    ///
    /// # Errors
    /// Returns the errors of `read`.
    pub fn part<E>(
        &self,
        process: usize,
        runs: &Runs,
        mut read: impl FnMut(usize) -> Result<Piece, E>,
    ) -> Result<MeshPart, E> {
        let (arity, run_length) = (self.kind.node_count(), runs.length());
        let mut own_nodes: Vec<u32> = Vec::new();
        self.each_own((process, runs), &mut read, |piece, positions| {
            own_nodes.extend(piece.nodes_at(positions, arity));
        })?;
        own_nodes.sort_unstable();
        own_nodes.dedup();

        let own = self.overlapping(runs.positions_of(process));
        let near: BTreeSet<usize> = own.flat_map(|(piece, _)| &self.neighbours[piece]).copied().collect();
        let mut is_needed = vec![false; runs.count()];
        for number in near {
            let (piece, first) = (read(number)?, self.range(number).start);
            let mut is_own = vec![false; piece.nodes.len()];
            common_places(&piece.nodes, &own_nodes).for_each(|place| is_own[place] = true);
            for (position, corners) in (first..).zip(piece.corners.chunks_exact(arity)) {
                is_needed[position / run_length] |= corners.iter().any(|&corner| is_own[corner as usize]);
            }
        }
        drop(own_nodes);

        let mut selected = Selected::new(self.kind, &self.regions);
        for number in 0..self.ends.len() {
            let positions = self.range(number);
            if !positions.clone().any(|position| is_needed[position / run_length]) {
                continue;
            }
            let piece = read(number)?;
            selected.add(&piece, positions.clone().map(|position| is_needed[position / run_length]));
        }
        let runs = runs.listed(|run| is_needed[run]);
        let (mesh, order) = selected.into_mesh();
        let numbering = Numbering::along(&Curve::through(self.extent.into_iter()), &mesh.points);
        Ok(MeshPart { mesh, numbering, order, run_length, runs })
    }
}

/// Returns the numbers that two ascending lists have in common.
fn common(some: &[u32], others: &[u32]) -> impl Iterator<Item = u32> {
    common_places(some, others).map(|place| some[place])
}

/// Returns the places of these numbers in the first list.
fn common_places(some: &[u32], others: &[u32]) -> impl Iterator<Item = usize> {
    let mut others = others;
    some.iter().enumerate().filter_map(move |(place, one)| {
        others = &others[others.partition_point(|other| other < one)..];
        (others.first() == Some(one)).then_some(place)
    })
}
