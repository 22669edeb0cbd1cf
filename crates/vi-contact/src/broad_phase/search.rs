//! Finds all pairs that can act or meet in a tube, with trees of boxes. If the tube changes at few nodes, only the pairs
//! of these nodes are searched again.

use std::sync::Arc;

use rayon::prelude::*;
use vi_core::Tube;

use super::margins::{Common, Margins};
use super::neighbours::{EdgePair, Neighbours};
use super::tree::{Bounds, Tree};
use crate::distance::Shape;
use crate::surface::{Edge, Surface};

/// Largest fraction of the nodes of a surface whose pairs are searched again without building new trees.
const FEW: f64 = 0.25;

/// A search with its trees and its result.
#[derive(Debug)]
pub(crate) struct Search {
    tube: Tube,
    common: Common,
    points: Tree,
    cells: Tree,
    edges: Tree,
    found: Arc<Neighbours>,
}

impl Neighbours {
    /// Returns all pairs nearer than their activation distance plus `margin` (m) at positions x.
    pub fn find(surface: &Surface, x: &[f64], margin: f64) -> Self {
        Self::within(surface, Tube::about(x, 0.5 * margin))
    }

    /// Returns all pairs that can act or meet in a tube.
    pub fn within(surface: &Surface, tube: Tube) -> Self {
        Arc::unwrap_or_clone(Search::new(surface, tube).found)
    }
}

impl Search {
    /// Searches all pairs.
    pub(crate) fn new(surface: &Surface, tube: Tube) -> Self {
        let margins = Margins::new(surface, &tube);
        let points =
            surface.points.par_iter().map(|point| margins.bounds(surface, &[point.node], point.body));
        let cells = surface.cells.par_iter().map(|cell| margins.bounds(surface, cell.nodes(), cell.body));
        let edges = surface.edges.par_iter().map(|edge| margins.bounds(surface, &edge.nodes, edge.body));
        let [points, cells, edges]: [Vec<Bounds>; 3] = [points.collect(), cells.collect(), edges.collect()];
        let [points, cells, edges] = [points, cells, edges].map(|bounds| Tree::new(&bounds));
        let (starts, near) = near_cells(surface, &margins, &points, &cells);
        let pairs = near_edges(surface, &margins, &edges);
        let planes = near_planes(surface, &margins);
        let common = margins.common();
        let found = Neighbours::new(starts, near, pairs, planes).covering(surface, margins);
        Self { tube, common, points, cells, edges, found: Arc::new(found) }
    }

    pub(crate) fn tube(&self) -> &Tube {
        &self.tube
    }

    /// Returns the pairs.
    pub(crate) fn found(&self) -> &Arc<Neighbours> {
        &self.found
    }

