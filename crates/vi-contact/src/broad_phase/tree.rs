//! A binary tree of boxes over items in Morton order (Morton 1966), stored as a heap: the children of box i are 2i
//! and 2i + 1, and each leaf holds a few items. The tree affects how fast items are found, but never which ones.

use std::ops::Range;

use crate::distance::at;
use crate::surface::LOOSE;

/// An axis-aligned box around parts of surfaces.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Bounds {
    pub(crate) min: [f64; 3],
    pub(crate) max: [f64; 3],
    /// The group of nodes that move as one, if all nodes in the box belong to the same; otherwise [`LOOSE`].
    held: u32,
}

/// The group of an empty box.
const NO_NODES: u32 = u32::MAX;

impl Bounds {
    pub(crate) const EMPTY: Self =
        Self { min: [f64::INFINITY; 3], max: [f64::NEG_INFINITY; 3], held: NO_NODES };

    /// Returns the box around nodes, as if each of them moved by itself.
    #[inline]
    pub(crate) fn of(nodes: &[u32], x: &[f64]) -> Self {
        let mut bounds = Self::EMPTY;
        for &node in nodes {
            let x = at(x, node);
            for k in 0..3 {
                bounds.min[k] = bounds.min[k].min(x[k]);
                bounds.max[k] = bounds.max[k].max(x[k]);
            }
        }
        bounds.held = LOOSE;
        bounds
    }

    /// Returns the box for nodes of a group that moves as one, or [`LOOSE`] ones.
    #[inline]
    pub(crate) fn of_group(self, held: u32) -> Self {
        Self { held, ..self }
    }

    #[inline]
    pub(crate) fn inflated(mut self, by: f64) -> Self {
        for k in 0..3 {
            self.min[k] -= by;
            self.max[k] += by;
        }
        self
    }

    #[inline]
    pub(crate) fn join(&mut self, other: &Self) {
        for k in 0..3 {
            self.min[k] = self.min[k].min(other.min[k]);
            self.max[k] = self.max[k].max(other.max[k]);
        }
        self.held = match (self.held, other.held) {
            (NO_NODES, held) | (held, NO_NODES) => held,
            (one, other) if one == other => one,
            _ => LOOSE,
        };
    }

    /// Returns whether the boxes overlap and do not move as one. Parts that move as one form no pair.
    #[inline]
    pub(crate) fn meets(&self, other: &Self) -> bool {
        // Compare all axes without a branch.
        (self.min[0] <= other.max[0])
            & (other.min[0] <= self.max[0])
            & (self.min[1] <= other.max[1])
            & (other.min[1] <= self.max[1])
            & (self.min[2] <= other.max[2])
            & (other.min[2] <= self.max[2])
            & ((self.held != other.held) | (self.held == LOOSE))
    }
}

/// Number of items per leaf. Of 2, 4 and 8, 4 was the fastest for a rebuild of two folded sheets of 80 000 triangles.
const LEAF: usize = 4;

/// Number of the first box at the depth where a search of pairs is divided among threads.
const FRONT: u32 = 64;

#[derive(Debug)]
pub(crate) struct Tree {
    /// Boxes of the heap; the first is unused.
    boxes: Vec<Bounds>,
    /// Items in Morton order, and their boxes.
    items: Vec<u32>,
    item_boxes: Vec<Bounds>,
    /// The place of each item in Morton order.
    places: Vec<u32>,
    leaves: usize,
}

