//! Makes a sheet from a mesh file: triangles only, welded points, a flat pattern from texture coordinates.

use vi_io::{DataArray, MeshFile};
use vi_mesh::{CellKind, Mesh};

/// Names of point arrays with texture coordinates, in lower case.
const UV_NAMES: [&str; 5] = ["uv", "tcoords", "texcoords", "texturecoordinates", "texture coordinates"];

/// Name of the cell array with u v at the three corners of each triangle.
const CORNERS: &str = "uv";

/// Default welding distance, as a fraction of the largest extent.
const WELD: f64 = 1e-9;

/// Cuts quadrilaterals into triangles, and welds points nearer to each other than `weld` (the unit of the file; default
/// 1e-9 of the extent). Removes unused points, and triangles that collapse in welding. Each change gives a note.
///
/// # Errors
/// Returns a problem if surface cells are not linear triangles or quadrilaterals, or if triangles occur twice.
pub(in crate::model) fn prepare(file: &mut MeshFile, weld: Option<f64>) -> Result<(), String> {
    let is_curved =
        |kind: &CellKind| kind.dimension() == 2 && !matches!(kind, CellKind::Tri3 | CellKind::Quad4);
    if let Some(kind) = file.mesh.blocks.iter().map(|block| block.kind).find(is_curved) {
        return Err(format!(
            "cells of type {} cannot be elements of a sheet, which are linear triangles; write the mesh with \
             elements of order 1",
            kind.name()
        ));
    }
    let cut = file.cut_quadrilaterals();
    if cut > 0 {
        file.notes.push(format!("{cut} quadrilaterals were cut into two triangles each"));
    }
    texture_to_corners(file)?;
    let extent = (0..3)
        .map(|k| {
            let at = |x: &[f64; 3]| x[k];
            let most = file.mesh.points.iter().map(at).fold(f64::NEG_INFINITY, f64::max);
            most - file.mesh.points.iter().map(at).fold(f64::INFINITY, f64::min)
        })
        .fold(0.0, f64::max);
    let welded = file.weld(weld.unwrap_or(WELD * extent));
    if welded > 0 {
        file.notes.push(format!(
            "{welded} points that lie on others were welded to them, {} are left (`weld = 0.0` keeps them apart)",
            file.mesh.points.len()
        ));
    }
    let before = file.mesh.cell_count();
    let unused = file.retain_cells(|_, _, nodes| match nodes {
        [_] => true,
        nodes => (1..nodes.len()).all(|k| !nodes[..k].contains(&nodes[k])),
    });
    let closed = before - file.mesh.cell_count();
    if closed > 0 {
        file.notes.push(format!("{closed} cells with coinciding corners were left out"));
    }
    let stray = unused + drop_points_without_triangle(file);
    if stray > 0 {
        file.notes.push(format!("{stray} points that no triangle uses were left out"));
    }
    refuse_doubles(file)
}

/// Removes lines and points that are not on the triangles, and points that only these use.
fn drop_points_without_triangle(file: &mut MeshFile) -> usize {
    let mut used = vec![false; file.mesh.points.len()];
    for (_, nodes) in file.mesh.cells().filter(|(kind, _)| kind.dimension() == 2) {
        nodes.iter().for_each(|&node| used[node as usize] = true);
    }
    file.retain_cells(|_, _, nodes| nodes.iter().all(|&node| used[node as usize]))
}

fn refuse_doubles(file: &MeshFile) -> Result<(), String> {
    let triangles = file.mesh.cells().enumerate().filter(|(_, (kind, _))| kind.dimension() == 2);
    let mut sorted: Vec<([u32; 3], usize)> = triangles
        .filter_map(|(cell, (_, nodes))| {
            let mut nodes: [u32; 3] = nodes.try_into().ok()?;
            nodes.sort_unstable();
            Some((nodes, cell))
        })
        .collect();
    sorted.sort_unstable();
    match sorted.windows(2).find(|pair| pair[0].0 == pair[1].0) {
        None => Ok(()),
        Some(pair) => Err(format!(
            "elements {} and {} have the same corners: a triangle exists twice, or two layers of the sheet lie \
             on each other and were welded; remove one, or keep the layers apart with `weld = 0.0`",
            pair[0].1, pair[1].1
        )),
    }
}

