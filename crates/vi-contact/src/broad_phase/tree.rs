//! A binary tree of boxes over items in a given order, stored as a heap: the children of box i are 2i and 2i + 1, and each leaf
//! holds a few items. The order affects how fast items are found, but never which ones.

use super::boxes::{Bounds, LEAF, Leaf, Rounded};
use crate::distance::Vec3;

/// Number of the first box at the depth where a search of pairs is divided among threads.
const FRONT: u32 = 64;

#[derive(Debug)]
pub(crate) struct Tree {
    origin: Vec3,
    /// Boxes of the heap; the first is unused.
    boxes: Vec<Rounded>,
    /// The boxes of the items.
    leaves: Vec<Leaf>,
    /// Items in the order of the leaves.
    items: Vec<u32>,
    /// The place of each item in this order.
    places: Vec<u32>,
}

impl Tree {
    /// Builds the tree of items 0, 1, 2, … with these boxes, given in the order of the leaves. Trees that are searched together
    /// have the same origin.
    pub(crate) fn new(bounds: &[Bounds], order: &[u32], origin: Vec3) -> Self {
        let items = order.to_vec();
        let count = items.len().div_ceil(LEAF).next_power_of_two();
        let mut leaves = vec![Leaf::EMPTY; count];
        let mut boxes = vec![Rounded::EMPTY; 2 * count];
        for (number, items) in items.chunks(LEAF).enumerate() {
            for (place, &item) in items.iter().enumerate() {
                let bounds = bounds[item as usize].rounded(&origin);
                leaves[number].set(place, &bounds);
                boxes[count + number].join(&bounds);
            }
        }
        let mut places = vec![0; items.len()];
        (0..).zip(&items).for_each(|(place, &item)| places[item as usize] = place);
        let mut tree = Self { origin, boxes, leaves, items, places };
        (1..count).rev().for_each(|node| tree.join_children(node));
        tree
    }

    fn join_children(&mut self, node: usize) {
        let mut joined = self.boxes[2 * node];
        joined.join(&self.boxes[2 * node + 1]);
        self.boxes[node] = joined;
    }

    /// Gives an item another box.
    pub(crate) fn update(&mut self, item: u32, bounds: Bounds) {
        let place = self.places[item as usize] as usize;
        let number = place / LEAF;
        self.leaves[number].set(place % LEAF, &bounds.rounded(&self.origin));
        let mut node = self.leaves.len() + number;
        self.boxes[node] = self.leaves[number].joined();
        while node > 1 {
            node /= 2;
            self.join_children(node);
        }
    }

    /// Calls `found` with every item whose box overlaps `bounds` and is not of the same group, and perhaps with items that are
    /// apart by less than the rounding of boxes.
    #[inline]
    pub(crate) fn visit(&self, bounds: &Bounds, found: &mut impl FnMut(u32)) {
        let bounds = bounds.rounded(&self.origin);
        if !self.boxes[1].meets(&bounds) {
            return;
        }
        let mut stack = [0_u32; 64];
        let mut top = 1;
        stack[0] = 1;
        while top > 0 {
            top -= 1;
            let node = stack[top] as usize;
            if let Some(number) = node.checked_sub(self.leaves.len()) {
                let leaf = &self.leaves[number];
                leaf.each_of(leaf.overlapping(&bounds), bounds.group, |item| {
                    found(self.items[number * LEAF + item]);
                });
                continue;
            }
            for child in [2 * node + 1, 2 * node] {
                if self.boxes[child].meets(&bounds) {
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
            let [a, b] = [a as usize - self.leaves.len(), b as usize - other.leaves.len()];
            let (leaf, others) = (&self.leaves[a], &other.leaves[b]);
            for i in 0..LEAF.min(self.items.len().saturating_sub(a * LEAF)) {
                let bounds = leaf.get(i);
                let mut bits = others.overlapping(&bounds);
                if is_same && a == b {
                    bits &= u32::MAX << (i + 1);
                }
                others.each_of(bits, bounds.group, |j| {
                    found(self.items[a * LEAF + i], other.items[b * LEAF + j]);
                });
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
            let [is_leaf, other_is_leaf] =
                [a as usize >= self.leaves.len(), b as usize >= other.leaves.len()];
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
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::surface::LOOSE;
    use crate::testing::Numbers;

    /// Returns overlapping boxes of nodes that move by themselves, then of two groups that move as one.
    fn boxes() -> Vec<Bounds> {
        let x: Vec<f64> = (0..90).map(|k| 0.01 * f64::from(k % 30)).collect();
        (0..30).map(|node| Bounds::of(&[node], &x).inflated(1.0).of_group(node / 10)).collect()
    }

    #[test]
    fn parts_that_move_as_one_are_not_found() {
        let boxes = boxes();
        let tree = Tree::new(&boxes, &(0..30).collect::<Vec<u32>>(), Vec3::zeros());
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

    /// Boxes of size 1e-3 near 1e6 m that touch, or are apart by 1e-9 of their size or by less than single precision resolves.
    #[test]
    fn no_overlap_is_lost_by_rounding() {
        let mut numbers = Numbers::new(7);
        for origin in [0.0, 1e6, -3e9] {
            let boxes: Vec<Bounds> = (0..200)
                .map(|k| {
                    let mut bounds = Bounds::EMPTY;
                    let step = 1e-3 * (1.0 + 1e-9 * f64::from(k % 3 - 1));
                    let x = Vec3::new(f64::from(k % 20), f64::from(k / 20), 0.3 * numbers.unit());
                    bounds.surround(x * step + Vec3::repeat(origin), Vec3::repeat(0.5e-3));
                    bounds
                })
                .collect();
            let meets = |a: &Bounds, b: &Bounds| (0..3).all(|k| a.min[k] <= b.max[k] && b.min[k] <= a.max[k]);
            let order: Vec<u32> = (0..200).rev().collect();
            let tree = Tree::new(&boxes, &order, Vec3::repeat(origin + 1e-2));
            let mut pairs = std::collections::BTreeSet::new();
            for front in tree.fronts(&tree) {
                tree.visit_pairs(&tree, front, &mut |a, b| {
                    assert!(pairs.insert([a.min(b), a.max(b)]), "found twice");
                });
            }
            for (a, first) in (0..).zip(&boxes) {
                let mut found = Vec::new();
                tree.visit(first, &mut |item| found.push(item));
                for (b, second) in (0..).zip(&boxes) {
                    if meets(first, second) {
                        assert!(found.contains(&b), "{a} {b}");
                        assert!(a == b || pairs.contains(&[a.min(b), a.max(b)]), "{a} {b}");
                    }
                }
            }
        }
    }
}
