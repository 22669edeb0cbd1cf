//! Builds a [`Surface`]: bodies first, then their cells, then the rules.

use std::cmp::Ordering;
use std::collections::{BTreeMap, BTreeSet};

use super::areas::areas;
use super::law::Laws;
use super::order::order;
use super::topology::edges;
use super::{Body, Cell, HalfSpace, LOOSE, Orders, PairRule, Point, Surface, within_rest};
use crate::barrier::Barrier;
use crate::broad_phase::nearest_own_cells;
use crate::distance::{Vec3, at};
use crate::error::ContactError;

/// Returns the places of the ends of the longest edge; of equally long ones, of the one whose ends have the smallest sum of
/// coordinates x, y or z, the first that differs.
fn longest_edge(nodes: [u32; 3], x: &[f64]) -> [u8; 2] {
    let key = |ends: [u8; 2]| {
        let [a, b] = ends.map(|place| at(x, nodes[place as usize]));
        let sum = a + b;
        [(b - a).norm_squared(), -sum.x, -sum.y, -sum.z]
    };
    let compare = |a: [f64; 4], b: [f64; 4]| {
        let unequal = a.iter().zip(&b).map(|(a, b)| a.total_cmp(b)).find(|order| order.is_ne());
        unequal.unwrap_or(Ordering::Equal)
    };
    let edges = [[1, 2], [0, 2], [0, 1]];
    edges.into_iter().max_by(|&a, &b| compare(key(a), key(b))).unwrap_or([0, 1])
}

/// Collects the parts of a [`Surface`].
///
/// Bodies are numbered 0, 1, 2, … in the order in which they are added.
#[derive(Debug, Clone)]
pub struct SurfaceBuilder {
    rest: Vec<f64>,
    start: Option<Vec<f64>>,
    barrier: Barrier,
    laws: Laws,
    cells: Vec<Cell>,
    quadrilaterals: Vec<[u32; 4]>,
    cuts: BTreeSet<[u32; 3]>,
    areas: BTreeMap<u32, f64>,
    half_spaces: Vec<HalfSpace>,
    held: BTreeMap<u32, u32>,
    frames: BTreeMap<u32, [u32; 4]>,
    stitches: BTreeSet<[u32; 2]>,
}

/// The body of a node that no cell contains.
const NOBODY: u32 = u32::MAX;

impl SurfaceBuilder {
    /// Starts with the rest positions of all nodes, three numbers each, m.
    pub fn new(rest: &[f64]) -> Self {
        let laws = Laws {
            bodies: Vec::new(),
            rules: BTreeMap::new(),
            friction: 0.0,
            damping: 0.0,
            half_reach: Vec::new(),
        };
        Self {
            rest: rest.to_vec(),
            start: None,
            barrier: Barrier::default(),
            laws,
            cells: Vec::new(),
            quadrilaterals: Vec::new(),
            cuts: BTreeSet::new(),
            areas: BTreeMap::new(),
            half_spaces: Vec::new(),
            held: BTreeMap::new(),
            frames: BTreeMap::new(),
            stitches: BTreeSet::new(),
        }
    }

    /// Sets the positions at the start, m, by which joined bodies are near each other; the default is the positions at
    /// rest.
    pub fn start(&mut self, x: &[f64]) {
        self.start = Some(x.to_vec());
    }

    /// Sets the barrier of all pairs.
    pub fn barrier(&mut self, barrier: Barrier) {
        self.barrier = barrier;
    }

    /// Sets Coulomb's coefficient for pairs without their own; default 0.
    pub fn friction(&mut self, coefficient: f64) {
        self.laws.friction = coefficient;
    }

    /// Sets the damping time for pairs without their own, s; default 0.
    pub fn damping(&mut self, time: f64) {
        self.laws.damping = time;
    }

    /// Adds a body and returns its number.
    pub fn body(&mut self, body: Body) -> u32 {
        self.laws.bodies.push(body);
        self.laws.bodies.len() as u32 - 1
    }

    /// Adds triangles to a body: the boundary of a solid, or a sheet. Their orientation does not matter.
    pub fn triangles(&mut self, body: u32, triangles: &[[u32; 3]]) {
        for &triangle in triangles {
            self.cell(body, triangle, 3);
        }
    }

