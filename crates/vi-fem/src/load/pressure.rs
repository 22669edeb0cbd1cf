//! Pressure that follows a surface as it deforms: f_a = −a(t) p ∫ N_a n da over the deformed facets.
//!
//! If the edge of the surface is held such that the pressure does no work at it, the force is minus the derivative of
//! V = p × (volume behind the surface), and the pressure is a potential. Otherwise it is a [`Force`], whose work the
//! ledger records. The volume is ∫ G·n da with a linear field G of divergence 1. The edge contributes nothing if it
//! is clamped, or if it slides in planes that contain G (Rumpel & Schweizerhof 2003 give the symmetric tangent).

mod volume_field;

use std::ops::Range;
use std::sync::Arc;

use vi_core::{Account, Fault, Force, ForceAccount, HessianKind, Potential, Stencils, Traits, packed_len};

use crate::path::amplitude::Amplitude;
use crate::small::tensor::{cross, dot};
use vi_mesh::{FacetBlock, FacetPoint, Mesh, Surface};

use volume_field::VolumeField;

/// The terms of a pressure: potentials if it has one, else forces.
pub enum Pressure {
    /// One potential per kind of facet.
    Potential(Vec<Box<dyn Potential>>),
    /// One force per kind of facet.
    Force(Vec<Arc<dyn Force>>),
}

/// Returns the terms of a pressure p a(t) (Pa, positive if it pushes into the body) on a surface. `is_fixed(node)`
/// tells which coordinates of a node are prescribed. Node a of the mesh is node a + `node_offset` of the system.
///
/// The pressure has a potential only if the prescribed nodes of the edge do not move: let `is_fixed` report moving
/// nodes as free.
pub fn pressure(
    mesh: &Mesh,
    surface: &Surface,
    pressure: f64,
    amplitude: &Amplitude,
    is_fixed: impl Fn(u32) -> [bool; 3],
    node_offset: usize,
    name: &str,
) -> Pressure {
    let facets = |block: &FacetBlock| Facets {
        name: name.into(),
        pressure,
        amplitude: amplitude.clone(),
        nodes: block.nodes.iter().map(|node| node + node_offset as u32).collect(),
        arity: block.arity(),
        rule: block.rule.clone(),
    };
    match VolumeField::of_surface(mesh, surface, is_fixed) {
        Some(field) => Pressure::Potential(
            surface
                .blocks()
                .iter()
                .map(|block| Box::new(VolumePressure { facets: facets(block), field }) as Box<dyn Potential>)
                .collect(),
        ),
        None => Pressure::Force(
            surface
                .blocks()
                .iter()
                .map(|block| Arc::new(FollowerPressure(facets(block))) as Arc<dyn Force>)
                .collect(),
        ),
    }
}

/// Number of nodes of the largest facet.
const LARGEST: usize = 9;

/// Facets of one kind under pressure.
#[derive(Debug, Clone)]
struct Facets {
    name: String,
    pressure: f64,
    amplitude: Amplitude,
    nodes: Vec<u32>,
    arity: usize,
    rule: Vec<FacetPoint>,
}

/// Returns the permutation symbol ε_ijk.
fn permutation(i: usize, j: usize, k: usize) -> f64 {
    ((i as f64 - j as f64) * (j as f64 - k as f64) * (k as f64 - i as f64)) / 2.0
}

