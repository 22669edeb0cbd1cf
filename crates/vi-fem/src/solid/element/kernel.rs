//! The kernel of all solid elements: x ↦ F at the quadrature points, P ↦ nodal forces, tangents ↦ element Hessians,
//! for eight elements at a time.
//!
//! At rest a quadrature point stores only J⁻¹ = (∂X/∂ξ)⁻¹ and its volume w det J. Then F = (Σ x_a ⊗ ∂N_a/∂ξ) J⁻¹ and
//! f_a = Σ_q w P J⁻ᵀ ∂N_a/∂ξ.

use std::marker::PhantomData;
use std::ops::Range;

use pulp::{Arch, Simd, WithSimd};
use vi_core::packed_len;

use super::contract::Element;
use super::rest_shape::{PointGeometry, RotatedGeometry};
use crate::lanes::pack::{GROUP, Pack, members, parts};
use crate::lanes::real::Lane;
use crate::lanes::transpose::{gather, put};
use crate::small::tensor::{
    cofactor, determinant, dot, mat3, packed_index, product, product_transposed, symmetric_index, vec3,
};
use crate::solid::material::batch::{PackedMat3, PackedTangent, load_mat3, store_mat3};
use vi_mesh::volume_of_round_off;

/// Solid elements of one kind in groups of eight; copies of the last element fill the last group.
pub(crate) struct Solids<E, const N: usize, const Q: usize> {
    arch: Arch,
    count: usize,
    nodes: Vec<u32>,
    /// The geometry of the quadrature points, Q per group.
    pub(crate) geometry: Vec<PointGeometry>,
    /// The rotated geometry, one per group, if [`Solids::rotate_rest_shapes`] has been called.
    pub(super) rotated: Vec<RotatedGeometry>,
    /// ∂N_a/∂ξ at the quadrature points.
    pub(super) gradients: [[[f64; 3]; N]; Q],
    element: PhantomData<E>,
}

impl<E: Element<N, Q>, const N: usize, const Q: usize> Solids<E, N, Q> {
    /// Returns elements with these nodes (N each) at rest at `points`. If an element is inverted or has no volume,
    /// returns it as the error: (index in the list, Q × its smallest w det J, m³).
    pub(crate) fn new(
        arch: Arch,
        points: &[[f64; 3]],
        mut nodes: Vec<u32>,
    ) -> Result<Self, Vec<(usize, f64)>> {
        let count = nodes.len() / N;
        let groups = count.div_ceil(GROUP);
        if let Some(last) = count.checked_sub(1) {
            let last: Vec<u32> = nodes[last * N..].to_vec();
            nodes.extend(last.iter().cycle().take((groups * GROUP - count) * N));
        }
        let rule = E::rule();
        let gradients = rule.map(|(xi, _)| E::gradients(xi));
        let empty = PointGeometry { inverse: [Pack::default(); 9], volume: Pack::default() };
        let mut geometry = vec![empty; groups * Q];
        let mut inverted = Vec::new();
        for element in 0..groups * GROUP {
            let (group, lane) = (element / GROUP, element % GROUP);
            let x: [[f64; 3]; N] = std::array::from_fn(|a| points[nodes[element * N + a] as usize]);
            let mut worst = f64::INFINITY;
            for q in 0..Q {
                let jacobian = E::reference_gradient(&x, &gradients[q]);
                let det = determinant(&jacobian);
                worst = worst.min(if det.is_nan() { f64::NEG_INFINITY } else { det });
                let cofactor = cofactor(&jacobian);
                let target = &mut geometry[group * Q + q];
                for i in 0..3 {
                    for j in 0..3 {
                        target.inverse[3 * i + j].0[lane] = cofactor[j][i] / det;
                    }
                }
                target.volume.0[lane] = rule[q].1 * det;
            }
            if worst <= volume_of_round_off(x.into_iter()) && element < count {
                inverted.push((element, worst * rule.iter().map(|(_, weight)| weight).sum::<f64>()));
            }
        }
        if !inverted.is_empty() {
            return Err(inverted);
        }
        Ok(Self { arch, count, nodes, geometry, rotated: Vec::new(), gradients, element: PhantomData })
    }

