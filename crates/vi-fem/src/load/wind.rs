//! Drag of moving or still air on a sheet, triangle by triangle: a force without a potential.

use std::ops::Range;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use vi_core::{Force, ForceAccount, Stencils, packed_len};

use crate::error::FemError;
use crate::small::tensor::{cross, dot};
use vi_mesh::Mesh;
use vi_mesh::Triangulation;

/// Air around a sheet: `wind = { velocity = [5.0, 0.0, 0.0] }`.
///
/// Let u = velocity − ẋ at the centre of a triangle, a its area vector and n = a/|a|. The force on the triangle is ½
/// ρ (C_n |u·n| (u·n) a + C_t |u| |a| (u − (u·n) n)), a third on each node: pressure drag along the normal and
/// friction along the surface, both against the motion relative to the air.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Wind {
    /// Velocity of the air, m/s; zero gives drag in still air.
    #[serde(default)]
    pub velocity: [f64; 3],
    /// Density ρ of the air, kg/m³; not negative.
    #[serde(default = "air_density")]
    pub density: f64,
    /// Coefficient C_n of the pressure drag, dimensionless; not negative. About 1.2 to 2 for a plate.
    #[serde(default = "pressure_coefficient")]
    pub normal: f64,
    /// Coefficient C_t of the friction, dimensionless; not negative. About 0.01 for smooth cloth.
    #[serde(default = "friction_coefficient")]
    pub tangential: f64,
}

fn air_density() -> f64 {
    1.2
}

fn pressure_coefficient() -> f64 {
    1.28
}

fn friction_coefficient() -> f64 {
    0.02
}

impl Wind {
    /// Returns the force on the triangles `elements` of a mesh. Node a of the mesh is node a + `node_offset` of the
    /// system.
    ///
    /// # Errors
    /// Returns [`FemError::Parameter`] for coefficients that are negative or not finite; an error for cells that do not
    /// exist, are not triangles, or have no area.
    pub fn force(
        &self,
        mesh: &Mesh,
        elements: &[u32],
        node_offset: usize,
        name: &str,
    ) -> Result<Box<dyn Force>, FemError> {
        for (key, value) in
            [("density", self.density), ("normal", self.normal), ("tangential", self.tangential)]
        {
            if !value.is_finite() || value < 0.0 {
                let requirement = "the coefficients of the wind must not be negative";
                return Err(FemError::Parameter { key, value, requirement });
            }
        }
        let surface = Triangulation::new(mesh, elements)?;
        let nodes = surface.triangles.iter().flatten().map(|&node| node + node_offset as u32).collect();
        Ok(Box::new(Drag { wind: self.clone(), nodes, name: format!("{name}: wind") }))
    }
}

struct Drag {
    wind: Wind,
    nodes: Vec<u32>,
    name: String,
}

type Vec3 = [f64; 3];
type Mat3 = [[f64; 3]; 3];

impl Drag {
    fn corners(&self, triangle: usize, x: &[f64]) -> [Vec3; 3] {
        [0, 1, 2].map(|k| {
            let node = self.nodes[3 * triangle + k] as usize;
            [x[3 * node], x[3 * node + 1], x[3 * node + 2]]
        })
    }

    /// Returns the relative velocity u (m/s) and the area vector a (m²).
    fn flow(&self, triangle: usize, x: &[f64], v: &[f64]) -> (Vec3, Vec3) {
        let [a, b, c] = self.corners(triangle, x);
        let [p, q, r] = self.corners(triangle, v);
        let u = [0, 1, 2].map(|i| self.wind.velocity[i] - (p[i] + q[i] + r[i]) / 3.0);
        let area = cross([0, 1, 2].map(|i| b[i] - a[i]), [0, 1, 2].map(|i| c[i] - a[i]));
        (u, area.map(|c| 0.5 * c))
    }

    /// Returns the force on a triangle, N.
    fn total(&self, u: Vec3, a: Vec3) -> Vec3 {
        let area = dot(a, a).sqrt();
        if area == 0.0 {
            return [0.0; 3];
        }
        let (across, speed) = (dot(u, a) / area, dot(u, u).sqrt());
        let half = 0.5 * self.wind.density;
        let (pressure, friction) =
            (half * self.wind.normal * across.abs() * across, half * self.wind.tangential * speed);
        [0, 1, 2].map(|i| pressure * a[i] + friction * (area * u[i] - across * a[i]))
    }

    /// Returns ∂f/∂u and ∂f/∂a.
    fn derivatives(&self, u: Vec3, a: Vec3) -> (Mat3, Mat3) {
        let area = dot(a, a).sqrt();
        let speed = dot(u, u).sqrt();
        if area == 0.0 || speed == 0.0 {
            return ([[0.0; 3]; 3], [[0.0; 3]; 3]);
        }
        let n = a.map(|c| c / area);
        let across = dot(u, n);
        let half = 0.5 * self.wind.density;
        let (normal, tangential) = (half * self.wind.normal, half * self.wind.tangential);
        let along = [0, 1, 2].map(|i| u[i] - across * n[i]);
        let unit = |i: usize, j: usize| f64::from(i == j);
        let by_u = |i: usize, j: usize| {
            let friction = speed * (unit(i, j) - n[i] * n[j]) + along[i] * u[j] / speed;
            area * (2.0 * normal * across.abs() * n[i] * n[j] + tangential * friction)
        };
        // ∂(u·n)/∂a = (u − (u·n) n)/|a|, and the derivative of |a| u − (u·n) a is u n − (u·n) I − n ⊗ along.
        let by_a = |i: usize, j: usize| {
            let pressure = across.abs() * (across * unit(i, j) + 2.0 * n[i] * along[j]);
            let friction = u[i] * n[j] - across * unit(i, j) - n[i] * along[j];
            normal * pressure + tangential * speed * friction
        };
        ([0, 1, 2].map(|i| [0, 1, 2].map(|j| by_u(i, j))), [0, 1, 2].map(|i| [0, 1, 2].map(|j| by_a(i, j))))
    }
}