impl Facets {
    fn stencils(&self) -> Stencils<'_> {
        Stencils { arity: self.arity, block: 3, nodes: &self.nodes }
    }

    /// Returns p a(t), Pa.
    fn at(&self, t: f64) -> f64 {
        self.pressure * self.amplitude.at(t)
    }

    fn positions(&self, facet: usize, x: &[f64]) -> [[f64; 3]; LARGEST] {
        let mut out = [[0.0; 3]; LARGEST];
        let nodes = &self.nodes[facet * self.arity..][..self.arity];
        for (out, &node) in out.iter_mut().zip(nodes) {
            out.copy_from_slice(&x[3 * node as usize..][..3]);
        }
        out
    }

    fn frames(&self, facet: usize, x: &[f64]) -> impl Iterator<Item = (&FacetPoint, [[f64; 3]; 3])> {
        let positions = self.positions(facet, x);
        self.rule.iter().map(move |point| (point, point.frame(positions.into_iter())))
    }

    /// Writes `factor` ∫ N_a n da.
    fn normals(&self, range: Range<usize>, x: &[f64], factor: f64, out: &mut [f64]) {
        for (facet, out) in range.zip(out.chunks_exact_mut(3 * self.arity)) {
            out.fill(0.0);
            for (point, [_, a, b]) in self.frames(facet, x) {
                let n = cross(a, b);
                for (out, value) in out.chunks_exact_mut(3).zip(&point.values) {
                    for i in 0..3 {
                        out[i] += factor * point.weight * value * n[i];
                    }
                }
            }
        }
    }

    /// Writes the packed lower triangle of one block per facet: `factor` times the integral of `entry` for ((a, m),
    /// (b, n)), where a, b are nodes and m, n axes.
    fn blocks(
        &self,
        range: Range<usize>,
        x: &[f64],
        factor: f64,
        out: &mut [f64],
        entry: impl Fn(&FacetPoint, &[[f64; 3]; 3], (usize, usize), (usize, usize)) -> f64,
    ) {
        let size = 3 * self.arity;
        for (facet, out) in range.zip(out.chunks_exact_mut(packed_len(size))) {
            out.fill(0.0);
            for (point, frame) in self.frames(facet, x) {
                let mut k = 0;
                for row in 0..size {
                    for column in 0..=row {
                        let value = entry(point, &frame, (row / 3, row % 3), (column / 3, column % 3));
                        out[k] += factor * point.weight * value;
                        k += 1;
                    }
                }
            }
        }
    }
}

/// Returns ∂(n_m)/∂x_bn with n = a × b, which is ε_mnj N_b,ξ b_j + ε_min N_b,η a_i.
fn normal_derivative(gradient: [f64; 2], [_, a, b]: &[[f64; 3]; 3], m: usize, n: usize) -> f64 {
    if m == n {
        return 0.0;
    }
    let k = 3 - m - n;
    permutation(m, n, k) * (gradient[0] * b[k] - gradient[1] * a[k])
}

/// The potential V = p ∫ G·n da.
struct VolumePressure {
    facets: Facets,
    field: VolumeField,
}

impl Potential for VolumePressure {
    fn name(&self) -> &str {
        &self.facets.name
    }

    fn account(&self) -> Account {
        Account::Load
    }

    fn stencils(&self) -> Stencils<'_> {
        self.facets.stencils()
    }

    fn traits(&self) -> Traits {
        Traits { hessian: HessianKind::Varying, time_dependent: !self.facets.amplitude.is_constant() }
    }

    fn energies(&self, range: Range<usize>, x: &[f64], t: f64, out: &mut [f64]) {
        let pressure = self.facets.at(t);
        for (facet, out) in range.zip(out) {
            let flux = |(point, [x, a, b]): (&FacetPoint, [[f64; 3]; 3])| {
                point.weight * dot(self.field.at(x), cross(a, b))
            };
            *out = pressure * self.facets.frames(facet, x).map(flux).sum::<f64>();
        }
    }

    /// Writes the pressure's force, which equals ∂V/∂x for every free coordinate. For prescribed coordinates it is
    /// the true force, whereas ∂V/∂x would contain the contribution of the edge too.
    fn gradients(&self, range: Range<usize>, x: &[f64], t: f64, out: &mut [f64]) {
        self.facets.normals(range, x, self.facets.at(t), out);
    }

    /// Writes ∂²/∂x² of G_k n_k: w_m N_a ∂n_m/∂x_bn + w_n N_b ∂n_n/∂x_am + Σ_k G_k ∂²n_k.
    fn hessians(&self, range: Range<usize>, x: &[f64], t: f64, out: &mut [f64]) {
        let weights = self.field.weights;
        let entry =
            |point: &FacetPoint, frame: &[[f64; 3]; 3], (a, m): (usize, usize), (b, n): (usize, usize)| {
                let (ga, gb) = (point.gradients[a], point.gradients[b]);
                let mut value = weights[m] * point.values[a] * normal_derivative(gb, frame, m, n)
                    + weights[n] * point.values[b] * normal_derivative(ga, frame, n, m);
                if m != n {
                    let k = 3 - m - n;
                    value +=
                        self.field.at(frame[0])[k] * permutation(k, m, n) * (ga[0] * gb[1] - gb[0] * ga[1]);
                }
                value
            };
        self.facets.blocks(range, x, self.facets.at(t), out, entry);
    }

    fn fault(&self, stencil: usize, _x: &[f64], t: f64) -> Option<Fault> {
        self.facets.amplitude.fault(stencil, t)
    }
}

