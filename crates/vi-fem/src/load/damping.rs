//! Damping of strain rates in the material frame (Kelvin–Voigt), and of velocities in proportion to mass; together
//! they are Rayleigh damping. Both are off by default.
//!
//! The viscous stress S_v = 2η Ė + ζ tr(Ė) I with Ė = sym(FᵀḞ) depends only on the rate of the Green–Lagrange strain;
//! free fall and rigid rotation are not damped. At small strains 2η = 2βμ, ζ = βλ gives Rayleigh's
//! stiffness-proportional damping force βK ẋ.

use std::ops::Range;
use std::sync::Arc;

use vi_core::{Force, ForceAccount, Potential, Stencils, packed_len};

use crate::error::FemError;
use crate::small::tensor::{cofactor, determinant, dot};
use crate::solid::element::contract::{Element, SolidVisitor};
use crate::solid::element::visit_solid;
use vi_mesh::{CellKind, Mesh};

type Vec3 = [f64; 3];

/// Viscosities of a solid for the stress S_v = 2η Ė + ζ tr(Ė) I.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Viscosity {
    /// Shear viscosity η, Pa s; not negative.
    pub shear: f64,
    /// Viscosity ζ of volume changes, Pa s. Damping only dissipates energy if η ≥ 0 and 2η + 3ζ ≥ 0.
    pub bulk: f64,
}

impl Viscosity {
    fn check(self) -> Result<(), FemError> {
        let ok = self.shear >= 0.0 && 2.0 * self.shear + 3.0 * self.bulk >= 0.0;
        if ok && self.shear.is_finite() && self.bulk.is_finite() {
            return Ok(());
        }
        let requirement =
            "viscosities must be finite, η ≥ 0 and 2η + 3ζ ≥ 0, or damping would add energy (Pa s)";
        Err(FemError::Parameter { key: "viscosity", value: self.shear.min(self.bulk), requirement })
    }
}

/// Returns the Kelvin–Voigt damping of solid elements, one force per element kind. Node a of the mesh is node a +
/// `node_offset` of the system.
///
/// [`FemError::Parameter`] for viscosities that would add energy; [`FemError::Mesh`] and [`FemError::Unsupported`]
/// for cells that are not solid elements.
pub fn kelvin_voigt(
    mesh: &Mesh,
    elements: &[u32],
    viscosity: Viscosity,
    node_offset: usize,
    name: &str,
) -> Result<Vec<Arc<dyn Force>>, FemError> {
    viscosity.check()?;
    let mut parts: Vec<(CellKind, KelvinVoigt)> = Vec::new();
    for &element in elements {
        let (kind, nodes) = mesh.element(element, "damping, element")?;
        let part = match parts.iter().position(|(other, _)| *other == kind) {
            Some(part) => part,
            None => {
                let name = name.to_owned();
                parts.push((
                    kind,
                    KelvinVoigt {
                        name,
                        viscosity,
                        arity: nodes.len(),
                        nodes: Vec::new(),
                        points: Vec::new(),
                    },
                ));
                parts.len() - 1
            }
        };
        let part = &mut parts[part].1;
        part.nodes.extend(nodes.iter().map(|node| node + node_offset as u32));
        visit_solid(kind, AddPoints { mesh, nodes, points: &mut part.points })
            .ok_or(FemError::Unsupported { kind, used: "solid elements" })?;
    }
    Ok(parts.into_iter().map(|(_, part)| Arc::new(part) as Arc<dyn Force>).collect())
}

/// A quadrature point at rest: its volume (m³), and ∂N_a/∂X (1/m) for each node a.
type Points = Vec<(f64, Vec<Vec3>)>;

struct AddPoints<'a> {
    mesh: &'a Mesh,
    nodes: &'a [u32],
    points: &'a mut Points,
}

