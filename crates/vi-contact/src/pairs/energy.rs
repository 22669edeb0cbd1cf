//! The contact energy at one configuration, with gradient and Hessian of each acting pair.

use rayon::prelude::*;

use super::edges::Mollifier;
use super::{Contact, Group, Partners};
use crate::distance::{Closest, Shape, Vec3, at, squared_hessian};
use crate::surface::Gauge;

pub use super::edges::Blend;

/// Number of items per task; fewer items run on the calling thread.
const CHUNK: usize = 512;

/// Concatenates what `each` appends for the items 0, 1, 2, …, in their order, with separate scratch memory for each task.
pub(crate) fn in_order<W, T: Send>(
    count: usize,
    space: impl Fn() -> W + Sync,
    each: impl Fn(usize, &mut W, &mut Vec<T>) + Sync,
) -> Vec<T> {
    let task = |chunk: usize| {
        let (mut space, mut out) = (space(), Vec::new());
        (chunk * CHUNK..((chunk + 1) * CHUNK).min(count)).for_each(|item| each(item, &mut space, &mut out));
        out
    };
    match count.div_ceil(CHUNK) {
        0 => Vec::new(),
        1 => task(0),
        chunks => (0..chunks).into_par_iter().flat_map_iter(task).collect(),
    }
}

/// Parameters from which the energy of a pair follows, given its distance.
#[derive(Debug, Clone, Copy)]
pub(super) struct Strength {
    pub(super) gauge: Gauge,
    pub(super) blend: Blend,
    /// Inclusion–exclusion number n.
    pub(super) multiplicity: f64,
}

/// A pair that acts at a configuration.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ActivePair {
    /// The parts of the pair.
    pub partners: Partners,
    /// The kind of pair; a point against a half-space is a [`Shape::PointPoint`] with a fixed normal.
    pub shape: Shape,
    /// Nodes of the pair; the first `shape.arity()` are used.
    pub nodes: [u32; 4],
    /// Closest points.
    pub closest: Closest,
    /// Energy C, J; negative for pairs that inclusion and exclusion subtracts.
    pub energy: f64,
    /// dC/dd, N.
    pub slope: f64,
    /// d²C/dd², N/m.
    pub curvature: f64,
    /// Gap g = d − ξ, m.
    pub gap: f64,
    /// For a point against a body, the first cell that contains the simplex of the pair; zero for other pairs.
    pub(crate) cell: u32,
    /// dC/dc, d²C/dc² and d²C/dd dc of nearly parallel edges, with c = |e_a × e_b|².
    parallel: Option<[f64; 3]>,
}

impl ActivePair {
    fn new(
        partners: Partners,
        shape: Shape,
        nodes: [u32; 4],
        closest: Closest,
        distance: f64,
        strength: &Strength,
    ) -> Self {
        let Strength { gauge, blend, multiplicity } = strength;
        let s = gauge.relative(distance);
        let energy = multiplicity * gauge.energy;
        Self {
            partners,
            shape,
            nodes,
            closest,
            energy: energy * blend.value(s),
            slope: energy / gauge.distance * blend.slope(s),
            curvature: energy / (gauge.distance * gauge.distance) * blend.curvature(s),
            gap: s * gauge.distance,
            cell: 0,
            parallel: None,
        }
    }

    /// Multiplies the energy by the mollifier at c.
    fn mollify(&mut self, mollifier: Mollifier, c: f64) {
        let (value, slope) = (mollifier.value(c), mollifier.slope(c));
        if value < 1.0 {
            self.parallel =
                Some([self.energy * slope, self.energy * mollifier.curvature(c), self.slope * slope]);
            self.energy *= value;
            self.slope *= value;
            self.curvature *= value;
        }
    }

    /// Returns ∂C/∂x_a, N.
    pub fn gradient(&self, x: &[f64]) -> [Vec3; 4] {
        let normal = self.closest.vector / self.closest.distance();
        let mut gradient = self.closest.weights.map(|weight| normal * (self.slope * weight));
        if let Some([by_c, ..]) = self.parallel {
            let x = self.nodes.map(|node| at(x, node));
            for (gradient, c) in gradient.iter_mut().zip(Mollifier::discrete_gradient(&x, &x)) {
                *gradient += c * by_c;
            }
        }
        gradient
    }

