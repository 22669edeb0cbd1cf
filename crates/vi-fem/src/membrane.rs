//! The membrane energy Σ_T A h W(E(F)) of a sheet of linear triangles, F = ∂x/∂X (3 × 2) constant on
//! each. It must not know bending, nor how blocks are summed.

mod corotated;
mod invariants;
mod neo_hookean;
mod orthotropic;
mod st_venant_kirchhoff;

use std::ops::Range;

use vi_core::{Account, Fault, HessianKind, Potential, Stencils, Traits, packed_len};

pub use corotated::CorotatedSheet;
pub use neo_hookean::NeoHookeanSheet;
pub use orthotropic::{OrthotropicParameters, OrthotropicSheet};
pub use st_venant_kirchhoff::StVenantKirchhoffSheet;

use crate::sheet_material::{SheetMaterial, SheetResponse, SheetVisitor};
use crate::surface::Surface;
use crate::tensor::{cross, dot};

/// An orthonormal frame of a triangle at rest: two axes in its plane, and the normal.
pub(crate) type Frame = [[f64; 3]; 3];

/// The frame of a triangle whose first axis is `direction`, a unit vector in its plane, else its first edge.
pub(crate) fn frame(corners: &[[f64; 3]; 3], direction: Option<[f64; 3]>) -> Frame {
    let edge = |k: usize| [0, 1, 2].map(|i| corners[k][i] - corners[0][i]);
    let unit = |v: [f64; 3]| {
        let length = dot(v, v).sqrt();
        v.map(|c| c / length)
    };
    let normal = unit(cross(edge(1), edge(2)));
    let first = direction.unwrap_or_else(|| unit(edge(1)));
    [first, cross(normal, first), normal]
}

/// Corners in the plane of a frame, from the first corner, m.
pub(crate) fn flatten(corners: &[[f64; 3]; 3], frame: &Frame) -> [[f64; 2]; 3] {
    corners.map(|corner| {
        let d = [0, 1, 2].map(|i| corner[i] - corners[0][i]);
        [dot(d, frame[0]), dot(d, frame[1])]
    })
}

/// Gradients of the three barycentric coordinates, 1/m, and the area, m².
pub(crate) fn barycentric_gradients(p: &[[f64; 2]; 3]) -> ([[f64; 2]; 3], f64) {
    let twice = (p[1][0] - p[0][0]) * (p[2][1] - p[0][1]) - (p[1][1] - p[0][1]) * (p[2][0] - p[0][0]);
    let gradient = |k: usize| {
        let (q, r) = (p[(k + 1) % 3], p[(k + 2) % 3]);
        [(q[1] - r[1]) / twice, (r[0] - q[0]) / twice]
    };
    ([gradient(0), gradient(1), gradient(2)], 0.5 * twice)
}

/// Builds the potential of a law.
pub(crate) struct BuildMembrane<'a> {
    pub(crate) surface: &'a Surface,
    pub(crate) thickness: f64,
    /// The first axis of the law in each triangle, if it has axes.
    pub(crate) directions: Option<&'a [[f64; 3]]>,
    pub(crate) tension_field: bool,
    pub(crate) node_offset: usize,
    pub(crate) name: String,
}

impl SheetVisitor for BuildMembrane<'_> {
    type Output = Box<dyn Potential>;

    fn visit<M: SheetMaterial>(self, material: M) -> Self::Output {
        let surface = self.surface;
        let rest = (0..surface.triangles.len())
            .map(|triangle| {
                let corners = surface.corners(triangle);
                let frame = frame(&corners, self.directions.map(|all| all[triangle]));
                let (gradients, area) = barycentric_gradients(&flatten(&corners, &frame));
                Rest { gradients, volume: area * self.thickness, frame }
            })
            .collect();
        let nodes = surface.triangles.iter().flatten().map(|&node| node + self.node_offset as u32).collect();
        let relaxed = self.tension_field;
        let cells = surface.cells.clone();
        Box::new(Membrane { material, relaxed, rest, nodes, cells, name: self.name })
    }
}

