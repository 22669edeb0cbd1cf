//! Finds rims of two bodies that lie on each other.
//!
//! A node over a face presses along the normal of the face. Over a rim it presses along the line to the rim, so that at a
//! distance s beside it and a gap g it is pushed aside by N s/√(g² + s²), where N is its force. The push grows with s, at most by N/g, which
//! is more than the stiffness of most bodies against it: nodes that are pressed onto a rim slide off it, by up to d̂.

use super::Contact;
use super::edges::Mollifier;
use crate::distance::{Shape, at};

/// Edges lie on each other up to this multiple of the reach of their pair. Increments from rest may fail where bodies have just not come
/// into their layer.
const BEFORE_CONTACT: f64 = 1.25;

impl Contact<'_> {
    /// Returns whether sharp edges of two bodies, each other's candidates, lie along each other at x: nearly parallel, and with
    /// the middle of the shorter one about d̂ from the other.
    pub fn rims_coincide(&self, [first, second]: [u32; 2], x: &[f64]) -> bool {
        self.neighbours.edges.iter().any(|&edges| {
            let [a, b] = edges.map(|edge| &self.surface.edges[edge as usize]);
            let is_between = [a.body, b.body] == [first, second] || [b.body, a.body] == [first, second];
            if !is_between || a.sharpness < 1.0 || b.sharpness < 1.0 {
                return false;
            }
            let Some(pair) = self.surface.edge_pair(edges) else { return false };
            let places = pair.nodes.map(|node| at(x, node));
            let [i, j, k, l] = places;
            let [shorter, [from, to]] =
                if a.square <= b.square { [[i, j], [k, l]] } else { [[k, l], [i, j]] };
            let middle = (shorter[0] + shorter[1]) * 0.5;
            let apart = Shape::PointEdge.closest(&[middle, from, to, to]).distance();
            let is_parallel = Mollifier::new(a, b).value(Mollifier::argument(&places)) < 1.0;
            is_parallel && apart < BEFORE_CONTACT * pair.gauge.reach()
        })
    }
}
