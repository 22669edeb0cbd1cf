//! An order of the elements of a region in which neighbours in space are neighbours in the list, so
//! that a run of them touches few nodes. It must not know what is summed over them.

use crate::Mesh;
use crate::pack::GROUP;

/// Bits of each coordinate that count.
const BITS: u32 = 20;

/// Sorts elements along Morton's curve through their centroids (G. M. Morton, 1966).
pub(crate) fn sort_by_place(mesh: &Mesh, elements: &mut [u32]) {
    let centroid = |element: u32| {
        let nodes = mesh.cell(element as usize).map_or(&[][..], |(_, nodes)| nodes);
        let mut sum = [0.0; 3];
        for &node in nodes {
            for i in 0..3 {
                sum[i] += mesh.points[node as usize][i] / nodes.len() as f64;
            }
        }
        sum
    };
    let (mut low, mut high) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
    for &element in elements.iter() {
        let point = centroid(element);
        for i in 0..3 {
            (low[i], high[i]) = (low[i].min(point[i]), high[i].max(point[i]));
        }
    }
    let extent = (0..3).map(|i| high[i] - low[i]).fold(0.0, f64::max);
    let scale = if extent > 0.0 { f64::from((1 << BITS) - 1) / extent } else { 0.0 };
    elements.sort_by_cached_key(|&element| {
        let point = centroid(element);
        (0..3).map(|i| spread(((point[i] - low[i]) * scale) as u64) << i).sum::<u64>()
    });
}

/// Deals the elements of each run of `run_length` into groups of eight, so that those of a group are an eighth of
/// the run apart: they share no node (but by chance), and what they add to the sums at their nodes does
/// not wait for each other.
pub(crate) fn interleave(run_length: usize, elements: &mut [u32]) {
    for run in elements.chunks_mut(run_length) {
        let (whole, _) = run.as_chunks_mut::<GROUP>();
        let sorted = whole.as_flattened().to_vec();
        for (k, group) in whole.iter_mut().enumerate() {
            for (lane, element) in group.iter_mut().enumerate() {
                *element = sorted[lane * (sorted.len() / GROUP) + k];
            }
        }
    }
}

/// Two zeros before each of the lowest 21 bits.
fn spread(bits: u64) -> u64 {
    let mut x = bits & 0x1f_ffff;
    for (shift, mask) in [
        (32, 0x1f_0000_0000_ffff),
        (16, 0x1f_0000_ff00_00ff),
        (8, 0x100f_00f0_0f00_f00f),
        (4, 0x10c3_0c30_c30c_30c3),
        (2, 0x1249_2492_4924_9249),
    ] {
        x = (x | x << shift) & mask;
    }
    x
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{BoxMesh, ElementKind};

    #[test]
    fn every_third_bit() {
        assert_eq!(spread(0b1011), 0b001_000_001_001);
        assert_eq!(spread(0x1f_ffff).count_ones(), 21);
    }

    #[test]
    fn groups_of_a_run_are_of_far_elements() {
        let mut elements: Vec<u32> = (0..150).collect();
        interleave(64, &mut elements);
        assert_eq!(elements[8..16], [1, 9, 17, 25, 33, 41, 49, 57]);
        assert_eq!(elements[64..72], [64, 72, 80, 88, 96, 104, 112, 120]);
        assert_eq!(
            elements[128..],
            [
                128, 130, 132, 134, 136, 138, 140, 142, 129, 131, 133, 135, 137, 139, 141, 143, 144, 145,
                146, 147, 148, 149
            ]
        );
    }

    #[test]
    fn runs_touch_few_nodes() {
        let mesh = BoxMesh {
            size: [4.0, 1.0, 1.0],
            cells: [32, 8, 8],
            element: ElementKind::Tet4,
            origin: [0.0; 3],
        };
        let mesh = mesh.build().unwrap();
        let mut elements = mesh.cells_of_dimension(3);
        let nodes_of = |elements: &[u32]| -> usize {
            let of_run = |run: &[u32]| {
                let mut nodes: Vec<u32> =
                    run.iter().flat_map(|&e| mesh.cell(e as usize).unwrap().1).copied().collect();
                nodes.sort_unstable();
                nodes.dedup();
                nodes.len()
            };
            elements.chunks(1024).map(of_run).sum()
        };
        let before = nodes_of(&elements);
        let all = elements.clone();
        sort_by_place(&mesh, &mut elements);
        assert!(nodes_of(&elements) < before * 3 / 4, "{} {before}", nodes_of(&elements));
        elements.sort_unstable();
        assert_eq!(elements, all);
    }
}
