//! The surfaces that can meet: points with areas, edges with the angle between their two triangles at rest (0 if
//! flat), cells (triangles, wire edges, single points), half-spaces, and the rules that decide which of them form
//! pairs.
//!
//! All of this is built once and never changes, so that the contact energy is a function of positions alone. Nodes
//! refer to the caller's flat array of positions: node n has the coordinates x[3n], x[3n+1], x[3n+2]. The corners of
//! a linear proxy of a curved surface are nodes too; the caller ties them to other nodes by weights.

mod areas;
mod build;
mod edge_pair;
mod half_space;
mod law;
mod order;
mod stitched;
mod topology;

pub use build::SurfaceBuilder;
pub(crate) use edge_pair::EdgePair;
pub use law::{Body, Law, PairRule};
pub use topology::median_edge;

use std::collections::{BTreeMap, BTreeSet};

use law::Laws;
use vi_core::Tube;

use crate::barrier::Barrier;
use crate::distance::{Shape, Vec3, at};
use crate::error::ContactError;

/// A point of a surface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Point {
    /// The node of the point.
    pub node: u32,
    /// The body to which it belongs.
    pub body: u32,
    /// The area that it represents, m².
    pub area: f64,
}

/// A simplex that points can meet: a triangle, an edge of a wire, or a single point.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Cell {
    /// Nodes in increasing order; the last is repeated if there are fewer than three.
    pub nodes: [u32; 3],
    /// Number of its nodes, 1 to 3.
    pub count: u8,
    /// The body to which it belongs.
    pub body: u32,
    /// Places in `nodes` of the ends of its edge that bristles follow: the longest one at rest, whatever the numbers of the
    /// nodes are.
    pub(crate) followed: [u8; 2],
    /// Whether it is part of a cut through the body, beyond which the body continues.
    pub(crate) is_cut: bool,
}

impl Cell {
    /// Returns the nodes without repetition.
    pub fn nodes(&self) -> &[u32] {
        &self.nodes[..self.count as usize]
    }

    /// Returns the kind of pair that a point forms with it.
    pub(crate) fn shape(&self) -> Shape {
        [Shape::PointPoint, Shape::PointEdge, Shape::PointTriangle][self.count as usize - 1]
    }
}

/// An edge of a surface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Edge {
    /// Nodes in increasing order.
    pub nodes: [u32; 2],
    /// The body to which it belongs.
    pub body: u32,
    /// The area that it represents, m²; see `surface/areas.rs`.
    pub area: f64,
    /// χ of the angle between the normals of its triangles at rest: 0 if flat, 1 from 30° on, and 1 for rims and wires.
    pub sharpness: f64,
    /// Squared length at rest, m².
    pub square: f64,
}

/// The half-space n·(x − x_o) < 0, filled with material, where x_o is the position of a node.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HalfSpace {
    /// A node on its face, usually prescribed; it takes the reaction.
    pub node: u32,
    /// The body to which it belongs.
    pub body: u32,
    /// Outward unit normal n at the start.
    pub normal: Vec3,
    /// Two more nodes a and b on its face if it rotates: n ∝ (x_a − x_o) × (x_b − x_o). Otherwise n is constant.
    pub corners: Option<[u32; 2]>,
}

/// Constants of one pair.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Gauge {
    /// Sum ξ of both radii, m: the gap is g = d − ξ.
    pub thickness: f64,
    /// Activation distance d̂, m.
    pub distance: f64,
    /// Scale of the energy: area times κ d̂, J.
    pub energy: f64,
}

impl Gauge {
    /// Returns the relative gap s = (d − ξ)/d̂.
    #[inline]
    pub fn relative(&self, distance: f64) -> f64 {
        (distance - self.thickness) / self.distance
    }

    /// Returns the distance from which on there is no force, m.
    #[inline]
    pub fn reach(&self) -> f64 {
        self.thickness + self.distance
    }

    /// Returns the squared distance from which on there is no force, m².
    #[inline]
    pub fn reach_squared(&self) -> f64 {
        self.reach() * self.reach()
    }
}

