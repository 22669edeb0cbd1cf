//! The constants of two edges. They are computed wherever a pair is evaluated, because lists have millions of pairs.

use super::{Gauge, Law, Surface, WELDED, within_rest};
use crate::distance::{Shape, at};
use crate::pairs::Blend;

/// Two edges that may meet.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct EdgePair {
    /// Numbers of the edges.
    pub(crate) edges: [u32; 2],
    /// Nodes of both edges.
    pub(crate) nodes: [u32; 4],
    /// Constants of the pair. The part that acts over the whole distance has the weight χ_a χ_b.
    pub(crate) gauge: Gauge,
    /// The distance from which on the pair exerts no force, m: for flat edges, less than the thickness plus d̂.
    pub(crate) reach: f64,
}

impl Surface {
    /// Returns a pair of edges; `None` if they form none.
    #[inline]
    pub(crate) fn edge_pair(&self, edges: [u32; 2]) -> Option<EdgePair> {
        let widest = self.widest_edge_pair(edges)?;
        let [a, b] = edges.map(|edge| &self.edges[edge as usize]);
        if a.body != b.body {
            return Some(widest);
        }
        let Gauge { thickness, distance, energy } = widest.gauge;
        let x = widest.nodes.map(|node| at(&self.rest, node));
        // From this distance at rest on, it restricts neither the thickness nor d̂. Most pairs are farther apart.
        let far = 1.000_001 * (thickness + 2.0 * distance).max(2.0 * thickness);
        if Shape::EdgeEdge.is_apart(&x, far * far) {
            return Some(widest);
        }
        let rest = self.rest_distance(Shape::EdgeEdge, widest.nodes);
        if rest <= WELDED * distance {
            return None;
        }
        let [thickness, within] = within_rest(thickness, distance, rest);
        let stiffness = self.law(a.body, b.body)?.stiffness;
        let energy = if within == distance { energy } else { self.edge_energy(edges, stiffness, within) };
        let gauge = Gauge { thickness, distance: within, energy };
        Some(self.with_reach(edges, widest.nodes, gauge))
    }

    /// Returns a pair of edges, with the largest thickness and d̂ that it can have: those of a pair that is far apart at rest.
    #[inline]
    pub(crate) fn widest_edge_pair(&self, edges: [u32; 2]) -> Option<EdgePair> {
        let [a, b] = edges.map(|edge| &self.edges[edge as usize]);
        let Law { distance, stiffness, .. } = self.law(a.body, b.body)?;
        let thickness = self.radius(a.body) + self.radius(b.body);
        let gauge = Gauge { thickness, distance, energy: self.edge_energy(edges, stiffness, distance) };
        Some(self.with_reach(edges, [a.nodes[0], a.nodes[1], b.nodes[0], b.nodes[1]], gauge))
    }

    /// Returns the scale of the energy of two edges with a layer modulus (Pa) and an activation distance (m), J.
    ///
    /// The crossing represents the area A B/(A + B) if the edges represent A and B: half of it if both are equal, and no more than the
    /// smaller one, however long the other edge is. Several short edges cross a long one, and each of them takes its own part.
    #[inline]
    fn edge_energy(&self, edges: [u32; 2], stiffness: f64, distance: f64) -> f64 {
        let [a, b] = edges.map(|edge| &self.edges[edge as usize]);
        a.area * b.area / (a.area + b.area) * stiffness * distance
    }

    #[inline]
    fn with_reach(&self, edges: [u32; 2], nodes: [u32; 4], gauge: Gauge) -> EdgePair {
        let [a, b] = edges.map(|edge| &self.edges[edge as usize]);
        let reach = gauge.thickness + Blend::of_edges(self.barrier, a, b).reach() * gauge.distance;
        EdgePair { edges, nodes, gauge, reach }
    }
}

#[cfg(test)]
mod tests {
    use crate::surface::{Body, Surface, SurfaceBuilder};

    /// Returns the surface of an edge of this length (m) that crosses one of .2 m.
    fn crossing(length: f64) -> Surface {
        let end = 0.5 * length;
        let x = [-end, 0.0, 0.2, end, 0.0, 0.2, 0.0, -0.1, 0.0, 0.0, 0.1, 0.0];
        let mut builder = SurfaceBuilder::new(&x);
        let mut body =
            || builder.body(Body { radius: 0.05, distance: 0.01, stiffness: 1e5, meets_itself: false });
        let bodies = [body(), body()];
        builder.segment(bodies[0], [0, 1], 1e-3);
        builder.segment(bodies[1], [2, 3], 1e-3);
        builder.build().expect("a valid surface")
    }

    /// However long an edge is, its crossing with a short one has no more energy than twice that of two short ones.
    #[test]
    fn a_crossing_represents_no_more_than_the_smaller_area() {
        let energy = |length: f64| {
            let surface = crossing(length);
            surface.edge_pair([0, 1]).expect("two edges that may meet").gauge.energy
        };
        for (length, ratio) in [(0.2, 1.0), (20.0, 40.0 / 20.2), (2e6, 2.0), (2e-3, 4e-3 / 0.202)] {
            let found = energy(length) / energy(0.2);
            assert!((found - ratio).abs() < 1e-6, "{length}: {found}");
        }
    }
}
