//! Verlet lists (Verlet 1967): all pairs that can act or meet in a tube of configurations.

use std::borrow::Cow;

use vi_core::Tube;

use super::margins::Margins;
use crate::distance::{Shape, Vec3, at};
use crate::surface::{Cell, EdgePair, Gauge, Surface};

/// The distances of the pairs of a point with a cell, and of two edges, at positions x, m, rounded down to single precision.
#[derive(Debug, Clone)]
pub(super) struct Apart {
    x: Vec<f64>,
    pub(super) cells: Vec<f32>,
    pub(super) edges: Vec<f32>,
    /// Round-off of distances that does not depend on them but on positions, m.
    round_off: f64,
}

/// Round-off of distances, relative to themselves and to the largest coordinate: far more than that of differences of positions, of
/// their squares and roots.
const ROUND_OFF: [f64; 2] = [1e-9, 64.0 * f64::EPSILON];

/// Returns a distance rounded down to single precision, m.
#[inline]
pub(super) fn rounded_down(distance: f64) -> f32 {
    let rounded = distance as f32;
    if f64::from(rounded) > distance { rounded.next_down() } else { rounded }
}

impl Apart {
    pub(super) fn new(x: Vec<f64>, cells: Vec<f32>, edges: Vec<f32>) -> Self {
        let round_off = ROUND_OFF[1] * x.iter().fold(0.0, |largest: f64, x| largest.max(x.abs()));
        Self { x, cells, edges, round_off }
    }

    /// Returns by how much a pair with this known distance is at least farther apart than `distance` at the known positions, m.
    #[inline]
    fn slack(&self, known: f32, distance: f64) -> f64 {
        f64::from(known) * (1.0 - ROUND_OFF[0]) - self.round_off - distance
    }

    /// Returns the largest square of a change of the vector between a node of the first part and one of the second, from
    /// the known positions to x, m².
    #[inline]
    fn largest_change(&self, x: &[f64], nodes: [u32; 4], first: usize) -> f64 {
        // A loop, because a closure over several nodes becomes a call.
        let mut motion = [Vec3::zeros(); 4];
        for a in 0..4 {
            motion[a] = at(x, nodes[a]) - at(&self.x, nodes[a]);
        }
        let mut largest = 0.0_f64;
        for i in 0..first {
            for j in first..4 {
                largest = largest.max((motion[i] - motion[j]).norm_squared());
            }
        }
        largest
    }

    /// Returns numbers w, one per node, m. A pair whose distance is d at the known positions is nowhere in the tube of `margins`
    /// nearer than d − w_i − w_j, where i and j are the nodes of its two parts with the largest w. The bound is weak if the parts
    /// move together but not with the mean of all points, and needs no vector of the pair.
    fn largest_changes(&self, surface: &Surface, margins: &Margins<'_>) -> Vec<f64> {
        let change = |node: u32| at(margins.middle(), node) - at(&self.x, node);
        let points = surface.points.iter();
        let mean = points.map(|point| change(point.node)).sum::<Vec3>() / surface.points.len().max(1) as f64;
        let of_node = |node: u32| (change(node) - mean).norm() + margins.spread(node);
        (0..self.x.len() as u32 / 3).map(of_node).collect()
    }
}

/// Candidates for contact in a tube of configurations, in the order of their numbers.
#[derive(Debug, Clone, Default)]
pub struct Neighbours {
    /// The tube, if the list shall know what it covers.
    tube: Option<Tube>,
    /// Distances of all pairs at one configuration, if they are known.
    apart: Option<Apart>,
    /// The points that are near any cell, ascending.
    near: Vec<u32>,
    /// Index in `cells` of the first cell of each point, followed by the total number.
    pub(crate) starts: Vec<u32>,
    pub(crate) cells: Vec<u32>,
    /// Numbers of both edges of each pair, the lower first. Their constants follow from the surface; with them a pair would take 56
    /// bytes instead of 8.
    pub(crate) edges: Vec<[u32; 2]>,
    /// Point and half-space of each pair.
    pub(crate) planes: Vec<[u32; 2]>,
}

impl Neighbours {
    /// Returns a list of these candidates; those of point i have the indices `starts[i]..starts[i + 1]` in `cells`.
    pub(super) fn new(
        starts: Vec<u32>,
        cells: Vec<u32>,
        edges: Vec<[u32; 2]>,
        planes: Vec<[u32; 2]>,
    ) -> Self {
        let near = (0..).zip(starts.windows(2)).filter(|(_, range)| range[0] < range[1]);
        let near = near.map(|(point, _)| point).collect();
        Self { tube: None, apart: None, near, starts, cells, edges, planes }
    }

