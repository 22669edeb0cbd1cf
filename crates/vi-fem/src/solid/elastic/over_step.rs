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
//! the rotation of F. Only the difference of P from P(F_m) is integrated.

#[cfg(test)]
mod laws;
mod tangent;

use std::cell::RefCell;
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
    /// Writes the corrections from the forces at F_m to those over the step, N.
    pub(super) fn write_corrections(&self, range: Range<usize>, x: [&[f64]; 2], out: &mut [f64]) {
        let arch = self.solids.arch();
        with_scratch(|Scratch { tensors, energies }| {
            self.in_passes(&range, self.at(x[0]), |groups, points| {
                let [ends, middles, factors] = parts_of(tensors, points.len());
                let [before, after] = parts_of(energies, points.len());
                self.solids.deformations(groups.clone(), x[1], ends);
                self.law.energies(arch, points, before);
                self.law.energies(arch, ends, after);
                arch.dispatch(Means { starts: points, ends, middles, factors });
                self.law.stresses(arch, middles);
                self.law.stresses(arch, factors);
                let (of_middles, of_factors, energies) = (&*middles, &*factors, [&*before, &*after]);
                arch.dispatch(Corrections { points, ends, of_middles, of_factors, energies });
                self.solids.forces(groups, points, range.clone(), out);
            });
        });
    }
}

/// Scratch memory for the points of a pass.
struct Scratch {
    tensors: Vec<PackedMat3>,
    energies: Vec<Pack>,
}

thread_local! {
    static SCRATCH: RefCell<Scratch> = const { RefCell::new(Scratch { tensors: Vec::new(), energies: Vec::new() }) };
}

fn with_scratch(work: impl FnOnce(&mut Scratch)) {
    SCRATCH.with_borrow_mut(|scratch| {
        scratch.tensors.resize(3 * POINTS, [Pack::default(); 9]);
        scratch.energies.resize(2 * POINTS, Pack::default());
        work(scratch);
    });
}

/// Returns the first `count` entries of each of N runs of [`POINTS`].
fn parts_of<T, const N: usize>(scratch: &mut [T], count: usize) -> [&mut [T]; N] {
    let mut parts = scratch.chunks_exact_mut(POINTS);
    std::array::from_fn(|_| parts.next().map_or(&mut [][..], |part| &mut part[..count]))
}

/// Writes F_m and ±U at each point.
struct Means<'a> {
    starts: &'a [PackedMat3],
    ends: &'a [PackedMat3],
    middles: &'a mut [PackedMat3],
    factors: &'a mut [PackedMat3],
}

impl WithSimd for Means<'_> {
    type Output = ();
    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        for (k, (start, end)) in self.starts.iter().zip(self.ends).enumerate() {
            for part in 0..parts::<S>() {
                let mean = Mean::new(&load_mat3(simd, start, part), &load_mat3(simd, end, part));
                store_mat3(&mut self.middles[k], part, &mean.deformation);
                store_mat3(&mut self.factors[k], part, &mean.factor);
            }
        }
    }
}

/// Overwrites F at the start with P − P(F_m) at each point, from P(F_m), P(±U) and the energies at both ends.
struct Corrections<'a> {
    points: &'a mut [PackedMat3],
    ends: &'a [PackedMat3],
    of_middles: &'a [PackedMat3],
    of_factors: &'a [PackedMat3],
    energies: [&'a [Pack]; 2],
}

impl WithSimd for Corrections<'_> {
    type Output = ();
    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        for (k, point) in self.points.iter_mut().enumerate() {
            for part in 0..parts::<S>() {
                let mean = Mean::new(&load_mat3(simd, point, part), &load_mat3(simd, &self.ends[k], part));
                let of_factor = load_mat3(simd, &self.of_factors[k], part);
                let [start, end] =
                    [self.energies[0][k].load(simd, part), self.energies[1][k].load(simd, part)];
                let stress = mean.stress(&of_factor, start, end);
                let of_middle = load_mat3(simd, &self.of_middles[k], part);
                store_mat3(point, part, &mat3!(i j => stress[i][j] - of_middle[i][j]));
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
    /// ±U with UᵀU = C_m, and the inverses of its diagonal.
    factor: Mat3<R>,
    inverses: [R; 3],
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
        let sign = determinant(&deformation).if_positive(one, -one);
        let u00 = metric[0][0].sqrt();
        let i00 = one / u00;
        let (u01, u02) = (metric[0][1] * i00, metric[0][2] * i00);
        let u11 = (metric[1][1] - u01 * u01).sqrt();
        let i11 = one / u11;
        let u12 = (metric[1][2] - u01 * u02) * i11;
        let u22 = (metric[2][2] - u02 * u02 - u12 * u12).sqrt();
        let u = [[u00, u01, u02], [zero, u11, u12], [zero, zero, u22]];
        let inverses = [i00, i11, one / u22].map(|inverse| sign * inverse);
        Self { deformation, metric, change, factor: mat3!(i j => sign * u[i][j]), inverses }
    }

    /// Returns T U⁻¹ of a matrix T.
    #[inline(always)]
    fn by_factor(&self, matrix: &Mat3<R>) -> Mat3<R> {
        let Self { factor, inverses: [i0, i1, i2], .. } = self;
        let first = vec3!(i => matrix[i][0] * *i0);
        let second = vec3!(i => (matrix[i][1] - first[i] * factor[0][1]) * *i1);
        let third = vec3!(i => (matrix[i][2] - first[i] * factor[0][2] - second[i] * factor[1][2]) * *i2);
        let columns = [first, second, third];
        mat3!(i j => columns[j][i])
    }

    /// Returns S = U⁻¹P(U), Pa.
    #[inline(always)]
    fn second_stress(&self, of_factor: &Mat3<R>) -> Mat3<R> {
        let Self { factor, inverses: [i0, i1, i2], .. } = self;
        // By rows, from the last one on.
        let last = vec3!(j => of_factor[2][j] * *i2);
        let middle = vec3!(j => (of_factor[1][j] - factor[1][2] * last[j]) * *i1);
        let first = vec3!(j => (of_factor[0][j] - factor[0][1] * middle[j] - factor[0][2] * last[j]) * *i0);
        let rows = [first, middle, last];
        let half = i0.constant(0.5);
        mat3!(i j => half * (rows[i][j] + rows[j][i]))
    }

    /// Returns P, Pa, from P(±U) and the energies at both ends, J/m³.
    #[inline(always)]
    fn stress(&self, of_factor: &Mat3<R>, start: R, end: R) -> Mat3<R> {
        let Self { deformation, metric, change, .. } = self;
        let s = self.second_stress(of_factor);
        let defect = (end - start) * 2.0 - contract(&s, change);
        let size = start.abs() + end.abs() + (contract(&s, &s) * contract(metric, metric)).sqrt();
        let alpha = defect / contract(change, change);
        let alpha = (defect.abs() - size * (NOISE * f64::EPSILON)).if_positive(alpha, start.constant(0.0));
        product(deformation, &mat3!(i j => alpha.mul_add(change[i][j], s[i][j])))
    }
}