impl SolidVisitor for AddPoints<'_> {
    type Output = ();
    fn visit<E: Element<N, Q>, const N: usize, const Q: usize>(self) {
        let x: [Vec3; N] = std::array::from_fn(|a| self.mesh.points[self.nodes[a] as usize]);
        for (xi, weight) in E::rule() {
            let gradients = E::gradients(xi);
            let jacobian = E::reference_gradient(&x, &gradients);
            let det = determinant(&jacobian);
            let cofactor = cofactor(&jacobian);
            // Push the gradients to the rest frame: J⁻ᵀ ∂N/∂ξ.
            let material = gradients.map(|g| [0, 1, 2].map(|i| dot(cofactor[i], g) / det));
            self.points.push((weight * det, material.to_vec()));
        }
    }
}

struct KelvinVoigt {
    name: String,
    viscosity: Viscosity,
    arity: usize,
    nodes: Vec<u32>,
    /// The quadrature points of all elements, element by element.
    points: Points,
}

/// Returns Σ_a u_a ⊗ G_a, the material gradient of a nodal field.
fn gradient(u: &[Vec3], g: &[Vec3]) -> [Vec3; 3] {
    let mut out = [[0.0; 3]; 3];
    for (u, g) in u.iter().zip(g) {
        for i in 0..3 {
            for j in 0..3 {
                out[i][j] += u[i] * g[j];
            }
        }
    }
    out
}

fn apply(m: &[Vec3; 3], g: Vec3) -> Vec3 {
    m.map(|row| dot(row, g))
}

impl KelvinVoigt {
    fn local(&self, stencil: usize, values: &[f64]) -> Vec<Vec3> {
        let nodes = &self.nodes[stencil * self.arity..][..self.arity];
        nodes.iter().map(|&node| [0, 1, 2].map(|i| values[3 * node as usize + i])).collect()
    }

    fn points_of(&self, stencil: usize) -> &[(f64, Vec<Vec3>)] {
        let each = self.points.len() / (self.nodes.len() / self.arity);
        &self.points[stencil * each..][..each]
    }

    /// Returns the viscous stress S_v, Pa.
    fn stress(&self, f: &[Vec3; 3], rate: &[Vec3; 3]) -> [Vec3; 3] {
        let Viscosity { shear, bulk } = self.viscosity;
        let e: [Vec3; 3] = [0, 1, 2].map(|p| {
            [0, 1, 2].map(|q| 0.5 * (0..3).map(|i| f[i][p] * rate[i][q] + rate[i][p] * f[i][q]).sum::<f64>())
        });
        let trace = e[0][0] + e[1][1] + e[2][2];
        [0, 1, 2].map(|p| [0, 1, 2].map(|q| 2.0 * shear * e[p][q] + if p == q { bulk * trace } else { 0.0 }))
    }

    /// Writes the packed lower triangle of one block per element: the sum of weight × `entry` over its quadrature
    /// points. `prepare` computes once per point what `entry` needs.
    fn blocks<P>(
        &self,
        range: Range<usize>,
        x: &[f64],
        v: &[f64],
        out: &mut [f64],
        prepare: impl Fn([Vec3; 3], [Vec3; 3], &[Vec3]) -> P,
        entry: impl Fn(&P, &[Vec3], (usize, usize), (usize, usize)) -> f64,
    ) {
        let size = 3 * self.arity;
        for (stencil, out) in range.zip(out.chunks_exact_mut(packed_len(size))) {
            out.fill(0.0);
            let (x, v) = (self.local(stencil, x), self.local(stencil, v));
            for (weight, g) in self.points_of(stencil) {
                let point = prepare(gradient(&x, g), gradient(&v, g), g);
                let mut k = 0;
                for row in 0..size {
                    for column in 0..=row {
                        out[k] += weight * entry(&point, g, (row / 3, row % 3), (column / 3, column % 3));
                        k += 1;
                    }
                }
            }
        }
    }
}

impl Force for KelvinVoigt {
    fn name(&self) -> &str {
        &self.name
    }

    fn account(&self) -> ForceAccount {
        ForceAccount::Damping
    }