    /// Records the tube that the list covers, and the distances of all pairs in the middle of its path.
    pub(super) fn covering(self, tube: Tube, apart: Apart) -> Self {
        Self { tube: Some(tube), apart: Some(apart), ..self }
    }

    /// Returns the distances of all pairs at one configuration, if they are known.
    pub(super) fn apart(&self) -> Option<&Apart> {
        self.apart.as_ref()
    }

    /// Returns those of the pairs that can act or meet in a tube, which must be inside the tube of this list. `known` is
    /// the tube if the new list shall know what it covers.
    pub(crate) fn narrowed(&self, surface: &Surface, tube: &Tube, known: Option<Tube>) -> Self {
        let margins = Margins::new(surface, tube);
        let before = self.apart.as_ref();
        let changes = before.map(|apart| apart.largest_changes(surface, &margins));
        // Bounds exclude most pairs without computing their closest points.
        let may_come = |nodes: [u32; 4], first: usize, known: Option<&f32>, distance: f64| {
            let (Some(changes), Some(before), Some(known)) = (&changes, before, known) else { return true };
            let [a, b, c, d] = nodes.map(|node| changes[node as usize]);
            let change = if first == 1 { a + b.max(c).max(d) } else { a.max(b) + c.max(d) };
            before.slack(*known, distance) <= change
        };
        let (mut of_cells, mut of_edges) = (Vec::new(), Vec::new());
        let cells = self.cells_where(surface, |node, cell, gauge, number| {
            let [a, b, c] = cell.nodes;
            let known = before.map(|before| &before.cells[number]);
            if !may_come([node, a, b, c], 1, known, gauge.reach()) {
                return false;
            }
            let distance = margins.distance_if_nearer(cell.shape(), [node, a, b, c], gauge.reach());
            of_cells.extend(distance.map(rounded_down));
            distance.is_some()
        });
        // Observers, who ask for a list that knows its tube, want all pairs nearer than d̂.
        let reach = |pair: &EdgePair| if known.is_some() { pair.gauge.reach() } else { pair.reach };
        let edges = self.edges.iter().enumerate().filter(|(number, edges)| {
            let known = before.map(|before| &before.edges[*number]);
            let is_near = |pair: &EdgePair| may_come(pair.nodes, 2, known, reach(pair));
            if !surface.widest_edge_pair(**edges).as_ref().is_some_and(is_near) {
                return false;
            }
            let Some(pair) = surface.edge_pair(**edges) else { return false };
            let distance = margins.distance_if_nearer(Shape::EdgeEdge, pair.nodes, reach(&pair));
            of_edges.extend(distance.map(rounded_down));
            distance.is_some()
        });
        let edges = edges.map(|(_, edges)| *edges).collect();
        let planes =
            self.planes.iter().filter(|&&[point, plane]| margins.is_near_plane(surface, point, plane));
        let planes = planes.copied().collect();
        let apart = Apart::new(margins.into_middle(), of_cells, of_edges);
        Self { tube: known, apart: Some(apart), ..Self::new(cells.0, cells.1, edges, planes) }
    }