    /// Declares pairs of triangles [a, b, c] and [a, c, d] of a deformable body to be quadrilaterals [a, b, c, d], whose corners
    /// represent areas as if they were cut along the other diagonal too.
    pub fn quadrilaterals(&mut self, quadrilaterals: &[[u32; 4]]) {
        self.quadrilaterals.extend(quadrilaterals);
    }

    /// Declares triangles to be faces of a cut, beyond which the body continues: on a plane of symmetry, or on a seam of a
    /// periodic body. Nothing presses them, so their nodes represent the area of other faces only, and an edge on their rim is
    /// as sharp as between a face and its mirror image.
    pub fn cuts(&mut self, triangles: &[[u32; 3]]) {
        let sorted = |mut nodes: [u32; 3]| {
            nodes.sort_unstable();
            nodes
        };
        self.cuts.extend(triangles.iter().map(|&nodes| sorted(nodes)));
    }

    /// Adds wire edges to a body: a rope, or a capsule. An edge represents its length times its width, the larger of
    /// 2·radius and d̂.
    pub fn wires(&mut self, body: u32, edges: &[[u32; 2]]) {
        for &[a, b] in edges {
            self.cell(body, [a, b, a.max(b)], 2);
        }
    }

    /// Adds a single point to a body that represents an area (m²): a particle, or a sphere with the body's radius.
    pub fn point(&mut self, body: u32, node: u32, area: f64) {
        self.cell(body, [node; 3], 1);
        self.areas.insert(node, area);
    }

    /// Adds an edge to a body whose two nodes represent `area` (m²) each: a capsule with the body's radius.
    pub fn segment(&mut self, body: u32, nodes: [u32; 2], area: f64) {
        self.wires(body, &[nodes]);
        self.areas.extend(nodes.map(|node| (node, area)));
    }

    /// Declares a body rigid, with these nodes as its frame: a point c and directors d₁, d₂, d₃, so that the body
    /// carries the points x = c + Σ X_k d_k. Friction on a round body, a point or segment with a radius, then acts at
    /// the point of contact.
    pub fn frame(&mut self, body: u32, nodes: [u32; 4]) {
        self.frames.insert(body, nodes);
    }

    /// Joins two nodes, for example by a stitch. There is no contact between parts of which one contains the first node
    /// and the other the second.
    pub fn stitch(&mut self, a: u32, b: u32) {
        self.stitches.insert([a.min(b), a.max(b)]);
    }

    fn cell(&mut self, body: u32, mut nodes: [u32; 3], count: u8) {
        nodes.sort_unstable();
        self.cells.push(Cell { nodes, count, body, followed: [0, 1], is_cut: false });
    }

    /// Makes a body a half-space n·(x − x_node) < 0 with an outward normal n of any length.
    pub fn half_space(&mut self, body: u32, node: u32, normal: [f64; 3]) {
        let normal = Vec3::from(normal).normalize();
        self.half_spaces.push(HalfSpace { node, body, normal, corners: None });
    }

    /// Lets the last half-space rotate with its node and two more nodes a and b on its face, where (x_a − x_o) × (x_b − x_o)
    /// points outward.
    pub fn corners(&mut self, corners: [u32; 2]) {
        if let Some(plane) = self.half_spaces.last_mut() {
            plane.corners = Some(corners);
        }
    }

    /// Sets the rule for the pair of bodies `a` and `b`.
    pub fn pair(&mut self, a: u32, b: u32, rule: PairRule) {
        self.laws.rules.insert((a.min(b), a.max(b)), rule);
    }

    /// Declares that these nodes move as one: as a rigid body, or because all are prescribed. Parts whose nodes are
    /// all in the same group form no pair. Groups are numbered from 1.
    pub fn hold(&mut self, nodes: impl IntoIterator<Item = u32>, group: u32) {
        self.held.extend(nodes.into_iter().map(|node| (node, group)));
    }