/// Moves texture coordinates from points to corners, so that welding can join charts.
fn texture_to_corners(file: &mut MeshFile) -> Result<(), String> {
    if file.cell_array(CORNERS).is_some_and(|array| array.components == 6) {
        return Ok(());
    }
    let is_texture = |array: &&DataArray| UV_NAMES.contains(&array.name.to_lowercase().as_str());
    let Some(array) = file.point_data.iter().find(is_texture) else { return Ok(()) };
    let size = array.components;
    if !matches!(size, 2 | 3) {
        return Err(format!("point data `{}` has {size} components; texture coordinates have 2", array.name));
    }
    let uv = |node: u32| [0, 1].map(|k| array.values[node as usize * size + k]);
    let values = file
        .mesh
        .cells()
        .flat_map(|(_, nodes)| [0, 1, 2].map(|k| nodes.get(k).map_or([0.0; 2], |&node| uv(node))))
        .flatten()
        .collect();
    file.cell_data.push(DataArray { name: CORNERS.into(), components: 6, values });
    Ok(())
}

/// Returns the texture coordinates of the file at the corners of every cell. `None` if there are none or one is not
/// finite.
pub(super) fn texture(file: &MeshFile) -> Option<Vec<[[f64; 2]; 3]>> {
    let array = file.cell_array(CORNERS).filter(|array| array.components == 6)?;
    let is_finite = array.values.iter().all(|value| value.is_finite());
    let corners = array.values.as_chunks::<6>().0.iter();
    is_finite.then(|| corners.map(|v| [[v[0], v[1]], [v[2], v[3]], [v[4], v[5]]]).collect())
}

/// Returns the pattern of a sheet, m: the corners of every cell of the mesh, before cells are reoriented. `None` if the
/// file has no texture coordinates.
///
/// # Errors
/// Returns an error if `uv_scale` (m per unit) is missing and the texture coordinates cannot be lengths in the file's
/// unit.
pub(super) fn pattern(
    file: &MeshFile,
    mesh: &Mesh,
    scale: f64,
    uv_scale: Option<f64>,
) -> Result<Option<Vec<[[f64; 2]; 3]>>, String> {
    let Some(array) = file.cell_array(CORNERS).filter(|array| array.components == 6) else { return Ok(None) };
    if let Some(k) = array.values.iter().position(|value| !value.is_finite()) {
        return Err(format!("the texture coordinates of element {} are not finite", k / 6));
    }
    let factor = uv_scale.unwrap_or(scale);
    let pattern: Vec<[[f64; 2]; 3]> = array
        .values
        .as_chunks::<6>()
        .0
        .iter()
        .map(|v| [0, 1, 2].map(|corner| [0, 1].map(|k| factor * v[2 * corner + k])))
        .collect();
    if uv_scale.is_none() {
        let (mut flat, mut curved) = (0.0, 0.0);
        for cell in mesh.cells_of_dimension(2) {
            let Some((_, &[a, b, c])) = mesh.cell(cell as usize) else { continue };
            let [a, b, c] = [a, b, c].map(|node| mesh.points[node as usize]);
            let (u, v) = ([0, 1, 2].map(|k| b[k] - a[k]), [0, 1, 2].map(|k| c[k] - a[k]));
            let n = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
            curved += 0.5 * n.iter().map(|c| c * c).sum::<f64>().sqrt();
            let [p, q, r] = pattern[cell as usize];
            flat += 0.5 * ((q[0] - p[0]) * (r[1] - p[1]) - (q[1] - p[1]) * (r[0] - p[0])).abs();
        }
        let ratio: f64 = (curved / flat).sqrt();
        if !(0.5..=2.0).contains(&ratio) {
            return Err(format!(
                "rest = \"flat\" takes the texture coordinates as the flat pattern, in the unit of the file, but \
                 their area is {flat:.4e} m² and that of the mesh {curved:.4e} m²; give `uv_scale`, the length of \
                 a unit of texture in m ({:.6e} makes the areas equal)",
                factor * ratio
            ));
        }
    }
    Ok(Some(pattern))
}
