//! Moves numbers between memory, where the numbers of one element are adjacent, and lanes, where the same number of
//! eight elements is adjacent.
//!
//! Moving single numbers costs more than all arithmetic of a linear tetrahedron. Therefore AVX2 and AVX-512 have
//! their own code here. All variants move the same numbers to the same places.

use std::ops::Range;

use pulp::Simd;

use crate::lanes::pack::{GROUP, Pack};
use crate::lanes::real::Lane;

/// Gathers the coordinates of `S::F64_LANES` nodes into lanes; lane l holds node `nodes[stride · l]`.
#[inline(always)]
pub(crate) fn gather<S: Simd>(simd: S, x: &[f64], nodes: &[u32], stride: usize) -> [Lane<S>; 3] {
    #[cfg(target_arch = "x86_64")]
    {
        use std::any::Any;
        // Cast between a type and itself, which costs nothing.
        let token: &dyn Any = &simd;
        if let Some(&v4) = token.downcast_ref::<pulp::x86::V4>() {
            let [a, b, c] = x86::gather_8(v4, x, nodes, stride);
            return [
                Lane::new(simd, pulp::bytemuck::cast(a)),
                Lane::new(simd, pulp::bytemuck::cast(b)),
                Lane::new(simd, pulp::bytemuck::cast(c)),
            ];
        }
        if let Some(&v3) = token.downcast_ref::<pulp::x86::V3>() {
            let [a, b, c] = x86::gather_4(v3, x, nodes, stride);
            return [
                Lane::new(simd, pulp::bytemuck::cast(a)),
                Lane::new(simd, pulp::bytemuck::cast(b)),
                Lane::new(simd, pulp::bytemuck::cast(c)),
            ];
        }
    }
    let mut local = [Pack::default(); 3];
    for lane in 0..S::F64_LANES {
        let point = &x[3 * nodes[stride * lane] as usize..][..3];
        for i in 0..3 {
            local[i].0[lane] = point[i];
        }
    }
    [local[0].load(simd, 0), local[1].load(simd, 0), local[2].load(simd, 0)]
}

/// Copies the numbers of those `members` that lie in `range` from lanes to `out`. Lane l holds element `members.start
/// + l`. `out` begins with the element range.start and holds `packs.len()` numbers per element.
#[inline(always)]
pub(crate) fn put<S: Simd>(
    simd: S,
    packs: &[Pack],
    members: Range<usize>,
    range: &Range<usize>,
    out: &mut [f64],
) {
    let size = packs.len();
    if members.len() == GROUP && range.start <= members.start && members.end <= range.end {
        scatter_rows(simd, packs, &mut out[(members.start - range.start) * size..][..GROUP * size]);
        return;
    }
    for element in range.start.max(members.start)..range.end.min(members.end) {
        let target = &mut out[(element - range.start) * size..][..size];
        for k in 0..size {
            target[k] = packs[k].0[element - members.start];
        }
    }
}

/// Writes `rows[lane · K + k] = packs[k][lane]`, where K is the number of packs.
#[inline(always)]
fn scatter_rows<S: Simd>(simd: S, packs: &[Pack], rows: &mut [f64]) {
    let size = packs.len();
    #[cfg(target_arch = "x86_64")]
    {
        use std::any::Any;
        let token: &dyn Any = &simd;
        if let Some(&v4) = token.downcast_ref::<pulp::x86::V4>()
            && size >= 8
        {
            return x86::scatter_8(v4, packs, rows);
        }
        if let Some(&v3) = token.downcast_ref::<pulp::x86::V3>()
            && size >= 4
        {
            return x86::scatter_4(v3, packs, rows);
        }
    }
    let _ = simd;
    for (lane, row) in rows.chunks_exact_mut(size).enumerate().take(GROUP) {
        for k in 0..size {
            row[k] = packs[k].0[lane];
        }
    }
}

#[cfg(target_arch = "x86_64")]
pub(crate) mod x86 {
    use pulp::bytemuck::cast;
    use pulp::x86::{V3, V4};
    use pulp::{f64x4, f64x8};
    use std::arch::x86_64::{__m256d, __m512d};

    use crate::lanes::pack::Pack;

    /// Loads four numbers: the three coordinates of the node, and one of the next node, which is discarded.
    #[inline(always)]
    fn point(x: &[f64], node: u32) -> __m256d {
        let start = 3 * node as usize;
        if let Some(four) = x.get(start..start + 4) {
            cast([four[0], four[1], four[2], four[3]])
        } else {
            let three = &x[start..start + 3];
            cast([three[0], three[1], three[2], 0.0])
        }
    }

