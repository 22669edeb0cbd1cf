//! How near a pair must be in the middle of a tube of configurations so that it can act or meet in the tube.
//!
//! Let m_i be the motion of node i along the path and r_i its reach. On the path, the vector between points of nodes i and
//! j differs from that in the middle by at most ½|m_i − m_j|. So a distance changes by at most
//! ```text
//! max_ij (r_i + r_j + ½ |m_i − m_j|).
//! ```

use vi_core::Tube;

use super::tree::Bounds;
use crate::distance::{Shape, Vec3, at};
use crate::surface::Surface;

/// Half a motion that all nodes have nearly in common, m. Boxes that are inflated with the same one can be compared.
pub(super) type Common = Vec3;

/// A bound on the angle (rad) by which the normal of a rotating half-space turns, above which all points count as near. The
/// bound is twice the sum s of the relative motions of its corners; the true angle is below s (1 + s/4)/(1 − s), which is
/// below 2s for s ≤ 0.3.
const LARGEST_TURN: f64 = 0.6;

/// The margins of all pairs in a tube.
pub(super) struct Margins<'a> {
    /// Positions in the middle of the path, m.
    middle: Vec<f64>,
    tube: &'a Tube,
    common: Common,
    /// For each node, its reach and half of its motion relative to the common one, m.
    spreads: Vec<f64>,
    moves: bool,
}

/// How near a pair comes in a tube.
pub(super) struct Approach {
    /// Square of the distance in the middle of the path, m².
    squared: f64,
    /// Largest change of the distance in the tube, m.
    change: f64,
}

impl Approach {
    /// Returns the distance in the middle of the path, m.
    pub(super) fn distance(&self) -> f64 {
        self.squared.sqrt()
    }

    /// Returns whether the distance can be less than `distance`, m.
    #[inline]
    pub(super) fn is_nearer(&self, distance: f64) -> bool {
        let reach = self.change + distance;
        self.squared < reach * reach
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

    fn largest_spread(&self, nodes: &[u32]) -> f64 {
        nodes.iter().map(|&node| self.spread(node)).fold(0.0, f64::max)
    }

    fn reach(&self, nodes: &[u32]) -> f64 {
        nodes.iter().map(|&node| self.tube.reach[node as usize]).fold(0.0, f64::max)
    }

    /// Returns the box around nodes of a body, inflated such that boxes overlap if a pair can act or meet.
    pub(super) fn bounds(&self, surface: &Surface, nodes: &[u32], body: u32) -> Bounds {
        let bounds = Bounds::of(nodes, &self.middle).of_group(surface.group_of(nodes));
        bounds.inflated(surface.reach(body) + self.largest_spread(nodes))
    }

    /// Returns the distance of a pair in the middle of the path, m, if it can be less than `distance`.
    #[inline]
    pub(super) fn distance_if_nearer(&self, shape: Shape, nodes: [u32; 4], distance: f64) -> Option<f64> {
        Some(self.if_nearer(shape, nodes, distance)?.distance())
    }

    /// Returns how near a pair comes in the tube, if its distance can be less than `distance`, m.
    #[inline]
    pub(super) fn if_nearer(&self, shape: Shape, nodes: [u32; 4], distance: f64) -> Option<Approach> {
        let (first, second) = nodes.split_at(shape.first_count());
        let x = nodes.map(|node| at(&self.middle, node));
        // This bound is at least the change, and most pairs need no better one.
        let bound = distance + self.largest_spread(first) + self.largest_spread(second);
        if shape.is_apart(&x, bound * bound) {
            return None;
        }
        let mut change = 0.0_f64;
        for &i in first {
            for &j in second {
                let relative = match self.moves {
                    true => 0.5 * (at(&self.tube.motion, i) - at(&self.tube.motion, j)).norm(),
                    false => 0.0,
                };
                change = change.max(self.tube.reach[i as usize] + self.tube.reach[j as usize] + relative);
            }
        }
        let approach = Approach { squared: shape.closest(&x).squared, change };
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
