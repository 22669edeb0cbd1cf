//! Finds where surfaces cross, exactly: segments against triangles by adaptive predicates (Shewchuk 1997, crate
//! `robust`), with the signs of exact arithmetic as long as no product underflows.
//!
//! It verifies the results of the contact crate, and shares no code with it.

#[cfg(feature = "cli")]
pub(crate) mod frame;

use std::collections::HashMap;

use nalgebra::Vector3;
use rayon::prelude::*;
use robust::{Coord, Coord3D, orient2d, orient3d};
use vi_mesh::Bounds;

/// Round-off of projections, relative to the largest numbers in them: far more than they have.
const ROUND_OFF: f64 = 1e-12;
/// Round-off below this number may be larger than its relative bound, because products underflow.
const SMALLEST: f64 = 1e-280;
/// Number of segments per task.
const SEGMENTS: usize = 1024;

/// A segment and a triangle with a common point.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub struct Intersection {
    /// Nodes of the segment.
    pub segment: [u32; 2],
    /// Nodes of the triangle.
    pub triangle: [u32; 3],
}

/// Returns all intersections of triangles and wires with triangles, sorted. Parts that share a node, or have nodes at
/// the same position, are connected there and do not count.
pub fn intersections(points: &[[f64; 3]], triangles: &[[u32; 3]], wires: &[[u32; 2]]) -> Vec<Intersection> {
    intersections_where(points, triangles, wires, |_, _| true)
}

/// Returns those of the [`intersections`] that `counts` accepts, given a node of the segment and one of the triangle. What it does not
/// accept is not tested.
pub fn intersections_where(
    points: &[[f64; 3]],
    triangles: &[[u32; 3]],
    wires: &[[u32; 2]],
    counts: impl Fn(u32, u32) -> bool + Sync,
) -> Vec<Intersection> {
    let place_of = places(points);
    let mut segments: Vec<[u32; 2]> =
        triangles.iter().flat_map(|&[a, b, c]| [[a, b], [b, c], [c, a]]).collect();
    segments.extend(wires);
    segments.iter_mut().for_each(|segment| segment.sort_unstable());
    segments.sort_unstable();
    segments.dedup();
    let grid = Grid::new(points, triangles);
    let of_segments = |segments: &[[u32; 2]]| {
        let mut found = Vec::new();
        for &segment in segments {
            let [p, q] = segment.map(|node| points[node as usize]);
            let places = segment.map(|node| place_of[node as usize]);
            grid.for_each_near(&bounds(points, &segment), |triangle| {
                let nodes = triangles[triangle as usize];
                let is_joined = nodes.iter().any(|&node| places.contains(&place_of[node as usize]));
                if is_joined || !counts(segment[0], nodes[0]) {
                    return;
                }
                let corners = nodes.map(|node| points[node as usize]);
                if !are_apart(p, q, corners) && meets(p, q, corners) {
                    found.push(Intersection { segment, triangle: nodes });
                }
            });
        }
        found
    };
    let mut found: Vec<Intersection> = segments.par_chunks(SEGMENTS).flat_map_iter(of_segments).collect();
    found.sort_unstable();
    // A triangle of which two cubes share a bucket is met twice.
    found.dedup();
    found
}

/// Returns whether a point is inside the closed surface of these triangles, which may have either orientation; points
/// on the surface do not count.
///
/// A ray from a point inside crosses the surface an odd number of times. A ray through an edge or a corner is
/// ambiguous; then another ray is used.
pub fn is_inside(place: [f64; 3], points: &[[f64; 3]], triangles: &[[u32; 3]]) -> bool {
    let [low, high] = bounds(points, triangles.as_flattened());
    if (0..3).any(|k| !(low[k] <= place[k] && place[k] <= high[k])) {
        return false;
    }
    let far = (0..3).map(|k| high[k] - low[k]).sum::<f64>();
    let parity = |direction: [f64; 3]| {
        let end = [0, 1, 2].map(|k| place[k] + far * direction[k]);
        let mut crossings = 0;
        for triangle in triangles {
            let [a, b, c] = triangle.map(|node| points[node as usize]);
            let (from, to) = (side(a, b, c, place), side(a, b, c, end));
            let turns = [side(place, end, a, b), side(place, end, b, c), side(place, end, c, a)];
            if turns.contains(&1) && turns.contains(&-1) || from * to > 0 {
                continue;
            }
            if from == 0 || to == 0 || turns.contains(&0) {
                return None;
            }
            crossings += 1;
        }
        Some(crossings % 2 == 1)
    };
    // No three of these directions lie in a plane, and none is along an axis or a diagonal.
    let directions =
        (1..=64).map(|k| [1, 2, 3].map(|axis| (f64::from(k * axis) * 2.399 + f64::from(axis)).sin() + 1.5));
    directions.into_iter().find_map(parity).unwrap_or(false)
}