    /// Writes ∂²C/∂x², N/m, as the packed lower triangle of the 3·arity coordinates, by rows.
    pub fn hessian(&self, x: &[f64], out: &mut [f64]) {
        let size = 3 * self.shape.arity();
        let x = self.nodes.map(|node| at(x, node));
        let (d, c) = (self.closest.distance(), self.closest.weights);
        let normal = self.closest.vector / d;
        let is_plane = matches!(self.partners, Partners::PointPlane(..));
        // C(d) with d = √D: C_DD = (C'' − C'/d)/(4 d²), C_D = C'/(2d).
        let rank_one = if is_plane {
            self.curvature
        } else {
            squared_hessian(self.shape, &self.closest, &x, out);
            out.iter_mut().for_each(|entry| *entry *= 0.5 * self.slope / d);
            self.curvature - self.slope / d
        };
        if is_plane {
            out.fill(0.0);
        }
        for (i, row) in rows(size, out) {
            let left = rank_one * c[i / 3] * normal[i % 3];
            for (j, entry) in row.iter_mut().enumerate() {
                *entry += left * c[j / 3] * normal[j % 3];
            }
        }
        if let Some([by_c, by_cc, by_dc]) = self.parallel {
            let gradient = Mollifier::discrete_gradient(&x, &x);
            let hessian = Mollifier::hessian(&x);
            let sign = [-1.0, 1.0, -1.0, 1.0];
            for (i, row) in rows(size, out) {
                let (a, k) = (i / 3, i % 3);
                for (j, entry) in row.iter_mut().enumerate() {
                    let (b, l) = (j / 3, j % 3);
                    let (u, v) = (gradient[a][k], gradient[b][l]);
                    *entry += by_cc * u * v
                        + by_dc * (u * c[b] * normal[l] + v * c[a] * normal[k])
                        + by_c * sign[a] * sign[b] * hessian[3 * (a / 2) + k][3 * (b / 2) + l];
                }
            }
        }
    }
}

/// Writes k (c ⊗ n)(c ⊗ n)ᵀ as a packed lower triangle.
pub(crate) fn pack_rank_one(k: f64, c: &[f64], normal: Vec3, size: usize, out: &mut [f64]) {
    for (i, row) in rows(size, out) {
        let left = k * c[i / 3] * normal[i % 3];
        for (j, entry) in row.iter_mut().enumerate() {
            *entry = left * c[j / 3] * normal[j % 3];
        }
    }
}

/// Adds k g gᵀ to a packed lower triangle, with the covectors g of nodes.
pub(crate) fn add_square(k: f64, g: &[Vec3], out: &mut [f64]) {
    let value = |i: usize| g[i / 3][i % 3];
    for (i, row) in rows(3 * g.len(), out) {
        let left = k * value(i);
        row.iter_mut().enumerate().for_each(|(j, entry)| *entry += left * value(j));
    }
}

/// Returns the rows of a packed lower triangle with their numbers.
fn rows(size: usize, mut packed: &mut [f64]) -> impl Iterator<Item = (usize, &mut [f64])> {
    (0..size).map(move |i| {
        let (row, rest) = std::mem::take(&mut packed).split_at_mut(i + 1);
        packed = rest;
        (i, row)
    })
}