    fn stencils(&self) -> Stencils<'_> {
        Stencils { arity: self.arity, block: 3, nodes: &self.nodes }
    }

    fn depends_on_velocity(&self) -> bool {
        true
    }

    /// Writes f_a = −Σ_q w F S_v ∂N_a/∂X, N.
    fn forces(&self, range: Range<usize>, x: &[f64], v: &[f64], _t: f64, out: &mut [f64]) {
        for (stencil, out) in range.zip(out.chunks_exact_mut(3 * self.arity)) {
            out.fill(0.0);
            let (x, v) = (self.local(stencil, x), self.local(stencil, v));
            for (weight, g) in self.points_of(stencil) {
                let (f, rate) = (gradient(&x, g), gradient(&v, g));
                let stress = self.stress(&f, &rate);
                for (out, &g) in out.chunks_exact_mut(3).zip(g) {
                    let force = apply(&f, apply(&stress, g));
                    for i in 0..3 {
                        out[i] -= weight * force[i];
                    }
                }
            }
        }
    }

    /// Writes the geometric part δ_ik G_a·S_v G_b plus the material part F ∂S_v/∂F G_a, symmetrised.
    fn stiffness(&self, range: Range<usize>, x: &[f64], v: &[f64], _t: f64, out: &mut [f64]) {
        struct Point {
            stress: [Vec3; 3],
            /// F Ḟᵀ.
            mixed: [Vec3; 3],
            /// F G_a and Ḟ G_a for each node a.
            pushed: Vec<(Vec3, Vec3)>,
        }
        let Viscosity { shear, bulk } = self.viscosity;
        let prepare = |f: [Vec3; 3], rate: [Vec3; 3], g: &[Vec3]| Point {
            stress: self.stress(&f, &rate),
            mixed: f.map(|row| rate.map(|other| dot(row, other))),
            pushed: g.iter().map(|&g| (apply(&f, g), apply(&rate, g))).collect(),
        };
        let one_sided = |point: &Point, g: &[Vec3], (a, i): (usize, usize), (b, k): (usize, usize)| {
            let ((fa, ra), (fb, rb)) = (point.pushed[a], point.pushed[b]);
            shear * (fb[i] * ra[k] + point.mixed[i][k] * dot(g[a], g[b])) + bulk * fa[i] * rb[k]
        };
        self.blocks(range, x, v, out, prepare, |point, g, row, column| {
            let geometric =
                if row.1 == column.1 { dot(g[row.0], apply(&point.stress, g[column.0])) } else { 0.0 };
            geometric + 0.5 * (one_sided(point, g, row, column) + one_sided(point, g, column, row))
        });
    }

    /// Writes η (F Fᵀ)_ik G_a·G_b + η (F G_b)_i (F G_a)_k + ζ (F G_a)_i (F G_b)_k.
    fn damping(&self, range: Range<usize>, x: &[f64], v: &[f64], _t: f64, out: &mut [f64]) {
        let Viscosity { shear, bulk } = self.viscosity;
        let prepare = |f: [Vec3; 3], _: [Vec3; 3], g: &[Vec3]| {
            let left = f.map(|row| f.map(|other| dot(row, other)));
            (left, g.iter().map(|&g| apply(&f, g)).collect::<Vec<_>>())
        };
        self.blocks(range, x, v, out, prepare, |(left, pushed), g, (a, i), (b, k)| {
            shear * (left[i][k] * dot(g[a], g[b]) + pushed[b][i] * pushed[a][k])
                + bulk * pushed[a][i] * pushed[b][k]
        });
    }
}

/// Checks a rate α of mass-proportional damping, 1/s.
fn check_rate(rate: f64) -> Result<(), FemError> {
    if rate >= 0.0 && rate.is_finite() {
        return Ok(());
    }
    let requirement = "mass-proportional damping must not be negative (1/s)";
    Err(FemError::Parameter { key: "mass_rate", value: rate, requirement })
}

/// f_a = −α m_a v_a: the mass-proportional part of Rayleigh damping, a drag relative to the inertial frame. Unlike
/// Kelvin–Voigt damping it also slows rigid motion.
pub struct MassDamping {
    name: String,
    nodes: Vec<u32>,
    /// α m_a, kg/s.
    coefficients: Vec<f64>,
}