    #[inline(always)]
    pub(super) fn gather_8(simd: V4, x: &[f64], nodes: &[u32], stride: usize) -> [f64x8; 3] {
        let isa = simd.avx512f;
        let mut pairs = [isa._mm512_setzero_pd(); 4];
        for lane in 0..4 {
            let low = isa._mm512_castpd256_pd512(point(x, nodes[stride * lane]));
            pairs[lane] = isa._mm512_insertf64x4::<1>(low, point(x, nodes[stride * (lane + 4)]));
        }
        columns_8(simd, pairs)
    }

    /// Transposes eight nodes to x, y and z. `pairs[l]` holds nodes l and l + 4, each as x, y, z and a number to
    /// discard.
    #[inline(always)]
    pub(crate) fn columns_8(simd: V4, pairs: [__m512d; 4]) -> [f64x8; 3] {
        let isa = simd.avx512f;
        let xz_01 = isa._mm512_unpacklo_pd(pairs[0], pairs[1]);
        let xz_23 = isa._mm512_unpacklo_pd(pairs[2], pairs[3]);
        let y_01 = isa._mm512_unpackhi_pd(pairs[0], pairs[1]);
        let y_23 = isa._mm512_unpackhi_pd(pairs[2], pairs[3]);
        let first = cast([0u64, 1, 8, 9, 4, 5, 12, 13]);
        let second = cast([2u64, 3, 10, 11, 6, 7, 14, 15]);
        [
            cast(isa._mm512_permutex2var_pd(xz_01, first, xz_23)),
            cast(isa._mm512_permutex2var_pd(y_01, first, y_23)),
            cast(isa._mm512_permutex2var_pd(xz_01, second, xz_23)),
        ]
    }

    #[inline(always)]
    pub(super) fn gather_4(simd: V3, x: &[f64], nodes: &[u32], stride: usize) -> [f64x4; 3] {
        let nodes = [
            point(x, nodes[0]),
            point(x, nodes[stride]),
            point(x, nodes[2 * stride]),
            point(x, nodes[3 * stride]),
        ];
        columns_4(simd, nodes)
    }

    /// Transposes four nodes, each given as x, y, z and a number to discard, to their x, y and z.
    #[inline(always)]
    pub(crate) fn columns_4(simd: V3, [a, b, c, d]: [__m256d; 4]) -> [f64x4; 3] {
        let isa = simd.avx;
        let (xz_01, xz_23) = (isa._mm256_unpacklo_pd(a, b), isa._mm256_unpacklo_pd(c, d));
        let (y_01, y_23) = (isa._mm256_unpackhi_pd(a, b), isa._mm256_unpackhi_pd(c, d));
        [
            cast(isa._mm256_permute2f128_pd::<0x20>(xz_01, xz_23)),
            cast(isa._mm256_permute2f128_pd::<0x20>(y_01, y_23)),
            cast(isa._mm256_permute2f128_pd::<0x31>(xz_01, xz_23)),
        ]
    }

    /// Transposes in blocks of 8 × 8; the last block overlaps the one before it.
    #[inline(always)]
    pub(super) fn scatter_8(simd: V4, packs: &[Pack], rows: &mut [f64]) {
        let size = packs.len();
        let mut k = 0;
        loop {
            transpose_8(simd, &packs[k..k + 8], &mut rows[k..], size);
            if k + 8 == size {
                return;
            }
            k = (k + 8).min(size - 8);
        }
    }