/// The force f_a = −p ∫ N_a n da of a pressure without a potential.
struct FollowerPressure(Facets);

impl Force for FollowerPressure {
    fn name(&self) -> &str {
        &self.0.name
    }

    fn account(&self) -> ForceAccount {
        ForceAccount::Force
    }

    fn stencils(&self) -> Stencils<'_> {
        self.0.stencils()
    }

    fn depends_on_velocity(&self) -> bool {
        false
    }

    fn forces(&self, range: Range<usize>, x: &[f64], _v: &[f64], t: f64, out: &mut [f64]) {
        self.0.normals(range, x, -self.0.at(t), out);
    }

    fn stiffness(&self, range: Range<usize>, x: &[f64], _v: &[f64], t: f64, out: &mut [f64]) {
        let entry =
            |point: &FacetPoint, frame: &[[f64; 3]; 3], (a, m): (usize, usize), (b, n): (usize, usize)| {
                0.5 * (point.values[a] * normal_derivative(point.gradients[b], frame, m, n)
                    + point.values[b] * normal_derivative(point.gradients[a], frame, n, m))
            };
        self.0.blocks(range, x, self.0.at(t), out, entry);
    }

    fn damping(&self, range: Range<usize>, _x: &[f64], _v: &[f64], _t: f64, out: &mut [f64]) {
        out[..packed_len(3 * self.0.arity) * range.len()].fill(0.0);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use vi_mesh::{BoxMesh, CellKind, Region};

    fn cube() -> Mesh {
        let kind = CellKind::Tet4;
        let mut mesh = BoxMesh { size: [1.0; 3], cells: [2, 2, 2], element: kind, origin: [0.5, 0.0, 0.25] }
            .build()
            .unwrap();
        let elements = mesh.cells_of_dimension(2);
        mesh.regions.push(Region { name: "all".into(), dimension: 2, cells: elements });
        mesh
    }

    fn deformed(mesh: &Mesh) -> Vec<f64> {
        let bend =
            |x: &[f64; 3]| [x[0] + 0.1 * x[1] * x[2], x[1] + 0.2 * x[0] * x[0], x[2] - 0.1 * x[0] * x[1]];
        mesh.points.iter().flat_map(bend).collect()
    }

    /// Returns the energy and the gradient, summed over the stencils.
    fn sums(term: &dyn Potential, x: &[f64]) -> (f64, Vec<f64>) {
        let stencils = term.stencils();
        let mut energies = vec![0.0; stencils.count()];
        let mut gradients = vec![0.0; stencils.count() * stencils.size()];
        term.energies(0..stencils.count(), x, 0.0, &mut energies);
        term.gradients(0..stencils.count(), x, 0.0, &mut gradients);
        let mut total = vec![0.0; x.len()];
        for (s, gradient) in gradients.chunks_exact(stencils.size()).enumerate() {
            for (a, &node) in stencils.of(s).iter().enumerate() {
                for i in 0..3 {
                    total[3 * node as usize + i] += gradient[3 * a + i];
                }
            }
        }
        (energies.iter().sum(), total)
    }

    /// Checks the gradient and the Hessian of the free coordinates against differences.
    fn check_derivatives(mesh: &Mesh, region: &str, is_fixed: impl Fn(u32) -> [bool; 3]) {
        let surface = Surface::of_region(mesh, region).unwrap();
        let Pressure::Potential(terms) =
            pressure(mesh, &surface, 3.0, &Amplitude::default(), &is_fixed, 0, "p")
        else {
            panic!("a potential was expected")
        };
        let mut x = deformed(mesh);
        for node in 0..mesh.points.len() {
            for k in 0..3 {
                if is_fixed(node as u32)[k] {
                    x[3 * node + k] = mesh.points[node][k];
                }
            }
        }
        let term = terms[0].as_ref();
        let (_, gradient) = sums(term, &x);
        let stencils = term.stencils();
        let mut hessians = vec![0.0; stencils.count() * packed_len(stencils.size())];
        term.hessians(0..stencils.count(), &x, 0.0, &mut hessians);
        let e = 1e-4;
        for dof in 0..x.len() {
            if is_fixed((dof / 3) as u32)[dof % 3] {
                continue;
            }
            let mut shifted = x.clone();
            shifted[dof] += e;
            let (above, g_above) = sums(term, &shifted);
            shifted[dof] -= 2.0 * e;
            let (below, g_below) = sums(term, &shifted);
            assert!(((above - below) / (2.0 * e) - gradient[dof]).abs() < 1e-8, "dof {dof}");
            // A central difference gives a column of the Hessian exactly, because V is cubic in x.
            let mut column = vec![0.0; x.len()];
            for (s, block) in hessians.chunks_exact(packed_len(stencils.size())).enumerate() {
                for (a, &p) in stencils.of(s).iter().enumerate() {
                    for (b, &q) in stencils.of(s).iter().enumerate() {
                        for i in 0..3 {
                            if 3 * q as usize + dof % 3 == dof {
                                let (row, col) = (3 * a + i, 3 * b + dof % 3);
                                let index = packed_len(row.max(col)) + row.min(col);
                                column[3 * p as usize + i] += block[index];
                            }
                        }
                    }
                }
            }
            for other in (0..x.len()).filter(|&k| !is_fixed((k / 3) as u32)[k % 3]) {
                let slope = (g_above[other] - g_below[other]) / (2.0 * e);
                assert!((slope - column[other]).abs() < 1e-8, "({other}, {dof}): {slope} {}", column[other]);
            }
        }
    }

    #[test]
    fn a_closed_surface_has_the_potential_p_times_volume() {
        let mesh = cube();
        let surface = Surface::of_region(&mesh, "all").unwrap();
        let once = Amplitude::default();
        let Pressure::Potential(terms) = pressure(&mesh, &surface, 2.0, &once, |_| [false; 3], 0, "p") else {
            panic!("a closed surface has a potential")
        };
        let rest: Vec<f64> = mesh.points.as_flattened().to_vec();
        assert!((sums(terms[0].as_ref(), &rest).0 - 2.0).abs() < 1e-14);
        check_derivatives(&mesh, "all", |_| [false; 3]);
    }

    #[test]
    fn edges_on_symmetry_planes_or_clamped_keep_the_potential() {
        let mesh = cube();
        let at = |node: u32| mesh.points[node as usize];
        // One plane each for y and z; the edge between them is fixed.
        let is_fixed = |node: u32| {
            let x = at(node);
            [false, x[1] == 0.0 || x[1] == 1.0, x[2] == 0.25]
        };
        // The top edge z = 1.25 is free, so there is no potential.
        let surface = Surface::of_region(&mesh, "x-max").unwrap();
        let once = Amplitude::default();
        assert!(matches!(pressure(&mesh, &surface, 1.0, &once, is_fixed, 0, "p"), Pressure::Force(_)));
        // Two parallel planes for y (plane strain), and one for each end of z.
        let held = |node: u32| {
            let x = at(node);
            [false, x[1] == 0.0 || x[1] == 1.0, x[2] == 0.25 || x[2] == 1.25]
        };
        check_derivatives(&mesh, "x-max", held);
        let clamped = |node: u32| {
            let x = at(node);
            [x[1] == 0.0 || x[1] == 1.0 || x[2] == 0.25 || x[2] == 1.25; 3]
        };
        check_derivatives(&mesh, "x-max", clamped);
    }

    #[test]
    fn force_and_potential_are_the_same_force() {
        let mesh = cube();
        let surface = Surface::of_region(&mesh, "x-max").unwrap();
        let once = Amplitude::default();
        let Pressure::Force(forces) = pressure(&mesh, &surface, 2.0, &once, |_| [false; 3], 0, "p") else {
            panic!("an open surface has no potential")
        };
        let x = deformed(&mesh);
        let force = forces[0].as_ref();
        let stencils = force.stencils();
        let mut out = vec![0.0; stencils.count() * stencils.size()];
        force.forces(0..stencils.count(), &x, &x, 0.0, &mut out);
        let clamped = |_: u32| [true; 3];
        let Pressure::Potential(terms) = pressure(&mesh, &surface, 2.0, &once, clamped, 0, "p") else {
            panic!("a clamped edge has a potential")
        };
        let mut gradients = vec![0.0; out.len()];
        terms[0].gradients(0..stencils.count(), &x, 0.0, &mut gradients);
        assert!(out.iter().zip(&gradients).all(|(f, g)| *f == -g));
        // At rest the force is p × area against the outward normal.
        let rest: Vec<f64> = mesh.points.as_flattened().to_vec();
        force.forces(0..stencils.count(), &rest, &rest, 0.0, &mut out);
        let sum: f64 = out.chunks_exact(3).map(|f| f[0]).sum();
        assert!((sum + 2.0).abs() < 1e-14, "{sum}");
    }
}
