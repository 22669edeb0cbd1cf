//! Element fields of a deformed body: stress, strain, energy density. They are computed on request only.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::error::FemError;
use crate::small::tensor::{Mat3, cofactor, determinant, product, product_transposed, right_cauchy_green};
use crate::solid::element::contract::{Element, SolidVisitor};
use crate::solid::element::visit_solid;
use crate::solid::material::Law;
use crate::solid::material::contract::{LawVisitor, Material};
use crate::solid::mean_dilation::LockingCure;
use vi_mesh::Mesh;

/// A quantity of each element, averaged over its volume at rest.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum ElementField {
    /// Cauchy stress σ = P Fᵀ/J, Pa; 9 components by rows.
    Stress,
    /// Von Mises stress √(3/2 s:s), s the deviator of σ, Pa.
    VonMises,
    /// Green–Lagrange strain E = (FᵀF − I)/2; 9 components by rows.
    Strain,
    /// Volume ratio J = det F.
    #[serde(rename = "J")]
    J,
    /// Strain energy Ψ per volume at rest, J/m³.
    EnergyDensity,
}

impl ElementField {
    /// Returns the name in files.
    pub fn name(self) -> &'static str {
        match self {
            Self::Stress => "stress",
            Self::VonMises => "von_mises",
            Self::Strain => "strain",
            Self::J => "J",
            Self::EnergyDensity => "energy_density",
        }
    }

    /// Returns the number of components per element.
    pub fn component_count(self) -> usize {
        match self {
            Self::Stress | Self::Strain => 9,
            Self::VonMises | Self::J | Self::EnergyDensity => 1,
        }
    }
}

/// Returns `field` for each of `elements` (numbers of solid cells) with one law at positions x (m, flat, 3 per node
/// of the mesh), `field.component_count()` numbers per element. Outside the domain of a law they are NaN or infinite.
/// With mean dilation they are evaluated at F̄.
///
/// # Errors
/// Returns [`FemError::Mesh`] for cells that do not exist; [`FemError::Unsupported`] for cells that are not solid
/// elements.
pub fn element_field(
    mesh: &Mesh,
    elements: &[u32],
    law: &Law,
    cure: LockingCure,
    x: &[f64],
    field: ElementField,
) -> Result<Vec<f64>, FemError> {
    let mut values = Vec::with_capacity(elements.len() * field.component_count());
    for &element in elements {
        let points = deformed(mesh, element, x)?;
        let at_points = law.visit(AtPoints { points: &points, field, cure });
        let volume: f64 = points.iter().map(|point| point.volume).sum();
        let mean = |k: usize| {
            let terms = points.iter().zip(at_points.chunks_exact(field.component_count()));
            terms.map(|(point, values)| point.volume / volume * values[k]).sum::<f64>()
        };
        values.extend((0..field.component_count()).map(mean));
    }
    Ok(values)
}

/// A quadrature point of a deformed element.
pub(crate) struct DeformedPoint {
    pub(crate) xi: [f64; 3],
    /// Weight on the reference cell.
    pub(crate) weight: f64,
    pub(crate) f: Mat3<f64>,
    /// Volume at rest, m³.
    pub(crate) volume: f64,
}

/// Returns the quadrature points of an element.
pub(crate) fn deformed(mesh: &Mesh, element: u32, x: &[f64]) -> Result<Vec<DeformedPoint>, FemError> {
    let (kind, nodes) = mesh.element(element, "field, element")?;
    visit_solid(kind, Deform { mesh, nodes, x }).ok_or(FemError::Unsupported { kind, used: "solid elements" })
}

struct Deform<'a> {
    mesh: &'a Mesh,
    nodes: &'a [u32],
    x: &'a [f64],
}

impl SolidVisitor for Deform<'_> {
    type Output = Vec<DeformedPoint>;
    fn visit<E: Element<N, Q>, const N: usize, const Q: usize>(self) -> Vec<DeformedPoint> {
        let rest: [[f64; 3]; N] = std::array::from_fn(|a| self.mesh.points[self.nodes[a] as usize]);
        let now: [[f64; 3]; N] = std::array::from_fn(|a| {
            let start = 3 * self.nodes[a] as usize;
            [self.x[start], self.x[start + 1], self.x[start + 2]]
        });
        let point = |(xi, weight): ([f64; 3], f64)| {
            let gradients = E::gradients(xi);
            let jacobian = E::reference_gradient(&rest, &gradients);
            let det = determinant(&jacobian);
            // J⁻¹ = (cof J)ᵀ/det J.
            let inverse = cofactor(&jacobian).map(|row| row.map(|value| value / det));
            let f = product_transposed(&E::reference_gradient(&now, &gradients), &inverse);
            DeformedPoint { xi, weight, f, volume: weight * det }
        };
        E::rule().map(point).into_iter().collect()
    }
}