/// The parts of surfaces in an order in which neighbours follow each other.
#[derive(Debug, Clone)]
pub(crate) struct Orders {
    pub(crate) points: Vec<u32>,
    pub(crate) cells: Vec<u32>,
    pub(crate) edges: Vec<u32>,
}

/// Surfaces, and the rules that decide which of their parts form pairs.
#[derive(Debug, Clone)]
pub struct Surface {
    pub(crate) barrier: Barrier,
    pub(crate) rest: Vec<f64>,
    pub(crate) start: Vec<f64>,
    pub(crate) points: Vec<Point>,
    pub(crate) cells: Vec<Cell>,
    /// Quadrilaterals of deformable bodies that are cut into two cells, along the diagonal of the first and third node.
    pub(crate) quadrilaterals: Vec<[u32; 4]>,
    pub(crate) edges: Vec<Edge>,
    pub(crate) half_spaces: Vec<HalfSpace>,
    pub(crate) laws: Laws,
    /// For each node, whether pairs read its place.
    pub(crate) is_read: Vec<bool>,
    /// For each node, the group of nodes that move as one, or [`LOOSE`].
    pub(crate) held: Vec<u32>,
    /// The nodes c, d₁, d₂, d₃ of each body that is rigid.
    pub(crate) frames: Vec<Option<[u32; 4]>>,
    /// Pairs of joined nodes, the lower number first.
    pub(crate) stitches: BTreeSet<[u32; 2]>,
    /// Thickness and activation distance of each point against its own body.
    pub(crate) own: Vec<[f64; 2]>,
    /// The order of points, cells and edges in trees of boxes.
    pub(crate) orders: Orders,
}

/// The group of nodes that move by themselves.
pub(crate) const LOOSE: u32 = 0;

/// The number of the group of the first body that does not meet itself, and whose nodes do not move as one.
const LAST_GROUP: u32 = u32::MAX - 1;

/// If two places of a body are closer than this fraction of d̂ at rest, they are the same place (a seam, a doubled
/// node) and form no pair.
const WELDED: f64 = 1e-6;

impl Surface {
    /// Returns the barrier of all pairs.
    pub fn barrier(&self) -> Barrier {
        self.barrier
    }

    /// Returns the points, which have areas.
    pub fn points(&self) -> &[Point] {
        &self.points
    }

    /// Returns the cells, body by body.
    pub fn cells(&self) -> &[Cell] {
        &self.cells
    }

    /// Returns the edges, body by body.
    pub fn edges(&self) -> &[Edge] {
        &self.edges
    }

    /// Returns the half-spaces.
    pub fn half_spaces(&self) -> &[HalfSpace] {
        &self.half_spaces
    }

    /// Returns the body of a node that is a point of a surface.
    pub fn body_of(&self, node: u32) -> Option<u32> {
        let place = self.points.binary_search_by_key(&node, |point| point.node).ok()?;
        Some(self.points[place].body)
    }

    /// Returns the radius of a body, m: half the thickness of a sheet.
    pub fn radius(&self, body: u32) -> f64 {
        self.laws.bodies[body as usize].radius
    }

    /// Returns the radius of a body plus half of its largest activation distance, m. Parts of two bodies can act on each
    /// other only if they are nearer than the sum for both.
    pub(crate) fn reach(&self, body: u32) -> f64 {
        self.laws.bodies[body as usize].radius + self.laws.half_reach[body as usize]
    }

    /// Returns the constants of bodies `a` and `b` against each other; `None` if they form no pair.
    pub fn law(&self, a: u32, b: u32) -> Option<Law> {
        self.laws.of(a, b)
    }

    /// Returns whether a body is a rigid ball or capsule: its skeleton does not rotate, its surface does.
    pub(crate) fn is_round(&self, body: u32) -> bool {
        self.frames[body as usize].is_some() && self.laws.bodies[body as usize].radius > 0.0
    }