impl Tree {
    /// Builds the tree of items 0, 1, 2, … with these boxes.
    pub(crate) fn new(bounds: &[Bounds]) -> Self {
        let mut all = Bounds::EMPTY;
        bounds.iter().for_each(|item| all.join(item));
        let mut codes: Vec<(u64, u32)> =
            bounds.iter().zip(0..).map(|(item, number)| (morton(item, &all), number)).collect();
        codes.sort_unstable();
        let items: Vec<u32> = codes.into_iter().map(|(_, item)| item).collect();
        let item_boxes: Vec<Bounds> = items.iter().map(|&item| bounds[item as usize]).collect();
        let leaves = items.len().div_ceil(LEAF).next_power_of_two();
        let mut boxes = vec![Bounds::EMPTY; 2 * leaves];
        for (leaf, items) in item_boxes.chunks(LEAF).enumerate() {
            items.iter().for_each(|item| boxes[leaves + leaf].join(item));
        }
        for node in (1..leaves).rev() {
            let mut joined = boxes[2 * node];
            joined.join(&boxes[2 * node + 1]);
            boxes[node] = joined;
        }
        let mut places = vec![0; items.len()];
        (0..).zip(&items).for_each(|(place, &item)| places[item as usize] = place);
        Self { boxes, items, item_boxes, places, leaves }
    }

    /// Gives an item another box.
    pub(crate) fn update(&mut self, item: u32, bounds: Bounds) {
        let place = self.places[item as usize] as usize;
        self.item_boxes[place] = bounds;
        let leaf = place / LEAF;
        let mut joined = Bounds::EMPTY;
        let last = ((leaf + 1) * LEAF).min(self.items.len());
        self.item_boxes[leaf * LEAF..last].iter().for_each(|item| joined.join(item));
        let mut node = self.leaves + leaf;
        self.boxes[node] = joined;
        while node > 1 {
            node /= 2;
            let mut joined = self.boxes[2 * node];
            joined.join(&self.boxes[2 * node + 1]);
            self.boxes[node] = joined;
        }
    }

    /// Calls `found` with every item whose box overlaps `bounds` and does not move as one with it.
    #[inline]
    pub(crate) fn visit(&self, bounds: &Bounds, found: &mut impl FnMut(u32)) {
        if !self.boxes[1].meets(bounds) {
            return;
        }
        let mut stack = [0_u32; 64];
        let mut top = 1;
        stack[0] = 1;
        while top > 0 {
            top -= 1;
            let node = stack[top] as usize;
            if node >= self.leaves {
                let first = (node - self.leaves) * LEAF;
                let last = (first + LEAF).min(self.items.len());
                for k in first..last {
                    if self.item_boxes[k].meets(bounds) {
                        found(self.items[k]);
                    }
                }
                continue;
            }
            for child in [2 * node + 1, 2 * node] {
                if self.boxes[child].meets(bounds) {
                    stack[top] = child as u32;
                    top += 1;
                }
            }
        }
    }

    /// Returns pairs of a box of this tree and one of `other` that overlap. Together they contain all pairs of items whose boxes
    /// overlap. They are parts of [`Tree::visit_pairs`] for several threads. If both are the same tree, each pair of items is
    /// contained once.
    pub(crate) fn fronts(&self, other: &Self) -> Vec<[u32; 2]> {
        let mut fronts = Vec::new();
        self.descend(other, [1, 1], |[a, b]| a >= FRONT || b >= FRONT, &mut |front| fronts.push(front));
        fronts
    }

    /// Calls `found` with every pair of an item of this tree and one of `other` whose boxes overlap, within a pair of boxes of
    /// [`Tree::fronts`]. If both are the same tree, the order of both items is arbitrary.
    #[inline]
    pub(crate) fn visit_pairs(&self, other: &Self, front: [u32; 2], found: &mut impl FnMut(u32, u32)) {
        let is_same = std::ptr::eq(self, other);
        self.descend(other, front, |_| false, &mut |[a, b]| {
            let [of_a, of_b] = [self.items_of(a), other.items_of(b)];
            for i in of_a {
                let first = if is_same && a == b { i + 1 } else { of_b.start };
                for j in first..of_b.end {
                    if self.item_boxes[i].meets(&other.item_boxes[j]) {
                        found(self.items[i], other.items[j]);
                    }
                }
            }
        });
    }