impl MassDamping {
    /// Returns the damping at rate α (1/s, not negative) of nodes with these masses (kg). Node a of the list is node
    /// a + `node_offset` of the system.
    ///
    /// # Errors
    /// Returns [`FemError::Parameter`] for a rate that is negative or not finite.
    pub fn new(masses: &[f64], rate: f64, node_offset: usize, name: &str) -> Result<Self, FemError> {
        check_rate(rate)?;
        Ok(Self {
            name: name.into(),
            nodes: (0..masses.len()).map(|node| (node + node_offset) as u32).collect(),
            coefficients: masses.iter().map(|mass| rate * mass).collect(),
        })
    }
}

impl Force for MassDamping {
    fn name(&self) -> &str {
        &self.name
    }

    fn account(&self) -> ForceAccount {
        ForceAccount::Damping
    }

    fn stencils(&self) -> Stencils<'_> {
        Stencils { arity: 1, block: 3, nodes: &self.nodes }
    }

    fn depends_on_velocity(&self) -> bool {
        true
    }

    fn forces(&self, range: Range<usize>, _x: &[f64], v: &[f64], _t: f64, out: &mut [f64]) {
        for (stencil, out) in range.zip(out.chunks_exact_mut(3)) {
            for i in 0..3 {
                out[i] = -self.coefficients[stencil] * v[3 * self.nodes[stencil] as usize + i];
            }
        }
    }

    fn stiffness(&self, range: Range<usize>, _x: &[f64], _v: &[f64], _t: f64, out: &mut [f64]) {
        out[..6 * range.len()].fill(0.0);
    }

    fn damping(&self, range: Range<usize>, _x: &[f64], _v: &[f64], _t: f64, out: &mut [f64]) {
        for (stencil, out) in range.zip(out.chunks_exact_mut(6)) {
            let c = self.coefficients[stencil];
            out.copy_from_slice(&[c, 0.0, c, 0.0, 0.0, c]);
        }
    }
}

/// f = −α M v with a consistent mass M: the drag of [`MassDamping`] for a system with this kinetic energy. With lumped masses it
/// would strain a body of quadratic elements in uniform motion.
pub struct ConsistentMassDamping {
    name: String,
    /// The kinetic energy ½ v·M v, a potential of the velocities.
    kinetic: Arc<dyn Potential>,
    rate: f64,
}

impl ConsistentMassDamping {
    /// Returns the damping at rate α (1/s, not negative) of the mass of a kinetic energy.
    ///
    /// # Errors
    /// Returns [`FemError::Parameter`] for a rate that is negative or not finite.
    pub fn new(kinetic: Arc<dyn Potential>, rate: f64, name: &str) -> Result<Self, FemError> {
        check_rate(rate)?;
        Ok(Self { name: name.into(), kinetic, rate })
    }
}

impl Force for ConsistentMassDamping {
    fn name(&self) -> &str {
        &self.name
    }

    fn account(&self) -> ForceAccount {
        ForceAccount::Damping
    }