    /// Returns the surfaces with other activation distances (m) of some pairs of bodies, and other positions at the start, m.
    pub(crate) fn with_distances(
        &self,
        distances: &BTreeMap<[u32; 2], f64>,
        start: &[f64],
    ) -> Result<Self, ContactError> {
        let mut surface = Self { start: start.to_vec(), ..self.clone() };
        for (&[a, b], &distance) in distances {
            surface.laws.rules.entry((a.min(b), a.max(b))).or_default().distance = Some(distance);
        }
        surface.laws.finish()?;
        Ok(surface)
    }

    /// Returns whether any bodies are joined.
    pub(crate) fn has_joints(&self) -> bool {
        !self.stitches.is_empty() || self.laws.rules.values().any(|rule| rule.joined)
    }

    /// Returns whether any pair of bodies has friction.
    pub(crate) fn has_friction(&self) -> bool {
        let rules = self.laws.rules.values();
        self.laws.friction > 0.0 || rules.into_iter().any(|rule| rule.friction.is_some_and(|mu| mu > 0.0))
    }

    /// Returns whether contact between any pair of bodies is damped.
    pub(crate) fn has_damping(&self) -> bool {
        let rules = self.laws.rules.values();
        self.laws.damping > 0.0 || rules.into_iter().any(|rule| rule.damping.is_some_and(|tau| tau > 0.0))
    }

    /// Returns whether there is friction between a round body and another one.
    pub(crate) fn has_rolling(&self) -> bool {
        let count = self.laws.bodies.len() as u32;
        let round = (0..count).filter(|&body| self.is_round(body));
        let rubs = |a: u32, b: u32| self.law(a, b).is_some_and(|law| law.friction > 0.0);
        round.into_iter().any(|a| (0..count).any(|b| a != b && rubs(a, b)))
    }

    /// Returns the group to which all of these nodes belong, or [`LOOSE`].
    pub(crate) fn group_of(&self, nodes: &[u32]) -> u32 {
        let group = self.held[nodes[0] as usize];
        let is_one = group != LOOSE && nodes[1..].iter().all(|&node| self.held[node as usize] == group);
        if is_one { group } else { LOOSE }
    }

    /// Returns a group to which nodes of a body belong, none of whose parts form a pair with each other, or [`LOOSE`]: the nodes
    /// move as one, or the body does not meet itself.
    pub(crate) fn group_without_pairs(&self, nodes: &[u32], body: u32) -> u32 {
        let meets_itself = || self.law(body, body).is_some();
        match self.group_of(nodes) {
            LOOSE if !meets_itself() => LAST_GROUP - body,
            group => group,
        }
    }

    /// Returns whether these nodes move as one rigid body, so that distances between them never change.
    pub(crate) fn is_rigid(&self, nodes: &[u32]) -> bool {
        self.group_of(nodes) != LOOSE
    }

    /// Returns the constants of a point against a body. All cells of the body share one d̂; otherwise the features
    /// between two cells would no longer cancel.
    pub(crate) fn point_gauge(&self, point: usize, body: u32) -> Option<Gauge> {
        let Point { body: own, area, .. } = self.points[point];
        let law = self.law(own, body)?;
        let [thickness, distance] = if own == body {
            self.own[point]
        } else {
            [self.laws.bodies[own as usize].radius + self.laws.bodies[body as usize].radius, law.distance]
        };
        // Each side acts on the other, so each has half the energy.
        Some(Gauge { thickness, distance, energy: 0.5 * area * law.stiffness * distance })
    }

    /// Returns the constants of a point against a half-space, which has no points of its own.
    pub(crate) fn plane_gauge(&self, point: usize, plane: usize) -> Option<Gauge> {
        let Point { body, area, .. } = self.points[point];
        let law = self.law(body, self.half_spaces[plane].body)?;
        let thickness = self.laws.bodies[body as usize].radius;
        Some(Gauge { thickness, distance: law.distance, energy: area * law.stiffness * law.distance })
    }

