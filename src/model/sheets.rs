//! Terms for sheets only: clamped edges, surrounding air, and notes.

use std::collections::{HashMap, HashSet};
use std::sync::Arc;

use vi_core::Force;
use vi_fem::Wind;
use vi_mesh::Mesh;

use super::read::ReadBody;
use crate::scene::{Body, Damping};

/// Returns the boundary edges of triangles whose two nodes are in one of these sets, in ascending order.
pub(super) fn edges_between(mesh: &Mesh, elements: &[u32], sets: &[HashSet<u32>]) -> Vec<[u32; 2]> {
    if sets.is_empty() {
        return Vec::new();
    }
    let mut sides: HashMap<[u32; 2], usize> = HashMap::new();
    for &element in elements {
        let Some((_, &[a, b, c])) = mesh.cell(element as usize) else { continue };
        for (p, q) in [(a, b), (b, c), (c, a)] {
            *sides.entry([p.min(q), p.max(q)]).or_default() += 1;
        }
    }
    let is_held = |edge: &[u32; 2]| sets.iter().any(|nodes| edge.iter().all(|node| nodes.contains(node)));
    let mut edges: Vec<[u32; 2]> = sides
        .into_iter()
        .filter(|(edge, count)| *count == 1 && is_held(edge))
        .map(|(edge, _)| edge)
        .collect();
    edges.sort_unstable();
    edges
}

/// Returns the force of the air on all triangles of a body.
pub(super) fn wind(wind: &Wind, body: &ReadBody<'_>, node_offset: usize) -> Result<Arc<dyn Force>, String> {
    let elements: Vec<u32> = body.materials.iter().flat_map(|part| part.elements.iter().copied()).collect();
    let force = wind.force(&body.read.mesh, &elements, node_offset, &body.scene.name);
    Ok(Arc::from(force.map_err(|error| error.to_string())?))
}

/// Returns notes on settings whose effect on a sheet may differ from what a reader of the scene expects.
pub(super) fn notes(body: &Body, damping: Option<&Damping>) -> Vec<String> {
    let mut notes = Vec::new();
    if body.dimension() != 2 {
        return notes;
    }
    if body.material.0.len() > 1 {
        notes.push(format!(
            "{}: where two materials of a sheet meet, the seam bends freely: each material resists bending \
             within its own region",
            body.name
        ));
    }
    let is_viscous = |d: &Damping| [d.shear_viscosity, d.bulk_viscosity, d.stiffness_time] != [0.0; 3];
    if damping.is_some_and(is_viscous) {
        notes.push(format!(
            "{}: viscosity applies to solids only; a sheet is damped by `mass_rate` alone",
            body.name
        ));
    }
    notes
}