    /// Returns those of the pairs that may come nearer than a distance, m, on the straight path between two
    /// configurations. The distance is a function of the constants of the pair. Bounds exclude most pairs without
    /// computing their closest points: if the distance was d at one configuration, it is at least d − max |Δ_i − Δ_j|
    /// after motions Δ of the nodes i of one part and j of the other.
    pub(crate) fn near_path(
        &self,
        surface: &Surface,
        x: [&[f64]; 2],
        distance: impl Fn(&Gauge) -> f64,
    ) -> Cow<'_, Self> {
        let Some(apart) = &self.apart else { return Cow::Borrowed(self) };
        let may_come = |nodes: [u32; 4], first: usize, known: f32, distance: f64| {
            let slack = apart.slack(known, distance);
            slack <= 0.0 || x.iter().any(|x| apart.largest_change(x, nodes, first) >= slack * slack)
        };
        let (starts, cells) = self.cells_where(surface, |node, cell, gauge, number| {
            let [a, b, c] = cell.nodes;
            may_come([node, a, b, c], 1, apart.cells[number], distance(&gauge))
        });
        let edges = self.edges.iter().zip(&apart.edges).filter(|(edges, known)| {
            let pair = surface.widest_edge_pair(**edges);
            pair.is_some_and(|pair| may_come(pair.nodes, 2, **known, distance(&pair.gauge).min(pair.reach)))
        });
        let edges = edges.map(|(edges, _)| *edges).collect();
        Cow::Owned(Self::new(starts, cells, edges, self.planes.clone()))
    }

    /// Returns the cells near each point that `keeps` accepts, given the node of the point, the cell, the constants of
    /// the pair and its number.
    fn cells_where(
        &self,
        surface: &Surface,
        mut keeps: impl FnMut(u32, &Cell, Gauge, usize) -> bool,
    ) -> (Vec<u32>, Vec<u32>) {
        let (mut starts, mut cells) = (Vec::with_capacity(self.starts.len()), Vec::new());
        starts.push(0);
        for &point in &self.near {
            starts.resize(point as usize + 1, cells.len() as u32);
            let mut gauges = Gauges::of(surface, point as usize);
            let first = self.starts[point as usize] as usize;
            for (number, &cell) in (first..).zip(self.cells_of(point as usize)) {
                let (node, part) = (surface.points[point as usize].node, &surface.cells[cell as usize]);
                if gauges.against(part.body).is_some_and(|gauge| keeps(node, part, gauge, number)) {
                    cells.push(cell);
                }
            }
        }
        starts.resize(surface.points.len() + 1, cells.len() as u32);
        (starts, cells)
    }

    /// Returns those of the pairs that `keeps` accepts, given the numbers of both bodies.
    pub(crate) fn between(&self, surface: &Surface, keeps: impl Fn([u32; 2]) -> bool) -> Self {
        let (mut starts, mut cells) = (vec![0], Vec::new());
        for (point, part) in surface.points.iter().enumerate() {
            let of_point = self.cells_of(point).iter();
            cells.extend(of_point.filter(|&&cell| keeps([part.body, surface.cells[cell as usize].body])));
            starts.push(cells.len() as u32);
        }
        let edges =
            self.edges.iter().filter(|edges| keeps(edges.map(|edge| surface.edges[edge as usize].body)));
        let planes = self.planes.iter().filter(|&&[point, plane]| {
            keeps([surface.points[point as usize].body, surface.half_spaces[plane as usize].body])
        });
        Self::new(starts, cells, edges.copied().collect(), planes.copied().collect())
    }

    /// Returns the numbers of the points and of the cells near them, in this order.
    pub(super) fn cell_pairs(&self) -> impl Iterator<Item = [u32; 2]> + '_ {
        self.near
            .iter()
            .flat_map(|&point| self.cells_of(point as usize).iter().map(move |&cell| [point, cell]))
    }

    /// Returns the points that are near any cell, ascending.
    pub(crate) fn near(&self) -> &[u32] {
        &self.near
    }

    /// Returns whether every pair that can act or meet at x is known to be among the candidates. If this holds at both
    /// ends of a straight path, it holds along the path.
    pub fn covers(&self, x: &[f64]) -> bool {
        self.tube.as_ref().is_some_and(|tube| tube.contains(x))
    }

    /// Returns the number of candidates of all kinds.
    pub fn count(&self) -> usize {
        self.cells.len() + self.edges.len() + self.planes.len()
    }

    /// Returns the cells near a point.
    pub fn cells_of(&self, point: usize) -> &[u32] {
        &self.cells[self.starts[point] as usize..self.starts[point + 1] as usize]
    }

    /// Returns the pairs of edges, as numbers of both, the lower first.
    pub fn edge_pairs(&self) -> &[[u32; 2]] {
        &self.edges
    }

    /// Returns the points near half-spaces, as numbers of both.
    pub fn plane_pairs(&self) -> &[[u32; 2]] {
        &self.planes
    }
}

/// The constants of one point against the bodies that it meets. The last one is kept, because the cells of a body follow
/// each other.
pub(super) struct Gauges<'a> {
    surface: &'a Surface,
    point: usize,
    last: Option<(u32, Option<Gauge>)>,
}

impl<'a> Gauges<'a> {
    pub(super) fn of(surface: &'a Surface, point: usize) -> Self {
        Self { surface, point, last: None }
    }

    pub(super) fn against(&mut self, body: u32) -> Option<Gauge> {
        match self.last {
            Some((last, gauge)) if last == body => gauge,
            _ => {
                let gauge = self.surface.point_gauge(self.point, body);
                self.last = Some((body, gauge));
                gauge
            }
        }
    }
}
