//! Lumped masses and quantities that follow from them: total mass, centre of mass, inertia.

use crate::error::FemError;
use crate::small::tensor::{Mat3, cross, determinant};
use crate::solid::consistent_mass::high_order_rule;
use crate::solid::element::contract::{Element, SolidVisitor};
use crate::solid::element::visit_solid;
use vi_mesh::{CellKind, Mesh};

/// Adds to `masses` the lumped mass (kg) of each node of the mesh, for `elements` (numbers of solid cells) at a
/// density (kg/m³). It uses the row sums of ρ ∫ N_a N_b dV if they are positive for the element kind, and otherwise
/// the scaled diagonal of Hinton, Rock & Zienkiewicz (1976), which is positive for every kind.
///
/// # Errors
/// Returns [`FemError::Mesh`] for cells that do not exist; [`FemError::Unsupported`] for cells that are not solid
/// elements.
pub fn add_lumped_mass(
    mesh: &Mesh,
    elements: &[u32],
    density: f64,
    masses: &mut [f64],
) -> Result<(), FemError> {
    each_solid(mesh, elements, |kind, nodes| visit_solid(kind, AddMass { mesh, nodes, density, masses }))
}

/// Adds the row sums ρ ∫ N_a dV (kg) to `sums`. Weight uses them in equilibrium, since they have the accuracy of the
/// element. They may be negative (tet10, hex20) and are then no masses.
///
/// # Errors
/// Returns the errors of [`add_lumped_mass`].
pub fn add_row_sums(mesh: &Mesh, elements: &[u32], density: f64, sums: &mut [f64]) -> Result<(), FemError> {
    each_solid(mesh, elements, |kind, nodes| {
        visit_solid(kind, AddRowSums { kind, mesh, nodes, density, sums })
    })
}

/// Returns the volume at rest (m³) of each of `elements` (numbers of solid cells).
///
/// # Errors
/// Returns the errors of [`add_lumped_mass`].
pub fn volumes(mesh: &Mesh, elements: &[u32]) -> Result<Vec<f64>, FemError> {
    let mut volumes = Vec::with_capacity(elements.len());
    each_solid(mesh, elements, |kind, nodes| {
        volumes.push(visit_solid(kind, Volume { mesh, nodes })?);
        Some(())
    })?;
    Ok(volumes)
}

struct Volume<'a> {
    mesh: &'a Mesh,
    nodes: &'a [u32],
}

impl SolidVisitor for Volume<'_> {
    type Output = f64;
    fn visit<E: Element<N, Q>, const N: usize, const Q: usize>(self) -> f64 {
        let x: [[f64; 3]; N] = std::array::from_fn(|a| self.mesh.points[self.nodes[a] as usize]);
        mass_shares::<E, N, Q>(&x).iter().sum()
    }
}

/// Calls `add` for each element; `add` returns `None` for a cell that is not solid.
fn each_solid(
    mesh: &Mesh,
    elements: &[u32],
    mut add: impl FnMut(CellKind, &[u32]) -> Option<()>,
) -> Result<(), FemError> {
    for &element in elements {
        let (kind, nodes) = mesh.element(element, "mass, element")?;
        add(kind, nodes).ok_or(FemError::Unsupported { kind, used: "solid elements" })?;
    }
    Ok(())
}

struct AddRowSums<'a> {
    kind: CellKind,
    mesh: &'a Mesh,
    nodes: &'a [u32],
    density: f64,
    sums: &'a mut [f64],
}

impl SolidVisitor for AddRowSums<'_> {
    type Output = ();
    fn visit<E: Element<N, Q>, const N: usize, const Q: usize>(self) {
        let x: [[f64; 3]; N] = std::array::from_fn(|a| self.mesh.points[self.nodes[a] as usize]);
        // Use the rule of the consistent mass, so that weight and inertia agree to round-off.
        for (xi, weight) in high_order_rule::<E, N, Q>(self.kind) {
            let dv = weight * determinant(&E::reference_gradient(&x, &E::gradients(xi)));
            for (&node, value) in self.nodes.iter().zip(E::values(xi)) {
                self.sums[node as usize] += self.density * dv * value;
            }
        }
    }
}

struct AddMass<'a> {
    mesh: &'a Mesh,
    nodes: &'a [u32],
    density: f64,
    masses: &'a mut [f64],
}

impl SolidVisitor for AddMass<'_> {
    type Output = ();
    fn visit<E: Element<N, Q>, const N: usize, const Q: usize>(self) {
        let x: [[f64; 3]; N] = std::array::from_fn(|a| self.mesh.points[self.nodes[a] as usize]);
        let shares = mass_shares::<E, N, Q>(&x);
        for (&node, share) in self.nodes.iter().zip(shares) {
            self.masses[node as usize] += self.density * share;
        }
    }
}

