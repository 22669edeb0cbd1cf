//! Moves numbers between the padded vectors of a patch and lanes. It is [`crate::lanes::transpose`] for nodes that a
//! single load reads.
//!
//! All variants add in the order of the lanes, node by node. Places are u16 indices into arrays that have an entry
//! for every u16, so no index needs a check and none can fail.

use pulp::Simd;
use vi_core::PatchArray;

use crate::lanes::pack::Pack;
use crate::lanes::real::Lane;

/// Runs `$v4` or `$v3` if the token is that of AVX-512 or AVX2.
macro_rules! on_x86 {
    ($simd:ident, $token:ident, $v4:expr, $v3:expr) => {
        #[cfg(target_arch = "x86_64")]
        {
            // Cast between a type and itself, which costs nothing.
            let token: &dyn std::any::Any = &$simd;
            if let Some(&$token) = token.downcast_ref::<pulp::x86::V4>() {
                return $v4;
            }
            if let Some(&$token) = token.downcast_ref::<pulp::x86::V3>() {
                return $v3;
            }
        }
    };
}

#[cfg(target_arch = "x86_64")]
#[inline(always)]
fn lanes<S: Simd, V: pulp::bytemuck::NoUninit + pulp::bytemuck::AnyBitPattern>(
    simd: S,
    [x, y, z]: [V; 3],
) -> [Lane<S>; 3] {
    use pulp::bytemuck::cast;
    [Lane::new(simd, cast(x)), Lane::new(simd, cast(y)), Lane::new(simd, cast(z))]
}

#[cfg(target_arch = "x86_64")]
#[inline(always)]
fn raw<S: Simd, V: pulp::bytemuck::AnyBitPattern>([x, y, z]: [Lane<S>; 3]) -> [V; 3] {
    use pulp::bytemuck::cast;
    [cast(x.raw()), cast(y.raw()), cast(z.raw())]
}

/// Gathers the coordinates of `S::F64_LANES` nodes into lanes; lane l holds the node at `places[stride · l]`.
#[inline(always)]
pub(crate) fn gather_places<S: Simd>(simd: S, x: &PatchArray, places: &[u16], stride: usize) -> [Lane<S>; 3] {
    on_x86!(
        simd,
        token,
        lanes(simd, x86::gather_8(token, x, places, stride)),
        lanes(simd, x86::gather_4(token, x, places, stride))
    );
    let mut local = [Pack::default(); 3];
    for lane in 0..S::F64_LANES {
        let point = &x[usize::from(places[stride * lane])].0;
        for i in 0..3 {
            local[i].0[lane] = point[i];
        }
    }
    [local[0].load(simd, 0), local[1].load(simd, 0), local[2].load(simd, 0)]
}

/// Adds the vector of lane l to the sum at `places[stride · l]`.
#[inline(always)]
pub(crate) fn add_to_places<S: Simd>(
    simd: S,
    value: [Lane<S>; 3],
    places: &[u16],
    stride: usize,
    sums: &mut PatchArray,
) {
    on_x86!(
        simd,
        token,
        x86::add_8(token, raw(value), places, stride, sums),
        x86::add_4(token, raw(value), places, stride, sums)
    );
    let mut local = [Pack::default(); 3];
    for i in 0..3 {
        local[i].store(0, value[i]);
    }
    for lane in 0..S::F64_LANES {
        let sum = &mut sums[usize::from(places[stride * lane])].0;
        for i in 0..3 {
            sum[i] += local[i].0[lane];
        }
    }
}

/// Returns the edges of `S::F64_LANES` tetrahedra from their first nodes as columns x₁ − x₀, x₂ − x₀, x₃ − x₀.
/// `places` holds four per element.
#[inline(always)]
pub(crate) fn gather_edges<S: Simd>(simd: S, x: &PatchArray, places: &[u16]) -> [[Lane<S>; 3]; 3] {
    #[cfg(target_arch = "x86_64")]
    {
        let token: &dyn std::any::Any = &simd;
        if let Some(&v4) = token.downcast_ref::<pulp::x86::V4>() {
            let [a, b, c] = x86::edges_8(v4, x, places);
            let columns = [lanes(simd, a), lanes(simd, b), lanes(simd, c)];
            return transposed(columns);
        }
    }
    let origin = gather_places(simd, x, places, 4);
    let columns = [
        gather_places(simd, x, &places[1..], 4),
        gather_places(simd, x, &places[2..], 4),
        gather_places(simd, x, &places[3..], 4),
    ];
    let mut edges = transposed(columns);
    for i in 0..3 {
        for j in 0..3 {
            edges[i][j] = edges[i][j] - origin[i];
        }
    }
    edges
}

#[inline(always)]
fn transposed<S: Simd>(columns: [[Lane<S>; 3]; 3]) -> [[Lane<S>; 3]; 3] {
    let mut rows = columns;
    for i in 0..3 {
        for j in 0..3 {
            rows[i][j] = columns[j][i];
        }
    }
    rows
}

