//! Stores eight numbers of eight elements (or points) side by side: the unit that kernels load and store.

use std::ops::Range;

use pulp::Simd;
use vi_core::Patch;

use crate::lanes::real::Lane;

/// Number of elements per group. It does not depend on the machine, so that results do not either.
pub(crate) const GROUP: usize = 8;

/// One number for each element of a group.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
#[repr(C, align(64))]
pub(crate) struct Pack(pub(crate) [f64; GROUP]);

impl Pack {
    /// Loads lane group number `part`, of GROUP / S::F64_LANES in the pack.
    #[inline(always)]
    pub(crate) fn load<S: Simd>(&self, simd: S, part: usize) -> Lane<S> {
        Lane::new(simd, S::as_simd_f64s(&self.0).0[part])
    }

    #[inline(always)]
    pub(crate) fn store<S: Simd>(&mut self, part: usize, value: Lane<S>) {
        S::as_mut_simd_f64s(&mut self.0).0[part] = value.raw();
    }
}

/// Returns how many lane groups make a [`Pack`].
#[inline(always)]
pub(crate) const fn parts<S: Simd>() -> usize {
    GROUP / S::F64_LANES
}

/// Returns the elements of a group. The range of the last group may reach past the last element.
pub(crate) fn members(group: usize) -> Range<usize> {
    group * GROUP..(group + 1) * GROUP
}

/// Deals the elements of each run of `run_length` into groups of eight whose members lie an eighth of the run apart.
/// Such elements rarely share a node, so that their additions to nodal sums need not wait for each other.
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

/// Returns the place, before [`interleave`], of the element that is at `place` of a run of `length` elements after it.
pub(crate) fn sorted_place(place: usize, length: usize) -> usize {
    let groups = length / GROUP;
    if place < groups * GROUP { place % GROUP * groups + place / GROUP } else { place }
}

/// Largest number of nodes of an element.
const MOST_NODES: usize = 27;

/// Calls `work` with groups and the places of the nodes of all their elements, `node_count` per element, for a range
/// of elements. If only some lanes of the first or last group lie in the range, the places of the others are
/// [`Patch::NOWHERE`].
pub(crate) fn whole_groups(
    range: Range<usize>,
    places: &[u16],
    node_count: usize,
    mut work: impl FnMut(Range<usize>, &[u16]),
) {
    let mut element = range.start;
    while element < range.end {
        let group = element / GROUP;
        let rest = &places[(element - range.start) * node_count..];
        let end = if element.is_multiple_of(GROUP) { range.end / GROUP } else { group };
        if group < end {
            work(group..end, &rest[..(end - group) * GROUP * node_count]);
            element = end * GROUP;
        } else {
            let stop = range.end.min((group + 1) * GROUP);
            let mut padded = [Patch::NOWHERE; GROUP * MOST_NODES];
            let (first, length) = ((element % GROUP) * node_count, (stop - element) * node_count);
            padded[first..first + length].copy_from_slice(&rest[..length]);
            work(group..group + 1, &padded[..GROUP * node_count]);
            element = stop;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

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
}