/// Returns the volume (m³) assigned to each node of an element at rest at `x`; the sum is the volume of the element.
pub(crate) fn mass_shares<E: Element<N, Q>, const N: usize, const Q: usize>(x: &[[f64; 3]; N]) -> [f64; N] {
    let (mut rows, mut diagonal, mut volume) = ([0.0; N], [0.0; N], 0.0);
    for (xi, weight) in E::mass_rule() {
        let dv = weight * determinant(&E::reference_gradient(x, &E::gradients(xi)));
        let values = E::values(xi);
        volume += dv;
        for a in 0..N {
            rows[a] += dv * values[a];
            diagonal[a] += dv * values[a] * values[a];
        }
    }
    // Decide by the element kind whether to use row sums, so that all elements of a mesh agree.
    let reference = E::mass_rule().iter().fold([0.0; N], |mut sum, &(xi, weight)| {
        let values = E::values(xi);
        for a in 0..N {
            sum[a] += weight * values[a];
        }
        sum
    });
    if reference.iter().all(|&share| share > 1e-9) {
        return rows;
    }
    let scale = volume / diagonal.iter().sum::<f64>();
    diagonal.map(|share| scale * share)
}

/// Mass, centre of mass and inertia of a set of point masses.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MassProperties {
    /// Total mass, kg.
    pub mass: f64,
    /// Centre of mass, m.
    pub centre: [f64; 3],
    /// Inertia tensor about the centre, Σ m (|r|² I − r ⊗ r), kg m².
    pub inertia: [[f64; 3]; 3],
}

/// Returns the mass properties of points (m) with masses (kg).
pub fn mass_properties(points: &[[f64; 3]], masses: &[f64]) -> MassProperties {
    let mass: f64 = masses.iter().sum();
    let mut centre = [0.0; 3];
    for (point, m) in points.iter().zip(masses) {
        for i in 0..3 {
            centre[i] += m * point[i] / mass;
        }
    }
    let mut inertia: Mat3<f64> = [[0.0; 3]; 3];
    for (point, m) in points.iter().zip(masses) {
        let r = [0, 1, 2].map(|i| point[i] - centre[i]);
        let square: f64 = r.iter().map(|value| value * value).sum();
        for i in 0..3 {
            for j in 0..3 {
                inertia[i][j] += m * (if i == j { square } else { 0.0 } - r[i] * r[j]);
            }
        }
    }
    MassProperties { mass, centre, inertia }
}

/// Returns the velocities v + ω × (x − centre) (m/s) of points (m) that move as one rigid body, 3 numbers per point.
pub fn rigid_velocities(
    points: &[[f64; 3]],
    centre: [f64; 3],
    velocity: [f64; 3],
    angular_velocity: [f64; 3],
) -> impl Iterator<Item = f64> {
    let at = move |point: &[f64; 3]| {
        let spin = cross(angular_velocity, [0, 1, 2].map(|i| point[i] - centre[i]));
        [0, 1, 2].map(|i| velocity[i] + spin[i])
    };
    points.iter().flat_map(at)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::solid::element::SOLIDS;
    use vi_mesh::BoxMesh;

    #[test]
    fn a_box_has_the_mass_and_centre_of_a_box() {
        let mesh = BoxMesh {
            size: [2.0, 1.0, 0.5],
            cells: [8, 4, 2],
            element: CellKind::Tet4,
            origin: [1.0, 0.0, 0.0],
        }
        .build()
        .unwrap();
        let mut masses = vec![0.0; mesh.points.len()];
        add_lumped_mass(&mesh, &mesh.cells_of_dimension(3), 3.0, &mut masses).unwrap();
        let found = mass_properties(&mesh.points, &masses);
        assert!((found.mass - 3.0).abs() < 1e-14);
        let expected = [2.0, 0.5, 0.25];
        assert!((0..3).all(|i| (found.centre[i] - expected[i]).abs() < 1e-14), "{found:?}");
        assert!(found.inertia[0][0] > 0.0 && found.inertia[0][1].abs() < 0.05);
    }

    #[test]
    fn row_sums_integrate_shape_functions() {
        for &element in SOLIDS {
            let shape = BoxMesh { size: [2.0, 1.0, 1.0], cells: [2, 1, 1], element, origin: [0.0; 3] };
            let mesh = shape.build().unwrap();
            let mut sums = vec![0.0; mesh.points.len()];
            add_row_sums(&mesh, &mesh.cells_of_dimension(3), 1.0, &mut sums).unwrap();
            // Check ∫ 1 dV, ∫ x dV and, if the element is quadratic, ∫ x² dV.
            let degrees = if element.node_count() > 8 { 3 } else { 2 };
            for k in 0..degrees {
                let sum: f64 = sums.iter().zip(&mesh.points).map(|(m, x)| m * x[0].powi(k)).sum();
                let exact = 2.0_f64.powi(k + 1) / f64::from(k + 1);
                assert!((sum - exact).abs() < 1e-13, "{element} {k}: {sum}");
            }
        }
    }
}
