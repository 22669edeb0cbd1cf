//! Solid elements on a patch: from the positions of its nodes to the sums at its nodes, eight elements
//! at a time, with no block of an element in memory. It must not know laws, nor what a patch is cut from.

use std::ops::Range;

use pulp::{Simd, WithSimd};
use vi_core::{Padded, Patch};

use super::Element;
use super::kernel::Solids;
use crate::material::{Material, PackedMat3, load_mat3, store_mat3};
use crate::pack::{GROUP, parts};
use crate::real::Lane;
use crate::tensor::{mat3, product, product_transposed};
use crate::transpose::{add_to_places, gather_places};

/// Most nodes of an element.
const MOST_NODES: usize = 27;

/// Elements `range`, the first of which has the places at the head of `places`.
#[derive(Clone)]
struct Run<'a> {
    range: Range<usize>,
    places: &'a [u16],
}

impl<'a> Run<'a> {
    /// The places of the elements of a group, N each, and the lanes that belong to the run: the other
    /// lanes read what a lane of the run reads, and are not to be summed.
    #[inline(always)]
    fn group<const N: usize>(
        &self,
        group: usize,
        room: &'a mut [u16; GROUP * MOST_NODES],
    ) -> (&'a [u16], Range<usize>) {
        let first = group * GROUP;
        let lanes = self.range.start.max(first) - first..self.range.end.min(first + GROUP) - first;
        if lanes.len() == GROUP {
            return (&self.places[(first - self.range.start) * N..][..GROUP * N], lanes);
        }
        for lane in 0..GROUP {
            let element = first + lane.clamp(lanes.start, lanes.end - 1) - self.range.start;
            room[lane * N..][..N].copy_from_slice(&self.places[element * N..][..N]);
        }
        (&room[..GROUP * N], lanes)
    }
}

/// The groups that hold the elements of `range`.
fn groups(range: &Range<usize>) -> Range<usize> {
    range.start / GROUP..range.end.div_ceil(GROUP)
}

impl<E: Element<N, Q>, const N: usize, const Q: usize> Solids<E, N, Q> {
    /// Adds the forces of the elements of `range` to the sums of a patch, the law's stresses made
    /// between two loads of the geometry: the fastest way, for elements compiled together with laws.
    #[inline(never)]
    pub(crate) fn add_forces_of<M: Material>(&self, material: &M, range: Range<usize>, patch: Patch<'_>) {
        let Patch { places, x, sums } = patch;
        self.arch().dispatch(Whole { solids: self, material, run: Run { range, places }, x, sums });
    }

    /// F at the quadrature points of `groups`, Q a group, of which the elements of `range` count.
    #[inline(never)]
    pub(crate) fn patch_deformations(
        &self,
        groups: Range<usize>,
        range: Range<usize>,
        places: &[u16],
        x: &[Padded],
        out: &mut [PackedMat3],
    ) {
        self.arch().dispatch(Deformations { solids: self, groups, run: Run { range, places }, x, out });
    }

    /// Adds the forces of the elements of `range` from P at the quadrature points of `groups`.
    #[inline(never)]
    pub(crate) fn add_forces(
        &self,
        groups: Range<usize>,
        stresses: &[PackedMat3],
        range: Range<usize>,
        places: &[u16],
        sums: &mut [Padded],
    ) {
        self.arch().dispatch(Forces { solids: self, groups, stresses, run: Run { range, places }, sums });
    }
}

/// The positions of the nodes of a part of a group.
#[inline(always)]
fn positions<S: Simd, const N: usize>(simd: S, x: &[Padded], places: &[u16]) -> [[Lane<S>; 3]; N] {
    let mut positions = [[Lane::splat(simd, 0.0); 3]; N];
    for a in 0..N {
        positions[a] = gather_places(simd, x, &places[a..], N);
    }
    positions
}

/// Adds the forces of those `lanes` of a group that lie in a part of it.
#[inline(always)]
fn add<S: Simd, const N: usize>(
    simd: S,
    forces: &[[Lane<S>; 3]; N],
    part: usize,
    places: &[u16],
    lanes: &Range<usize>,
    sums: &mut [Padded],
) {
    let (first, width) = (part * S::F64_LANES, S::F64_LANES);
    let lanes = lanes.start.max(first) - first..(lanes.end.max(first) - first).min(width);
    for a in 0..N {
        add_to_places(simd, forces[a], &places[a..], N, lanes.clone(), sums);
    }
}

struct Whole<'a, E, M, const N: usize, const Q: usize> {
    solids: &'a Solids<E, N, Q>,
    material: &'a M,
    run: Run<'a>,
    x: &'a [Padded],
    sums: &'a mut [Padded],
}

impl<E: Element<N, Q>, M: Material, const N: usize, const Q: usize> WithSimd for Whole<'_, E, M, N, Q> {
    type Output = ();
    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self { solids, material, run, x, sums } = self;
        for group in groups(&run.range) {
            let mut room = [0; GROUP * MOST_NODES];
            let (places, lanes) = run.group::<N>(group, &mut room);
            for part in 0..parts::<S>() {
                let places = &places[part * S::F64_LANES * N..][..S::F64_LANES * N];
                let position = positions::<S, N>(simd, x, places);
                let mut forces = [[Lane::splat(simd, 0.0); 3]; N];
                for q in 0..Q {
                    let geometry = &solids.geometry[group * Q + q];
                    let inverse = load_mat3(simd, &geometry.inverse, part);
                    let f = product(&E::reference_gradient(&position, &solids.gradients[q]), &inverse);
                    let p = product_transposed(&material.stress(&f), &inverse);
                    let volume = geometry.volume.load(simd, part);
                    let p = mat3!(i j => p[i][j] * volume);
                    E::add_reference_forces(&p, &solids.gradients[q], &mut forces);
                }
                add(simd, &forces, part, places, &lanes, sums);
            }
        }
    }
}

struct Deformations<'a, E, const N: usize, const Q: usize> {
    solids: &'a Solids<E, N, Q>,
    groups: Range<usize>,
    run: Run<'a>,
    x: &'a [Padded],
    out: &'a mut [PackedMat3],
}

impl<E: Element<N, Q>, const N: usize, const Q: usize> WithSimd for Deformations<'_, E, N, Q> {
    type Output = ();
    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self { solids, groups, run, x, out } = self;
        for (group, out) in groups.zip(out.chunks_exact_mut(Q)) {
            let mut room = [0; GROUP * MOST_NODES];
            let (places, _) = run.group::<N>(group, &mut room);
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
    run: Run<'a>,
    sums: &'a mut [Padded],
}

impl<E: Element<N, Q>, const N: usize, const Q: usize> WithSimd for Forces<'_, E, N, Q> {
    type Output = ();
    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self { solids, groups, stresses, run, sums } = self;
        for (group, stresses) in groups.zip(stresses.chunks_exact(Q)) {
            let mut room = [0; GROUP * MOST_NODES];
            let (places, lanes) = run.group::<N>(group, &mut room);
            for part in 0..parts::<S>() {
                let places = &places[part * S::F64_LANES * N..][..S::F64_LANES * N];
                let forces = solids.lane_forces(simd, group, stresses, part);
                add(simd, &forces, part, places, &lanes, sums);
            }
        }
    }
}
