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

use pulp::{Simd, WithSimd};

use super::{ElasticPotential, POINTS};
use crate::lanes::pack::{Pack, parts};
use crate::lanes::real::Real;
use crate::small::tensor::{Mat3, combine, contract, determinant, mat3, product, right_cauchy_green, vec3};
use crate::solid::element::contract::Element;
use crate::solid::material::batch::{PackedMat3, load_mat3, store_mat3};

/// A defect 2 ΔΨ − S:ΔC below this many units of its round-off counts as zero: it is of third order in ΔC, so that α ΔC would be
/// round-off over |ΔC|.
const NOISE: f64 = 16.0;

impl<E: Element<N, Q>, const N: usize, const Q: usize> ElasticPotential<E, N, Q> {
    pub(super) fn forces_over_step(&self, range: Range<usize>, x: [&[f64]; 2], out: &mut [f64]) {
        let arch = self.solids.arch();
        let [mut ends, mut means] = [[[Pack::default(); 9]; POINTS]; 2];
        let mut energies = [[Pack::default(); POINTS]; 2];
        self.in_passes(&range, self.at(x[0]), |groups, points| {
            let count = points.len();
            let (ends, means) = (&mut ends[..count], &mut means[..count]);
            self.solids.deformations(groups.clone(), x[1], ends);
            self.law.energies(arch, points, &mut energies[0][..count]);
            self.law.energies(arch, ends, &mut energies[1][..count]);
            arch.dispatch(Factors { starts: points, ends, factors: means });
            self.law.stresses(arch, means);
            let energies = energies.each_ref().map(|energies| &energies[..count]);
            arch.dispatch(Stresses { points, ends, of_factors: means, energies });
            self.solids.forces(groups, points, range.clone(), out);
        });
    }
}

/// Writes ±U at each point.
struct Factors<'a> {
    starts: &'a [PackedMat3],
    ends: &'a [PackedMat3],
    factors: &'a mut [PackedMat3],
}

impl WithSimd for Factors<'_> {
    type Output = ();
    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        for (factor, (start, end)) in self.factors.iter_mut().zip(self.starts.iter().zip(self.ends)) {
            for part in 0..parts::<S>() {
                let mean = Mean::new(&load_mat3(simd, start, part), &load_mat3(simd, end, part));
                store_mat3(factor, part, &mean.factor);
            }
        }
    }
}

/// Overwrites F at the start with P of the step at each point, from P(±U) and the energies at both ends.
struct Stresses<'a> {
    points: &'a mut [PackedMat3],
    ends: &'a [PackedMat3],
    of_factors: &'a [PackedMat3],
    energies: [&'a [Pack]; 2],
}

impl WithSimd for Stresses<'_> {
    type Output = ();
    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        for (k, point) in self.points.iter_mut().enumerate() {
            for part in 0..parts::<S>() {
                let mean = Mean::new(&load_mat3(simd, point, part), &load_mat3(simd, &self.ends[k], part));
                let of_factor = load_mat3(simd, &self.of_factors[k], part);
                let [start, end] =
                    [self.energies[0][k].load(simd, part), self.energies[1][k].load(simd, part)];
                store_mat3(point, part, &mean.stress(&of_factor, start, end));
            }
        }
    }
}

/// The kinematics of a point over a step.
struct Mean<R> {
    /// F_m, C_m and ΔC.
    deformation: Mat3<R>,
    metric: Mat3<R>,
    change: Mat3<R>,
    /// ±U with UᵀU = C_m.
    factor: Mat3<R>,
}

impl<R: Real> Mean<R> {
    #[inline(always)]
    fn new(start: &Mat3<R>, end: &Mat3<R>) -> Self {
        let [zero, half, one] =
            [start[0][0].constant(0.0), start[0][0].constant(0.5), start[0][0].constant(1.0)];
        let deformation = combine(half, start, half, end);
        let (before, after) = (right_cauchy_green(start), right_cauchy_green(end));
        let metric = combine(half, &before, half, &after);
        let change = mat3!(i j => after[i][j] - before[i][j]);
        let u00 = metric[0][0].sqrt();
        let (u01, u02) = (metric[0][1] / u00, metric[0][2] / u00);
        let u11 = (metric[1][1] - u01 * u01).sqrt();
        let u12 = (metric[1][2] - u01 * u02) / u11;
        let u22 = (metric[2][2] - u02 * u02 - u12 * u12).sqrt();
        let u = [[u00, u01, u02], [zero, u11, u12], [zero, zero, u22]];
        let sign = determinant(&deformation).if_positive(one, -one);
        Self { deformation, metric, change, factor: mat3!(i j => sign * u[i][j]) }
    }

    /// Returns P, Pa, from P(±U) and the energies at both ends, J/m³.
    #[inline(always)]
    fn stress(&self, of_factor: &Mat3<R>, start: R, end: R) -> Mat3<R> {
        let Self { deformation, metric, change, factor } = self;
        let half = start.constant(0.5);
        // U⁻¹P by rows, from the last one on.
        let last = vec3!(j => of_factor[2][j] / factor[2][2]);
        let middle = vec3!(j => (of_factor[1][j] - factor[1][2] * last[j]) / factor[1][1]);
        let first =
            vec3!(j => (of_factor[0][j] - factor[0][1] * middle[j] - factor[0][2] * last[j]) / factor[0][0]);
        let rows = [first, middle, last];
        let s = mat3!(i j => half * (rows[i][j] + rows[j][i]));
        let defect = (end - start) * 2.0 - contract(&s, change);
        let size = start.abs() + end.abs() + (contract(&s, &s) * contract(metric, metric)).sqrt();
        let alpha = defect / contract(change, change);
        let alpha = (defect.abs() - size * (NOISE * f64::EPSILON)).if_positive(alpha, start.constant(0.0));
        product(deformation, &mat3!(i j => alpha.mul_add(change[i][j], s[i][j])))
    }
}
