//! Dead loads: tractions, body forces and point loads whose direction is fixed while the body moves. Each has the
//! potential V = −a(t) Σ_a f_a·(x_a − X_a).

use std::ops::Range;

use vi_core::{Account, Fault, HessianKind, Potential, Stencils, Traits};

use crate::error::FemError;
use crate::load::spread::{Resultant, Spread};
use crate::path::amplitude::Amplitude;
use crate::path::field::VectorField;
use crate::small::tensor::{cross, determinant, dot};
use crate::solid::element::contract::{Element, SolidVisitor};
use crate::solid::element::visit_solid;
use vi_mesh::Surface;
use vi_mesh::{Mesh, MeshError};

/// Nodal forces a(t) f_a of fixed direction.
#[derive(Debug, Clone)]
pub struct DeadLoad {
    name: String,
    amplitude: Amplitude,
    nodes: Vec<u32>,
    /// f_a, N.
    forces: Vec<[f64; 3]>,
    /// X_a, m.
    rest: Vec<[f64; 3]>,
}

impl DeadLoad {
    /// Returns forces (N) on single nodes. Node a of the mesh is node a + `node_offset` of the system.
    ///
    /// # Errors
    /// Returns [`FemError::Mesh`] for nodes that do not exist.
    pub fn points(
        mesh: &Mesh,
        forces: &[(u32, [f64; 3])],
        amplitude: Amplitude,
        node_offset: usize,
        name: &str,
    ) -> Result<Self, FemError> {
        let mut sum = NodalSum::new(mesh);
        for (index, &(node, force)) in forces.iter().enumerate() {
            let available = mesh.points.len();
            if node as usize >= available {
                let (what, target, value) = ("point load", "node", node as usize);
                return Err(MeshError::OutOfRange { what, index, target, value, available }.into());
            }
            sum.add(node, 1.0, force);
        }
        sum.into_load(mesh, amplitude, node_offset, name)
    }

    /// Returns the nodal forces f_a = ∫ N_a T dA of a traction T (Pa, force per area at rest) on a surface.
    ///
    /// # Errors
    /// Returns [`FemError::Invalid`] if the field has no finite value on the surface.
    pub fn traction(
        mesh: &Mesh,
        surface: &Surface,
        traction: &VectorField,
        amplitude: Amplitude,
        node_offset: usize,
        name: &str,
    ) -> Result<Self, FemError> {
        let mut sum = NodalSum::new(mesh);
        for block in surface.blocks() {
            for nodes in block.facets() {
                for point in &block.rule {
                    let at = nodes.iter().map(|&node| mesh.points[node as usize]);
                    let [position, a, b] = point.frame(at);
                    let n = cross(a, b);
                    let area = point.weight * dot(n, n).sqrt();
                    let traction = traction.at(position);
                    for (&node, value) in nodes.iter().zip(&point.values) {
                        sum.add(node, area * value, traction);
                    }
                }
            }
        }
        sum.into_load(mesh, amplitude, node_offset, name)
    }

    /// Returns a total force F (N) and moment (N m), spread over a part of a body as the traction F/A + θ × (X − c).
    /// It varies linearly about the centroid c, and θ is chosen such that the moment is correct. To round-off, the
    /// nodal forces sum to F, and their moment about `about` (default c) is M.
    ///
    /// # Errors
    /// Returns [`FemError::Invalid`] if the part is a straight line and the moment has a component along it, or if a
    /// value is not finite.
    pub fn resultant_on(
        mesh: &Mesh,
        spread: &Spread,
        resultant: &Resultant,
        amplitude: Amplitude,
        node_offset: usize,
        name: &str,
    ) -> Result<Self, FemError> {
        let mut sum = NodalSum::new(mesh);
        let traction = spread.traction(resultant)?;
        for point in &spread.points {
            let traction = traction(point.position);
            for &(node, value) in &point.nodes {
                sum.add(node, point.measure * value, traction);
            }
        }
        sum.into_load(mesh, amplitude, node_offset, name)
    }

