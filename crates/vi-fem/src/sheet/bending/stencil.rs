//! The stencils of bending: hinges that join nodes, and the coefficients with which they act.

use pulp::Simd;

use super::turn::Turn;
use crate::lanes::pack::Pack;
use crate::lanes::real::{Lane, Real};
use crate::sheet::dihedral::Fold;

/// Largest number of hinges of a stencil: three of its triangle and two of each neighbour.
pub(super) const BENDS: usize = 9;

/// Marks a fourth corner of a support, at a vector from the first that is fixed in space.
pub(super) const CARRIED: u8 = u8::MAX;

/// A hinge of a stencil.
pub(super) struct Bend<const F: usize> {
    /// The number of the hinge in the sheet.
    pub(super) hinge: u32,
    /// The corners as local nodes of the stencil; the fourth may be [`CARRIED`].
    pub(super) corners: [u8; 4],
    /// The vector from the first corner to a [`CARRIED`] fourth one, m.
    pub(super) vector: [f64; 3],
    pub(super) rest_angle: f64,
    /// The coefficients in the F forms: roots of energies in the unit of [`BentSheet::unit`](super::sheet::BentSheet::unit).
    pub(super) form: [f64; F],
}

/// A stencil: its nodes and hinges.
pub(super) struct Stencil<const F: usize> {
    pub(super) nodes: Vec<u32>,
    pub(super) bends: Vec<Bend<F>>,
}

/// One hinge for each stencil of a group: its coefficients in the forms.
pub(super) struct FormPack<const F: usize>(pub(super) [Pack; F]);

/// Returns the rotations of hinges from rest, given by sin θ̄ and cos θ̄.
#[inline(always)]
pub(super) fn turn<S: Simd>(
    simd: S,
    part: usize,
    [sine, cosine]: &[Pack; 2],
    fold: &Fold<Lane<S>>,
) -> Turn<Lane<S>> {
    Turn::new(fold.direction(), [sine.load(simd, part), cosine.load(simd, part)])
}

impl<const F: usize> FormPack<F> {
    #[inline(always)]
    pub(super) fn load<S: Simd>(&self, simd: S, part: usize) -> [Lane<S>; F] {
        let mut form = [Lane::splat(simd, 0.0); F];
        for f in 0..F {
            form[f] = self.0[f].load(simd, part);
        }
        form
    }
}

/// Returns a·b + c.
#[inline(always)]
pub(super) fn dot_add<R: Real, const F: usize>(a: &[R; F], b: &[R; F], c: R) -> R {
    let mut sum = c;
    for f in 0..F {
        sum = a[f].mul_add(b[f], sum);
    }
    sum
}