/// A triangle at rest.
struct Rest {
    /// Gradients of the barycentric coordinates in the frame, 1/m.
    gradients: [[f64; 2]; 3],
    /// Area × thickness, m³.
    volume: f64,
    frame: Frame,
}

struct Membrane<M> {
    material: M,
    relaxed: bool,
    rest: Vec<Rest>,
    nodes: Vec<u32>,
    cells: Vec<u32>,
    name: String,
}

/// A triangle as it is: F by columns, and the response to its strain.
struct Deformed {
    f: [[f64; 3]; 2],
    response: SheetResponse,
}

impl<M: SheetMaterial> Membrane<M> {
    fn deformation(&self, triangle: usize, x: &[f64]) -> [[f64; 3]; 2] {
        let rest = &self.rest[triangle];
        let [a, b, c] = [0, 1, 2].map(|k| {
            let first = 3 * self.nodes[3 * triangle + k] as usize;
            [x[first], x[first + 1], x[first + 2]]
        });
        // From differences of positions, so that a far away sheet is as exact as a near one.
        let (u, v) = ([0, 1, 2].map(|i| b[i] - a[i]), [0, 1, 2].map(|i| c[i] - a[i]));
        let g = &rest.gradients;
        [0, 1].map(|j| [0, 1, 2].map(|i| u[i] * g[1][j] + v[i] * g[2][j]))
    }

    fn deform(&self, triangle: usize, x: &[f64]) -> Deformed {
        let f = self.deformation(triangle, x);
        let strain = [0.5 * (dot(f[0], f[0]) - 1.0), 0.5 * (dot(f[1], f[1]) - 1.0), dot(f[0], f[1])];
        let response =
            if self.relaxed { self.material.relaxed(&strain) } else { self.material.response(&strain) };
        Deformed { f, response }
    }

    /// A h [∂²W/∂e² through ∂e/∂x on both sides + S through the gradients of the nodes].
    fn hessian(&self, triangle: usize, f: &[[f64; 3]; 2], response: &SheetResponse, out: &mut [f64]) {
        let rest = &self.rest[triangle];
        let g = &rest.gradients;
        let [s11, s22, s12] = response.stress;
        // ∂e/∂x of each local coordinate.
        let strains: [[f64; 3]; 9] = std::array::from_fn(|n| {
            let (a, i) = (n / 3, n % 3);
            [f[0][i] * g[a][0], f[1][i] * g[a][1], f[0][i] * g[a][1] + f[1][i] * g[a][0]]
        });
        let mut k = 0;
        for row in 0..9 {
            let stress = response.tangent.map(|line| dot(line, strains[row]));
            let (a, i) = (row / 3, row % 3);
            for column in 0..=row {
                let (b, j) = (column / 3, column % 3);
                let mut entry = dot(stress, strains[column]);
                if i == j {
                    entry +=
                        g[a][0] * (s11 * g[b][0] + s12 * g[b][1]) + g[a][1] * (s12 * g[b][0] + s22 * g[b][1]);
                }
                out[k] = rest.volume * entry;
                k += 1;
            }
        }
    }
}

impl<M: SheetMaterial> Potential for Membrane<M> {
    fn name(&self) -> &str {
        &self.name
    }

    fn account(&self) -> Account {
        Account::Elastic
    }