    /// Searches the pairs in another tube, which differs at few nodes. Returns false and does nothing if it differs at
    /// many. The result is that of a search of all pairs.
    pub(crate) fn update(&mut self, surface: &Surface, tube: Tube) -> bool {
        if self.tube.start.len() != tube.start.len() {
            return false;
        }
        let differs = |node: usize| {
            let place = 3 * node..3 * node + 3;
            self.tube.reach[node] != tube.reach[node]
                || self.tube.start[place.clone()] != tube.start[place.clone()]
                || self.tube.motion[place.clone()] != tube.motion[place]
        };
        let changed: Vec<bool> = (0..tube.reach.len()).map(differs).collect();
        let count = changed.iter().filter(|changed| **changed).count();
        if count as f64 > FEW * surface.points.len() as f64 {
            return false;
        }
        let any = |nodes: &[u32]| nodes.iter().any(|&node| changed[node as usize]);
        let margins = Margins::with_common(&tube, self.common);
        let which = |count: usize, is_changed: &dyn Fn(usize) -> bool| -> Vec<u32> {
            (0..count).filter(|&k| is_changed(k)).map(|k| k as u32).collect()
        };
        let points = which(surface.points.len(), &|k| any(&[surface.points[k].node]));
        let cells = which(surface.cells.len(), &|k| any(surface.cells[k].nodes()));
        let edges = which(surface.edges.len(), &|k| any(&surface.edges[k].nodes));
        for &point in &points {
            let part = surface.points[point as usize];
            self.points.update(point, margins.bounds(surface, &[part.node], part.body));
        }
        for &cell in &cells {
            let part = &surface.cells[cell as usize];
            self.cells.update(cell, margins.bounds(surface, part.nodes(), part.body));
        }
        for &edge in &edges {
            let part = &surface.edges[edge as usize];
            self.edges.update(edge, margins.bounds(surface, &part.nodes, part.body));
        }
        // The new pairs: changed points with all cells, changed cells with all other points.
        let mut pairs: Vec<[u32; 2]> = Vec::new();
        let mut near = Vec::new();
        for &point in &points {
            cells_of_point(surface, &margins, &self.cells, point as usize, &mut near);
            pairs.extend(near.drain(..).map(|cell| [point, cell]));
        }
        for &cell in &cells {
            let part = &surface.cells[cell as usize];
            self.points.visit(&margins.bounds(surface, part.nodes(), part.body), &mut |point| {
                let is_other = !changed[surface.points[point as usize].node as usize];
                if is_other && is_near_cell(surface, &margins, point, cell) {
                    pairs.push([point, cell]);
                }
            });
        }
        pairs.sort_unstable();
        let (mut starts, mut all) = (vec![0], Vec::new());
        let mut pairs = pairs.into_iter().peekable();
        for (point, part) in surface.points.iter().enumerate() {
            let first = all.len();
            if !changed[part.node as usize] {
                let kept = self.found.cells_of(point).iter();
                all.extend(kept.filter(|&&cell| !any(surface.cells[cell as usize].nodes())));
            }
            let kept = all.len();
            while let Some([_, cell]) = pairs.next_if(|pair| pair[0] as usize == point) {
                all.push(cell);
            }
            if kept > first && all.len() > kept {
                all[first..].sort_unstable();
            }
            starts.push(all.len() as u32);
        }
        let changes = |edge: u32| any(&surface.edges[edge as usize].nodes);
        let kept = self.found.edge_pairs().iter().filter(|pair| !pair.edges.into_iter().any(changes));
        let mut edge_pairs: Vec<EdgePair> = kept.copied().collect();
        for &edge in &edges {
            let accepts = |other: u32| !changes(other) || other > edge;
            edges_of_edge(surface, &margins, &self.edges, edge, accepts, &mut edge_pairs);
        }
        // A stable sort uses the order of the kept pairs.
        edge_pairs.sort_by_key(|pair| pair.edges);
        let planes = near_planes(surface, &margins);
        let found = Neighbours::new(starts, all, edge_pairs, planes).covering(surface, margins);
        (self.tube, self.found) = (tube, Arc::new(found));
        true
    }
}

/// Returns whether a point and a cell whose boxes overlap can act or meet.
#[inline]
fn is_near_cell(surface: &Surface, margins: &Margins<'_>, point: u32, cell: u32) -> bool {
    let (part, other) = (&surface.points[point as usize], &surface.cells[cell as usize]);
    let [a, b, c] = other.nodes;
    if a == part.node || b == part.node || c == part.node {
        return false;
    }
    let nodes = [part.node, a, b, c];
    // The gauge of a pair reaches no farther than both bodies. This test spares most pairs their gauge.
    let most = surface.reach(part.body) + surface.reach(other.body);
    if !margins.is_nearer(other.shape(), nodes, 1.000_001 * most) {
        return false;
    }
    let gauge = surface.point_gauge(point as usize, other.body);
    gauge.is_some_and(|gauge| margins.is_near(other.shape(), nodes, &gauge))
        && surface.admits_point(point as usize, cell as usize)
}

/// Appends the cells near a point, in their order.
fn cells_of_point(surface: &Surface, margins: &Margins<'_>, tree: &Tree, point: usize, out: &mut Vec<u32>) {
    let first = out.len();
    let part = &surface.points[point];
    tree.visit(&margins.bounds(surface, &[part.node], part.body), &mut |cell| {
        if is_near_cell(surface, margins, point as u32, cell) {
            out.push(cell);
        }
    });
    out[first..].sort_unstable();
}