/// Evaluates a field at each point of one element.
pub(crate) struct AtPoints<'a> {
    pub(crate) points: &'a [DeformedPoint],
    pub(crate) field: ElementField,
    pub(crate) cure: LockingCure,
}

impl LawVisitor for AtPoints<'_> {
    type Output = Vec<f64>;
    fn visit<M: Material>(self, material: M) -> Vec<f64> {
        let mut values = Vec::with_capacity(self.points.len() * self.field.component_count());
        let mut deformations: Vec<Mat3<f64>> = self.points.iter().map(|point| point.f).collect();
        if self.cure == LockingCure::MeanDilation {
            let volumes: Vec<f64> = self.points.iter().map(|point| point.volume).collect();
            adjust(M::LINEAR, &mut deformations, &volumes);
        }
        for f in &deformations {
            match self.field {
                ElementField::Stress => values.extend(cauchy(&material, f).as_flattened()),
                ElementField::VonMises => values.push(von_mises(&cauchy(&material, f))),
                ElementField::Strain => {
                    let c = right_cauchy_green(f);
                    let strain = [0, 1, 2]
                        .map(|i| [0, 1, 2].map(|j| 0.5 * (c[i][j] - if i == j { 1.0 } else { 0.0 })));
                    values.extend(strain.as_flattened());
                }
                ElementField::J => values.push(determinant(f)),
                ElementField::EnergyDensity => values.push(material.energy(f)),
            }
        }
        values
    }
}

/// Replaces F by F̄ as defined in [`crate::mean_dilation`].
fn adjust(is_linear: bool, deformations: &mut [Mat3<f64>], volumes: &[f64]) {
    let measure = |f: &Mat3<f64>| if is_linear { f[0][0] + f[1][1] + f[2][2] } else { determinant(f) };
    let whole: f64 = volumes.iter().sum();
    let theta = deformations.iter().zip(volumes).map(|(f, dv)| dv * measure(f)).sum::<f64>() / whole;
    for f in deformations {
        let own = measure(f);
        for i in 0..3 {
            if is_linear {
                f[i][i] += (theta - own) / 3.0;
            } else {
                f[i] = f[i].map(|value| (theta / own).cbrt() * value);
            }
        }
    }
}

/// Returns σ = P Fᵀ/J.
fn cauchy<M: Material>(material: &M, f: &Mat3<f64>) -> Mat3<f64> {
    let j = determinant(f);
    let transposed = [0, 1, 2].map(|i| [f[0][i], f[1][i], f[2][i]]);
    product(&material.stress(f), &transposed).map(|row| row.map(|value| value / j))
}

pub(crate) fn von_mises(stress: &Mat3<f64>) -> f64 {
    let pressure = (stress[0][0] + stress[1][1] + stress[2][2]) / 3.0;
    let mut sum = 0.0;
    for i in 0..3 {
        for j in 0..3 {
            let deviator = stress[i][j] - if i == j { pressure } else { 0.0 };
            sum += deviator * deviator;
        }
    }
    (1.5 * sum).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::solid::element::SOLIDS;
    use crate::solid::material::parameters::Isotropic;
    use vi_mesh::{BoxMesh, CellKind};

    /// Tests uniaxial stress of the neo-Hookean law (reference case C6): σ₁₁ = P₁₁ λ/J, all other components zero.
    #[test]
    fn uniaxial_stress_of_every_element() {
        let (stretch, side) = (2.0, 0.7980775445);
        for &element in SOLIDS {
            let mesh =
                BoxMesh { size: [1.0; 3], cells: [1, 2, 1], element, origin: [0.0; 3] }.build().unwrap();
            let x: Vec<f64> =
                mesh.points.iter().flat_map(|p| [stretch * p[0], side * p[1], side * p[2]]).collect();
            let law = Law::NeoHookean(Isotropic { young: 10.0, poisson: 0.3, density: 1.0 });
            let elements = mesh.cells_of_dimension(3);
            let cure = if element == CellKind::Hex8 { LockingCure::MeanDilation } else { LockingCure::None };
            let field = |field| element_field(&mesh, &elements, &law, cure, &x, field).unwrap();
            let axial = 10.0 * 0.6467446602 / (side * side);
            assert!((field(ElementField::Stress)[0] - axial).abs() < 1e-7);
            assert!(field(ElementField::Stress)[4].abs() < 1e-7);
            assert!((field(ElementField::VonMises)[0] - axial).abs() < 1e-7);
            assert!((field(ElementField::J)[0] - stretch * side * side).abs() < 1e-12);
            assert!((field(ElementField::Strain)[0] - 1.5).abs() < 1e-12);
            assert_eq!(field(ElementField::Strain).len(), 9 * elements.len());
            assert!(field(ElementField::EnergyDensity)[0] > 0.0);
        }
    }
}
