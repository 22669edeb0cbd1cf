//! Finds all pairs that can act or meet in a tube, with trees of boxes. If the tube changes at few nodes, only the pairs
//! of these nodes are searched again.

use std::sync::Arc;

use rayon::prelude::*;
use vi_core::Tube;

use super::boxes::Bounds;
use super::margins::{Common, Margins};
use super::neighbours::{Apart, Neighbours, rounded_down};
use super::tree::Tree;
use crate::distance::{Shape, Vec3, at};
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
        let orders = &surface.orders;
        let origin = surface.points.first().map_or(Vec3::zeros(), |point| at(margins.middle(), point.node));
        let points = Tree::new(&points, &orders.points, origin);
        let cells = Tree::new(&cells, &orders.cells, origin);
        let edges = Tree::new(&edges, &orders.edges, origin);
        let near_cells = near_cells(surface, &margins, &points, &cells);
        let near_edges = near_edges(surface, &margins, &edges);
        let common = margins.common();
        let found = found(surface, &tube, margins, near_cells, near_edges);
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
        let Some(apart) = self.found.apart().filter(|_| self.tube.start.len() == tube.start.len()) else {
            return false;
        };
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
        // Pairs of nodes that did not change are as far apart as before.
        let kept = self.found.cell_pairs().zip(&apart.cells).filter(|([point, cell], _)| {
            let node = surface.points[*point as usize].node;
            !changed[node as usize] && !any(surface.cells[*cell as usize].nodes())
        });
        let mut near_cells: Vec<NearCell> =
            kept.map(|(parts, &distance)| NearCell { parts, distance }).collect();
        // The new pairs: changed points with all cells, changed cells with all other points.
        for &point in &points {
            let part = surface.points[point as usize];
            self.cells.visit(&margins.bounds(surface, &[part.node], part.body), &mut |cell| {
                near_cells.extend(near_cell(surface, &margins, [point, cell]));
            });
        }
        for &cell in &cells {
            let part = &surface.cells[cell as usize];
            self.points.visit(&margins.bounds(surface, part.nodes(), part.body), &mut |point| {
                if !changed[surface.points[point as usize].node as usize] {
                    near_cells.extend(near_cell(surface, &margins, [point, cell]));
                }
            });
        }
        // A stable sort uses the order of the kept pairs.
        near_cells.sort_by_key(|near| near.parts);
        let changes = |edge: u32| any(&surface.edges[edge as usize].nodes);
        let kept = self.found.edge_pairs().iter().zip(&apart.edges);
        let kept = kept.filter(|(edges, _)| !edges.iter().copied().any(changes));
        let mut near_edges: Vec<NearEdges> =
            kept.map(|(&edges, &distance)| NearEdges { edges, distance }).collect();
        for &edge in &edges {
            let Edge { nodes, body, .. } = surface.edges[edge as usize];
            self.edges.visit(&margins.bounds(surface, &nodes, body), &mut |other| {
                if !changes(other) || other > edge {
                    near_edges.extend(near_edge(surface, &margins, [edge, other]));
                }
            });
        }
        near_edges.sort_by_key(|near| near.edges);
        self.found = Arc::new(found(surface, &tube, margins, near_cells, near_edges));
        self.tube = tube;
        true
    }
}

/// A point and a cell that can act or meet.
#[derive(Clone, Copy)]
struct NearCell {
    /// Numbers of both.
    parts: [u32; 2],
    /// Distance in the middle of the path, m, rounded down.
    distance: f32,
}

/// Two edges that can act or meet.
#[derive(Clone, Copy)]
struct NearEdges {
    /// Numbers of both, the lower first.
    edges: [u32; 2],
    /// Distance in the middle of the path, m, rounded down.
    distance: f32,
}

