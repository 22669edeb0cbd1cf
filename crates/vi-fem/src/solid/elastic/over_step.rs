//! The forces of a step from x₀ to x₁ that exchange exactly the change of the strain energy, in each quadrature point (J. C. Simo,
//! N. Tarnow, ZAMP 43 (1992) 757–792; O. Gonzalez, Comput. Methods Appl. Mech. Engrg. 190 (2000) 1763–1783). With C = FᵀF, the
//! means F_m and C_m of both ends, and ΔC = C₁ − C₀,
//! ```text
//! P = F_m (S + α ΔC),   S = 2 ∂Ψ/∂C (C_m),   α = (2 ΔΨ − S:ΔC)/(ΔC:ΔC).
//! ```
//! As ½ΔC is the symmetric part of F_mᵀΔF, P:ΔF = ½ (S + α ΔC):ΔC = ΔΨ, and P F_mᵀ is symmetric, so that the forces have no moment
//! about x_m. A rigid motion has ΔC = 0 and C_m = C₀, whatever its angle is: F_m alone is contracted by it.
//!
//! Laws are functions of F. S is U⁻¹P(U) with the Cholesky factor UᵀU = C_m, or −U if the elements are inverted, as Ψ does not depend on
//! the rotation of F.

use std::ops::Range;

use nalgebra::Matrix3;

use super::{ElasticPotential, POINTS};
use crate::lanes::pack::{GROUP, Pack};
use crate::solid::element::contract::Element;
use crate::solid::material::batch::PackedMat3;

/// A defect 2 ΔΨ − S:ΔC below this many units of its round-off counts as zero: it is of third order in ΔC, so that α ΔC would be
/// round-off over |ΔC|.
const NOISE: f64 = 16.0;

impl<E: Element<N, Q>, const N: usize, const Q: usize> ElasticPotential<E, N, Q> {
    pub(super) fn forces_over_step(&self, range: Range<usize>, x: [&[f64]; 2], out: &mut [f64]) {
        let arch = self.solids.arch();
        let [mut ends, mut means] = [[[Pack::default(); 9]; POINTS]; 2];
        let mut energies = [[Pack::default(); POINTS]; 2];
        self.in_passes(&range, self.at(x[0]), |groups, points| {
            let (ends, means) = (&mut ends[..points.len()], &mut means[..points.len()]);
            self.solids.deformations(groups.clone(), x[1], ends);
            self.law.energies(arch, points, &mut energies[0][..points.len()]);
            self.law.energies(arch, ends, &mut energies[1][..ends.len()]);
            for (mean, (start, end)) in means.iter_mut().zip(points.iter().zip(&*ends)) {
                for lane in 0..GROUP {
                    store(mean, lane, &Mean::new([start, end].map(|f| load(f, lane))).factor);
                }
            }
            self.law.stresses(arch, means);
            for (k, (point, (end, stress))) in points.iter_mut().zip(ends.iter().zip(&*means)).enumerate() {
                for lane in 0..GROUP {
                    let mean = Mean::new([&*point, end].map(|f| load(f, lane)));
                    let energies = [0, 1].map(|end: usize| energies[end][k].0[lane]);
                    store(point, lane, &mean.stress(&load(stress, lane), energies));
                }
            }
            self.solids.forces(groups, points, range.clone(), out);
        });
    }
}

/// The kinematics of a point over a step.
struct Mean {
    /// F_m, C_m and ΔC.
    deformation: Matrix3<f64>,
    metric: Matrix3<f64>,
    change: Matrix3<f64>,
    /// ±U with UᵀU = C_m.
    factor: Matrix3<f64>,
}

impl Mean {
    fn new([start, end]: [Matrix3<f64>; 2]) -> Self {
        let deformation = 0.5 * (start + end);
        let metrics = [start, end].map(|f| f.transpose() * f);
        let (metric, change) = (0.5 * (metrics[0] + metrics[1]), metrics[1] - metrics[0]);
        let mut u = Matrix3::zeros();
        for i in 0..3 {
            for j in i..3 {
                let rest = metric[(i, j)] - (0..i).map(|k| u[(k, i)] * u[(k, j)]).sum::<f64>();
                u[(i, j)] = if i == j { rest.sqrt() } else { rest / u[(i, i)] };
            }
        }
        let factor = if deformation.determinant() < 0.0 { -u } else { u };
        Self { deformation, metric, change, factor }
    }

    /// Returns P, Pa, from P(±U) and the energies at both ends, J/m³.
    fn stress(&self, of_factor: &Matrix3<f64>, [start, end]: [f64; 2]) -> Matrix3<f64> {
        let Self { deformation, metric, change, factor } = self;
        let mut s = *of_factor;
        for j in 0..3 {
            for i in (0..3).rev() {
                let rest = s[(i, j)] - (i + 1..3).map(|k| factor[(i, k)] * s[(k, j)]).sum::<f64>();
                s[(i, j)] = rest / factor[(i, i)];
            }
        }
        let s = 0.5 * (s + s.transpose());
        let defect = 2.0 * (end - start) - s.dot(change);
        let size = start.abs().max(end.abs()) + s.norm() * metric.norm();
        let alpha =
            if defect.abs() > NOISE * f64::EPSILON * size { defect / change.norm_squared() } else { 0.0 };
        deformation * (s + alpha * change)
    }
}

fn load(f: &PackedMat3, lane: usize) -> Matrix3<f64> {
    Matrix3::from_fn(|i, j| f[3 * i + j].0[lane])
}

fn store(f: &mut PackedMat3, lane: usize, value: &Matrix3<f64>) {
    for i in 0..3 {
        for j in 0..3 {
            f[3 * i + j].0[lane] = value[(i, j)];
        }
    }
}