impl Contact<'_> {
    /// Returns all pairs that act at positions x, in the order of points, edges, half-spaces.
    pub fn active(&self, x: &[f64]) -> Vec<ActivePair> {
        let near = self.neighbours.near();
        let mut pairs = in_order(near.len(), Group::new, |k, group, out| {
            self.active_at_point(near[k] as usize, x, group, out);
        });
        pairs.extend(in_order(
            self.neighbours.edges.len(),
            || (),
            |pair, (), out| out.extend(self.active_edges(pair, x)),
        ));
        pairs.extend((0..self.neighbours.planes.len()).filter_map(|pair| self.active_plane(pair, x)));
        pairs
    }

    /// Returns C(x), J; infinite if surfaces touch.
    pub fn energy(&self, x: &[f64]) -> f64 {
        self.active(x).iter().map(|pair| pair.energy).sum()
    }

    /// Adds the pairs that act on one point to `out`.
    pub(crate) fn active_at_point(
        &self,
        point: usize,
        x: &[f64],
        group: &mut Group<1>,
        out: &mut Vec<ActivePair>,
    ) {
        let node = self.surface.points[point].node;
        let blend = Blend::of_points(self.surface.barrier);
        for (body, cells) in self.bodies_of(point) {
            let Some(gauge) = self.surface.point_gauge(point, body) else { continue };
            group.gather(self.surface, node, cells, &gauge, [x]);
            out.extend(group.terms.iter().map(|term| {
                let [closest] = term.closest;
                let partners = Partners::PointBody(point as u32, body);
                let strength = Strength { gauge, blend, multiplicity: f64::from(term.multiplicity) };
                let distance = closest.distance();
                let pair = ActivePair::new(partners, term.shape, term.nodes, closest, distance, &strength);
                ActivePair { cell: term.home, ..pair }
            }));
        }
    }

    /// Returns the cells near a point, body by body.
    pub(crate) fn bodies_of(&self, point: usize) -> impl Iterator<Item = (u32, &[u32])> {
        let body = |cell: &u32| self.surface.cells[*cell as usize].body;
        let runs = self.neighbours.cells_of(point).chunk_by(move |a, b| body(a) == body(b));
        runs.map(move |cells| (body(&cells[0]), cells))
    }

    /// Returns the pair of edges of a candidate if it acts.
    pub(crate) fn active_edges(&self, pair: usize, x: &[f64]) -> Option<ActivePair> {
        let pair = self.surface.edge_pair(self.neighbours.edges[pair])?;
        let nodes = pair.nodes;
        let positions = nodes.map(|node| at(x, node));
        let [closest] = Shape::EdgeEdge.closest_if_nearer(&[positions], pair.reach * pair.reach)?;
        let [a, b] = pair.edges.map(|edge| &self.surface.edges[edge as usize]);
        let blend = Blend::of_edges(self.surface.barrier, a, b);
        let partners = Partners::Edges(pair.edges[0], pair.edges[1]);
        let strength = Strength { gauge: pair.gauge, blend, multiplicity: 1.0 };
        let mut active =
            ActivePair::new(partners, Shape::EdgeEdge, nodes, closest, closest.distance(), &strength);
        active.mollify(Mollifier::new(a, b), Mollifier::argument(&positions));
        (active.energy != 0.0).then_some(active)
    }

    /// Returns the point and half-space of a candidate if they act.
    pub(crate) fn active_plane(&self, pair: usize, x: &[f64]) -> Option<ActivePair> {
        let [point, plane] = self.neighbours.planes[pair];
        let gauge = self.surface.plane_gauge(point as usize, plane as usize)?;
        let (nodes, places) = self.over_plane(point, plane, x);
        let face = &self.surface.half_spaces[plane as usize];
        let height = face.height(&places);
        if height >= gauge.reach() {
            return None;
        }
        let closest = face.closest(&places);
        let blend = Blend::of_points(self.surface.barrier);
        let partners = Partners::PointPlane(point, plane);
        let strength = Strength { gauge, blend, multiplicity: 1.0 };
        Some(ActivePair::new(partners, face.shape(), nodes, closest, height, &strength))
    }

    /// Returns the height of a point over a half-space, m.
    pub(crate) fn height(&self, point: u32, plane: u32, x: &[f64]) -> f64 {
        self.surface.half_spaces[plane as usize].height(&self.over_plane(point, plane, x).1)
    }

    /// Returns the nodes of a point and a half-space, and their positions.
    pub(crate) fn over_plane(&self, point: u32, plane: u32, x: &[f64]) -> ([u32; 4], [Vec3; 4]) {
        let node = self.surface.points[point as usize].node;
        let nodes = self.surface.half_spaces[plane as usize].nodes_with(node);
        (nodes, nodes.map(|node| at(x, node)))
    }

    /// Returns the nodes of two edges.
    pub(crate) fn edge_nodes(&self, [a, b]: [u32; 2]) -> [u32; 4] {
        let ([i, j], [k, l]) = (self.surface.edges[a as usize].nodes, self.surface.edges[b as usize].nodes);
        [i, j, k, l]
    }
}
