//! How near a pair comes in a tube of configurations.
//!
//! Let x_i(τ) = start_i + τ m_i be the path of node i and r_i its reach. For any unit vector w, the projections of
//! x_i − x_j on w are affine in τ. So a pair with the nodes i and j of its parts is nowhere in the tube nearer than
//! ```text
//! min over τ in {0, 1} of [min_i (w·x_i(τ) − r_i) − max_j (w·x_j(τ) + r_j)].
//! ```
//! This bound is large for parts that slide along each other: with the w between their closest points, only the motion
//! that brings them together counts. A pair is listed if no direction that is tried proves it apart: the vector between
//! the closest points in the middle of the path, and the three axes. Because of the axes, the list does not depend on the
//! boxes of the search.

use vi_core::Tube;

use super::boxes::Bounds;
use crate::distance::{Shape, Vec3, at};
use crate::surface::Surface;

/// Half a motion that all nodes have nearly in common, m. Boxes that are inflated with the same one can be compared.
pub(super) type Common = Vec3;

/// A bound on the angle (rad) by which the normal of a rotating half-space turns, above which all points count as near. The
/// bound is twice the sum s of the relative motions of its corners; the true angle is below s (1 + s/4)/(1 − s), which is
/// below 2s for s ≤ 0.3.
const LARGEST_TURN: f64 = 0.6;

/// The paths of all nodes in a tube.
pub(super) struct Margins<'a> {
    /// Positions in the middle of the path, m.
    middle: Vec<f64>,
    tube: &'a Tube,
    common: Common,
    /// For each node, the sum of its reach and of half its motion relative to the common one, m.
    spreads: Vec<f64>,
    moves: bool,
}

/// The distance of a pair in a tube, and a lower bound on it.
pub(super) struct Approach {
    /// Distance in the middle of the path, m.
    distance: f64,
    /// A lower bound on the distance of the pair anywhere in the tube, m.
    least: f64,
}

impl Approach {
    /// Returns the distance in the middle of the path, m.
    pub(super) fn distance(&self) -> f64 {
        self.distance
    }

    /// Returns whether the distance can be less than `distance`, m.
    #[inline]
    pub(super) fn is_nearer(&self, distance: f64) -> bool {
        self.least < distance
    }
}

/// The path of a pair in a tube.
struct PairPath {
    /// Number of nodes of the first part.
    first: usize,
    /// Positions of the nodes in the middle, m.
    middle: [Vec3; 4],
    /// Half of the motions of the nodes, m.
    half: [Vec3; 4],
    /// Reaches of the nodes, m.
    reach: [f64; 4],
}

impl PairPath {
    /// Returns the least of w·(x_i − x_j) − |w|(r_i + r_j) on the path, m |w|, given |w|.
    #[inline]
    fn least_along(&self, w: Vec3, length: f64) -> f64 {
        let origin = self.middle[3];
        self.least_of(|a| (w.dot(&(self.middle[a] - origin)), w.dot(&self.half[a])), length)
    }

    /// Returns the least of the distance along each axis, the largest of the three, m.
    #[inline]
    fn least_along_axes(&self) -> f64 {
        let along = |axis: usize| {
            let sign = if self.middle[0][axis] >= self.middle[3][axis] { 1.0 } else { -1.0 };
            self.least_of(|a| (sign * self.middle[a][axis], sign * self.half[a][axis]), 1.0)
        };
        along(0).max(along(1)).max(along(2))
    }

    /// Returns the least difference of the first part and the second, given the projection of each node in the middle and
    /// half of its motion.
    #[inline]
    fn least_of(&self, projection: impl Fn(usize) -> (f64, f64), length: f64) -> f64 {
        let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
        for a in 0..4 {
            let (place, half) = projection(a);
            let spare = length * self.reach[a];
            let ends = [place - half, place + half];
            for end in 0..2 {
                if a < self.first {
                    low[end] = low[end].min(ends[end] - spare);
                } else {
                    high[end] = high[end].max(ends[end] + spare);
                }
            }
        }
        (low[0] - high[0]).min(low[1] - high[1])
    }
}

impl<'a> Margins<'a> {
    pub(super) fn new(surface: &Surface, tube: &'a Tube) -> Self {
        let motion: Vec3 = surface.points.iter().map(|point| at(&tube.motion, point.node)).sum();
        Self::with_common(tube, motion * (0.5 / surface.points.len().max(1) as f64))
    }

