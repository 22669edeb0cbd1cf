//! The pairs that act, and their energies.
//!
//! The energy of a point p against the cells of a body is, with the point's area w, the modulus κ and the activation
//! distance d̂,
//! ```text
//! C_p = ½ w κ d̂ Σ_σ n_σ B((d(p, σ) − ξ)/d̂).
//! ```
//! The sum is over all simplices σ of the body: triangles and wire edges with n = 1, other edges with n = 1 −
//! (triangles at the edge), nodes with n = 1 + (triangles at it) − (edges at it). This is inclusion and exclusion:
//! the numbers n of all simplices that contain a given one sum to 1. So every part of the surface counts once,
//! however it is meshed, also on rims, forks and wires. d(p, σ) is the distance from the closed simplex. Hence C_p is
//! one continuous function of positions, a sum over fixed pairs (p, σ) with fixed n. Grouping pairs with the same
//! closest feature only simplifies the arithmetic and never changes the sum (see `groups.rs`).
//! The formula is the "improved max" of Li et al. 2023 (Convergent IPC) for points against triangles, with n from the
//! mesh. For crossing edges nothing is subtracted, because their sum could become negative.

mod chord;
mod clusters;
mod crossing;
mod edges;
mod energy;
mod gaps;
mod groups;
mod rims;
mod step;
mod term;
mod viscosity;

pub use clusters::clusters;
pub use energy::{ActivePair, Blend};
pub use gaps::Gap;
pub use step::{AT_END, StepPair, StepSettings};

use crate::broad_phase::Neighbours;
use crate::distance::at;
use crate::surface::Surface;

pub(crate) use chord::DistanceChange;
pub(crate) use energy::{add_square, in_order, pack_rank_one};
pub(crate) use groups::Group;

/// The two parts of a pair.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Partners {
    /// A point and the cells of a body, by their numbers.
    PointBody(u32, u32),
    /// A point and a half-space, by their numbers.
    PointPlane(u32, u32),
    /// Two edges, by their numbers.
    Edges(u32, u32),
}

impl Partners {
    /// Returns the number of nodes of the first part: one for a point, two for an edge.
    pub(crate) fn first_count(self) -> usize {
        if matches!(self, Self::Edges(..)) { 2 } else { 1 }
    }

    /// Returns a number that no other pair has. A surface has fewer than 2³¹ parts of each kind.
    pub(crate) fn number(self) -> u64 {
        let (kind, a, b) = match self {
            Self::PointBody(point, body) => (0, point, body),
            Self::PointPlane(point, plane) => (1, point, plane),
            Self::Edges(a, b) => (2, a, b),
        };
        kind << 62 | u64::from(a) << 31 | u64::from(b)
    }
}

impl Surface {
    /// Returns the numbers of both bodies of a pair.
    pub(crate) fn bodies_of(&self, partners: Partners) -> [u32; 2] {
        match partners {
            Partners::PointBody(point, body) => [self.points[point as usize].body, body],
            Partners::PointPlane(point, plane) => {
                [self.points[point as usize].body, self.half_spaces[plane as usize].body]
            }
            Partners::Edges(a, b) => [self.edges[a as usize].body, self.edges[b as usize].body],
        }
    }

    /// Returns the frames of both bodies of a pair; `None` for a body without frame.
    pub(crate) fn frames_of(&self, partners: Partners) -> [Option<[u32; 4]>; 2] {
        self.bodies_of(partners).map(|body| self.frames[body as usize])
    }

    /// Returns the distance between neighbouring nodes at a pair, m: that of the finer side.
    pub(crate) fn spacing(&self, partners: Partners, x: &[f64]) -> f64 {
        let between = |[a, b]: [u32; 2]| (at(x, a) - at(x, b)).norm();
        let around = |point: u32| self.points[point as usize].area.sqrt();
        match partners {
            Partners::PointBody(point, _) | Partners::PointPlane(point, _) => around(point),
            Partners::Edges(a, b) => {
                let [a, b] = [a, b].map(|edge| between(self.edges[edge as usize].nodes));
                a.min(b)
            }
        }
    }

    /// Returns whether the friction of this pair is that of a round body.
    pub(crate) fn rolls(&self, partners: Partners) -> bool {
        self.bodies_of(partners).into_iter().any(|body| self.is_round(body))
    }
}

/// Surfaces with the candidates near a configuration, from which energies and forces are computed.
#[derive(Debug, Clone, Copy)]
pub struct Contact<'a> {
    /// The surfaces.
    pub surface: &'a Surface,
    /// Candidates that cover every configuration to be evaluated.
    pub neighbours: &'a Neighbours,
}
