//! Verlet lists (Verlet 1967): all pairs nearer than their activation distance plus a margin, at one configuration.
//! While no node has moved farther than half the margin, no pair outside the lists can act or meet.

use rayon::prelude::*;

use super::tree::{Bounds, Tree};
use crate::distance::{Shape, at};
use crate::surface::{Edge, Gauge, Surface};

/// Number of queries per task.
const CHUNK: usize = 1024;

/// Two edges that may meet.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EdgePair {
    /// Numbers of the edges, the lower first.
    pub edges: [u32; 2],
    /// Constants of the pair.
    pub gauge: Gauge,
}

/// Candidates for contact near one configuration, in the order of their numbers.
#[derive(Debug, Clone, Default)]
pub struct Neighbours {
    reference: Vec<f64>,
    margin: f64,
    /// The points that are near any cell, ascending.
    near: Vec<u32>,
    /// Index in `cells` of the first cell of each point, followed by the total number.
    pub(crate) starts: Vec<u32>,
    pub(crate) cells: Vec<u32>,
    pub(crate) edges: Vec<EdgePair>,
    /// Point and half-space of each pair.
    pub(crate) planes: Vec<[u32; 2]>,
}

impl Neighbours {
    /// Returns all pairs nearer than their activation distance plus `margin` (m) at positions x.
    pub fn find(surface: &Surface, x: &[f64], margin: f64) -> Self {
        let (starts, cells) = near_cells(surface, x, margin);
        let edges = near_edges(surface, x, margin);
        let mut planes = Vec::new();
        for point in 0..surface.points.len() {
            for plane in 0..surface.half_spaces.len() {
                let (node, face) = (surface.points[point].node, &surface.half_spaces[plane]);
                let Some(gauge) = surface.plane_gauge(point, plane) else { continue };
                let height = face.normal.dot(&(at(x, node) - at(x, face.node)));
                let is_pair =
                    !surface.is_rigid(&[node, face.node]) && !surface.is_held_to_plane(point, plane);
                if height < gauge.thickness + gauge.distance + margin && is_pair {
                    planes.push([point as u32, plane as u32]);
                }
            }
        }
        let near = with_cells(&starts);
        Self { reference: x.to_vec(), margin, near, starts, cells, edges, planes }
    }

    /// Returns those of the pairs that can act or meet while no node is farther than its `reach` (m) from x. All such
    /// configurations must be covered by this list. The returned list has no margin: it covers only x.
    pub fn narrowed(&self, surface: &Surface, x: &[f64], reach: &[f64]) -> Self {
        let margin_of = |nodes: &[u32]| nodes.iter().map(|&node| reach[node as usize]).fold(0.0, f64::max);
        let is_near = |shape: Shape, nodes: [u32; 4], gauge: &Gauge| {
            // The margin of a pair is the sum over both sides of the largest reach of their nodes.
            let (first, second) = nodes.split_at(if shape == Shape::EdgeEdge { 2 } else { 1 });
            let margin = margin_of(first) + margin_of(second);
            let reach = gauge.thickness + gauge.distance + margin;
            shape.closest(&nodes.map(|node| at(x, node))).squared < reach * reach
        };
        let (mut starts, mut cells) = (Vec::with_capacity(self.starts.len()), Vec::new());
        starts.push(0);
        let mut near = self.near.iter().peekable();
        for point in 0..surface.points.len() {
            if near.next_if(|&&other| other as usize == point).is_some() {
                cells.extend(self.cells_of(point).iter().filter(|&&cell| {
                    let cell = &surface.cells[cell as usize];
                    let [a, b, c] = cell.nodes;
                    let gauge = surface.point_gauge(point, cell.body);
                    gauge.is_some_and(|gauge| {
                        is_near(cell.shape(), [surface.points[point].node, a, b, c], &gauge)
                    })
                }));
            }
            starts.push(cells.len() as u32);
        }
        let edges = self.edges.iter().filter(|pair| {
            let [[i, j], [k, l]] = pair.edges.map(|edge| surface.edges[edge as usize].nodes);
            is_near(Shape::EdgeEdge, [i, j, k, l], &pair.gauge)
        });
        let planes = self.planes.iter().filter(|&&[point, plane]| {
            let (node, face) = (surface.points[point as usize].node, &surface.half_spaces[plane as usize]);
            let height = face.normal.dot(&(at(x, node) - at(x, face.node)));
            let gauge = surface.plane_gauge(point as usize, plane as usize);
            let margin = margin_of(&[node, face.node]) + margin_of(&[face.node]);
            gauge.is_some_and(|gauge| height < gauge.thickness + gauge.distance + margin)
        });
        let (edges, planes) = (edges.copied().collect(), planes.copied().collect());
        let near = with_cells(&starts);
        Self { reference: x.to_vec(), margin: 0.0, near, starts, cells, edges, planes }
    }

    /// Returns the points that are near any cell, ascending.
    pub(crate) fn near(&self) -> &[u32] {
        &self.near
    }

    /// Returns whether every pair that can act or meet at x is among the candidates. This holds while 2 max|Δx| ≤
    /// margin. The set of such x is convex: if it contains both ends of a straight path, it contains the path.
    pub fn covers(&self, surface: &Surface, x: &[f64]) -> bool {
        let limit = 0.25 * self.margin * self.margin;
        surface.nodes().all(|node| (at(x, node) - at(&self.reference, node)).norm_squared() <= limit)
    }

