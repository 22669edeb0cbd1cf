//! The part of a mesh that one of several processes computes.

use crate::cell::CellKind;
use crate::mesh::Mesh;
use crate::order::{Curve, Numbering, sort_by_place};
use crate::piece::Selected;
use crate::runs::Runs;

/// A part of a mesh: whole runs of its elements along Morton's curve. It contains all elements at the nodes of the runs that
/// one process computes.
#[derive(Debug, Clone, PartialEq)]
pub struct MeshPart {
    /// Nodes and elements in their order in the whole mesh. It has all regions of the whole mesh, with those of their nodes that
    /// are nodes of the runs of the process.
    pub mesh: Mesh,
    /// The order of the nodes of the part along the curve of the whole mesh.
    pub numbering: Numbering,
    /// The elements of the part in the order of the curve: run after run.
    pub order: Vec<u32>,
    /// Number of elements per run; the last run of the whole mesh may be shorter.
    pub run_length: usize,
    /// The number of each run in the whole mesh, and the process that computes it.
    pub runs: Vec<(u32, u32)>,
}

impl MeshPart {
    /// Cuts the part that process number `process` needs out of a mesh of volumes of one kind: the runs that it
    /// computes, and all runs that share nodes with them. Regions of facets, edges and points become regions of points.
    pub fn of_mesh(mesh: &Mesh, process: usize, runs: &Runs) -> Self {
        let mut on_curve = mesh.cells_of_dimension(3);
        sort_by_place(mesh, &mut on_curve);
        let run_length = runs.length();
        let mut is_own_node = vec![false; mesh.points.len()];
        let own = &on_curve[runs.positions_of(process)];
        mesh.corners_of(own).for_each(|node| is_own_node[node as usize] = true);
        let touches = |run: &[u32]| mesh.corners_of(run).any(|node| is_own_node[node as usize]);
        let is_needed: Vec<bool> = on_curve.chunks(run_length).map(touches).collect();
        let needed = on_curve.chunks(run_length).zip(&is_needed).filter(|(_, is_needed)| **is_needed);

        let kind = mesh.blocks.iter().map(|block| block.kind).find(|kind| kind.dimension() == 3);
        let regions: Vec<_> = mesh.regions.iter().map(|of| (of.name.clone(), of.dimension)).collect();
        let mut selected = Selected::new(kind.unwrap_or(CellKind::Tet4), &regions);
        selected.elements = needed.flat_map(|(run, _)| run).copied().collect();
        selected.corners = mesh.corners_of(&selected.elements).collect();
        let nodes = mesh.nodes_of(&selected.elements).into_iter();
        selected.nodes = nodes.map(|node| (node, mesh.points[node as usize])).collect();
        for (members, region) in selected.members.iter_mut().zip(&mesh.regions) {
            *members =
                if region.dimension == 3 { region.cells.clone() } else { mesh.nodes_of(&region.cells) };
        }
        let (part, order) = selected.into_mesh();
        let curve = Curve::through(mesh.points.iter().copied());
        let numbering = Numbering::along(&curve, &part.points);
        Self { mesh: part, numbering, order, run_length, runs: runs.listed(|run| is_needed[run]) }
    }
}