/// Returns, for each node, the first node at the same position.
fn places(points: &[[f64; 3]]) -> Vec<u32> {
    let mut first = HashMap::new();
    // 0.0 and −0.0 are the same position.
    let key = |point: &[f64; 3]| point.map(|value| (value + 0.0).to_bits());
    (0..).zip(points).map(|(node, point)| *first.entry(key(point)).or_insert(node)).collect()
}

/// Returns whether a direction shows, beyond round-off, that the segment p q and the triangle have no common point: the normal of the
/// triangle, or one in its plane across an edge. Most pairs need no other test.
#[inline]
fn are_apart(p: [f64; 3], q: [f64; 3], [a, b, c]: [[f64; 3]; 3]) -> bool {
    let to = |x: [f64; 3]| Vector3::from(x) - Vector3::from(a);
    let [p, q, b, c] = [p, q, b, c].map(to);
    let largest = p.amax().max(q.amax()).max(b.amax()).max(c.amax());
    let normal = b.cross(&c);
    [normal, b.cross(&normal), c.cross(&normal), (c - b).cross(&normal)].iter().any(|along| {
        // Projections of differences have round-off of some 1e-16 of this product, unless they underflow.
        let margin = ROUND_OFF * along.amax() * largest;
        let [p, q, b, c] = [p, q, b, c].map(|x| along.dot(&x));
        let gap = (p.min(q) - b.max(c).max(0.0)).max(b.min(c).min(0.0) - p.max(q));
        margin > SMALLEST && gap > margin
    })
}

/// Returns whether the closed segment p q intersects the closed triangle. A degenerate triangle intersects nothing;
/// its edges do.
fn meets(p: [f64; 3], q: [f64; 3], triangle: [[f64; 3]; 3]) -> bool {
    let [a, b, c] = triangle;
    let (of_p, of_q) = (side(a, b, c, p), side(a, b, c, q));
    if of_p * of_q > 0 {
        return false;
    }
    if of_p == 0 && of_q == 0 {
        return meets_in_plane(p, q, triangle);
    }
    let turns = [side(p, q, a, b), side(p, q, b, c), side(p, q, c, a)];
    turns.iter().all(|&turn| turn >= 0) || turns.iter().all(|&turn| turn <= 0)
}

/// Tests a segment in the plane of the triangle. Projection along an axis that leaves the triangle a positive area
/// preserves all incidences.
fn meets_in_plane(p: [f64; 3], q: [f64; 3], triangle: [[f64; 3]; 3]) -> bool {
    (0..3).any(|axis| {
        let flat = |x: [f64; 3]| Coord { x: x[(axis + 1) % 3], y: x[(axis + 2) % 3] };
        let turn = |a: Coord<f64>, b: Coord<f64>, c: Coord<f64>| sign(orient2d(a, b, c));
        let (p, q, corners) = (flat(p), flat(q), triangle.map(flat));
        let area = turn(corners[0], corners[1], corners[2]);
        if area == 0 {
            return false;
        }
        let edges = [[0, 1], [1, 2], [2, 0]].map(|ends| ends.map(|k: usize| corners[k]));
        let inside = |x: Coord<f64>| edges.iter().all(|&[a, b]| turn(a, b, x) * area >= 0);
        let crosses =
            |[a, b]: [Coord<f64>; 2]| turn(a, b, p) * turn(a, b, q) < 0 && turn(p, q, a) * turn(p, q, b) <= 0;
        inside(p) || inside(q) || edges.into_iter().any(crosses)
    })
}

/// Returns the side of the plane through a, b and c on which d lies: 1, −1, or 0 on the plane.
fn side(a: [f64; 3], b: [f64; 3], c: [f64; 3], d: [f64; 3]) -> i32 {
    sign(orient3d(solid(a), solid(b), solid(c), solid(d)))
}

fn solid([x, y, z]: [f64; 3]) -> Coord3D<f64> {
    Coord3D { x, y, z }
}

fn sign(value: f64) -> i32 {
    i32::from(value > 0.0) - i32::from(value < 0.0)
}

