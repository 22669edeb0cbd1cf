//! Continuous collision detection by separating planes: proofs that two moving simplices stay apart.
//!
//! The nodes of simplices A and B move on straight lines, x(t) = (1−t) x₀ + t x₁. For any direction w and nodes i of
//! A, j of B, a_ij(t) = w·(x_i − x_j) is affine in t. If every a_ij ≥ |w| ξ at two times, the convex hulls are at
//! least ξ apart at all times between them. So a few affine functions prove an interval, whatever the quality of w.
//! Each a_ij is reduced by
//! ```text
//! 8u |w|₁ (|Δ₀|₁ + |Δ₁|₁) + 4u |w| ξ,   u = 2⁻⁵³,   Δ = x_i − x_j at both ends.
//! ```
//! This covers the rounding of Δ, of the products and of the times. w is the vector between the closest points at the
//! time up to which separation is proved; the interval is extended as long as it grows. The returned interval is
//! always proved; the limit of iterations can only make it shorter.
//!
//! The additive method of Li et al. 2021 (C-IPC) can miss collisions by rounding; this method cannot. It also needs
//! no tolerance, unlike root finders over intervals (Wang et al. 2021, Tight Inclusion).

use crate::distance::{Shape, Vec3, at};
use crate::pairs::{Contact, Partners, in_order};
use crate::surface::Gauge;

/// Largest number of directions tried for one pair. Far pairs need one; pairs nearer than 1e-2 of their size need six
/// on average. A path along a thin capsule needs hundreds: with 24 directions, which proved 3e-4 of it, Newton's method
/// crept along needles until the step failed.
const DIRECTIONS: usize = 400;
/// The search ends if the interval grows by less than this.
const PROGRESS: f64 = 1e-5;

/// One separating direction, and the interval for which it proves separation.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Certificate {
    /// The direction w.
    pub direction: Vec3,
    /// Start of the interval.
    pub from: f64,
    /// End of the interval.
    pub to: f64,
}

/// Returns a time s in [0, 1] such that the pair is proved to stay more than `thickness` apart on [0, s] while its
/// nodes move straight from x₀ to x₁; zero if it is not apart at the start. `record` receives the certificates, whose
/// consecutive intervals cover 0 to s.
#[inline]
pub fn separated_until(
    shape: Shape,
    x0: &[Vec3; 4],
    x1: &[Vec3; 4],
    thickness: f64,
    record: impl FnMut(Certificate),
) -> f64 {
    separated_from(shape, x0, x1, thickness, shape.closest(x0).vector, record)
}

/// Returns [`separated_until`], given the vector between the closest points at the start.
#[inline]
fn separated_from(
    shape: Shape,
    x0: &[Vec3; 4],
    x1: &[Vec3; 4],
    thickness: f64,
    mut vector: Vec3,
    mut record: impl FnMut(Certificate),
) -> f64 {
    let mut time = 0.0;
    for _ in 0..DIRECTIONS {
        let length = vector.norm();
        if length == 0.0 || !length.is_finite() {
            return time;
        }
        let direction = vector / length;
        let Some(until) = plane_holds_until(shape, x0, x1, thickness, direction, time) else { return time };
        record(Certificate { direction, from: time, to: until });
        if until >= 1.0 {
            return 1.0;
        }
        let progress = until - time;
        time = until;
        if progress < PROGRESS {
            return time;
        }
        let mut x = *x0;
        for a in 0..shape.arity() {
            x[a] += (x1[a] - x0[a]) * time;
        }
        vector = shape.closest(&x).vector;
    }
    time
}

/// Returns the end of the interval from `time` on in which direction w separates; `None` if it does not separate at
/// `time`.
#[inline]
fn plane_holds_until(
    shape: Shape,
    x0: &[Vec3; 4],
    x1: &[Vec3; 4],
    thickness: f64,
    w: Vec3,
    time: f64,
) -> Option<f64> {
    const U: f64 = 0.5 * f64::EPSILON;
    let (first, arity) = (shape.first_count(), shape.arity());
    let size = w.x.abs() + w.y.abs() + w.z.abs();
    // |w| is 1 up to a few roundings.
    let apart = thickness * (1.0 + 16.0 * U);
    let mut until = 1.0_f64;
    for i in 0..first {
        for j in first..arity {
            let (start, end) = (x0[i] - x0[j], x1[i] - x1[j]);
            let sum =
                (start.x.abs() + start.y.abs() + start.z.abs()) + (end.x.abs() + end.y.abs() + end.z.abs());
            let lost = 8.0 * U * size * sum + apart;
            let (a0, a1) = (w.dot(&start) - lost, w.dot(&end) - lost);
            let now = (1.0 - time) * a0 + time * a1;
            if now < 0.0 || now.is_nan() {
                return None;
            }
            if a1 < 0.0 {
                until = until.min((a0 / (a0 - a1)) * (1.0 - 8.0 * U));
            }
        }
    }
    (until > time).then_some(until)
}

