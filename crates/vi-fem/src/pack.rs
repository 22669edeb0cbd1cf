//! Eight numbers of eight elements (or points) side by side: the unit that kernels load and store.
//! It must not know what the numbers mean.

use pulp::Simd;

use crate::real::Lane;

/// Elements a group, whatever the width of the machine: results must not depend on it.
pub(crate) const GROUP: usize = 8;

/// One number of each element of a group.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
#[repr(C, align(64))]
pub(crate) struct Pack(pub(crate) [f64; GROUP]);

impl Pack {
    /// Lane group `part` of GROUP / S::F64_LANES.
    #[inline(always)]
    pub(crate) fn load<S: Simd>(&self, simd: S, part: usize) -> Lane<S> {
        Lane::new(simd, S::as_simd_f64s(&self.0).0[part])
    }

    #[inline(always)]
    pub(crate) fn store<S: Simd>(&mut self, part: usize, value: Lane<S>) {
        S::as_mut_simd_f64s(&mut self.0).0[part] = value.raw();
    }
}

/// How many lane groups make a [`Pack`].
#[inline(always)]
pub(crate) const fn parts<S: Simd>() -> usize {
    GROUP / S::F64_LANES
}

/// The elements of a group; the last group may be short of some.
pub(crate) fn members(group: usize) -> std::ops::Range<usize> {
    group * GROUP..(group + 1) * GROUP
}
