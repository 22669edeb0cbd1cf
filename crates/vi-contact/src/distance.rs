//! Distances between two simplices: point–point, point–edge, point–triangle, edge–edge.
//!
//! A pair has up to four nodes. r = Σ_a c_a x_a connects its closest points, with weights c that sum to zero (1 on
//! the point, −β on the triangle). Everything is computed from differences of positions. Squares in a Gram matrix
//! would lose u L²/d² for a distance d between features of size L; differences lose u L/d, where u = 2⁻⁵³.

mod curvature;
mod edge;
mod triangle;

pub(crate) use curvature::{free_motions, squared_hessian};
pub(crate) use edge::edge_edge;
pub(crate) use triangle::{point_edge, point_point, point_triangle};

use nalgebra::Vector3;

/// A vector in space.
pub(crate) type Vec3 = Vector3<f64>;

/// Returns the position of a node in the flat array of coordinates.
#[inline]
pub(crate) fn at(x: &[f64], node: u32) -> Vec3 {
    let k = 3 * node as usize;
    let [a, b, c] = x[k..k + 3] else { unreachable!("three coordinates") };
    Vec3::new(a, b, c)
}

/// The closest points of a pair.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Closest {
    /// |r|², m².
    pub squared: f64,
    /// r = Σ c_a x_a, from the second simplex to the first, m.
    pub vector: Vec3,
    /// c_a; zero for nodes that the pair does not have.
    pub weights: [f64; 4],
}

impl Closest {
    /// Returns the nodes that determine the closest points: bit a is set if c_a ≠ 0.
    #[inline]
    pub fn support(&self) -> u8 {
        (0..4).fold(0, |bits, a| bits | (u8::from(self.weights[a] != 0.0) << a))
    }

    /// Returns d = |r|, m.
    #[inline]
    pub fn distance(&self) -> f64 {
        self.squared.sqrt()
    }
}

/// Returns Σ_a c_a x_a.
#[inline]
pub(crate) fn combine(weights: &[f64; 4], x: &[Vec3; 4]) -> Vec3 {
    x[0] * weights[0] + x[1] * weights[1] + x[2] * weights[2] + x[3] * weights[3]
}

/// The kinds of pairs.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Shape {
    /// Node 0 against node 1.
    PointPoint,
    /// Node 0 against the edge of nodes 1 and 2.
    PointEdge,
    /// Node 0 against the triangle of nodes 1, 2 and 3.
    PointTriangle,
    /// The edge of nodes 0 and 1 against that of nodes 2 and 3.
    EdgeEdge,
}

impl Shape {
    /// Returns the number of nodes of the pair.
    pub fn arity(self) -> usize {
        match self {
            Self::PointPoint => 2,
            Self::PointEdge => 3,
            Self::PointTriangle | Self::EdgeEdge => 4,
        }
    }

    /// Returns the number of nodes of the first simplex; the others up to the arity belong to the second.
    #[inline]
    pub(crate) fn first_count(self) -> usize {
        if self == Self::EdgeEdge { 2 } else { 1 }
    }

    /// Returns whether the distance of the pair is more than the square root of `squared` (m²), as far as the distance along the
    /// line between the centroids shows it. This is much cheaper than the closest points, and finds most pairs of neighbours
    /// in a mesh apart.
    #[inline]
    pub(crate) fn is_apart(self, x: &[Vec3; 4], squared: f64) -> bool {
        let [a, b, c, d] = *x;
        let (line, least, most) = if self.first_count() == 2 {
            let line = (a + b) - (c + d);
            (line, line.dot(&(a - c)).min(line.dot(&(b - c))), line.dot(&(d - c)).max(0.0))
        } else {
            let line = a * 3.0 - (b + c + d);
            (line, line.dot(&(a - b)), line.dot(&(c - b)).max(line.dot(&(d - b))).max(0.0))
        };
        let apart = least - most;
        // Keep pairs that are apart by no more than round-off.
        apart > 0.0 && apart * apart >= squared * (1.0 + 1e-9) * line.norm_squared()
    }

    /// Returns the closest points at several positions of the nodes, if the square of their distance is below `squared` (m²) at
    /// one of them.
    #[inline]
    pub(crate) fn closest_if_nearer<const N: usize>(
        self,
        x: &[[Vec3; 4]; N],
        squared: f64,
    ) -> Option<[Closest; N]> {
        // The closest points of two points cost less than the bound.
        if self != Self::PointPoint && x.iter().all(|x| self.is_apart(x, squared)) {
            return None;
        }
        let closest = std::array::from_fn(|end| self.closest(&x[end]));
        closest.iter().any(|closest: &Closest| closest.squared < squared).then_some(closest)
    }

    /// Returns the closest points at positions x. Entries of x beyond the arity are ignored. Of equally close
    /// features the one with the lowest index is chosen.
    #[inline]
    pub fn closest(self, x: &[Vec3; 4]) -> Closest {
        match self {
            Self::PointPoint => point_point(x),
            Self::PointEdge => point_edge(x),
            Self::PointTriangle => point_triangle(x),
            Self::EdgeEdge => edge_edge(x),
        }
    }
}
