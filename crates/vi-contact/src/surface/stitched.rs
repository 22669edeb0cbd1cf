//! Counts the pairs that stitches exclude from contact.

use std::collections::{BTreeMap, BTreeSet};

use super::Surface;

/// A pair that a stitch excludes.
#[derive(PartialEq, Eq, PartialOrd, Ord)]
enum Pair {
    PointCell(usize, usize),
    Edges(usize, usize),
}

impl Surface {
    /// Returns how many pairs of a point with a cell, and of two edges, are no pairs of contact because these stitches, each between two
    /// nodes, join nodes of both parts; by the numbers of both bodies, the lower first. Bodies that never meet do not count.
    pub fn stitched_pairs(&self, stitches: &[[u32; 2]]) -> BTreeMap<[u32; 2], usize> {
        let sewn: BTreeSet<u32> = stitches.iter().flatten().copied().collect();
        let by_node = |parts: Vec<&[u32]>| {
            let mut of_node = BTreeMap::<u32, BTreeSet<usize>>::new();
            for (number, nodes) in parts.into_iter().enumerate() {
                for node in nodes.iter().filter(|node| sewn.contains(node)) {
                    of_node.entry(*node).or_default().insert(number);
                }
            }
            move |node: u32| of_node.get(&node).cloned().unwrap_or_default()
        };
        let cells = by_node(self.cells.iter().map(|cell| &cell.nodes[..]).collect());
        let edges = by_node(self.edges.iter().map(|edge| &edge.nodes[..]).collect());
        let mut pairs = BTreeMap::<Pair, [u32; 2]>::new();
        let mut enter = |pair: Pair, [a, b]: [u32; 2]| {
            if self.law(a, b).is_some() {
                pairs.insert(pair, [a.min(b), a.max(b)]);
            }
        };
        for &[a, b] in stitches {
            for [a, b] in [[a, b], [b, a]] {
                let Ok(point) = self.points.binary_search_by_key(&a, |point| point.node) else { continue };
                for cell in cells(b).into_iter().filter(|&cell| !self.cells[cell].nodes.contains(&a)) {
                    enter(Pair::PointCell(point, cell), [self.points[point].body, self.cells[cell].body]);
                }
            }
            for first in edges(a) {
                for second in edges(b) {
                    let (one, other) = (&self.edges[first], &self.edges[second]);
                    if one.nodes.iter().all(|node| !other.nodes.contains(node)) {
                        enter(Pair::Edges(first.min(second), first.max(second)), [one.body, other.body]);
                    }
                }
            }
        }
        let mut counts = BTreeMap::new();
        pairs.into_values().for_each(|bodies| *counts.entry(bodies).or_insert(0) += 1);
        counts
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::surface::{Body, SurfaceBuilder};

    /// Returns two sheets of 3 × 3 nodes over each other, sewn by these stitches.
    fn sheets(stitches: &[[u32; 2]]) -> Surface {
        let place = |node: u32| [f64::from(node % 3), f64::from(node / 3 % 3), f64::from(node / 9)];
        let mut builder = SurfaceBuilder::new((0..18).flat_map(place).collect::<Vec<f64>>().as_slice());
        for first in [0, 9] {
            let body = builder.body(Body { radius: 0.0, distance: 0.1, stiffness: 1.0, meets_itself: true });
            let cell = |k: u32| {
                let corner = first + k % 2 + 3 * (k / 2);
                [[corner, corner + 1, corner + 4], [corner, corner + 4, corner + 3]]
            };
            builder.triangles(body, (0..4).flat_map(cell).collect::<Vec<_>>().as_slice());
        }
        stitches.iter().for_each(|&[a, b]| builder.stitch(a, b));
        builder.build().unwrap()
    }

    /// The counts are the numbers of pairs that are admitted without the stitches and not with them.
    #[test]
    fn the_counts_are_those_of_the_pairs_that_stitches_take() {
        for stitches in [&[[0, 9]][..], &[[4, 13]], &[[0, 9], [1, 10], [4, 13], [2, 6]], &[[8, 10], [8, 11]]]
        {
            let (loose, sewn) = (sheets(&[]), sheets(stitches));
            let mut counts = BTreeMap::<[u32; 2], usize>::new();
            let mut enter = |[a, b]: [u32; 2]| *counts.entry([a.min(b), a.max(b)]).or_default() += 1;
            for point in 0..loose.points.len() {
                for cell in 0..loose.cells.len() {
                    if loose.admits_point(point, cell) && !sewn.admits_point(point, cell) {
                        enter([loose.points[point].body, loose.cells[cell].body]);
                    }
                }
            }
            for a in 0..loose.edges.len() {
                for b in a + 1..loose.edges.len() {
                    if loose.admits_edges(a, b) && !sewn.admits_edges(a, b) {
                        enter([loose.edges[a].body, loose.edges[b].body]);
                    }
                }
            }
            assert_eq!(loose.stitched_pairs(stitches), counts, "{stitches:?}");
        }
    }
}
