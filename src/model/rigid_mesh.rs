//! Rigid bodies shaped by a mesh: a closed surface of triangles from a file, and the mass properties of the enclosed
//! volume.

use std::path::Path;

use nalgebra::{Matrix3, Vector3};
use vi_mesh::{Bounds, Surface, orient_triangles};

use super::import::sheet;
use super::shape::Form;
use super::shells;

/// Reads the solid within a surface mesh, or within the boundary of a mesh of solids. `scale` is in metres per unit of
/// the file. If the mass of the body matters, the shells of the surface must bound a solid.
///
/// # Errors
/// Returns an error if the file cannot be read, or its surface does not enclose a volume.
pub(super) fn read(path: &Path, scale: f64, has_mass: bool) -> Result<Form, String> {
    let mut file = vi_io::read_mesh(path).map_err(|error| error.to_string())?;
    let wrong = |message: String| format!("{}: {message}", path.display());
    let is_solid = file.mesh.blocks.iter().any(|block| block.kind.dimension() == 3);
    let mut mesh = if is_solid {
        file.mesh.clone()
    } else {
        sheet::prepare(&mut file, None).map_err(wrong)?;
        let elements = file.mesh.cells_of_dimension(2);
        orient_triangles(&mut file.mesh, &elements).map_err(|error| wrong(error.to_string()))?;
        file.mesh
    };
    mesh.points.iter_mut().for_each(|x| *x = x.map(|x| scale * x));
    let surface = Surface::of_body(&mesh, if is_solid { 3 } else { 2 });
    let triangles = surface.map_err(|error| wrong(error.to_string()))?.triangles();
    let form = enclosed(&mesh.points, triangles).map_err(wrong)?;
    // Messages name positions of the file.
    let fault = || {
        let place = |x: &[f64; 3]| [0, 1, 2].map(|k| (x[k] + form.centre[k]) / scale);
        shells::fault(&form.points.iter().map(place).collect::<Vec<_>>(), &form.triangles)
    };
    match has_mass.then(fault).flatten() {
        Some(fault) => Err(wrong(fault)),
        None => Ok(form),
    }
}

/// Returns the solid within a closed surface.
fn enclosed(all: &[[f64; 3]], mut triangles: Vec<[u32; 3]>) -> Result<Form, String> {
    if triangles.is_empty() {
        return Err("has no triangles: give a surface mesh, or a mesh of solids".to_owned());
    }
    if let Some([a, b]) = open_edge(&triangles) {
        return Err(format!(
            "its surface is not closed: the edge from {:?} to {:?} does not lie between exactly two triangles; a rigid \
             body needs a watertight surface",
            all[a as usize], all[b as usize]
        ));
    }
    let mut nodes: Vec<u32> = triangles.as_flattened().to_vec();
    nodes.sort_unstable();
    nodes.dedup();
    let place = |node: u32| nodes.partition_point(|&other| other < node) as u32;
    triangles.iter_mut().for_each(|triangle| *triangle = triangle.map(place));
    let points: Vec<Vector3<f64>> = nodes.iter().map(|&node| Vector3::from(all[node as usize])).collect();
    // Positions are relative to the mean of all points, so that no digits are lost far from the origin.
    let middle = points.iter().sum::<Vector3<f64>>() / points.len() as f64;
    let (mut volume, mut moment, mut second) = (0.0, Vector3::zeros(), Matrix3::zeros());
    for triangle in &triangles {
        let [a, b, c] = triangle.map(|k| points[k as usize] - middle);
        let part = a.dot(&b.cross(&c)) / 6.0;
        let sum = a + b + c;
        volume += part;
        moment += sum * (part / 4.0);
        // This adds ∫ r rᵀ dV over the tetrahedron of a, b, c and the mean.
        second += (a * a.transpose() + b * b.transpose() + c * c.transpose() + sum * sum.transpose())
            * (part / 20.0);
    }
    if volume < 0.0 {
        (volume, moment, second) = (-volume, -moment, -second);
        triangles.iter_mut().for_each(|triangle| triangle.swap(1, 2));
    }
    let [length, width, height] = Bounds::of(points.iter().map(|&x| x.into())).sides();
    let box_volume = length * width * height;
    if volume.is_nan() || volume <= 1e-9 * box_volume {
        return Err(format!("its surface encloses no volume ({volume:.3e} m³)"));
    }
    let from_middle = moment / volume;
    let squares = second / volume - from_middle * from_middle.transpose();
    let centre = middle + from_middle;
    Ok(Form {
        points: points.iter().map(|x| (x - centre).into()).collect(),
        triangles,
        skeleton: Vec::new(),
        radius: 0.0,
        volume,
        centre: centre.into(),
        squares,
        thickness: length.min(width).min(height),
    })
}

/// Returns an edge that is not shared by exactly two triangles with opposite directions along it.
fn open_edge(triangles: &[[u32; 3]]) -> Option<[u32; 2]> {
    let mut edges: Vec<[u32; 2]> = triangles.iter().flat_map(|&[a, b, c]| [[a, b], [b, c], [c, a]]).collect();
    edges.sort_unstable();
    let twice = edges.windows(2).find(|pair| pair[0] == pair[1]).map(|pair| pair[0]);
    twice.or_else(|| edges.iter().find(|&&[a, b]| edges.binary_search(&[b, a]).is_err()).copied())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::shape;
    use crate::scene::RigidShape;

    /// A box of triangles that is translated and turned inside out has the mass properties of a box.
    #[test]
    fn mass_properties_of_a_mesh_are_those_of_its_solid() {
        let shape = RigidShape::Box { size: [0.3, 1.0, 2.0] };
        let form = shape::form(&shape);
        let shifted: Vec<[f64; 3]> = form.points.iter().map(|x| [x[0] + 1e3, x[1] - 5.0, x[2]]).collect();
        let inside_out = form.triangles.iter().map(|&[a, b, c]| [a, c, b]).collect();
        let found = enclosed(&shifted, inside_out).expect("a closed surface");
        assert!((found.volume - 0.6).abs() < 1e-11);
        assert!((Vector3::from(found.centre) - Vector3::new(1e3, -5.0, 0.0)).norm() < 1e-9);
        assert!((found.squares - form.squares).norm() < 1e-10, "{}", found.squares);
        assert_eq!(found.triangles, form.triangles);
    }

    #[test]
    fn an_open_surface_names_its_edge() {
        let form = shape::form(&RigidShape::Box { size: [1.0; 3] });
        let message = enclosed(&form.points, form.triangles[1..].to_vec()).expect_err("a hole");
        assert!(message.contains("not closed"), "{message}");
    }
}