/// Returns the list of pairs in the order of their numbers, and of the points near half-spaces.
fn found(
    surface: &Surface,
    tube: &Tube,
    margins: Margins<'_>,
    cells: Vec<NearCell>,
    edges: Vec<NearEdges>,
) -> Neighbours {
    let planes = near_planes(surface, &margins);
    let of_cells = cells.iter().map(|near| near.distance).collect();
    let apart = Apart::new(margins.into_middle(), of_cells, edges.iter().map(|near| near.distance).collect());
    let mut starts = vec![0; surface.points.len() + 1];
    cells.iter().for_each(|near| starts[near.parts[0] as usize + 1] += 1);
    for point in 0..surface.points.len() {
        starts[point + 1] += starts[point];
    }
    let cells = cells.into_iter().map(|near| near.parts[1]).collect();
    let edges = edges.into_iter().map(|near| near.edges).collect();
    Neighbours::new(starts, cells, edges, planes).covering(tube.clone(), apart)
}

/// Returns a point and a cell whose boxes overlap, if they can act or meet.
#[inline]
fn near_cell(surface: &Surface, margins: &Margins<'_>, parts: [u32; 2]) -> Option<NearCell> {
    let [point, cell] = parts.map(|part| part as usize);
    let (part, other) = (&surface.points[point], &surface.cells[cell]);
    let [a, b, c] = other.nodes;
    if a == part.node || b == part.node || c == part.node {
        return None;
    }
    // The gauge of a pair reaches no farther than both bodies. This test spares most pairs their gauge.
    let most = surface.reach(part.body) + surface.reach(other.body);
    let approach = margins.if_nearer(other.shape(), [part.node, a, b, c], 1.000_001 * most)?;
    let gauge = surface.point_gauge(point, other.body)?;
    let is_near = approach.is_nearer(gauge.reach()) && surface.admits_point(point, cell);
    is_near.then(|| NearCell { parts, distance: rounded_down(approach.distance()) })
}

/// Returns the points and the cells near them, in the order of their numbers.
fn near_cells(surface: &Surface, margins: &Margins<'_>, points: &Tree, cells: &Tree) -> Vec<NearCell> {
    let of_front = |front: &[u32; 2]| {
        let mut near = Vec::new();
        points.visit_pairs(cells, *front, &mut |point, cell| {
            near.extend(near_cell(surface, margins, [point, cell]));
        });
        near
    };
    let mut near: Vec<NearCell> = points.fronts(cells).par_iter().flat_map_iter(of_front).collect();
    near.par_sort_unstable_by_key(|near| near.parts);
    near
}

/// Returns two edges whose boxes overlap, given in any order, if they can act or meet.
#[inline]
fn near_edge(surface: &Surface, margins: &Margins<'_>, edges: [u32; 2]) -> Option<NearEdges> {
    let edges = [edges[0].min(edges[1]), edges[0].max(edges[1])];
    let [first, second] = edges.map(|edge| edge as usize);
    let ([a, b], [c, d]) = (surface.edges[first].nodes, surface.edges[second].nodes);
    if a == c || a == d || b == c || b == d {
        return None;
    }
    // The gauge of a pair reaches no farther than both bodies. This test spares most pairs their gauge.
    let most = surface.reach(surface.edges[first].body) + surface.reach(surface.edges[second].body);
    let approach = margins.if_nearer(Shape::EdgeEdge, [a, b, c, d], 1.000_001 * most)?;
    if !surface.admits_edges(first, second) {
        return None;
    }
    let gauge = surface.edge_pair(edges)?.gauge;
    let distance = rounded_down(approach.distance());
    approach.is_nearer(gauge.reach()).then_some(NearEdges { edges, distance })
}

/// Returns the pairs of edges near each other, in the order of their numbers.
fn near_edges(surface: &Surface, margins: &Margins<'_>, tree: &Tree) -> Vec<NearEdges> {
    let of_front = |front: &[u32; 2]| {
        let mut near = Vec::new();
        tree.visit_pairs(tree, *front, &mut |a, b| near.extend(near_edge(surface, margins, [a, b])));
        near
    };
    let mut near: Vec<NearEdges> = tree.fronts(tree).par_iter().flat_map_iter(of_front).collect();
    near.par_sort_unstable_by_key(|near| near.edges);
    near
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
