//! The tangent of the forces over a step by F_m, the mean of F at both ends. With S and 𝔻 = 2 ∂S/∂C at C_m, dC_m = F₁ᵀdF_m + dF_mᵀF₁,
//! and so
//! ```text
//! dP = dF_m S + F_m 𝔻 : F₁ᵀdF_m.
//! ```
//! Factors are symmetric, so F₁ is replaced by F_m. The law gives A = ∂P/∂F at U, where dP = dU S + U 𝔻 : UᵀdU. With G = F_m U⁻¹,
//! ```text
//! dP = G A : (GᵀdF_m) + (I − G Gᵀ) dF_m S.
//! ```
//! ∂P/∂F at F_m would contain the stress of its contraction, which is large if a stiff body turns: of a band of 10¹⁰ Pa in a body of
//! 10⁶ Pa (`benches/large_steps.py`, h = 10 ms), 71 of 100 steps were cut, now 24. F between F_m and F₁, which would approximate the
//! symmetric part of the derivative to second order, is worse (85 cut): then rotations about x_m have moments of the order of the stiffness.

use std::cell::RefCell;
use std::ops::Range;

use pulp::{Simd, WithSimd};
use vi_core::packed_len;

use super::{Mean, Scratch, parts_of, with_scratch};
use crate::lanes::pack::{Pack, parts};
use crate::lanes::real::Lane;
use crate::small::tensor::{mat3, packed_index, product, product_transposed};
use crate::solid::elastic::ElasticPotential;
use crate::solid::element::contract::Element;
use crate::solid::material::batch::{PackedMat3, PackedTangent, load_mat3, store_mat3};

thread_local! {
    /// Tangents and the Hessian of one group.
    static TANGENTS: RefCell<(Vec<PackedTangent>, Vec<Pack>)> = const { RefCell::new((Vec::new(), Vec::new())) };
}

impl<E: Element<N, Q>, const N: usize, const Q: usize> ElasticPotential<E, N, Q> {
    /// Writes the Hessians of a step. If `is_projected`, they are positive semidefinite.
    pub(in crate::solid::elastic) fn tangents_over_step(
        &self,
        range: Range<usize>,
        x: [&[f64]; 2],
        is_projected: bool,
        out: &mut [f64],
    ) {
        let arch = self.solids.arch();
        with_scratch(|Scratch { tensors, .. }| {
            TANGENTS.with_borrow_mut(|(tangents, block)| {
                tangents.resize(Q.max(tangents.len()), [Pack::default(); 45]);
                let size = packed_len(3 * N);
                block.resize(size.max(block.len()), Pack::default());
                let (tangents, block) = (&mut tangents[..Q], &mut block[..size]);
                self.in_passes(&range, self.at(x[0]), |groups, points| {
                    let [ends, factors, of_factors] = parts_of(tensors, points.len());
                    self.solids.deformations(groups.clone(), x[1], ends);
                    arch.dispatch(Factors { starts: points, ends, factors });
                    of_factors.copy_from_slice(factors);
                    self.law.stresses(arch, of_factors);
                    for (k, group) in groups.enumerate() {
                        let at = k * Q..(k + 1) * Q;
                        match is_projected {
                            true => self.law.projected_tangents(arch, &factors[at.clone()], tangents),
                            false => self.law.tangents(arch, &factors[at.clone()], tangents),
                        }
                        let [starts, ends, of_factors] =
                            [&points[at.clone()], &ends[at.clone()], &of_factors[at]];
                        arch.dispatch(Turn { starts, ends, of_factors, tangents, is_projected });
                        self.solids.hessians(group, tangents, block, range.clone(), out);
                    }
                });
            });
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

/// Replaces A at ±U by the tangent of the step at each point.
struct Turn<'a> {
    starts: &'a [PackedMat3],
    ends: &'a [PackedMat3],
    of_factors: &'a [PackedMat3],
    tangents: &'a mut [PackedTangent],
    is_projected: bool,
}

impl WithSimd for Turn<'_> {
    type Output = ();
    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        for (k, tangent) in self.tangents.iter_mut().enumerate() {
            for part in 0..parts::<S>() {
                let (start, end) =
                    (load_mat3(simd, &self.starts[k], part), load_mat3(simd, &self.ends[k], part));
                let mean = Mean::new(&start, &end);
                let stress = mean.second_stress(&load_mat3(simd, &self.of_factors[k], part));
                let turn = mean.by_factor(&mean.deformation);
                // I − G Gᵀ.
                let [zero, one] = [0.0, 1.0].map(|value| Lane::splat(simd, value));
                let square = product_transposed(&turn, &turn);
                let rest = mat3!(i k => if i == k { one } else { zero } - square[i][k]);
                for column in 0..3 {
                    for row in column..3 {
                        let place = |i: usize, k: usize| {
                            let (a, b) = (3 * i + row, 3 * k + column);
                            packed_index(a.max(b), a.min(b))
                        };
                        let old = mat3!(i k => tangent[place(i, k)].load(simd, part));
                        let new = product_transposed(&product(&turn, &old), &turn);
                        for i in 0..3 {
                            // The block of a row and the same column is symmetric.
                            for k in 0..if row == column { i + 1 } else { 3 } {
                                let pull =
                                    if self.is_projected { zero } else { rest[i][k] * stress[row][column] };
                                tangent[place(i, k)].store(part, new[i][k] + pull);
                            }
                        }
                    }
                }
            }
        }
    }
}