/// Adds the forces of `S::F64_LANES` tetrahedra: the columns of `forces` to their last three nodes, and minus the sum
/// of the columns to the first.
#[inline(always)]
pub(crate) fn add_edge_forces<S: Simd>(
    simd: S,
    forces: [[Lane<S>; 3]; 3],
    places: &[u16],
    sums: &mut PatchArray,
) {
    #[cfg(target_arch = "x86_64")]
    {
        let token: &dyn std::any::Any = &simd;
        if let Some(&v4) = token.downcast_ref::<pulp::x86::V4>() {
            let columns = [
                raw([forces[0][0], forces[1][0], forces[2][0]]),
                raw([forces[0][1], forces[1][1], forces[2][1]]),
                raw([forces[0][2], forces[1][2], forces[2][2]]),
            ];
            return x86::add_edge_forces_8(v4, columns, places, sums);
        }
    }
    let mut first = [Lane::splat(simd, 0.0); 3];
    for i in 0..3 {
        first[i] = -(forces[i][0] + forces[i][1] + forces[i][2]);
    }
    add_to_places(simd, first, places, 4, sums);
    for j in 0..3 {
        let column = [forces[0][j], forces[1][j], forces[2][j]];
        add_to_places(simd, column, &places[j + 1..], 4, sums);
    }
}

#[cfg(target_arch = "x86_64")]
mod x86 {
    use std::arch::x86_64::{__m256d, __m512d};

    use pulp::bytemuck::cast;
    use pulp::x86::{V3, V4};
    use pulp::{f64x4, f64x8};
    use vi_core::{Padded, PatchArray};

    use crate::lanes::transpose::x86::{columns_4, columns_8};

    #[inline(always)]
    fn load(x: &PatchArray, place: u16) -> __m256d {
        cast(x[usize::from(place)].0)
    }

    #[inline(always)]
    fn add(isa: pulp::core_arch::x86::Avx, value: __m256d, sum: &mut Padded) {
        sum.0 = cast(isa._mm256_add_pd(cast(sum.0), value));
    }

    /// Loads the nodes of lanes l and l + 4 side by side.
    #[inline(always)]
    fn pairs(simd: V4, x: &PatchArray, places: &[u16], stride: usize) -> [__m512d; 4] {
        let isa = simd.avx512f;
        let mut pairs = [isa._mm512_setzero_pd(); 4];
        for lane in 0..4 {
            let low = isa._mm512_castpd256_pd512(load(x, places[stride * lane]));
            pairs[lane] = isa._mm512_insertf64x4::<1>(low, load(x, places[stride * (lane + 4)]));
        }
        pairs
    }

    /// Transposes x, y, z of eight nodes to vectors that hold lanes l and l + 4 side by side; the fourth numbers are
    /// unused.
    #[inline(always)]
    fn rows(simd: V4, [x, y, z]: [f64x8; 3]) -> [__m512d; 4] {
        let isa = simd.avx512f;
        let [x, y, z]: [__m512d; 3] = [cast(x), cast(y), cast(z)];
        let (even, odd) = (isa._mm512_unpacklo_pd(x, y), isa._mm512_unpackhi_pd(x, y));
        [
            isa._mm512_permutex2var_pd(even, cast([0u64, 1, 8, 8, 4, 5, 12, 12]), z),
            isa._mm512_permutex2var_pd(odd, cast([0u64, 1, 9, 9, 4, 5, 13, 13]), z),
            isa._mm512_permutex2var_pd(even, cast([2u64, 3, 10, 10, 6, 7, 14, 14]), z),
            isa._mm512_permutex2var_pd(odd, cast([2u64, 3, 11, 11, 6, 7, 15, 15]), z),
        ]
    }

    #[inline(always)]
    fn add_rows(simd: V4, rows: [__m512d; 4], places: &[u16], stride: usize, sums: &mut PatchArray) {
        let isa = simd.avx512f;
        for lane in 0..4 {
            let low = isa._mm512_castpd512_pd256(rows[lane]);
            add(simd.avx, low, &mut sums[usize::from(places[stride * lane])]);
        }
        for lane in 0..4 {
            let high = isa._mm512_extractf64x4_pd::<1>(rows[lane]);
            add(simd.avx, high, &mut sums[usize::from(places[stride * (lane + 4)])]);
        }
    }

    #[inline(always)]
    pub(super) fn gather_8(simd: V4, x: &PatchArray, places: &[u16], stride: usize) -> [f64x8; 3] {
        columns_8(simd, pairs(simd, x, places, stride))
    }

    #[inline(always)]
    pub(super) fn add_8(simd: V4, value: [f64x8; 3], places: &[u16], stride: usize, sums: &mut PatchArray) {
        add_rows(simd, rows(simd, value), places, stride, sums);
    }

    /// Subtracts before transposing, so that three nodes need transposing instead of four.
    #[inline(always)]
    pub(super) fn edges_8(simd: V4, x: &PatchArray, places: &[u16]) -> [[f64x8; 3]; 3] {
        let isa = simd.avx512f;
        let origin = pairs(simd, x, places, 4);
        let mut columns = [[cast([0.0; 8]); 3]; 3];
        for j in 0..3 {
            let mut edges = pairs(simd, x, &places[j + 1..], 4);
            for lane in 0..4 {
                edges[lane] = isa._mm512_sub_pd(edges[lane], origin[lane]);
            }
            columns[j] = columns_8(simd, edges);
        }
        columns
    }