/// Triangles, listed by the grid cubes that their bounding boxes intersect.
struct Grid {
    origin: [f64; 3],
    size: f64,
    /// Index in `members` of the first triangle of each bucket, followed by the total number. Several cubes may share a bucket.
    starts: Vec<usize>,
    members: Vec<u32>,
    /// The bounding box of each triangle, and the cube of its lower corner.
    boxes: Vec<[[f64; 3]; 2]>,
    first: Vec<[i64; 3]>,
}

/// Largest number of cubes along the longest side.
const FINEST: f64 = 256.0;

/// Returns the bucket of a cube among a number of buckets that is a power of two (M. Teschner et al., "Optimized spatial hashing for
/// collision detection of deformable objects", VMV 2003).
fn bucket([i, j, k]: [i64; 3], count: usize) -> usize {
    let mixed = i.wrapping_mul(73_856_093) ^ j.wrapping_mul(19_349_663) ^ k.wrapping_mul(83_492_791);
    mixed as usize & (count - 1)
}

impl Grid {
    fn new(points: &[[f64; 3]], triangles: &[[u32; 3]]) -> Self {
        let boxes: Vec<[[f64; 3]; 2]> = triangles.iter().map(|nodes| bounds(points, nodes)).collect();
        let extent = |[low, high]: &[[f64; 3]; 2]| (0..3).map(|k| high[k] - low[k]).fold(0.0, f64::max);
        let all = Bounds::of(boxes.iter().flatten().copied());
        let mean = boxes.iter().map(extent).sum::<f64>() / boxes.len().max(1) as f64;
        let size = mean.max(all.longest_side() / FINEST);
        let size = if size > 0.0 && size.is_finite() { size } else { 1.0 };
        let (starts, members) = (Vec::new(), Vec::new());
        let mut grid = Self { origin: all.low, size, starts, members, boxes: Vec::new(), first: Vec::new() };
        grid.first = boxes.iter().map(|[low, _]| grid.cube(low)).collect();
        // Sort the triangles by bucket: count, sum, and fill from the end of each bucket.
        let count = (4 * boxes.len()).next_power_of_two();
        let buckets = |item| grid.cubes_of(item).map(|cube| bucket(cube, count));
        let mut starts = vec![0; count + 1];
        boxes.iter().flat_map(&buckets).for_each(|bucket| starts[bucket] += 1);
        let mut total = 0;
        for start in &mut starts {
            total += *start;
            *start = total;
        }
        let mut members = vec![0; total];
        for (number, item) in boxes.iter().enumerate().rev() {
            for bucket in buckets(item) {
                starts[bucket] -= 1;
                members[starts[bucket]] = number as u32;
            }
        }
        (grid.starts, grid.members, grid.boxes) = (starts, members, boxes);
        grid
    }

    fn cubes_of(&self, [low, high]: &[[f64; 3]; 2]) -> impl Iterator<Item = [i64; 3]> + use<> {
        let [first, last] = [self.cube(low), self.cube(high)];
        let along = move |axis: usize| first[axis]..=last[axis];
        along(0).flat_map(move |i| along(1).flat_map(move |j| along(2).map(move |k| [i, j, k])))
    }

    /// Returns the cube that contains a point.
    fn cube(&self, point: &[f64; 3]) -> [i64; 3] {
        [0, 1, 2].map(|k: usize| ((point[k] - self.origin[k]) / self.size).floor() as i64)
    }

    /// Calls `see` with the triangles whose bounding boxes intersect that of a segment. A triangle of which two cubes share a bucket
    /// is seen twice.
    #[inline]
    fn for_each_near(&self, bounds: &[[f64; 3]; 2], mut see: impl FnMut(u32)) {
        let first = self.cube(&bounds[0]);
        self.cubes_of(bounds).for_each(|cube| {
            let bucket = bucket(cube, self.starts.len() - 1);
            for &triangle in &self.members[self.starts[bucket]..self.starts[bucket + 1]] {
                // Two boxes have several cubes in common. Only the first one of these counts.
                let other = self.first[triangle as usize];
                let is_first = (0..3).all(|k| cube[k] == first[k].max(other[k]));
                if is_first && overlap(bounds, &self.boxes[triangle as usize]) {
                    see(triangle);
                }
            }
        });
    }
}

/// Returns whether two boxes have a common point.
#[inline]
fn overlap([low, high]: &[[f64; 3]; 2], [other_low, other_high]: &[[f64; 3]; 2]) -> bool {
    (0..3).all(|k| low[k] <= other_high[k] && other_low[k] <= high[k])
}