    /// Calls `found` with the pairs of overlapping boxes below `front` that are leaves or that `is_end` accepts.
    #[inline]
    fn descend(
        &self,
        other: &Self,
        front: [u32; 2],
        is_end: impl Fn([u32; 2]) -> bool,
        found: &mut impl FnMut([u32; 2]),
    ) {
        let is_same = std::ptr::eq(self, other);
        if !self.boxes[front[0] as usize].meets(&other.boxes[front[1] as usize]) {
            return;
        }
        let mut stack = vec![front];
        while let Some([a, b]) = stack.pop() {
            let [is_leaf, other_is_leaf] = [a as usize >= self.leaves, b as usize >= other.leaves];
            if is_leaf && other_is_leaf || is_end([a, b]) {
                found([a, b]);
                continue;
            }
            let of_a = if is_leaf { a..a + 1 } else { 2 * a..2 * a + 2 };
            let of_b = if other_is_leaf { b..b + 1 } else { 2 * b..2 * b + 2 };
            for a in of_a {
                for b in of_b.clone() {
                    let is_twice = is_same && a > b;
                    if !is_twice && self.boxes[a as usize].meets(&other.boxes[b as usize]) {
                        stack.push([a, b]);
                    }
                }
            }
        }
    }

    /// Returns the places of the items of a leaf.
    fn items_of(&self, leaf: u32) -> Range<usize> {
        let first = (leaf as usize - self.leaves) * LEAF;
        first.min(self.items.len())..(first + LEAF).min(self.items.len())
    }
}

/// Returns 21 bits of each coordinate of the centre, interleaved.
fn morton(item: &Bounds, all: &Bounds) -> u64 {
    let mut code = 0;
    for k in 0..3 {
        let size = all.max[k] - all.min[k];
        let part = 0.5 * (item.min[k] + item.max[k]) - all.min[k];
        let unit = if size > 0.0 { (part / size).clamp(0.0, 1.0) } else { 0.0 };
        code |= spread((unit * 2_097_151.0) as u64) << k;
    }
    code
}

/// Inserts two zero bits between the bits of a number below 2²¹.
fn spread(mut bits: u64) -> u64 {
    bits = (bits | (bits << 32)) & 0x1f_0000_0000_ffff;
    bits = (bits | (bits << 16)) & 0x1f_0000_ff00_00ff;
    bits = (bits | (bits << 8)) & 0x100f_00f0_0f00_f00f;
    bits = (bits | (bits << 4)) & 0x10c3_0c30_c30c_30c3;
    (bits | (bits << 2)) & 0x1249_2492_4924_9249
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns overlapping boxes of nodes that move by themselves, then of two groups that move as one.
    fn boxes() -> Vec<Bounds> {
        let x: Vec<f64> = (0..90).map(|k| 0.01 * f64::from(k % 30)).collect();
        (0..30).map(|node| Bounds::of(&[node], &x).inflated(1.0).of_group(node / 10)).collect()
    }

    #[test]
    fn parts_that_move_as_one_are_not_found() {
        let boxes = boxes();
        let tree = Tree::new(&boxes);
        let mut pairs = Vec::new();
        for front in tree.fronts(&tree) {
            tree.visit_pairs(&tree, front, &mut |a, b| pairs.push([a.min(b), a.max(b)]));
        }
        pairs.sort_unstable();
        let group = |item: u32| item / 10;
        let all = (0..30).flat_map(|a| (a + 1..30).map(move |b| [a, b]));
        let expected: Vec<[u32; 2]> =
            all.filter(|&[a, b]| group(a) != group(b) || group(a) == LOOSE).collect();
        assert_eq!(pairs, expected);
        let mut found = Vec::new();
        tree.visit(&boxes[15], &mut |item| found.push(item));
        found.sort_unstable();
        assert_eq!(found, (0..10).chain(20..30).collect::<Vec<u32>>());
    }
}