    pub(super) fn with_common(tube: &'a Tube, common: Common) -> Self {
        let moves = tube.motion.iter().any(|motion| *motion != 0.0);
        let spread = |(node, reach): (u32, &f64)| reach + (at(&tube.motion, node) * 0.5 - common).norm();
        let spreads = (0..).zip(&tube.reach).map(spread).collect();
        Self { middle: tube.middle(), tube, common, spreads, moves }
    }

    pub(super) fn common(&self) -> Common {
        self.common
    }

    /// Returns the positions in the middle of the path, m.
    pub(super) fn middle(&self) -> &[f64] {
        &self.middle
    }

    /// Returns the largest distance of a node from its place in the middle of the path, besides the common motion, m.
    pub(super) fn spread(&self, node: u32) -> f64 {
        self.spreads[node as usize]
    }

    /// Returns the positions in the middle of the path, m.
    pub(super) fn into_middle(self) -> Vec<f64> {
        self.middle
    }

    fn reach(&self, nodes: &[u32]) -> f64 {
        nodes.iter().map(|&node| self.tube.reach[node as usize]).fold(0.0, f64::max)
    }

    /// Returns the box around the paths of nodes of a body, without the common motion, inflated such that boxes overlap if a
    /// pair can act or meet.
    pub(super) fn bounds(&self, surface: &Surface, nodes: &[u32], body: u32) -> Bounds {
        let mut bounds = Bounds::EMPTY;
        for &node in nodes {
            let half = (at(&self.tube.motion, node) * 0.5 - self.common).abs();
            let reach = surface.reach(body) + self.tube.reach[node as usize];
            // The box is larger by more than the round-off of both.
            bounds.surround(at(&self.middle, node), half.map(|half| (half + reach) * (1.0 + 1e-9)));
        }
        bounds.of_group(surface.group_without_pairs(nodes, body))
    }

    /// Returns the distance of a pair in the middle of the path, m, if it can be less than `distance`.
    #[inline]
    pub(super) fn distance_if_nearer(&self, shape: Shape, nodes: [u32; 4], distance: f64) -> Option<f64> {
        Some(self.if_nearer(shape, nodes, distance)?.distance())
    }

    /// Returns how near a pair comes in the tube, if its distance can be less than `distance`, m.
    #[inline]
    pub(super) fn if_nearer(&self, shape: Shape, nodes: [u32; 4], distance: f64) -> Option<Approach> {
        // Loops, because a closure over several nodes becomes a call.
        let (mut middle, mut spread) = ([Vec3::zeros(); 4], [0.0; 4]);
        for a in 0..4 {
            middle[a] = at(&self.middle, nodes[a]);
            spread[a] = self.spread(nodes[a]);
        }
        // A ball about each part contains its motion. It shows most pairs apart, and costs much less than the closest points.
        let others = spread[2].max(spread[3]);
        let spread = match shape.first_count() {
            1 => spread[0] + spread[1].max(others),
            _ => spread[0].max(spread[1]) + others,
        };
        let bound = distance + spread;
        if shape != Shape::PointPoint && shape.is_apart(&middle, bound * bound) {
            return None;
        }
        let mut path =
            PairPath { first: shape.first_count(), middle, half: [Vec3::zeros(); 4], reach: [0.0; 4] };
        for a in 0..4 {
            path.reach[a] = self.tube.reach[nodes[a] as usize];
            if self.moves {
                path.half[a] = at(&self.tube.motion, nodes[a]) * 0.5;
            }
        }
        let closest = shape.closest(&path.middle);
        let length = closest.distance();
        let along = if length > 0.0 { path.least_along(closest.vector, length) / length } else { 0.0 };
        let approach = Approach { distance: length, least: along.max(path.least_along_axes()) };
        approach.is_nearer(distance).then_some(approach)
    }