    /// Checks everything and builds the surface.
    ///
    /// # Errors
    /// Returns [`ContactError`] if a number is outside its domain, a node does not exist or belongs to two bodies, or a
    /// cell has no extent.
    pub fn build(mut self) -> Result<Surface, ContactError> {
        self.laws.finish()?;
        // Make the cells of a body adjacent.
        self.cells.sort_by_key(|cell| (cell.body, cell.nodes, cell.count));
        self.cells.dedup();
        let owners = self.owners()?;
        for cell in &mut self.cells {
            cell.followed = longest_edge(cell.nodes, &self.rest);
            cell.is_cut = cell.count == 3 && self.cuts.contains(&cell.nodes);
        }
        let widths: Vec<f64> =
            self.laws.bodies.iter().map(|body| body.distance.max(2.0 * body.radius)).collect();
        let edges = edges(&self.cells, &widths, &self.rest);
        let is_rigid = |body: u32| self.frames.contains_key(&body);
        let of_cells = areas(&self.cells, &self.quadrilaterals, is_rigid, &widths, &self.rest);
        let mut areas: BTreeMap<u32, f64> =
            (0..).zip(of_cells).filter_map(|(node, area)| Some((node, area?))).collect();
        areas.extend(self.areas);
        let points: Vec<Point> =
            areas.iter().map(|(&node, &area)| Point { node, body: owners[node as usize], area }).collect();
        if let Some(edge) = edges.iter().find(|edge| edge.square == 0.0) {
            return Err(ContactError::Degenerate { body: edge.body, nodes: edge.nodes.to_vec() });
        }
        if let Some(point) = points.iter().find(|point| !(point.area > 0.0 && point.area.is_finite())) {
            let domain = "must be positive and finite";
            return Err(ContactError::Value {
                body: point.body,
                quantity: "area",
                value: point.area,
                domain,
            });
        }
        let mut held = vec![LOOSE; self.rest.len() / 3];
        for (node, group) in self.held {
            held[node as usize] = group;
        }
        let centre =
            |nodes: &[u32]| nodes.iter().map(|&node| at(&self.rest, node)).sum::<Vec3>() / nodes.len() as f64;
        let orders = Orders {
            points: order(points.iter().map(|point| (point.body, centre(&[point.node])))),
            cells: order(self.cells.iter().map(|cell| (cell.body, centre(cell.nodes())))),
            edges: order(edges.iter().map(|edge| (edge.body, centre(&edge.nodes)))),
        };
        let frame = |body: u32| self.frames.get(&body).copied();
        let frames = (0..self.laws.bodies.len() as u32).map(frame).collect();
        let is_read = vec![false; self.rest.len() / 3];
        let mut surface = Surface {
            barrier: self.barrier,
            start: self.start.unwrap_or_else(|| self.rest.clone()),
            rest: self.rest,
            own: vec![[0.0; 2]; points.len()],
            points,
            cells: self.cells,
            quadrilaterals: self.quadrilaterals,
            edges,
            half_spaces: self.half_spaces,
            laws: self.laws,
            is_read,
            held,
            frames,
            stitches: self.stitches,
            orders,
        };
        let read: Vec<u32> = surface.nodes().collect();
        read.into_iter().for_each(|node| surface.is_read[node as usize] = true);
        let nearest = nearest_own_cells(&surface);
        for (point, rest) in nearest.into_iter().enumerate() {
            let body = surface.laws.bodies[surface.points[point].body as usize];
            surface.own[point] = within_rest(2.0 * body.radius, body.distance, rest);
        }
        Ok(surface)
    }

    /// Returns the body of each node of a cell, and [`NOBODY`] for other nodes.
    fn owners(&self) -> Result<Vec<u32>, ContactError> {
        let count = self.rest.len() / 3;
        let mut owners = vec![NOBODY; count];
        let planes = self.half_spaces.iter();
        let planes =
            planes.flat_map(|plane| std::iter::once(plane.node).chain(plane.corners.into_iter().flatten()));
        let held = self.held.keys().copied().chain(self.frames.values().flatten().copied());
        if let Some(node) = planes.chain(held).find(|&node| node as usize >= count) {
            return Err(ContactError::Node { node, count });
        }
        for cell in &self.cells {
            for &node in cell.nodes() {
                if node as usize >= count {
                    return Err(ContactError::Node { node, count });
                }
                let first = std::mem::replace(&mut owners[node as usize], cell.body);
                if first != cell.body && first != NOBODY {
                    return Err(ContactError::Shared { node, first, second: cell.body });
                }
            }
            let nodes = cell.nodes();
            if nodes.windows(2).any(|pair| pair[0] == pair[1]) {
                return Err(ContactError::Degenerate { body: cell.body, nodes: nodes.to_vec() });
            }
        }
        Ok(owners)
    }
}