/// Returns the cells near each point, in the order of points and of cells.
fn near_cells(surface: &Surface, margins: &Margins<'_>, points: &Tree, cells: &Tree) -> (Vec<u32>, Vec<u32>) {
    let of_front = |front: &[u32; 2]| {
        let mut pairs = Vec::new();
        points.visit_pairs(cells, *front, &mut |point, cell| {
            if is_near_cell(surface, margins, point, cell) {
                pairs.push(u64::from(point) << 32 | u64::from(cell));
            }
        });
        pairs
    };
    let mut pairs: Vec<u64> = points.fronts(cells).par_iter().flat_map_iter(of_front).collect();
    pairs.par_sort_unstable();
    let mut starts = vec![0; surface.points.len() + 1];
    pairs.iter().for_each(|pair| starts[(pair >> 32) as usize + 1] += 1);
    for point in 0..surface.points.len() {
        starts[point + 1] += starts[point];
    }
    (starts, pairs.into_iter().map(|pair| pair as u32).collect())
}

/// Appends the pairs of an edge with the edges near it that `accepts` accepts.
fn edges_of_edge(
    surface: &Surface,
    margins: &Margins<'_>,
    tree: &Tree,
    edge: u32,
    accepts: impl Fn(u32) -> bool,
    out: &mut Vec<EdgePair>,
) {
    let Edge { nodes, body, .. } = surface.edges[edge as usize];
    tree.visit(&margins.bounds(surface, &nodes, body), &mut |other| {
        if accepts(other) {
            out.extend(near_pair(surface, margins, [edge, other]));
        }
    });
}

/// Returns the pair of two edges whose boxes overlap, in any order, if they can act or meet.
#[inline]
fn near_pair(surface: &Surface, margins: &Margins<'_>, edges: [u32; 2]) -> Option<EdgePair> {
    let edges = [edges[0].min(edges[1]), edges[0].max(edges[1])];
    let [first, second] = edges.map(|edge| edge as usize);
    let ([a, b], [c, d]) = (surface.edges[first].nodes, surface.edges[second].nodes);
    if a == c || a == d || b == c || b == d {
        return None;
    }
    // The gauge of a pair reaches no farther than both bodies. This test spares most pairs their gauge.
    let most = surface.reach(surface.edges[first].body) + surface.reach(surface.edges[second].body);
    let nodes = [a, b, c, d];
    if !margins.is_nearer(Shape::EdgeEdge, nodes, 1.000_001 * most) || !surface.admits_edges(first, second) {
        return None;
    }
    let gauge = surface.edge_gauge(first, second)?;
    let is_near = margins.is_near(Shape::EdgeEdge, nodes, &gauge);
    is_near.then(|| EdgePair { edges, gauge, reach: surface.edge_reach(edges, &gauge) })
}

/// Returns the pairs of edges near each other, in the order of their numbers.
fn near_edges(surface: &Surface, margins: &Margins<'_>, tree: &Tree) -> Vec<EdgePair> {
    let of_front = |front: &[u32; 2]| {
        let mut pairs = Vec::new();
        tree.visit_pairs(tree, *front, &mut |a, b| pairs.extend(near_pair(surface, margins, [a, b])));
        pairs
    };
    let mut pairs: Vec<EdgePair> = tree.fronts(tree).par_iter().flat_map_iter(of_front).collect();
    pairs.par_sort_unstable_by_key(|pair| pair.edges);
    pairs
}

/// Returns the points near half-spaces, as numbers of both.
fn near_planes(surface: &Surface, margins: &Margins<'_>) -> Vec<[u32; 2]> {
    let mut planes = Vec::new();
    for point in 0..surface.points.len() {
        for plane in 0..surface.half_spaces.len() {
            let nodes = [surface.points[point].node, surface.half_spaces[plane].node];
            let is_pair = !surface.is_rigid(&nodes) && !surface.is_held_to_plane(point, plane);
            if is_pair && margins.is_near_plane(surface, point as u32, plane as u32) {
                planes.push([point as u32, plane as u32]);
            }
        }
    }
    planes
}
