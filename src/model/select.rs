//! Finds the nodes, facets and elements of a mesh that a selection of a scene names.

use std::path::Path;

use vi_fem::Spread;
use vi_mesh::{Bounds, Mesh, Surface};

use crate::scene::{PlaneRegion, Selection};

/// Largest distance from a plane of the nodes that lie on it, as a fraction of the extent of the body.
pub(super) const ON_PLANE: f64 = 1e-6;

/// Returns the nodes of a selection, in ascending order unless they are listed.
///
/// # Errors
/// Returns a problem with the key at fault.
pub(super) fn nodes(mesh: &Mesh, on: &Selection) -> Result<Vec<u32>, (&'static str, String)> {
    let key = on.key();
    let found = if let Some(region) = &on.region {
        return mesh.region_nodes(region).map_err(|error| (key, error.to_string()));
    } else if let Some(within) = &on.within {
        mesh.nodes_in_box(within.min, within.max)
    } else if let Some(PlaneRegion { point, normal, distance }) = &on.plane {
        mesh.nodes_near_plane(*point, *normal, distance.unwrap_or(ON_PLANE * extent(mesh)))
    } else if let Some(sphere) = &on.sphere {
        mesh.nodes_in_ball(sphere.centre, sphere.radius)
    } else if let Some(path) = &on.node_file {
        let listed = read_list(path).map_err(|message| (key, message))?;
        return listed_nodes(mesh, &listed)
            .map_err(|message| (key, format!("{}: {message}", path.display())));
    } else {
        let listed = on.nodes.as_deref().unwrap_or_default();
        return listed_nodes(mesh, listed).map_err(|message| (key, message));
    };
    if found.is_empty() {
        let Bounds { low, high } = Bounds::of(mesh.points.iter().copied());
        let shape = match key {
            "plane" => "on this plane",
            "sphere" => "in this ball",
            _ => "in this box",
        };
        return Err((key, format!("no node is {shape}; the body lies in {low:?} to {high:?} m")));
    }
    Ok(found)
}

/// Returns these nodes, if the mesh has them.
pub(super) fn listed_nodes(mesh: &Mesh, nodes: &[usize]) -> Result<Vec<u32>, String> {
    let count = mesh.points.len();
    match nodes.iter().find(|&&node| node >= count) {
        Some(node) => Err(format!("there is no node {node}; the body has nodes 0 to {}", count - 1)),
        None => Ok(nodes.iter().map(|&node| node as u32).collect()),
    }
}

fn read_list(path: &Path) -> Result<Vec<usize>, String> {
    let text =
        std::fs::read_to_string(path).map_err(|error| format!("cannot read {}: {error}", path.display()))?;
    let mut nodes = Vec::new();
    for (line, content) in (1..).zip(text.lines()) {
        let content = content.split('#').next().unwrap_or_default();
        for word in content.split([' ', '\t', ',', ';']).filter(|word| !word.is_empty()) {
            let node = word.parse().map_err(|_| {
                format!(
                    "{}:{line}: '{word}' is not a node number; write whole numbers from 0",
                    path.display()
                )
            })?;
            nodes.push(node);
        }
    }
    if nodes.is_empty() {
        return Err(format!("{} lists no nodes", path.display()));
    }
    Ok(nodes)
}

/// Returns the facets of a selection on a body of `dimension`: those of a surface region, or the facets of its boundary
/// (for a sheet: its triangles) whose nodes are all selected.
///
/// # Errors
/// Returns a problem with the key at fault.
pub(super) fn surface(
    mesh: &Mesh,
    dimension: usize,
    on: &Selection,
) -> Result<Surface, (&'static str, String)> {
    let key = on.key();
    let has_facets =
        |name: &String| mesh.regions.iter().any(|region| region.name == *name && region.dimension == 2);
    match on.region.as_ref() {
        Some(name) if has_facets(name) => {
            Surface::of_region(mesh, name).map_err(|error| (key, error.to_string()))
        }
        _ => {
            let nodes = nodes(mesh, on)?;
            let all = Surface::of_body(mesh, dimension).map_err(|error| (key, error.to_string()))?;
            let part = all.within(&nodes);
            if part.area(mesh) > 0.0 {
                return Ok(part);
            }
            let count = nodes.len();
            let message = format!(
                "no facet of the surface has all its nodes among the {count} that are selected; select a part of the \
                 surface, e.g. by a surface region"
            );
            Err((key, message))
        }
    }
}

/// Returns the surface of a selection, or the curves of a region of lines, over which a total force is distributed.
///
/// # Errors
/// Returns a problem with the key at fault.
pub(super) fn spread(
    mesh: &Mesh,
    dimension: usize,
    on: &Selection,
) -> Result<Spread, (&'static str, String)> {
    let named = |region: &&vi_mesh::Region| on.region.as_ref() == Some(&region.name);
    let regions: Vec<_> = mesh.regions.iter().filter(named).collect();
    if !regions.is_empty() && regions.iter().all(|region| region.dimension == 1) {
        let cells: Vec<u32> = regions.iter().flat_map(|region| region.cells.iter().copied()).collect();
        return Ok(Spread::of_lines(mesh, &cells));
    }
    Ok(Spread::of_surface(mesh, &surface(mesh, dimension, on)?))
}

/// Returns the elements (cells of the body's dimension) of a selection: those of a region of that dimension, otherwise
/// those with a selected node. If nothing is selected, returns all.
///
/// # Errors
/// Returns a problem with the key at fault.
pub(super) fn elements(
    mesh: &Mesh,
    dimension: usize,
    on: &Selection,
) -> Result<Vec<u32>, (&'static str, String)> {
    if on.is_empty() {
        return Ok(mesh.cells_of_dimension(dimension));
    }
    let named =
        |region: &&vi_mesh::Region| on.region.as_ref() == Some(&region.name) && region.dimension == dimension;
    let mut cells: Vec<u32> =
        mesh.regions.iter().filter(named).flat_map(|region| region.cells.clone()).collect();
    if cells.is_empty() {
        let mut is_selected = vec![false; mesh.points.len()];
        nodes(mesh, on)?.into_iter().for_each(|node| is_selected[node as usize] = true);
        cells = mesh.cells_of_dimension(dimension);
        let touches = |&cell: &u32| {
            let nodes = mesh.cell(cell as usize).map_or(&[][..], |(_, nodes)| nodes);
            nodes.iter().any(|&node| is_selected[node as usize])
        };
        cells.retain(touches);
    }
    cells.sort_unstable();
    cells.dedup();
    Ok(cells)
}

/// Returns the largest extent of a mesh along an axis, m.
pub(super) fn extent(mesh: &Mesh) -> f64 {
    Bounds::of(mesh.points.iter().copied()).longest_side()
}