    /// Returns whether a point can come within its activation distance of a half-space, or meet it.
    pub(super) fn is_near_plane(&self, surface: &Surface, point: u32, plane: u32) -> bool {
        let Some(gauge) = surface.plane_gauge(point as usize, plane as usize) else { return false };
        let (node, face) = (surface.points[point as usize].node, &surface.half_spaces[plane as usize]);
        let nodes = face.nodes_with(node);
        let middle = nodes.map(|node| at(&self.middle, node));
        let motion = nodes.map(|node| at(&self.tube.motion, node));
        let mut margin = self.reach(&[node]) + self.reach(&[face.node]);
        margin += match face.corners {
            None => 0.5 * face.normal.dot(&(motion[0] - motion[1])).abs(),
            Some(corners) => {
                // The normal turns by at most the motions of the corners relative to the face, over their distances.
                let mut turn = 0.0;
                for (k, corner) in (2..).zip(corners) {
                    let relative = self.reach(&[corner])
                        + self.reach(&[face.node])
                        + 0.5 * (motion[k] - motion[1]).norm();
                    turn += 2.0 * relative / (middle[k] - middle[1]).norm();
                }
                if turn > LARGEST_TURN {
                    return true;
                }
                0.5 * (motion[0] - motion[1]).norm() + turn * (middle[0] - middle[1]).norm()
            }
        };
        face.height(&middle) < gauge.reach() + margin
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::Numbers;

    /// Returns a pair: random, of nearly parallel edges or a sliver, far from the origin, or with a gap of 1e-12.
    fn pair(numbers: &mut Numbers, kind: usize) -> [Vec3; 4] {
        let mut x = [(); 4].map(|()| numbers.vector());
        match kind {
            1 => x[3] = x[2] + (x[1] - x[0]) * 0.7 + numbers.vector() * 1e-9,
            2 => x.iter_mut().for_each(|x| *x += Vec3::new(1e6, -1e6, 1e6)),
            3 => x[0] = (x[1] + x[2] + x[3]) / 3.0 + Vec3::new(0.0, 0.0, 1e-12),
            _ => {}
        }
        x
    }

    #[test]
    fn no_configuration_of_a_tube_is_nearer_than_the_bound() {
        let mut numbers = Numbers::new(11);
        let shapes = [
            (Shape::PointPoint, [0, 1, 1, 1]),
            (Shape::PointEdge, [0, 1, 2, 2]),
            (Shape::PointTriangle, [0, 1, 2, 3]),
            (Shape::EdgeEdge, [0, 1, 2, 3]),
        ];
        let (mut far, mut sharp) = (0, 0);
        for round in 0..20_000 {
            let (shape, nodes) = shapes[round % 4];
            let x = pair(&mut numbers, round / 4 % 4);
            let size = 10_f64.powf(-6.0 * numbers.unit());
            let common = numbers.vector();
            let motion = [(); 4].map(|()| common + numbers.vector() * size);
            let reach = [(); 4].map(|()| 0.3 * size * numbers.unit());
            let flat = |of: &[Vec3; 4]| of.iter().flat_map(|v| [v.x, v.y, v.z]).collect::<Vec<f64>>();
            let tube = Tube { start: flat(&x), motion: flat(&motion), reach: reach.to_vec() };
            let margins = Margins::with_common(&tube, common * 0.5);
            let approach = margins.if_nearer(shape, nodes, f64::INFINITY).expect("any pair is nearer");
            let largest = x.iter().map(Vec3::amax).fold(1.0, f64::max);
            let mut nearest = f64::INFINITY;
            for k in 0..6 {
                let tau = if k < 2 { f64::from(k) } else { numbers.unit() };
                let places = nodes.map(|node| {
                    let node = node as usize;
                    let shift = numbers.vector().normalize() * reach[node];
                    x[node] + motion[node] * tau + shift
                });
                // Nodes that a pair has twice are at one place.
                let places = [0, 1, 2, 3].map(|a: usize| {
                    places[nodes.iter().position(|node| *node == nodes[a]).expect("a node of the pair")]
                });
                nearest = nearest.min(shape.closest(&places).distance());
            }
            assert!(approach.least <= nearest + 1e-14 * largest, "{shape:?} {round}: {nearest:e}");
            far += usize::from(approach.least > 0.5 * approach.distance);
            sharp += usize::from(approach.least > 0.9 * nearest);
            // If the pair can come nearer than a distance, it is found.
            let found = margins.if_nearer(shape, nodes, nearest + 1e-9 * largest);
            assert!(found.is_some(), "{shape:?} {round}");
        }
        assert!(far > 10_000 && sharp > 5_000, "{far} {sharp}");
    }
}
