//! Axis-aligned boxes. Those of a tree are relative to an origin and rounded outwards to single precision, which halves their
//! size. Both roundings are monotonic, so no overlap is lost.

use crate::distance::{Vec3, at};
use crate::surface::LOOSE;

/// An axis-aligned box around parts of surfaces.
#[derive(Debug, Clone, Copy)]
pub(super) struct Bounds {
    pub(super) min: [f64; 3],
    pub(super) max: [f64; 3],
    /// The group of nodes whose parts form no pair with each other, if all nodes in the box belong to the same; otherwise [`LOOSE`].
    group: u32,
}

impl Bounds {
    pub(super) const EMPTY: Self =
        Self { min: [f64::INFINITY; 3], max: [f64::NEG_INFINITY; 3], group: LOOSE };

    /// Returns the box around nodes, which form pairs with all others.
    #[inline]
    pub(super) fn of(nodes: &[u32], x: &[f64]) -> Self {
        let mut bounds = Self::EMPTY;
        nodes.iter().for_each(|&node| bounds.surround(at(x, node), Vec3::zeros()));
        bounds
    }

    /// Makes the box contain all points within `by` of x along each axis.
    #[inline]
    pub(super) fn surround(&mut self, x: Vec3, by: Vec3) {
        for k in 0..3 {
            self.min[k] = self.min[k].min(x[k] - by[k]);
            self.max[k] = self.max[k].max(x[k] + by[k]);
        }
    }

    /// Returns the box for nodes of a group whose parts form no pair with each other, or [`LOOSE`] ones.
    #[inline]
    pub(super) fn of_group(self, group: u32) -> Self {
        Self { group, ..self }
    }

    #[inline]
    pub(super) fn inflated(mut self, by: f64) -> Self {
        for k in 0..3 {
            self.min[k] -= by;
            self.max[k] += by;
        }
        self
    }

    /// Returns the box relative to an origin, rounded outwards.
    #[inline]
    pub(super) fn rounded(&self, origin: &Vec3) -> Rounded {
        let mut rounded = Rounded { group: self.group, ..Rounded::EMPTY };
        for k in 0..3 {
            let (min, max) = (self.min[k] - origin[k], self.max[k] - origin[k]);
            let (low, high) = (min as f32, max as f32);
            rounded.min[k] = if f64::from(low) > min { low.next_down() } else { low };
            rounded.max[k] = if f64::from(high) < max { high.next_up() } else { high };
        }
        rounded
    }
}

/// A box in the tree.
#[derive(Debug, Clone, Copy)]
pub(super) struct Rounded {
    min: [f32; 3],
    max: [f32; 3],
    pub(super) group: u32,
}

/// The group of an empty box.
const NO_NODES: u32 = u32::MAX;

impl Rounded {
    pub(super) const EMPTY: Self =
        Self { min: [f32::INFINITY; 3], max: [f32::NEG_INFINITY; 3], group: NO_NODES };

    #[inline]
    pub(super) fn join(&mut self, other: &Self) {
        for k in 0..3 {
            self.min[k] = self.min[k].min(other.min[k]);
            self.max[k] = self.max[k].max(other.max[k]);
        }
        self.group = match (self.group, other.group) {
            (NO_NODES, group) | (group, NO_NODES) => group,
            (one, other) if one == other => one,
            _ => LOOSE,
        };
    }

    /// Returns whether the boxes overlap and are not of the same group.
    #[inline]
    pub(super) fn meets(&self, other: &Self) -> bool {
        // Compare all axes without a branch.
        (self.min[0] <= other.max[0])
            & (other.min[0] <= self.max[0])
            & (self.min[1] <= other.max[1])
            & (other.min[1] <= self.max[1])
            & (self.min[2] <= other.max[2])
            & (other.min[2] <= self.max[2])
            & ((self.group != other.group) | (self.group == LOOSE))
    }
}

/// Number of items per leaf, whose boxes are compared at once.
pub(super) const LEAF: usize = 8;

/// The boxes of the items of a leaf, side by side, so that the compiler compares them with vector instructions.
#[derive(Debug, Clone, Copy)]
pub(super) struct Leaf {
    min: [[f32; LEAF]; 3],
    max: [[f32; LEAF]; 3],
    group: [u32; LEAF],
}

impl Leaf {
    pub(super) const EMPTY: Self = Self {
        min: [[f32::INFINITY; LEAF]; 3],
        max: [[f32::NEG_INFINITY; LEAF]; 3],
        group: [NO_NODES; LEAF],
    };

    #[inline]
    pub(super) fn set(&mut self, item: usize, bounds: &Rounded) {
        for axis in 0..3 {
            self.min[axis][item] = bounds.min[axis];
            self.max[axis][item] = bounds.max[axis];
        }
        self.group[item] = bounds.group;
    }

    #[inline]
    pub(super) fn get(&self, item: usize) -> Rounded {
        let [mut min, mut max] = [[0.0; 3]; 2];
        for axis in 0..3 {
            min[axis] = self.min[axis][item];
            max[axis] = self.max[axis][item];
        }
        Rounded { min, max, group: self.group[item] }
    }

    /// Returns the box around all items.
    pub(super) fn joined(&self) -> Rounded {
        let mut joined = Rounded::EMPTY;
        (0..LEAF).for_each(|item| joined.join(&self.get(item)));
        joined
    }

    /// Returns the items whose boxes overlap another one, a bit for each.
    #[inline]
    pub(super) fn overlapping(&self, other: &Rounded) -> u32 {
        let larger = |a: f32, b: f32| if a > b { a } else { b };
        let mut gaps = [f32::NEG_INFINITY; LEAF];
        for axis in 0..3 {
            let (min, max) = (other.min[axis], other.max[axis]);
            for item in 0..LEAF {
                let gap = larger(self.min[axis][item] - max, min - self.max[axis][item]);
                gaps[item] = larger(gaps[item], gap);
            }
        }
        // Select constants first, because shifts of single bits would not be vector instructions.
        let mut bits = [0; LEAF];
        for item in 0..LEAF {
            bits[item] = if gaps[item] <= 0.0 { 1_u32 << item } else { 0 };
        }
        bits.into_iter().fold(0, |all, bit| all | bit)
    }

    /// Calls `found` with each item of `bits` that is not in `group`; with all items if `group` is [`LOOSE`].
    #[inline]
    pub(super) fn each_of(&self, mut bits: u32, group: u32, mut found: impl FnMut(usize)) {
        while bits != 0 {
            let item = bits.trailing_zeros() as usize;
            bits &= bits - 1;
            if self.group[item] != group || group == LOOSE {
                found(item);
            }
        }
    }
}