impl Force for Drag {
    fn name(&self) -> &str {
        &self.name
    }

    fn account(&self) -> ForceAccount {
        ForceAccount::Force
    }

    fn stencils(&self) -> Stencils<'_> {
        Stencils { arity: 3, block: 3, nodes: &self.nodes }
    }

    fn depends_on_velocity(&self) -> bool {
        true
    }

    fn forces(&self, range: Range<usize>, x: &[f64], v: &[f64], _t: f64, out: &mut [f64]) {
        for (triangle, out) in range.zip(out.chunks_exact_mut(9)) {
            let (u, a) = self.flow(triangle, x, v);
            let force = self.total(u, a);
            for (k, out) in out.iter_mut().enumerate() {
                *out = force[k % 3] / 3.0;
            }
        }
    }

    fn stiffness(&self, range: Range<usize>, x: &[f64], v: &[f64], _t: f64, out: &mut [f64]) {
        for (triangle, out) in range.zip(out.chunks_exact_mut(packed_len(9))) {
            let (u, a) = self.flow(triangle, x, v);
            let (_, by_a) = self.derivatives(u, a);
            let corners = self.corners(triangle, x);
            // For a corner ∂a/∂x is ½ (opposite edge) × ·, hence ∂f/∂x = ½ ∂f/∂a [opposite edge]×.
            let by_x: [[f64; 3]; 9] = std::array::from_fn(|n| {
                let (k, j) = (n / 3, n % 3);
                let (p, q) = (corners[(k + 1) % 3], corners[(k + 2) % 3]);
                let mut axis = [0.0; 3];
                axis[j] = 0.5;
                let da = cross([0, 1, 2].map(|i| q[i] - p[i]), axis);
                by_a.map(|row| dot(row, da) / 3.0)
            });
            let mut k = 0;
            for row in 0..9 {
                for column in 0..=row {
                    out[k] = -0.5 * (by_x[column][row % 3] + by_x[row][column % 3]);
                    k += 1;
                }
            }
        }
    }

    fn damping(&self, range: Range<usize>, x: &[f64], v: &[f64], _t: f64, out: &mut [f64]) {
        for (triangle, out) in range.zip(out.chunks_exact_mut(packed_len(9))) {
            let (u, a) = self.flow(triangle, x, v);
            let (by_u, _) = self.derivatives(u, a);
            let mut k = 0;
            for row in 0..9 {
                for column in 0..=row {
                    let (i, j) = (row % 3, column % 3);
                    // u falls by a third of each node's velocity, and each node carries a third of the force.
                    out[k] = 0.5 * (by_u[i][j] + by_u[j][i]) / 9.0;
                    k += 1;
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use vi_mesh::{CellBlock, CellKind};

    fn triangle() -> Mesh {
        let points = vec![[0.0, 0.0, 0.0], [1.0, 0.2, 0.1], [0.1, 0.9, -0.3]];
        let blocks = vec![CellBlock { kind: CellKind::Tri3, nodes: vec![0, 1, 2] }];
        Mesh { points, blocks, regions: vec![] }
    }

    #[test]
    fn drag_opposes_motion_and_its_blocks_are_symmetric_parts_of_differences() {
        let mesh = triangle();
        let wind = Wind { velocity: [3.0, -1.0, 2.0], density: 1.2, normal: 1.3, tangential: 0.1 };
        let drag = wind.force(&mesh, &[0], 0, "flag").unwrap();
        let x = mesh.points.as_flattened().to_vec();
        let v: Vec<f64> = (0..9).map(|k| (k as f64 * 1.3).sin()).collect();
        let forces = |x: &[f64], v: &[f64]| {
            let mut out = [0.0; 9];
            drag.forces(0..1, x, v, 0.0, &mut out);
            out
        };
        let (mut stiffness, mut damping) = ([0.0; 45], [0.0; 45]);
        drag.stiffness(0..1, &x, &v, 0.0, &mut stiffness);
        drag.damping(0..1, &x, &v, 0.0, &mut damping);
        let step = 1e-6;
        let column = |n: usize, moves_x: bool| -> [f64; 9] {
            let at = |h: f64| {
                let (mut x, mut v) = (x.clone(), v.clone());
                (if moves_x { &mut x } else { &mut v })[n] += h;
                forces(&x, &v)
            };
            let (plus, minus) = (at(step), at(-step));
            std::array::from_fn(|m| -(plus[m] - minus[m]) / (2.0 * step))
        };
        for (blocks, moves_x) in [(stiffness, true), (damping, false)] {
            let columns: Vec<[f64; 9]> = (0..9).map(|n| column(n, moves_x)).collect();
            for row in 0..9 {
                for other in 0..=row {
                    let symmetric = 0.5 * (columns[other][row] + columns[row][other]);
                    let entry = blocks[row * (row + 1) / 2 + other];
                    assert!((symmetric - entry).abs() < 1e-8, "{row} {other}: {symmetric} {entry}");
                }
            }
        }
        // In still air drag dissipates energy for any motion.
        let still = Wind { velocity: [0.0; 3], ..wind }.force(&mesh, &[0], 0, "flag").unwrap();
        let mut out = [0.0; 9];
        let drift: Vec<f64> = v[..3].iter().copied().cycle().take(9).collect();
        still.forces(0..1, &x, &drift, 0.0, &mut out);
        assert!(out.iter().zip(&drift).map(|(f, v)| f * v).sum::<f64>() < 0.0);
    }
}