    /// Returns the nodal forces f_a = ∫ N_a b h dA of a force b per volume at rest (N/m³) on the triangles of a
    /// sheet. `volumes` holds each triangle's cell number and its volume h A (m³).
    ///
    /// # Errors
    /// Returns the errors of [`DeadLoad::body_force`].
    pub fn body_force_on_sheet(
        mesh: &Mesh,
        volumes: &[(u32, f64)],
        force: &VectorField,
        amplitude: Amplitude,
        node_offset: usize,
        name: &str,
    ) -> Result<Self, FemError> {
        let mut sum = NodalSum::new(mesh);
        for &(element, volume) in volumes {
            let (kind, nodes) = mesh.element(element, "body force, element")?;
            let &[a, b, c] = nodes else {
                return Err(FemError::Unsupported { kind, used: "triangles of a sheet" });
            };
            let corners = [a, b, c].map(|node| mesh.points[node as usize]);
            // Integrate at the midpoints of the edges: exact for b linear in x.
            for values in [[0.5, 0.5, 0.0], [0.0, 0.5, 0.5], [0.5, 0.0, 0.5]] {
                let position = [0, 1, 2].map(|i| (0..3).map(|k| values[k] * corners[k][i]).sum());
                let force = force.at(position);
                for (&node, value) in nodes.iter().zip(values) {
                    sum.add(node, volume / 3.0 * value, force);
                }
            }
        }
        sum.into_load(mesh, amplitude, node_offset, name)
    }

    /// Returns the nodal forces f_a = ∫ N_a b dV of a force b per volume at rest (N/m³) on solid elements.
    ///
    /// # Errors
    /// Returns [`FemError::Mesh`] and [`FemError::Unsupported`] for cells that are not solid elements;
    /// [`FemError::Invalid`] if the field has no finite value in them.
    pub fn body_force(
        mesh: &Mesh,
        elements: &[u32],
        force: &VectorField,
        amplitude: Amplitude,
        node_offset: usize,
        name: &str,
    ) -> Result<Self, FemError> {
        let mut sum = NodalSum::new(mesh);
        for &element in elements {
            let (kind, nodes) = mesh.element(element, "body force, element")?;
            visit_solid(kind, AddBodyForce { mesh, nodes, force, sum: &mut sum })
                .ok_or(FemError::Unsupported { kind, used: "solid elements" })?;
        }
        sum.into_load(mesh, amplitude, node_offset, name)
    }

    /// Returns the total force Σ f_a (N) at amplitude 1.
    pub fn resultant(&self) -> [f64; 3] {
        [0, 1, 2].map(|i| self.forces.iter().map(|force| force[i]).sum())
    }

    fn displacement(&self, stencil: usize, x: &[f64]) -> [f64; 3] {
        let start = 3 * self.nodes[stencil] as usize;
        [0, 1, 2].map(|i| x[start + i] - self.rest[stencil][i])
    }
}

struct AddBodyForce<'a> {
    mesh: &'a Mesh,
    nodes: &'a [u32],
    force: &'a VectorField,
    sum: &'a mut NodalSum,
}

impl SolidVisitor for AddBodyForce<'_> {
    type Output = ();
    fn visit<E: Element<N, Q>, const N: usize, const Q: usize>(self) {
        let x: [[f64; 3]; N] = std::array::from_fn(|a| self.mesh.points[self.nodes[a] as usize]);
        for (xi, weight) in E::rule() {
            let dv = weight * determinant(&E::reference_gradient(&x, &E::gradients(xi)));
            let values = E::values(xi);
            let position = [0, 1, 2].map(|i| (0..N).map(|a| values[a] * x[a][i]).sum());
            let force = self.force.at(position);
            for (&node, value) in self.nodes.iter().zip(values) {
                self.sum.add(node, dv * value, force);
            }
        }
    }
}

/// Nodal forces while they are summed.
struct NodalSum {
    forces: Vec<[f64; 3]>,
    touched: Vec<bool>,
}

impl NodalSum {
    fn new(mesh: &Mesh) -> Self {
        Self { forces: vec![[0.0; 3]; mesh.points.len()], touched: vec![false; mesh.points.len()] }
    }

    fn add(&mut self, node: u32, factor: f64, force: [f64; 3]) {
        let node = node as usize;
        self.touched[node] = true;
        for i in 0..3 {
            self.forces[node][i] += factor * force[i];
        }
    }