    /// Forms the force on the first node after transposing, for the same reason.
    #[inline(always)]
    pub(super) fn add_edge_forces_8(
        simd: V4,
        forces: [[f64x8; 3]; 3],
        places: &[u16],
        sums: &mut PatchArray,
    ) {
        let isa = simd.avx512f;
        let (a, b, c) = (rows(simd, forces[0]), rows(simd, forces[1]), rows(simd, forces[2]));
        let mut first = [isa._mm512_setzero_pd(); 4];
        for lane in 0..4 {
            first[lane] = isa._mm512_sub_pd(first[lane], a[lane]);
            first[lane] = isa._mm512_sub_pd(first[lane], b[lane]);
            first[lane] = isa._mm512_sub_pd(first[lane], c[lane]);
        }
        add_rows(simd, first, places, 4, sums);
        add_rows(simd, a, &places[1..], 4, sums);
        add_rows(simd, b, &places[2..], 4, sums);
        add_rows(simd, c, &places[3..], 4, sums);
    }

    #[inline(always)]
    pub(super) fn gather_4(simd: V3, x: &PatchArray, places: &[u16], stride: usize) -> [f64x4; 3] {
        let nodes = [
            load(x, places[0]),
            load(x, places[stride]),
            load(x, places[2 * stride]),
            load(x, places[3 * stride]),
        ];
        columns_4(simd, nodes)
    }

    #[inline(always)]
    pub(super) fn add_4(simd: V3, value: [f64x4; 3], places: &[u16], stride: usize, sums: &mut PatchArray) {
        let isa = simd.avx;
        let [x, y, z]: [__m256d; 3] = [cast(value[0]), cast(value[1]), cast(value[2])];
        let (even, odd) = (isa._mm256_unpacklo_pd(x, y), isa._mm256_unpackhi_pd(x, y));
        let (z_even, z_odd) = (isa._mm256_unpacklo_pd(z, z), isa._mm256_unpackhi_pd(z, z));
        add(isa, isa._mm256_permute2f128_pd::<0x20>(even, z_even), &mut sums[usize::from(places[0])]);
        add(isa, isa._mm256_permute2f128_pd::<0x20>(odd, z_odd), &mut sums[usize::from(places[stride])]);
        add(
            isa,
            isa._mm256_permute2f128_pd::<0x31>(even, z_even),
            &mut sums[usize::from(places[2 * stride])],
        );
        add(isa, isa._mm256_permute2f128_pd::<0x31>(odd, z_odd), &mut sums[usize::from(places[3 * stride])]);
    }
}

#[cfg(test)]
mod tests {
    use vi_core::{Padded, Patch};

    use super::*;
    use crate::lanes::instructions::InstructionSet;

    struct RoundTrip;
    impl pulp::WithSimd for RoundTrip {
        type Output = ();
        fn with_simd<S: Simd>(self, simd: S) {
            let mut x = Patch::zeros();
            for (node, x) in x.iter_mut().take(20).enumerate() {
                *x = Padded([node as f64, 10.0 * node as f64, 100.0 + node as f64, f64::NAN]);
            }
            // Use tetrahedra that share nodes.
            let places: Vec<u16> = (0..32).map(|k| (7 * k + 19) % 20).collect();
            let width = S::F64_LANES;
            let (mut sums, mut edge_sums) = (Patch::zeros(), Patch::zeros());
            let edges = gather_edges(simd, &x, &places);
            add_edge_forces(simd, edges, &places, &mut edge_sums);
            for a in 0..4 {
                let found = gather_places(simd, &x, &places[a..], 4);
                add_to_places(simd, found, &places[a..], 4, &mut sums);
                for i in 0..3 {
                    let mut pack = Pack::default();
                    pack.store(0, found[i]);
                    for lane in 0..width {
                        assert_eq!(pack.0[lane], x[usize::from(places[4 * lane + a])].0[i]);
                    }
                }
            }
            let mut expected = vec![[[0.0; 3]; 2]; 20];
            for tet in places.chunks_exact(4).take(width) {
                for (a, &node) in tet.iter().enumerate() {
                    for i in 0..3 {
                        let at = |place: u16| x[usize::from(place)].0[i];
                        expected[usize::from(node)][0][i] += at(node);
                        if a > 0 {
                            expected[usize::from(node)][1][i] += at(node) - at(tet[0]);
                            expected[usize::from(tet[0])][1][i] -= at(node) - at(tet[0]);
                        }
                    }
                }
            }
            for (node, expected) in expected.iter().enumerate() {
                assert_eq!(sums[node].0[..3], expected[0], "{node}");
                assert_eq!(edge_sums[node].0[..3], expected[1], "{node}");
            }
        }
    }

    #[test]
    fn every_instruction_set_reads_and_adds_the_same() {
        for set in [InstructionSet::Scalar, InstructionSet::Avx2, InstructionSet::Avx512] {
            if let Ok(arch) = set.arch() {
                arch.dispatch(RoundTrip);
            }
        }
    }
}
