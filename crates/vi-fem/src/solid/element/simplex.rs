//! The linear simplex compiled together with a law. Forces on patches and Hessians stay in registers, and the
//! geometry is loaded once.

use std::ops::Range;

use pulp::{Arch, Simd, WithSimd};
use vi_core::{PatchArray, prefetch};

use super::contract::Element;
use super::kernel::Solids;
use super::rest_shape::{PointGeometry, RestShape, RotatedGeometry};
use crate::lanes::pack::{GROUP, Pack, members, parts};
use crate::lanes::places::{add_edge_forces, gather_edges};
use crate::lanes::real::Lane;
use crate::lanes::transpose::gather;
use crate::lanes::transpose::put;
use crate::small::tensor::{Mat3, Tangent, dot, mat3, packed_index, product, vec3};
use crate::solid::material::batch::load_mat3;
use crate::solid::material::contract::Material;

/// The rest shapes of some groups of simplices.
#[derive(Clone, Copy)]
pub(crate) enum Shapes<'a> {
    /// Rest shapes in the orientation of the mesh.
    Plain(&'a [PointGeometry]),
    /// Rotated rest shapes, for isotropic and objective laws.
    Rotated(&'a [RotatedGeometry]),
}

impl<E: Element<N, Q>, const N: usize, const Q: usize> Solids<E, N, Q> {
    /// Returns the shapes of groups of simplices, rotated if [`Solids::rotate_rest_shapes`] has been called.
    pub(crate) fn shapes(&self, groups: Range<usize>) -> Shapes<'_> {
        match self.rotated.is_empty() {
            true => Shapes::Plain(&self.geometry[groups]),
            false => Shapes::Rotated(&self.rotated[groups]),
        }
    }
}

/// Adds the forces of simplices of these `shapes` to the sums of a patch; `places` holds four per element.
#[inline(never)]
pub(crate) fn add_forces<M: Material>(
    arch: Arch,
    material: &M,
    shapes: Shapes<'_>,
    places: &[u16],
    x: &PatchArray,
    sums: &mut PatchArray,
) {
    match shapes {
        Shapes::Plain(shapes) => arch.dispatch(Forces { shapes, material, places, x, sums }),
        Shapes::Rotated(shapes) => arch.dispatch(Forces { shapes, material, places, x, sums }),
    }
}

/// Writes the packed Hessians of the simplices of `range`, whose groups have the shapes `geometry` and these `nodes`,
/// four per element.
#[inline(never)]
pub(crate) fn hessians<M: Material>(
    arch: Arch,
    material: &M,
    geometry: &[PointGeometry],
    nodes: &[u32],
    range: Range<usize>,
    x: &[f64],
    out: &mut [f64],
) {
    arch.dispatch(Hessians { geometry, nodes, material, range, x, out });
}

/// Distance in groups by which shapes and places are prefetched. 10⁶ St. Venant–Kirchhoff tetrahedra take 14.6 ns each
/// without, 11.8 at 2, 11.3 at 4 and 8, and at 16 as at 8. In cache (12 288), all take 7.5 ns. The first groups of a
/// run are prefetched at the end of the previous run, which precedes them in memory.
const AHEAD: usize = 8;

struct Forces<'a, G, M> {
    shapes: &'a [G],
    material: &'a M,
    places: &'a [u16],
    x: &'a PatchArray,
    sums: &'a mut PatchArray,
}

impl<G: RestShape, M: Material> WithSimd for Forces<'_, G, M> {
    type Output = ();
    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self { shapes, material, places, x, sums } = self;
        let (places, _) = places.as_chunks::<{ 4 * GROUP }>();
        for (shape, places) in shapes.iter().zip(places) {
            prefetch(shape, AHEAD);
            prefetch(places, AHEAD);
            for part in 0..parts::<S>() {
                let places = &places[part * S::F64_LANES * 4..][..S::F64_LANES * 4];
                let f = shape.deformation(simd, part, &gather_edges(simd, x, places));
                let forces = shape.forces(simd, part, &material.stress(&f));
                add_edge_forces(simd, forces, places, sums);
            }
        }
    }
}

struct Hessians<'a, M> {
    geometry: &'a [PointGeometry],
    nodes: &'a [u32],
    material: &'a M,
    range: Range<usize>,
    x: &'a [f64],
    out: &'a mut [f64],
}

impl<M: Material> WithSimd for Hessians<'_, M> {
    type Output = ();
    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self { geometry, nodes, material, range, x, out } = self;
        let mut block = [Pack::default(); 78];
        for group in range.start / GROUP..range.end.div_ceil(GROUP) {
            let geometry = &geometry[group];
            let nodes = &nodes[group * GROUP * 4..][..GROUP * 4];
            for part in 0..parts::<S>() {
                let nodes = &nodes[part * S::F64_LANES * 4..][..S::F64_LANES * 4];
                let origin = gather(simd, x, nodes, 4);
                let columns = [
                    gather(simd, x, &nodes[1..], 4),
                    gather(simd, x, &nodes[2..], 4),
                    gather(simd, x, &nodes[3..], 4),
                ];
                let inverse = load_mat3(simd, &geometry.inverse, part);
                let f = product(&mat3!(i j => columns[j][i] - origin[i]), &inverse);
                let tangent = material.tangent(&f);
                write_block(simd, &tangent, &inverse, geometry.volume.load(simd, part), part, &mut block);
            }
            put(simd, &block, members(group), &range, out);
        }
    }
}

/// Writes K_(ai)(bk) = V Σ_jl G_aj C_ijkl G_bl for the nodes 1, 2, 3, whose gradients G_a are the rows of J⁻¹. All
/// gradients sum to zero, and so do the blocks of a row, which gives the blocks of node 0.
#[inline(always)]
fn write_block<S: Simd>(
    simd: S,
    tangent: &Tangent<Lane<S>>,
    inverse: &Mat3<Lane<S>>,
    volume: Lane<S>,
    part: usize,
    block: &mut [Pack; 78],
) {
    let zero = Lane::splat(simd, 0.0);
    // Minus the sums of the rows of nodes 1, 2, 3: K_(ai)(0k).
    let mut first = [[[zero; 3]; 3]; 3];
    for a in 0..3 {
        let weighted = vec3!(j => inverse[a][j] * volume);
        // Σ_j G_aj C_ijkl for all (i, k, l).
        let rows = vec3!(i => mat3!(k l => dot(
            weighted,
            vec3!(j => tangent.entry(3 * i + j, 3 * k + l))
        )));
        for b in 0..=a {
            let term = mat3!(i k => dot(rows[i][k], inverse[b]));
            for i in 0..3 {
                for k in 0..3 {
                    first[a][i][k] = first[a][i][k] - term[i][k];
                    if b < a {
                        first[b][i][k] = first[b][i][k] - term[k][i];
                    }
                    if b < a || k <= i {
                        block[packed_index(3 * a + 3 + i, 3 * b + 3 + k)].store(part, term[i][k]);
                    }
                }
            }
        }
    }
    for i in 0..3 {
        for k in 0..3 {
            for a in 0..3 {
                block[packed_index(3 * a + 3 + i, k)].store(part, first[a][i][k]);
            }
            if k <= i {
                let corner = -(first[0][i][k] + first[1][i][k] + first[2][i][k]);
                block[packed_index(i, k)].store(part, corner);
            }
        }
    }
}