    /// Returns the margin, m.
    pub fn margin(&self) -> f64 {
        self.margin
    }

    /// Returns the number of candidates of all kinds.
    pub fn count(&self) -> usize {
        self.cells.len() + self.edges.len() + self.planes.len()
    }

    /// Returns the cells near a point.
    pub fn cells_of(&self, point: usize) -> &[u32] {
        &self.cells[self.starts[point] as usize..self.starts[point + 1] as usize]
    }

    /// Returns the pairs of edges.
    pub fn edge_pairs(&self) -> &[EdgePair] {
        &self.edges
    }

    /// Returns the points near half-spaces, as numbers of both.
    pub fn plane_pairs(&self) -> &[[u32; 2]] {
        &self.planes
    }
}

/// Returns the points whose list of cells is not empty.
fn with_cells(starts: &[u32]) -> Vec<u32> {
    (0..).zip(starts.windows(2)).filter(|(_, range)| range[0] < range[1]).map(|(point, _)| point).collect()
}

/// Returns the distance by which the box of a part of a body is inflated, such that boxes overlap if a pair is nearer
/// than its reach.
fn inflation(surface: &Surface, body: u32, margin: f64) -> f64 {
    surface.laws.bodies[body as usize].radius + surface.laws.half_reach[body as usize] + 0.5 * margin
}

/// Returns the cells near each point, in the order of points and of cells.
fn near_cells(surface: &Surface, x: &[f64], margin: f64) -> (Vec<u32>, Vec<u32>) {
    let bounds: Vec<Bounds> = surface
        .cells
        .par_iter()
        .map(|cell| Bounds::of(cell.nodes(), x).inflated(inflation(surface, cell.body, margin)))
        .collect();
    let tree = Tree::new(&bounds);
    let near = |point: usize, out: &mut Vec<u32>| {
        let first = out.len();
        let part = &surface.points[point];
        let position = at(x, part.node);
        let bounds = Bounds::of(&[part.node], x).inflated(inflation(surface, part.body, margin));
        tree.visit(&bounds, &mut |cell| {
            let other = &surface.cells[cell as usize];
            let Some(gauge) = surface.point_gauge(point, other.body) else { return };
            let [a, b, c] = other.nodes.map(|node| at(x, node));
            let reach = gauge.thickness + gauge.distance + margin;
            if !other.nodes.contains(&part.node)
                && other.shape().closest(&[position, a, b, c]).squared < reach * reach
                && surface.admits_point(point, cell as usize)
            {
                out.push(cell);
            }
        });
        out[first..].sort_unstable();
    };
    let chunks: Vec<(Vec<u32>, Vec<u32>)> = (0..surface.points.len().div_ceil(CHUNK))
        .into_par_iter()
        .map(|chunk| {
            let (mut ends, mut cells) = (Vec::new(), Vec::new());
            for point in chunk * CHUNK..((chunk + 1) * CHUNK).min(surface.points.len()) {
                near(point, &mut cells);
                ends.push(cells.len() as u32);
            }
            (ends, cells)
        })
        .collect();
    let (mut starts, mut cells) = (vec![0], Vec::new());
    for (ends, found) in chunks {
        let base = cells.len() as u32;
        starts.extend(ends.into_iter().map(|end| base + end));
        cells.extend(found);
    }
    (starts, cells)
}

/// Returns the pairs of edges near each other, in the order of their numbers.
fn near_edges(surface: &Surface, x: &[f64], margin: f64) -> Vec<EdgePair> {
    let bounds: Vec<Bounds> = surface
        .edges
        .par_iter()
        .map(|edge| Bounds::of(&edge.nodes, x).inflated(inflation(surface, edge.body, margin)))
        .collect();
    let tree = Tree::new(&bounds);
    let near = |first: u32, out: &mut Vec<EdgePair>| {
        let Edge { nodes: [a, b], body, .. } = surface.edges[first as usize];
        let (start, end) = (at(x, a), at(x, b));
        let own = inflation(surface, body, margin);
        tree.visit(&bounds[first as usize], &mut |second| {
            let Edge { nodes: [c, d], body, .. } = surface.edges[second as usize];
            if second <= first || a == c || a == d || b == c || b == d {
                return;
            }
            let closest = Shape::EdgeEdge.closest(&[start, end, at(x, c), at(x, d)]);
            // The gauge of a pair reaches no farther than both inflations. This test spares most pairs their gauge.
            let most = own + inflation(surface, body, margin);
            if closest.squared > 1.000_001 * most * most
                || !surface.admits_edges(first as usize, second as usize)
            {
                return;
            }
            let Some(gauge) = surface.edge_gauge(first as usize, second as usize) else { return };
            let reach = gauge.thickness + gauge.distance + margin;
            if closest.squared < reach * reach {
                out.push(EdgePair { edges: [first, second], gauge });
            }
        });
    };
    let mut pairs: Vec<EdgePair> = tree
        .order()
        .par_chunks(CHUNK)
        .flat_map_iter(|queries| {
            let mut out = Vec::new();
            queries.iter().for_each(|&edge| near(edge, &mut out));
            out
        })
        .collect();
    pairs.par_sort_unstable_by_key(|pair| pair.edges);
    pairs
}