    /// Computes the rotated geometry of linear tetrahedra. Use it only for laws that are isotropic and objective.
    pub(crate) fn rotate_rest_shapes(&mut self) {
        self.rotated = self.geometry.iter().map(RotatedGeometry::of).collect();
    }

    /// Returns the number of elements.
    pub(crate) fn count(&self) -> usize {
        self.count
    }

    /// Returns the instruction set of the kernels.
    pub(crate) fn arch(&self) -> Arch {
        self.arch
    }

    /// Returns the node numbers, N per element.
    pub(crate) fn nodes(&self) -> &[u32] {
        &self.nodes[..self.count * N]
    }

    /// Returns [`Solids::nodes`] for whole groups.
    pub(crate) fn padded_nodes(&self) -> &[u32] {
        &self.nodes
    }

    /// Returns the elements `range`; `None` if it does not begin with a group.
    pub(crate) fn portion(&self, range: Range<usize>) -> Option<Self> {
        if !range.start.is_multiple_of(GROUP) {
            return None;
        }
        let groups = range.start / GROUP..range.end.div_ceil(GROUP);
        let rotated =
            if self.rotated.is_empty() { Vec::new() } else { self.rotated[groups.clone()].to_vec() };
        Some(Self {
            arch: self.arch,
            count: range.len(),
            nodes: self.nodes[groups.start * GROUP * N..groups.end * GROUP * N].to_vec(),
            geometry: self.geometry[groups.start * Q..groups.end * Q].to_vec(),
            rotated,
            gradients: self.gradients,
            element: PhantomData,
        })
    }

    /// Adds `offset` to every node number.
    pub(crate) fn shift_nodes(&mut self, offset: u32) {
        for node in &mut self.nodes {
            *node += offset;
        }
    }

    /// Returns the volumes w det J (m³) of the quadrature points of a group.
    pub(crate) fn volumes(&self, group: usize) -> impl Iterator<Item = &Pack> + Clone {
        self.geometry[group * Q..][..Q].iter().map(|point| &point.volume)
    }

    /// Writes F at the quadrature points of some groups, Q per group.
    #[inline(never)]
    pub(crate) fn deformations(&self, groups: Range<usize>, x: &[f64], out: &mut [PackedMat3]) {
        self.arch.dispatch(Deformations { solids: self, groups, x, out });
    }

    /// Writes the gradients of the elements of `range` from P at the quadrature points of `groups`.
    #[inline(never)]
    pub(crate) fn forces(
        &self,
        groups: Range<usize>,
        stresses: &[PackedMat3],
        range: Range<usize>,
        out: &mut [f64],
    ) {
        self.arch.dispatch(Forces { solids: self, groups, stresses, range, out });
    }

    /// Writes the packed Hessians of the elements of `range` in `group` from the tangents at its quadrature points;
    /// `block` is scratch memory for one packed Hessian of a group.
    #[inline(never)]
    pub(crate) fn hessians(
        &self,
        group: usize,
        tangents: &[PackedTangent],
        block: &mut [Pack],
        range: Range<usize>,
        out: &mut [f64],
    ) {
        self.arch.dispatch(Hessians { solids: self, group, tangents, block, range, out });
    }
}

impl<E: Element<N, Q>, const N: usize, const Q: usize> Solids<E, N, Q> {
    /// Returns the nodal forces of a part of a group from P at its quadrature points.
    #[inline(always)]
    pub(super) fn lane_forces<S: Simd>(
        &self,
        simd: S,
        group: usize,
        stresses: &[PackedMat3],
        part: usize,
    ) -> [[Lane<S>; 3]; N] {
        let mut forces = [[Lane::splat(simd, 0.0); 3]; N];
        for q in 0..Q {
            let geometry = &self.geometry[group * Q + q];
            let volume = geometry.volume.load(simd, part);
            let inverse = load_mat3(simd, &geometry.inverse, part);
            let p = product_transposed(&load_mat3(simd, &stresses[q], part), &inverse);
            let p = mat3!(i j => p[i][j] * volume);
            E::add_reference_forces(&p, &self.gradients[q], &mut forces);
        }
        forces
    }
}