    /// Returns whether this point and this cell may meet. They may not if the cell contains the point, is welded to
    /// it, or moves with it.
    pub(crate) fn admits_point(&self, point: usize, cell: usize) -> bool {
        let (point, cell) = (self.points[point], &self.cells[cell]);
        let Some(law) = self.law(point.body, cell.body) else { return false };
        if cell.nodes.contains(&point.node) {
            return false;
        }
        let [a, b, c] = cell.nodes;
        if self.is_rigid(&[point.node, a, b, c]) || self.is_stitched(&[point.node], &[a, b, c]) {
            return false;
        }
        let nodes = [point.node, a, b, c];
        let is_apart =
            point.body != cell.body || self.rest_distance(cell.shape(), nodes) > WELDED * law.distance;
        is_apart && !self.is_joint(&law, [point.body, cell.body], cell.shape(), nodes)
    }

    /// Returns whether a node of the first part is joined to one of the second.
    fn is_stitched(&self, first: &[u32], second: &[u32]) -> bool {
        let joins = |a: u32, b: u32| self.stitches.contains(&[a.min(b), a.max(b)]);
        !self.stitches.is_empty() && first.iter().any(|&a| second.iter().any(|&b| joins(a, b)))
    }

    /// Returns whether these parts are at the place where their bodies are joined.
    fn is_joint(&self, law: &Law, [a, b]: [u32; 2], shape: Shape, nodes: [u32; 4]) -> bool {
        if !law.joined {
            return false;
        }
        let distance = shape.closest(&nodes.map(|node| at(&self.start, node))).distance();
        let reach =
            if a == b { WELDED * law.distance } else { self.radius(a) + self.radius(b) + law.distance };
        distance <= reach
    }

    /// Returns whether a point starts in the layer of a half-space to which its body is joined.
    pub(crate) fn is_held_to_plane(&self, point: usize, plane: usize) -> bool {
        let (point, face) = (self.points[point], &self.half_spaces[plane]);
        let Some(law) = self.law(point.body, face.body).filter(|law| law.joined) else { return false };
        let height = face.normal.dot(&(at(&self.start, point.node) - at(&self.start, face.node)));
        height <= self.radius(point.body) + law.distance
    }

    /// Returns whether these edges may come into contact.
    pub(crate) fn admits_edges(&self, a: usize, b: usize) -> bool {
        let ([i, j], [k, l]) = (self.edges[a].nodes, self.edges[b].nodes);
        let bodies = [self.edges[a].body, self.edges[b].body];
        i != k
            && i != l
            && j != k
            && j != l
            && !self.is_rigid(&[i, j, k, l])
            && !self.is_stitched(&[i, j], &[k, l])
            && self
                .law(bodies[0], bodies[1])
                .is_some_and(|law| !self.is_joint(&law, bodies, Shape::EdgeEdge, [i, j, k, l]))
    }

    pub(super) fn rest_distance(&self, shape: Shape, nodes: [u32; 4]) -> f64 {
        shape.closest(&nodes.map(|node| at(&self.rest, node))).distance()
    }

    /// Returns a tube in which nodes whose places no pair reads may be anywhere. Among these are the directors of rigid bodies,
    /// whose coordinates are no lengths.
    pub(crate) fn loosened(&self, mut tube: Tube) -> Tube {
        for (node, _) in self.is_read.iter().enumerate().filter(|(_, is_read)| !**is_read) {
            tube.start[3 * node..3 * node + 3].fill(0.0);
            tube.motion[3 * node..3 * node + 3].fill(0.0);
            tube.reach[node] = f64::INFINITY;
        }
        tube
    }

    /// Returns the nodes that contact reads.
    pub fn nodes(&self) -> impl Iterator<Item = u32> + '_ {
        let cells = self.cells.iter().flat_map(|cell| cell.nodes().iter().copied());
        let faces = self.half_spaces.iter();
        let faces =
            faces.flat_map(|plane| std::iter::once(plane.node).chain(plane.corners.into_iter().flatten()));
        cells.chain(faces)
    }
}

/// Returns a thickness and an activation distance that exert no force at a rest distance.
fn within_rest(thickness: f64, distance: f64, rest: f64) -> [f64; 2] {
    let thickness = thickness.min(0.5 * rest);
    [thickness, distance.min(0.5 * (rest - thickness))]
}