    fn stencils(&self) -> Stencils<'_> {
        self.kinetic.stencils()
    }

    fn depends_on_velocity(&self) -> bool {
        true
    }

    fn forces(&self, range: Range<usize>, _x: &[f64], v: &[f64], _t: f64, out: &mut [f64]) {
        let size = range.len() * self.stencils().size();
        self.kinetic.gradients(range, v, 0.0, out);
        out[..size].iter_mut().for_each(|out| *out *= -self.rate);
    }

    fn stiffness(&self, range: Range<usize>, _x: &[f64], _v: &[f64], _t: f64, out: &mut [f64]) {
        out[..range.len() * packed_len(self.stencils().size())].fill(0.0);
    }

    fn damping(&self, range: Range<usize>, _x: &[f64], v: &[f64], _t: f64, out: &mut [f64]) {
        let size = range.len() * packed_len(self.stencils().size());
        self.kinetic.hessians(range, v, 0.0, out);
        out[..size].iter_mut().for_each(|out| *out *= self.rate);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use vi_mesh::BoxMesh;

    fn damped() -> (Mesh, Arc<dyn Force>) {
        let kind = CellKind::Tet4;
        let shape = BoxMesh { size: [1.0, 0.7, 0.4], cells: [1, 1, 1], element: kind, origin: [0.0; 3] };
        let mesh = shape.build().unwrap();
        let all = mesh.cells_of_dimension(3);
        let viscosity = Viscosity { shear: 3.0, bulk: 2.0 };
        let force = kelvin_voigt(&mesh, &all, viscosity, 0, "damping").unwrap().remove(0);
        (mesh, force)
    }

    fn forces(force: &dyn Force, x: &[f64], v: &[f64]) -> Vec<f64> {
        let stencils = force.stencils();
        let mut out = vec![f64::NAN; stencils.count() * stencils.size()];
        force.forces(0..stencils.count(), x, v, 0.0, &mut out);
        out
    }

    fn states(mesh: &Mesh) -> (Vec<f64>, Vec<f64>) {
        let bend = |x: &Vec3| [x[0] + 0.2 * x[1] * x[2], x[1] + 0.3 * x[0] * x[0], x[2] - 0.2 * x[0] * x[1]];
        let swirl = |x: &Vec3| [0.3 * x[2] - x[1] * x[0], x[0] * x[0], 0.5 - x[1] * x[2] + x[0]];
        (mesh.points.iter().flat_map(bend).collect(), mesh.points.iter().flat_map(swirl).collect())
    }

    #[test]
    fn rigid_motion_is_not_damped_and_strain_rates_lose_energy() {
        let (mesh, force) = damped();
        let (x, v) = states(&mesh);
        // v = a + ω × x of the deformed body.
        let omega = [0.7, -1.1, 2.0];
        let spin: Vec<f64> = x
            .as_chunks::<3>()
            .0
            .iter()
            .flat_map(|&x| {
                let turned = crate::small::tensor::cross(omega, x);
                [turned[0] + 3.0, turned[1] - 1.0, turned[2]]
            })
            .collect();
        assert!(forces(force.as_ref(), &x, &spin).iter().all(|f| f.abs() < 1e-13));
        let local = |stencil: usize, a: usize, i: usize| 3 * force.stencils().of(stencil)[a] as usize + i;
        let f = forces(force.as_ref(), &x, &v);
        let mut power = 0.0;
        let mut total = [0.0; 3];
        for (stencil, f) in f.chunks_exact(12).enumerate() {
            for a in 0..4 {
                for i in 0..3 {
                    power += f[3 * a + i] * v[local(stencil, a, i)];
                    total[i] += f[3 * a + i];
                }
            }
        }
        assert!(power < -0.1, "{power}");
        assert!(total.iter().all(|sum| sum.abs() < 1e-13));
    }

    #[test]
    fn tangents_are_the_symmetric_parts_of_differences() {
        let (mesh, force) = damped();
        let (x, v) = states(&mesh);
        let stencils = force.stencils();
        let packed = packed_len(12);
        let (mut stiffness, mut damping) =
            (vec![0.0; stencils.count() * packed], vec![0.0; stencils.count() * packed]);
        force.stiffness(0..stencils.count(), &x, &v, 0.0, &mut stiffness);
        force.damping(0..stencils.count(), &x, &v, 0.0, &mut damping);
        let e = 1e-5;
        for stencil in 0..stencils.count() {
            let dof = |local: usize| 3 * stencils.of(stencil)[local / 3] as usize + local % 3;
            let slope = |row: usize, column: usize, of_velocity: bool| {
                let shifted = |by: f64| {
                    let (mut x, mut v) = (x.clone(), v.clone());
                    if of_velocity {
                        v[dof(column)] += by
                    } else {
                        x[dof(column)] += by
                    }
                    forces(force.as_ref(), &x, &v)[stencil * 12 + row]
                };
                (shifted(-e) - shifted(e)) / (2.0 * e)
            };
            for row in 0..12 {
                for column in 0..=row {
                    let place = stencil * packed + packed_len(row) + column;
                    for (of_velocity, found) in [(false, stiffness[place]), (true, damping[place])] {
                        let both = slope(row, column, of_velocity) + slope(column, row, of_velocity);
                        assert!((0.5 * both - found).abs() < 1e-8, "{row} {column} {both} {found}");
                    }
                }
            }
        }
    }
}