    fn into_load(
        self,
        mesh: &Mesh,
        amplitude: Amplitude,
        node_offset: usize,
        name: &str,
    ) -> Result<DeadLoad, FemError> {
        let nodes: Vec<usize> = (0..self.touched.len()).filter(|&node| self.touched[node]).collect();
        if let Some(&node) = nodes.iter().find(|&&node| self.forces[node].iter().any(|f| !f.is_finite())) {
            let problem = format!("'{name}' has no finite value at node {node}, {:?} m", mesh.points[node]);
            return Err(FemError::Invalid { what: "load", problem });
        }
        Ok(DeadLoad {
            name: name.into(),
            amplitude,
            forces: nodes.iter().map(|&node| self.forces[node]).collect(),
            rest: nodes.iter().map(|&node| mesh.points[node]).collect(),
            nodes: nodes.iter().map(|&node| (node + node_offset) as u32).collect(),
        })
    }
}

impl Potential for DeadLoad {
    fn name(&self) -> &str {
        &self.name
    }

    fn account(&self) -> Account {
        Account::Load
    }

    fn stencils(&self) -> Stencils<'_> {
        Stencils { arity: 1, block: 3, nodes: &self.nodes }
    }

    fn traits(&self) -> Traits {
        Traits { hessian: HessianKind::Zero, time_dependent: !self.amplitude.is_constant() }
    }

    fn energies(&self, range: Range<usize>, x: &[f64], t: f64, out: &mut [f64]) {
        let factor = -self.amplitude.at(t);
        for (out, stencil) in out.iter_mut().zip(range) {
            *out = factor * dot(self.forces[stencil], self.displacement(stencil, x));
        }
    }

    fn gradients(&self, range: Range<usize>, _x: &[f64], t: f64, out: &mut [f64]) {
        let factor = -self.amplitude.at(t);
        for (out, force) in out.chunks_exact_mut(3).zip(&self.forces[range]) {
            for i in 0..3 {
                out[i] = factor * force[i];
            }
        }
    }

    fn hessians(&self, range: Range<usize>, _x: &[f64], _t: f64, out: &mut [f64]) {
        out[..6 * range.len()].fill(0.0);
    }

    fn fault(&self, stencil: usize, _x: &[f64], t: f64) -> Option<Fault> {
        self.amplitude.fault(stencil, t)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use vi_mesh::{BoxMesh, CellKind};

    fn cube() -> Mesh {
        let kind = CellKind::Tet4;
        BoxMesh { size: [2.0, 1.0, 1.0], cells: [2, 2, 2], element: kind, origin: [0.0; 3] }.build().unwrap()
    }

    #[test]
    fn loads_have_their_resultant() {
        let mesh = cube();
        let side = Surface::of_region(&mesh, "x-max").unwrap();
        assert!((side.area(&mesh) - 1.0).abs() < 1e-14);
        let once = Amplitude::default();
        let field = VectorField::expressions(["0", "6*y", "z^0"]).unwrap();
        let load = DeadLoad::traction(&mesh, &side, &field, once.clone(), 0, "shear").unwrap();
        let sum = load.resultant();
        assert!((sum[1] - 3.0).abs() < 1e-14 && (sum[2] - 1.0).abs() < 1e-14, "{sum:?}");
        let all = mesh.cells_of_dimension(3);
        let weight = VectorField::from([0.0, 0.0, -3.0]);
        let load = DeadLoad::body_force(&mesh, &all, &weight, once, 0, "weight").unwrap();
        assert!((load.resultant()[2] + 6.0).abs() < 1e-13);
    }

    #[test]
    fn the_energy_is_minus_the_work() {
        let mesh = cube();
        let ramp = Amplitude::expression("2*t").unwrap();
        let load = DeadLoad::points(&mesh, &[(3, [1.0, -2.0, 3.0])], ramp, 5, "pull").unwrap();
        let mut x = vec![0.0; 3 * (mesh.points.len() + 5)];
        for (node, point) in mesh.points.iter().enumerate() {
            x[3 * (node + 5)..3 * (node + 6)].copy_from_slice(point);
        }
        let mut energy = [f64::NAN];
        load.energies(0..1, &x, 0.5, &mut energy);
        assert_eq!(energy, [0.0]);
        x[3 * 8 + 1] += 0.25;
        load.energies(0..1, &x, 0.5, &mut energy);
        assert_eq!(energy, [0.5]);
        assert!(load.traits().time_dependent);
    }
}
