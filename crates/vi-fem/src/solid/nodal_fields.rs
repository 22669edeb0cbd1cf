//! Extrapolates element fields to the nodes.
//!
//! In each element a linear function of ξ is fitted to the values at the quadrature points (least squares with the
//! weights of the rule) and evaluated at the nodes. A node takes the mean of its elements, weighted by their volumes.
//! Fields that are linear in space are reproduced exactly, on the boundary too (Hinton & Campbell 1974).

use std::collections::HashMap;

use nalgebra::{DMatrix, DVector};

use crate::error::FemError;
use crate::solid::fields::ElementField;
use crate::solid::fields::{AtPoints, DeformedPoint, deformed, von_mises};
use crate::solid::material::Law;
use crate::solid::mean_dilation::LockingCure;
use vi_mesh::{CellKind, Mesh};

/// Returns `field` at every node of the mesh, `field.component_count()` numbers per node, from the elements of
/// `parts`, each with its law, at positions x (m, flat). It is zero at nodes without an element. The von Mises stress
/// is that of the smoothed stress.
///
/// # Errors
/// Returns the errors of [`crate::element_field`].
pub fn nodal_field(
    mesh: &Mesh,
    parts: &[(&[u32], &Law)],
    cure: LockingCure,
    x: &[f64],
    field: ElementField,
) -> Result<Vec<f64>, FemError> {
    if field == ElementField::VonMises {
        let stresses = nodal_field(mesh, parts, cure, x, ElementField::Stress)?;
        let rows = |s: &[f64]| [[s[0], s[1], s[2]], [s[3], s[4], s[5]], [s[6], s[7], s[8]]];
        return Ok(stresses.chunks_exact(9).map(|s| von_mises(&rows(s))).collect());
    }
    let components = field.component_count();
    let mut values = vec![0.0; components * mesh.points.len()];
    let mut volumes = vec![0.0; mesh.points.len()];
    let mut fits: HashMap<CellKind, DMatrix<f64>> = HashMap::new();
    for &(elements, law) in parts {
        for &element in elements {
            let points = deformed(mesh, element, x)?;
            // The cell exists, because it could be deformed above.
            let Some((kind, nodes)) = mesh.cell(element as usize) else { continue };
            let fit = fits.entry(kind).or_insert_with(|| fit(kind, &points));
            let at_points = law.visit(AtPoints { points: &points, field, cure });
            let volume: f64 = points.iter().map(|point| point.volume).sum();
            for &node in nodes {
                volumes[node as usize] += volume;
            }
            for k in 0..components {
                let of_points = DVector::from_fn(points.len(), |q, _| at_points[components * q + k]);
                for (&node, value) in nodes.iter().zip((&*fit * of_points).iter()) {
                    values[components * node as usize + k] += volume * value;
                }
            }
        }
    }
    for (node, values) in values.chunks_exact_mut(components).enumerate() {
        if volumes[node] > 0.0 {
            values.iter_mut().for_each(|value| *value /= volumes[node]);
        }
    }
    Ok(values)
}

/// Returns the matrix from values at the quadrature points to those of their linear fit at the nodes.
fn fit(kind: CellKind, points: &[DeformedPoint]) -> DMatrix<f64> {
    let nodes = kind.reference_nodes();
    let terms = if points.len() < 4 { 1 } else { 4 };
    let term = |xi: [f64; 3], k: usize| if k == 0 { 1.0 } else { xi[k - 1] };
    let basis = DMatrix::from_fn(points.len(), terms, |q, k| term(points[q].xi, k));
    let weighted = DMatrix::from_fn(terms, points.len(), |k, q| points[q].weight * term(points[q].xi, k));
    let at_nodes = DMatrix::from_fn(nodes.len(), terms, |a, k| term(nodes[a], k));
    // Four or more points of a rule that is exact to degree 2 determine a linear function.
    let inverse = (&weighted * basis).try_inverse().unwrap_or_else(|| DMatrix::zeros(terms, terms));
    at_nodes * inverse * weighted
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::solid::element::SOLIDS;
    use crate::solid::material::parameters::Isotropic;
    use vi_mesh::BoxMesh;

    /// Tests pure bending of linear elasticity, σ_xx = E κ y. It is linear in space, so the stress is exact at every
    /// node of quadratic elements, at the surface too.
    #[test]
    fn linear_stress_is_exact_at_the_nodes() {
        let (young, curvature) = (3.0, 1e-6);
        let law = Law::Linear(Isotropic { young, poisson: 0.25, density: 1.0 });
        for &element in SOLIDS {
            if element.is_linear() {
                continue;
            }
            let mesh = BoxMesh { size: [1.0; 3], cells: [2; 3], element, origin: [0.0, -0.5, -0.5] }
                .build()
                .unwrap();
            let x: Vec<f64> = mesh
                .points
                .iter()
                .flat_map(|&[x, y, z]| {
                    let (k, n) = (curvature, 0.25);
                    [x + k * x * y, y - 0.5 * k * (x * x + n * (y * y - z * z)), z - n * k * y * z]
                })
                .collect();
            let all = mesh.cells_of_dimension(3);
            let parts = [(all.as_slice(), &law)];
            // The Cauchy stress of the linear law has terms of second order in κ.
            let stress = nodal_field(&mesh, &parts, LockingCure::None, &x, ElementField::Stress).unwrap();
            for (point, stress) in mesh.points.iter().zip(stress.chunks_exact(9)) {
                let error = stress[0] - young * curvature * point[1];
                assert!(error.abs() < 1e-5 * young * curvature, "{element} {point:?}: {error:e}");
            }
        }
    }

    #[test]
    fn every_field_of_an_affine_map_is_the_elements() {
        let law = Law::NeoHookean(Isotropic { young: 10.0, poisson: 0.3, density: 1.0 });
        for &element in SOLIDS {
            let mesh =
                BoxMesh { size: [1.0; 3], cells: [2, 1, 1], element, origin: [0.0; 3] }.build().unwrap();
            let x: Vec<f64> =
                mesh.points.iter().flat_map(|p| [1.2 * p[0] + 0.1 * p[1], 0.9 * p[1], 1.1 * p[2]]).collect();
            let all = mesh.cells_of_dimension(3);
            for field in [
                ElementField::Stress,
                ElementField::VonMises,
                ElementField::Strain,
                ElementField::J,
                ElementField::EnergyDensity,
            ] {
                for cure in [LockingCure::None, LockingCure::MeanDilation] {
                    let of_elements = crate::element_field(&mesh, &all, &law, cure, &x, field).unwrap();
                    let at_nodes = nodal_field(&mesh, &[(&all, &law)], cure, &x, field).unwrap();
                    let components = field.component_count();
                    assert_eq!(at_nodes.len(), components * mesh.points.len());
                    for (k, value) in at_nodes.iter().enumerate() {
                        let error = value - of_elements[k % components];
                        assert!(error.abs() < 1e-11, "{element} {field:?}: {error:e}");
                    }
                }
            }
        }
    }
}