fn bounds(points: &[[f64; 3]], nodes: &[u32]) -> [[f64; 3]; 2] {
    let Bounds { low, high } = Bounds::of(nodes.iter().map(|&node| points[node as usize]));
    [low, high]
}

#[cfg(test)]
mod tests {
    use super::*;

    const TRIANGLE: [[f64; 3]; 3] = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];

    #[test]
    fn a_crossing_of_the_smallest_size_is_seen_and_the_smallest_gap_is_none() {
        // Predicates are exact as long as products do not underflow.
        let tiny = 1e-100;
        for (low, high, expected) in
            [(-tiny, 1.0, true), (0.0, 1.0, true), (tiny, 1.0, false), (-1.0, -tiny, false)]
        {
            assert_eq!(meets([0.2, 0.2, low], [0.3, 0.3, high], TRIANGLE), expected, "{low:e} {high:e}");
        }
        // Segments through an edge, through a corner, and one bit next to it.
        assert!(meets([0.5, 0.5, -1.0], [0.5, 0.5, 1.0], TRIANGLE));
        assert!(meets([0.0, 0.0, -1.0], [0.0, 0.0, 1.0], TRIANGLE));
        assert!(!meets([0.5, 0.5_f64.next_up(), -1.0], [0.5, 0.5_f64.next_up(), 1.0], TRIANGLE));
        assert!(!meets([-tiny, 0.5, -1.0], [-tiny, 0.5, 1.0], TRIANGLE));
    }

    #[test]
    fn what_a_direction_shows_apart_does_not_meet() {
        let mut seed = 1_u64;
        let mut number = || {
            seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (seed >> 11) as f64 / (1_u64 << 53) as f64
        };
        let (mut apart, mut meeting, mut neither) = (0, 0, 0);
        for round in 0..20_000 {
            // Multiples of an eighth have common planes, edges and corners; others have none.
            let mut place =
                || [(); 3].map(|()| if round % 2 == 0 { number() } else { (8.0 * number()).floor() / 8.0 });
            let [p, q, a, b, c] = [(); 5].map(|()| place());
            match (are_apart(p, q, [a, b, c]), meets(p, q, [a, b, c])) {
                (true, met) => {
                    assert!(!met, "{p:?} {q:?} {a:?} {b:?} {c:?}");
                    apart += 1;
                }
                (false, true) => meeting += 1,
                (false, false) => neither += 1,
            }
        }
        assert!(apart > 10_000 && meeting > 500 && neither < 5_000, "{apart} {meeting} {neither}");
    }

    #[test]
    fn segments_in_the_plane_of_a_triangle_are_judged_there() {
        assert!(meets([0.1, 0.1, 0.0], [0.2, 0.2, 0.0], TRIANGLE));
        assert!(meets([-1.0, 0.5, 0.0], [2.0, 0.4, 0.0], TRIANGLE));
        assert!(!meets([1.0, 0.1, 0.0], [0.9, 0.2, 0.0], TRIANGLE));
        assert!(!meets([2.0, 0.0, 0.0], [3.0, 0.0, 0.0], TRIANGLE));
    }

    #[test]
    fn a_place_is_inside_a_closed_surface_or_not() {
        let points = [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        let triangles = [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]];
        let tiny = 1e-15;
        for (place, expected) in [
            ([0.2, 0.2, 0.2], true),
            ([0.4, 0.4, 0.4], false),
            ([tiny, 0.5, 0.25], true),
            ([-tiny, 0.5, 0.25], false),
            ([0.25, 0.25, 0.5 - tiny], true),
            ([0.25, 0.25, 0.5 + tiny], false),
            ([5.0, 0.2, 0.2], false),
        ] {
            assert_eq!(is_inside(place, &points, &triangles), expected, "{place:?}");
        }
    }

    #[test]
    fn only_parts_without_a_common_place_are_pairs() {
        let mut points = TRIANGLE.to_vec();
        points.extend([[0.2, 0.2, -1.0], [0.3, 0.3, 1.0], [0.0, 0.0, -0.0], [0.25, 0.2, 5.0]]);
        let triangles = [[0, 1, 2], [3, 4, 6]];
        let found = intersections(&points, &triangles, &[[3, 5]]);
        let through = |segment| Intersection { segment, triangle: [0, 1, 2] };
        assert_eq!(found, [through([3, 4]), through([3, 6])]);
        assert_eq!(intersections(&points, &triangles[..1], &[]), []);
    }
}
