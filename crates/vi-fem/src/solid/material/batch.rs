//! Evaluates a law at many points at once, in SIMD lanes.
//!
//! Laws and elements are compiled separately. They exchange groups of deformation gradients that stay in the
//! first-level cache. This takes one kernel per law and one per element instead of one per pair.

use pulp::{Arch, Simd, WithSimd};

use super::contract::Material;
use super::eigensystem::projected_tangent;
use crate::lanes::pack::{Pack, parts};
use crate::lanes::real::Lane;
use crate::small::tensor::Tangent;
use crate::small::tensor::{Mat3, mat3};

/// One 3 × 3 matrix by rows for each point of a group.
pub(crate) type PackedMat3 = [Pack; 9];
/// One tangent for each point of a group.
pub(crate) type PackedTangent = [Pack; 45];

#[inline(always)]
pub(crate) fn load_mat3<S: Simd>(simd: S, packed: &PackedMat3, part: usize) -> Mat3<Lane<S>> {
    mat3!(i j => packed[3 * i + j].load(simd, part))
}

#[inline(always)]
pub(crate) fn store_mat3<S: Simd>(packed: &mut PackedMat3, part: usize, value: &Mat3<Lane<S>>) {
    for i in 0..3 {
        for j in 0..3 {
            packed[3 * i + j].store(part, value[i][j]);
        }
    }
}

struct Energies<'a, M>(&'a M, &'a [PackedMat3], &'a mut [Pack]);
impl<M: Material> WithSimd for Energies<'_, M> {
    type Output = ();
    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self(material, points, out) = self;
        for (f, energy) in points.iter().zip(out) {
            for part in 0..parts::<S>() {
                energy.store(part, material.energy(&load_mat3(simd, f, part)));
            }
        }
    }
}

struct Stresses<'a, M>(&'a M, &'a mut [PackedMat3]);
impl<M: Material> WithSimd for Stresses<'_, M> {
    type Output = ();
    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self(material, points) = self;
        for f in points {
            for part in 0..parts::<S>() {
                let stress = material.stress(&load_mat3(simd, f, part));
                store_mat3(f, part, &stress);
            }
        }
    }
}

struct Tangents<'a, M, const PROJECTED: bool>(&'a M, &'a [PackedMat3], &'a mut [PackedTangent]);
impl<M: Material, const PROJECTED: bool> WithSimd for Tangents<'_, M, PROJECTED> {
    type Output = ();
    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self(material, points, out) = self;
        for (f, packed) in points.iter().zip(out) {
            for part in 0..parts::<S>() {
                let f = load_mat3(simd, f, part);
                let Tangent(entries) =
                    if PROJECTED { projected_tangent(material, &f) } else { material.tangent(&f) };
                for k in 0..45 {
                    packed[k].store(part, entries[k]);
                }
            }
        }
    }
}

/// Writes Ψ(F) at each point.
#[inline(never)]
pub(crate) fn energies<M: Material>(arch: Arch, material: &M, points: &[PackedMat3], out: &mut [Pack]) {
    arch.dispatch(Energies(material, points, out));
}

/// Overwrites F with P(F) at each point.
#[inline(never)]
pub(crate) fn stresses<M: Material>(arch: Arch, material: &M, points: &mut [PackedMat3]) {
    arch.dispatch(Stresses(material, points));
}

/// Writes ∂²Ψ/∂F∂F at each point.
#[inline(never)]
pub(crate) fn tangents<M: Material>(
    arch: Arch,
    material: &M,
    points: &[PackedMat3],
    out: &mut [PackedTangent],
) {
    arch.dispatch(Tangents::<M, false>(material, points, out));
}

/// Writes ∂²Ψ/∂F∂F with its negative eigenvalues set to zero at each point.
#[inline(never)]
pub(crate) fn projected_tangents<M: Material>(
    arch: Arch,
    material: &M,
    points: &[PackedMat3],
    out: &mut [PackedTangent],
) {
    arch.dispatch(Tangents::<M, true>(material, points, out));
}
