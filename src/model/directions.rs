//! Finds the directions along which nodes are held: global axes, normals of surfaces, axes of cylinders and spheres,
//! all at rest.

use vi_mesh::Mesh;

use super::select::{self, ON_PLANE};
use crate::scene::{Axis, Fix, HeldAxis, LocalAxis};

/// Returns the unit vector of a global axis.
pub(super) fn of_axis(axis: Axis) -> [f64; 3] {
    let mut unit = [0.0; 3];
    unit[axis as usize] = 1.0;
    unit
}

/// For each node of a fix, the unit directions along which it is held.
pub(super) type DirectionsOfNodes = Vec<Vec<[f64; 3]>>;

/// Returns the unit directions of each node of a fix; `None` if they are global axes only.
///
/// # Errors
/// Returns a problem with the key at fault.
pub(super) fn directions(
    fix: &Fix,
    mesh: &Mesh,
    dimension: usize,
    nodes: &[u32],
) -> Result<Option<DirectionsOfNodes>, (&'static str, String)> {
    if fix.symmetry {
        check_plane(fix, mesh, nodes)?;
    }
    if fix.axes.iter().all(|axis| matches!(axis, HeldAxis::Space(_))) {
        return Ok(None);
    }
    let is_of_surface = |axis: &HeldAxis| {
        matches!(axis, HeldAxis::Local(LocalAxis::Normal))
            || matches!(axis, HeldAxis::Local(LocalAxis::Tangent)) && fix.about.is_none()
    };
    let normals = match fix.axes.iter().any(is_of_surface) {
        false => None,
        true => {
            let surface = select::surface(mesh, dimension, &fix.on)?;
            let mut normals = vec![None; mesh.points.len()];
            for (node, normal) in surface.normals(mesh) {
                normals[node as usize] = unit(normal);
            }
            Some(normals)
        }
    };
    let mut all = Vec::with_capacity(nodes.len());
    for &node in nodes {
        let normal = || {
            normals.as_ref().and_then(|normals| normals[node as usize]).ok_or_else(|| {
                let message = format!(
                    "node {node} has no normal: it is on no facet of the selected surface, or facets on both of its \
                     sides cancel; select a part of the surface"
                );
                ("axes", message)
            })
        };
        let mut directions = Vec::new();
        for axis in &fix.axes {
            match axis {
                HeldAxis::Space(axis) => directions.push(of_axis(*axis)),
                HeldAxis::Vector(direction) => directions.extend(unit(*direction)),
                HeldAxis::Local(LocalAxis::Normal) => directions.push(normal()?),
                HeldAxis::Local(LocalAxis::Tangent) if fix.about.is_none() => {
                    directions.extend(across(normal()?));
                }
                HeldAxis::Local(local) => {
                    let [radial, hoop, axial] = around(fix, mesh.points[node as usize], select::extent(mesh))
                        .map_err(|why| ("about", format!("node {node} {why}")))?;
                    match local {
                        LocalAxis::Radial => directions.push(radial),
                        LocalAxis::Hoop => directions.push(hoop),
                        LocalAxis::Axial => directions.push(axial),
                        _ => directions.extend([hoop, axial]),
                    }
                }
            }
        }
        all.push(directions);
    }
    Ok(Some(all))
}

/// Returns the radial, hoop and axial directions at a point. For a sphere the last two are any two tangents.
fn around(fix: &Fix, x: [f64; 3], extent: f64) -> Result<[[f64; 3]; 3], &'static str> {
    let Some(about) = &fix.about else { return Err("has no cylinder or sphere") };
    let arm = [0, 1, 2].map(|i| x[i] - about.point[i]);
    let axis = about.axis.and_then(unit);
    let radius = match axis {
        Some(axis) => {
            let along = dot(arm, axis);
            [0, 1, 2].map(|i| arm[i] - along * axis[i])
        }
        None => arm,
    };
    if dot(radius, radius).sqrt() <= 1e-9 * extent {
        return Err(
            "lies on the axis or in the centre, where no direction is radial; hold it in an entry of its own, along x, y, z",
        );
    }
    let radial = unit(radius).unwrap_or(radius);
    Ok(match axis {
        Some(axis) => [radial, cross(axis, radial), axis],
        None => {
            let [hoop, axial] = across(radial);
            [radial, hoop, axial]
        }
    })
}

/// Checks that the nodes of a mirror plane lie in it.
fn check_plane(fix: &Fix, mesh: &Mesh, nodes: &[u32]) -> Result<(), (&'static str, String)> {
    let (Some(normal), Some(&first)) = (mirror_normal(fix), nodes.first()) else { return Ok(()) };
    let origin = mesh.points[first as usize];
    let off = |&node: &u32| {
        let x = mesh.points[node as usize];
        dot(normal, [0, 1, 2].map(|i| x[i] - origin[i])).abs()
    };
    let most = nodes.iter().map(off).fold(0.0, f64::max);
    if most > ON_PLANE * select::extent(mesh) {
        let message = format!(
            "the nodes do not lie in one plane with the normal {normal:?}: they are up to {most:.3e} m apart along it; \
             select the nodes in the mirror plane, e.g. by `plane`"
        );
        return Err(("symmetry", message));
    }
    Ok(())
}

/// Returns the unit normal of the mirror plane of a fix with `symmetry`.
pub(super) fn mirror_normal(fix: &Fix) -> Option<[f64; 3]> {
    match fix.axes[..] {
        [HeldAxis::Space(axis)] if fix.symmetry => Some(of_axis(axis)),
        [HeldAxis::Vector(direction)] if fix.symmetry => unit(direction),
        _ => None,
    }
}

/// Returns two unit vectors normal to a unit vector and to each other.
pub(super) fn across(normal: [f64; 3]) -> [[f64; 3]; 2] {
    let smallest = (0..3).min_by(|&a, &b| normal[a].abs().total_cmp(&normal[b].abs())).unwrap_or(0);
    let mut other = [0.0; 3];
    other[smallest] = 1.0;
    let first = cross(normal, other);
    let first = unit(first).unwrap_or(first);
    [first, cross(normal, first)]
}

pub(super) fn unit(v: [f64; 3]) -> Option<[f64; 3]> {
    let length = dot(v, v).sqrt();
    (length > 0.0 && length.is_finite()).then(|| v.map(|c| c / length))
}

pub(super) fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

pub(super) fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}