    fn stencils(&self) -> Stencils<'_> {
        Stencils { arity: 3, block: 3, nodes: &self.nodes }
    }

    fn traits(&self) -> Traits {
        Traits { hessian: HessianKind::Varying, time_dependent: false }
    }

    fn energies(&self, range: Range<usize>, x: &[f64], _t: f64, out: &mut [f64]) {
        for (triangle, out) in range.zip(out) {
            *out = self.rest[triangle].volume * self.deform(triangle, x).response.energy;
        }
    }

    fn gradients(&self, range: Range<usize>, x: &[f64], _t: f64, out: &mut [f64]) {
        for (triangle, out) in range.zip(out.chunks_exact_mut(9)) {
            let Deformed { f, response } = self.deform(triangle, x);
            let rest = &self.rest[triangle];
            let [s11, s22, s12] = response.stress.map(|s| s * rest.volume);
            for i in 0..3 {
                let p = [f[0][i] * s11 + f[1][i] * s12, f[0][i] * s12 + f[1][i] * s22];
                for (a, g) in rest.gradients.iter().enumerate() {
                    out[3 * a + i] = p[0] * g[0] + p[1] * g[1];
                }
            }
        }
    }

    fn hessians(&self, range: Range<usize>, x: &[f64], _t: f64, out: &mut [f64]) {
        for (triangle, out) in range.zip(out.chunks_exact_mut(packed_len(9))) {
            let Deformed { f, response } = self.deform(triangle, x);
            self.hessian(triangle, &f, &response, out);
        }
    }

    /// The two parts of the Hessian are made positive each by itself, in closed form: the tangent as a
    /// 3 × 3 matrix, the stress as a 2 × 2 one. Never less than zero, at times more than the least.
    fn projected_hessians(&self, range: Range<usize>, x: &[f64], _t: f64, out: &mut [f64]) {
        for (triangle, out) in range.zip(out.chunks_exact_mut(packed_len(9))) {
            let Deformed { f, mut response } = self.deform(triangle, x);
            response.stress = positive_stress(response.stress);
            response.tangent = positive_tangent(response.tangent);
            self.hessian(triangle, &f, &response, out);
        }
    }

    /// F completed by the unit normal.
    fn mean_deformations(&self, range: Range<usize>, x: &[f64], out: &mut [f64]) -> bool {
        for (triangle, out) in range.zip(out.chunks_exact_mut(9)) {
            let f = self.deformation(triangle, x);
            let Rest { volume, frame, .. } = &self.rest[triangle];
            let normal = cross(f[0], f[1]);
            let length = dot(normal, normal).sqrt().max(f64::MIN_POSITIVE);
            for i in 0..3 {
                for j in 0..3 {
                    let value = f[0][i] * frame[0][j] + f[1][i] * frame[1][j];
                    out[3 * i + j] = volume * (value + normal[i] / length * frame[2][j]);
                }
            }
        }
        true
    }

    fn fault(&self, stencil: usize, x: &[f64], _t: f64) -> Option<Fault> {
        let Deformed { f, response } = self.deform(stencil, x);
        if response.energy.is_finite() && response.stress.iter().all(|s| s.is_finite()) {
            return None;
        }
        let normal = cross(f[0], f[1]);
        Some(Fault {
            element: self.cells[stencil] as usize,
            quantity: "area over area at rest",
            value: dot(normal, normal).sqrt(),
            domain: "must be positive and finite",
        })
    }
}

/// A symmetric 2 × 2 matrix (s₁₁, s₂₂, s₁₂) with its negative eigenvalues set to zero.
fn positive_stress([s11, s22, s12]: [f64; 3]) -> [f64; 3] {
    let (mean, half) = (0.5 * (s11 + s22), 0.5 * (s11 - s22));
    let radius = half.hypot(s12);
    if mean >= radius {
        return [s11, s22, s12];
    }
    let largest = mean + radius;
    if largest.is_nan() || largest <= 0.0 {
        return [0.0; 3];
    }
    // ½ (I + deviator/radius) projects onto the larger eigenvalue's direction.
    let factor = 0.5 * largest / radius;
    [factor * (radius + half), factor * (radius - half), factor * s12]
}

/// A symmetric 3 × 3 matrix with its negative eigenvalues set to zero.
fn positive_tangent(tangent: [[f64; 3]; 3]) -> [[f64; 3]; 3] {
    let matrix = nalgebra::Matrix3::from_fn(|i, j| tangent[i][j]);
    if matrix.iter().any(|value| !value.is_finite()) {
        return tangent;
    }
    let eigen = matrix.symmetric_eigen();
    let scaled =
        eigen.eigenvectors * nalgebra::Matrix3::from_diagonal(&eigen.eigenvalues.map(|v| v.max(0.0)));
    let positive = scaled * eigen.eigenvectors.transpose();
    [0, 1, 2].map(|i| [0, 1, 2].map(|j| 0.5 * (positive[(i, j)] + positive[(j, i)])))
}
