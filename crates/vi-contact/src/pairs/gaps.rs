//! The gaps of candidates, whether or not they act.

use std::collections::BTreeMap;

use super::Contact;
use crate::distance::{Shape, at};

/// The gap of a candidate at one configuration.
#[derive(Debug, Clone, PartialEq)]
pub struct Gap {
    /// The distance minus half the thickness of both sides, m.
    pub gap: f64,
    /// Activation distance d̂, m.
    pub distance: f64,
    /// The bodies of both parts.
    pub bodies: [u32; 2],
    /// The nodes of both parts: one and one to three, or two and two. A half-space has one node.
    pub nodes: [Vec<u32>; 2],
}

impl Gap {
    /// Returns whether the parts consist of these nodes, in any order and with repetitions.
    pub fn has_nodes(&self, nodes: &[u32]) -> bool {
        let own = || self.nodes.iter().flatten();
        own().all(|node| nodes.contains(node)) && nodes.iter().all(|node| own().any(|own| own == node))
    }
}

impl Contact<'_> {
    /// Returns the smallest gap of all candidates at x, m; infinite if there are none.
    pub fn smallest_gap(&self, x: &[f64]) -> f64 {
        self.gaps(x).map(|gap| gap.gap).fold(f64::INFINITY, f64::min)
    }

    /// Returns the smallest gap (m) of the candidates of each pair of bodies at x, by the numbers of both bodies.
    pub fn smallest_gaps(&self, x: &[f64]) -> BTreeMap<[u32; 2], f64> {
        let mut smallest = BTreeMap::new();
        for Gap { gap, bodies: [a, b], .. } in self.gaps(x) {
            let least = smallest.entry([a.min(b), a.max(b)]).or_insert(f64::INFINITY);
            *least = gap.min(*least);
        }
        smallest
    }

    /// Iterates over the gaps of all candidates at x.
    pub fn gaps(&self, x: &[f64]) -> impl Iterator<Item = Gap> {
        let surface = self.surface;
        let points = self.neighbours.starts.windows(2).enumerate().flat_map(move |(point, range)| {
            let part = surface.points[point];
            let cells = &self.neighbours.cells[range[0] as usize..range[1] as usize];
            cells.iter().filter_map(move |&cell| {
                let cell = &surface.cells[cell as usize];
                let gauge = surface.point_gauge(point, cell.body)?;
                let [a, b, c] = cell.nodes;
                let closest = cell.shape().closest(&[part.node, a, b, c].map(|node| at(x, node)));
                Some(Gap {
                    gap: closest.distance() - gauge.thickness,
                    distance: gauge.distance,
                    bodies: [part.body, cell.body],
                    nodes: [vec![part.node], cell.nodes().to_vec()],
                })
            })
        });
        let edges = self.neighbours.edges.iter().filter_map(move |&edges| {
            let pair = surface.edge_pair(edges)?;
            let [i, j, k, l] = pair.nodes;
            let closest = Shape::EdgeEdge.closest(&[i, j, k, l].map(|node| at(x, node)));
            Some(Gap {
                gap: closest.distance() - pair.gauge.thickness,
                distance: pair.gauge.distance,
                bodies: edges.map(|edge| surface.edges[edge as usize].body),
                nodes: [vec![i, j], vec![k, l]],
            })
        });
        let planes = self.neighbours.planes.iter().filter_map(move |&[point, plane]| {
            let gauge = surface.plane_gauge(point as usize, plane as usize)?;
            let (part, face) = (surface.points[point as usize], &surface.half_spaces[plane as usize]);
            Some(Gap {
                gap: self.height(point, plane, x) - gauge.thickness,
                distance: gauge.distance,
                bodies: [part.body, face.body],
                nodes: [vec![part.node], vec![face.node]],
            })
        });
        points.chain(edges).chain(planes)
    }
}