    #[inline(always)]
    fn transpose_8(simd: V4, packs: &[Pack], rows: &mut [f64], stride: usize) {
        let isa = simd.avx512f;
        let zero = isa._mm512_setzero_pd();
        let mut r = [zero; 8];
        for k in 0..8 {
            r[k] = cast(packs[k].0);
        }
        // Interleave pairs of rows into even and odd lanes; then exchange halves of 128 bits twice.
        let mut even = [zero; 4];
        let mut odd = [zero; 4];
        for k in 0..4 {
            even[k] = isa._mm512_unpacklo_pd(r[2 * k], r[2 * k + 1]);
            odd[k] = isa._mm512_unpackhi_pd(r[2 * k], r[2 * k + 1]);
        }
        for (parity, t) in [(0, even), (1, odd)] {
            let (u, v) =
                (isa._mm512_shuffle_f64x2::<0x88>(t[0], t[1]), isa._mm512_shuffle_f64x2::<0x88>(t[2], t[3]));
            store_8(rows, parity * stride, isa._mm512_shuffle_f64x2::<0x88>(u, v));
            store_8(rows, (parity + 4) * stride, isa._mm512_shuffle_f64x2::<0xdd>(u, v));
            let (u, v) =
                (isa._mm512_shuffle_f64x2::<0xdd>(t[0], t[1]), isa._mm512_shuffle_f64x2::<0xdd>(t[2], t[3]));
            store_8(rows, (parity + 2) * stride, isa._mm512_shuffle_f64x2::<0x88>(u, v));
            store_8(rows, (parity + 6) * stride, isa._mm512_shuffle_f64x2::<0xdd>(u, v));
        }
    }

    #[inline(always)]
    fn store_8(rows: &mut [f64], at: usize, value: __m512d) {
        let value: [f64; 8] = cast(value);
        rows[at..at + 8].copy_from_slice(&value);
    }

    /// Transposes in blocks of 4 × 4; the last block overlaps the one before it.
    #[inline(always)]
    pub(super) fn scatter_4(simd: V3, packs: &[Pack], rows: &mut [f64]) {
        let size = packs.len();
        let mut k = 0;
        loop {
            for half in 0..2 {
                transpose_4(simd, &packs[k..k + 4], half, &mut rows[4 * half * size + k..], size);
            }
            if k + 4 == size {
                return;
            }
            k = (k + 4).min(size - 4);
        }
    }

    #[inline(always)]
    fn transpose_4(simd: V3, packs: &[Pack], half: usize, rows: &mut [f64], stride: usize) {
        let isa = simd.avx;
        let mut r = [isa._mm256_setzero_pd(); 4];
        for k in 0..4 {
            let values = &packs[k].0[4 * half..4 * half + 4];
            r[k] = cast([values[0], values[1], values[2], values[3]]);
        }
        let (even_01, even_23) = (isa._mm256_unpacklo_pd(r[0], r[1]), isa._mm256_unpacklo_pd(r[2], r[3]));
        let (odd_01, odd_23) = (isa._mm256_unpackhi_pd(r[0], r[1]), isa._mm256_unpackhi_pd(r[2], r[3]));
        for (lane, value) in [
            isa._mm256_permute2f128_pd::<0x20>(even_01, even_23),
            isa._mm256_permute2f128_pd::<0x20>(odd_01, odd_23),
            isa._mm256_permute2f128_pd::<0x31>(even_01, even_23),
            isa._mm256_permute2f128_pd::<0x31>(odd_01, odd_23),
        ]
        .into_iter()
        .enumerate()
        {
            let value: [f64; 4] = cast(value);
            rows[lane * stride..lane * stride + 4].copy_from_slice(&value);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lanes::instructions::InstructionSet;

    struct RoundTrip;
    impl pulp::WithSimd for RoundTrip {
        type Output = ();
        fn with_simd<S: Simd>(self, simd: S) {
            let x: Vec<f64> = (0..60).map(f64::from).collect();
            let nodes: Vec<u32> = (0..16).map(|k| (7 * k + 19) % 20).collect();
            let found = gather(simd, &x, &nodes, 2);
            for i in 0..3 {
                let mut pack = Pack::default();
                pack.store(0, found[i]);
                for lane in 0..S::F64_LANES {
                    assert_eq!(pack.0[lane], x[3 * nodes[2 * lane] as usize + i], "{i} {lane}");
                }
            }
            for size in [1, 3, 4, 6, 8, 12, 30, 78] {
                let packs: Vec<Pack> =
                    (0..size).map(|k| Pack(std::array::from_fn(|lane| (100 * lane + k) as f64))).collect();
                let mut rows = vec![0.0; 8 * size];
                scatter_rows(simd, &packs, &mut rows);
                for lane in 0..8 {
                    for k in 0..size {
                        assert_eq!(rows[lane * size + k], (100 * lane + k) as f64, "{size}");
                    }
                }
            }
        }
    }

    #[test]
    fn every_instruction_set_moves_the_same_numbers() {
        for set in [InstructionSet::Scalar, InstructionSet::Avx2, InstructionSet::Avx512] {
            if let Ok(arch) = set.arch() {
                arch.dispatch(RoundTrip);
            }
        }
    }
}
