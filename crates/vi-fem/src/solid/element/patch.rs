//! Solid elements on a patch: from the positions of its nodes to the sums at its nodes, eight elements at a time. No
//! element block is stored in memory.

use std::ops::Range;

use pulp::{Simd, WithSimd};
use vi_core::PatchArray;

use super::contract::Element;
use super::kernel::Solids;
use crate::lanes::pack::{GROUP, parts};
use crate::lanes::places::{add_to_places, gather_places};
use crate::lanes::real::Lane;
use crate::small::tensor::product;
use crate::solid::material::batch::{PackedMat3, load_mat3, store_mat3};

impl<E: Element<N, Q>, const N: usize, const Q: usize> Solids<E, N, Q> {
    /// Writes F at the quadrature points of groups, Q per group.
    #[inline(never)]
    pub(crate) fn patch_deformations(
        &self,
        groups: Range<usize>,
        places: &[u16],
        x: &PatchArray,
        out: &mut [PackedMat3],
    ) {
        self.arch().dispatch(Deformations { solids: self, groups, places, x, out });
    }

    /// Adds the forces of groups from P at their quadrature points.
    #[inline(never)]
    pub(crate) fn add_forces(
        &self,
        groups: Range<usize>,
        stresses: &[PackedMat3],
        places: &[u16],
        sums: &mut PatchArray,
    ) {
        self.arch().dispatch(Forces { solids: self, groups, stresses, places, sums });
    }
}

/// Returns the positions of the nodes of a part of a group.
#[inline(always)]
fn positions<S: Simd, const N: usize>(simd: S, x: &PatchArray, places: &[u16]) -> [[Lane<S>; 3]; N] {
    let mut positions = [[Lane::splat(simd, 0.0); 3]; N];
    for a in 0..N {
        positions[a] = gather_places(simd, x, &places[a..], N);
    }
    positions
}

struct Deformations<'a, E, const N: usize, const Q: usize> {
    solids: &'a Solids<E, N, Q>,
    groups: Range<usize>,
    places: &'a [u16],
    x: &'a PatchArray,
    out: &'a mut [PackedMat3],
}

impl<E: Element<N, Q>, const N: usize, const Q: usize> WithSimd for Deformations<'_, E, N, Q> {
    type Output = ();
    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self { solids, groups, places, x, out } = self;
        let places = places.chunks_exact(GROUP * N);
        for ((group, out), places) in groups.zip(out.chunks_exact_mut(Q)).zip(places) {
            for part in 0..parts::<S>() {
                let places = &places[part * S::F64_LANES * N..][..S::F64_LANES * N];
                let position = positions::<S, N>(simd, x, places);
                for q in 0..Q {
                    let inverse = load_mat3(simd, &solids.geometry[group * Q + q].inverse, part);
                    let f = product(&E::reference_gradient(&position, &solids.gradients[q]), &inverse);
                    store_mat3(&mut out[q], part, &f);
                }
            }
        }
    }
}

struct Forces<'a, E, const N: usize, const Q: usize> {
    solids: &'a Solids<E, N, Q>,
    groups: Range<usize>,
    stresses: &'a [PackedMat3],
    places: &'a [u16],
    sums: &'a mut PatchArray,
}

impl<E: Element<N, Q>, const N: usize, const Q: usize> WithSimd for Forces<'_, E, N, Q> {
    type Output = ();
    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self { solids, groups, stresses, places, sums } = self;
        let places = places.chunks_exact(GROUP * N);
        for ((group, stresses), places) in groups.zip(stresses.chunks_exact(Q)).zip(places) {
            for part in 0..parts::<S>() {
                let places = &places[part * S::F64_LANES * N..][..S::F64_LANES * N];
                let forces = solids.lane_forces(simd, group, stresses, part);
                for a in 0..N {
                    add_to_places(simd, forces[a], &places[a..], N, sums);
                }
            }
        }
    }
}