struct Deformations<'a, E, const N: usize, const Q: usize> {
    solids: &'a Solids<E, N, Q>,
    groups: Range<usize>,
    x: &'a [f64],
    out: &'a mut [PackedMat3],
}

impl<E: Element<N, Q>, const N: usize, const Q: usize> WithSimd for Deformations<'_, E, N, Q> {
    type Output = ();
    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self { solids, groups, x, out } = self;
        for (group, out) in groups.zip(out.chunks_exact_mut(Q)) {
            let nodes = &solids.nodes[group * GROUP * N..][..GROUP * N];
            for part in 0..parts::<S>() {
                let nodes = &nodes[part * S::F64_LANES * N..][..S::F64_LANES * N];
                let mut position = [[Lane::splat(simd, 0.0); 3]; N];
                for a in 0..N {
                    position[a] = gather(simd, x, &nodes[a..], N);
                }
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
    range: Range<usize>,
    out: &'a mut [f64],
}

impl<E: Element<N, Q>, const N: usize, const Q: usize> WithSimd for Forces<'_, E, N, Q> {
    type Output = ();
    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self { solids, groups, stresses, range, out } = self;
        let mut local = [[Pack::default(); 3]; N];
        for (group, stresses) in groups.zip(stresses.chunks_exact(Q)) {
            for part in 0..parts::<S>() {
                let f = solids.lane_forces(simd, group, stresses, part);
                for a in 0..N {
                    for i in 0..3 {
                        local[a][i].store(part, f[a][i]);
                    }
                }
            }
            put(simd, local.as_flattened(), members(group), &range, out);
        }
    }
}

struct Hessians<'a, E, const N: usize, const Q: usize> {
    solids: &'a Solids<E, N, Q>,
    group: usize,
    tangents: &'a [PackedTangent],
    block: &'a mut [Pack],
    range: Range<usize>,
    out: &'a mut [f64],
}

impl<E: Element<N, Q>, const N: usize, const Q: usize> WithSimd for Hessians<'_, E, N, Q> {
    type Output = ();
    /// Writes K_(ai)(bk) = Σ_q w Σ_jl G_aj C_ijkl G_bl with G_a = J⁻ᵀ ∂N_a/∂ξ.
    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self { solids, group, tangents, block, range, out } = self;
        let block = &mut block[..packed_len(3 * N)];
        for (q, tangent) in tangents.iter().enumerate() {
            let geometry = &solids.geometry[group * Q + q];
            for part in 0..parts::<S>() {
                let volume = geometry.volume.load(simd, part);
                let inverse = load_mat3(simd, &geometry.inverse, part);
                let mut g = [[Lane::splat(simd, 0.0); 3]; N];
                for a in 0..N {
                    let xi = vec3!(m => Lane::splat(simd, solids.gradients[q][a][m]));
                    g[a] = vec3!(j => dot([inverse[0][j], inverse[1][j], inverse[2][j]], xi));
                }
                for a in 0..N {
                    let weighted = vec3!(j => g[a][j] * volume);
                    // Σ_j G_aj C_ijkl for all (i, k, l).
                    let rows = vec3!(i => mat3!(k l => dot(
                        weighted,
                        vec3!(j => tangent[symmetric_index(3 * i + j, 3 * k + l)].load(simd, part))
                    )));
                    for b in 0..=a {
                        let term = mat3!(i k => dot(rows[i][k], g[b]));
                        for i in 0..3 {
                            let length = if b < a { 3 } else { i + 1 };
                            let target = &mut block[packed_index(3 * a + i, 3 * b)..][..length];
                            for k in 0..length {
                                let before =
                                    if q == 0 { Lane::splat(simd, 0.0) } else { target[k].load(simd, part) };
                                target[k].store(part, before + term[i][k]);
                            }
                        }
                    }
                }
            }
        }
        put(simd, block, members(group), &range, out);
    }
}