/// The first point of a path that is not proved free of contact.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Impact {
    /// The fraction of the path that is proved free, in [0, 1), or on which the pair keeps the part of its gap that was asked
    /// for.
    pub time: f64,
    /// The pair that meets there, or may meet.
    pub partners: Partners,
    /// The nodes of the pair; the last one is repeated if there are fewer.
    pub nodes: [u32; 4],
}

impl Contact<'_> {
    /// Returns the earliest impact on the straight path from x₀ to x₁; `None` if the whole path is proved free of
    /// contact.
    ///
    /// The candidates must cover both ends. Of several pairs with the same time the first is returned.
    pub fn first_impact(&self, x0: &[f64], x1: &[f64]) -> Option<Impact> {
        self.impacts(x0, x1, 0.0)
            .into_iter()
            .min_by(|a, b| a.time.total_cmp(&b.time).then_with(|| a.partners.cmp(&b.partners)))
    }

    /// Returns every pair whose straight path from x₀ to x₁ is not proved free of contact, or on which its gap is not proved to
    /// stay above the fraction `kept` of what it is at x₀; a gap wider than the layer counts as that of the layer. Such a pair
    /// may move until twice this fraction is left, so that it can keep enough if others stop its nodes one by one.
    ///
    /// Newton's method doubles a gap that is much too small in one iteration. With `kept` = ¼, a correction is undone as fast as
    /// it is done. With a tenth, pairs of a knife on several edges became too small in turn, and no step converged, however
    /// short.
    pub(crate) fn impacts(&self, x0: &[f64], x1: &[f64], kept: f64) -> Vec<Impact> {
        let surface = self.surface;
        let near = self.neighbours.near();
        let mut impacts = in_order(
            near.len(),
            || (),
            |k, (), out| {
                let point = near[k] as usize;
                let node = surface.points[point].node;
                for (body, cells) in self.bodies_of(point) {
                    let Some(gauge) = surface.point_gauge(point, body) else { continue };
                    for &cell in cells {
                        let cell = &surface.cells[cell as usize];
                        let [a, b, c] = cell.nodes;
                        let partners = Partners::PointBody(point as u32, body);
                        out.extend(impact(partners, cell.shape(), [node, a, b, c], &gauge, [x0, x1], kept));
                    }
                }
            },
        );
        impacts.extend(in_order(
            self.neighbours.edges.len(),
            || (),
            |pair, (), out| {
                let edges = self.neighbours.edges[pair];
                let Some(pair) = surface.edge_pair(edges) else { return };
                let partners = Partners::Edges(edges[0], edges[1]);
                out.extend(impact(partners, Shape::EdgeEdge, pair.nodes, &pair.gauge, [x0, x1], kept));
            },
        ));
        let of_planes = self.neighbours.planes.iter().filter_map(|&[point, plane]| {
            let gauge = surface.plane_gauge(point as usize, plane as usize)?;
            let face = &surface.half_spaces[plane as usize];
            let [(nodes, start), (_, end)] = [x0, x1].map(|x| self.over_plane(point, plane, x));
            let free_until = |least: f64| {
                if face.corners.is_some() {
                    face.free_until(&start, &end, least)
                } else {
                    // The normal is the direction that separates.
                    let shape = Shape::PointPoint;
                    plane_holds_until(shape, &start, &end, least, face.normal, 0.0).unwrap_or(0.0)
                }
            };
            let time = time_of(&gauge, face.height(&start), kept, free_until)?;
            Some(Impact { time, partners: Partners::PointPlane(point, plane), nodes })
        });
        impacts.extend(of_planes);
        impacts
    }
}

/// Returns the time until which a pair may move on a path where its distance is `distance` at the start, as
/// [`Contact::impacts`] describes; `None` if it may make the whole path. `free_until` returns the time until which the pair is
/// proved to stay farther apart than a distance.
#[inline]
fn time_of(gauge: &Gauge, distance: f64, kept: f64, free_until: impl Fn(f64) -> f64) -> Option<f64> {
    let gap = (distance - gauge.thickness).clamp(0.0, gauge.distance);
    let until = |kept: f64| free_until(gauge.thickness + kept * gap);
    (until(kept) < 1.0).then(|| until(2.0 * kept))
}

/// Returns the impact of a pair on the straight path from x₀ to x₁; `None` if that is proved free.
fn impact(
    partners: Partners,
    shape: Shape,
    nodes: [u32; 4],
    gauge: &Gauge,
    x: [&[f64]; 2],
    kept: f64,
) -> Option<Impact> {
    let [start, end] = x.map(|x| nodes.map(|node| at(x, node)));
    let closest = shape.closest(&start);
    let free_until = |least: f64| separated_from(shape, &start, &end, least, closest.vector, |_| {});
    let time = time_of(gauge, closest.distance(), kept, free_until)?;
    Some(Impact { time, partners, nodes })
}
