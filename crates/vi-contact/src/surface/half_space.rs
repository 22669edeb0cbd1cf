//! Points over half-spaces, whose faces may rotate.

use super::HalfSpace;
use crate::distance::{Closest, Shape, Vec3, combine};

/// Round-off of one operation.
const U: f64 = 0.5 * f64::EPSILON;
/// Number of bisections for the free part of a path.
const BISECTIONS: usize = 40;

impl HalfSpace {
    /// Returns the nodes of a pair with the point at `node`; the last one is repeated if there are fewer.
    pub(crate) fn nodes_with(&self, node: u32) -> [u32; 4] {
        let [a, b] = self.corners.unwrap_or([self.node; 2]);
        [node, self.node, a, b]
    }

    /// Returns the kind of pair that a point forms with it: two nodes if its normal is constant.
    pub(crate) fn shape(&self) -> Shape {
        if self.corners.is_some() { Shape::PointTriangle } else { Shape::PointPoint }
    }

    /// Returns the outward unit normal, with the nodes of a pair at positions x.
    pub(crate) fn normal_at(&self, x: &[Vec3; 4]) -> Vec3 {
        match self.corners {
            Some(_) => (x[2] - x[1]).cross(&(x[3] - x[1])).normalize(),
            None => self.normal,
        }
    }

    /// Returns the height of the point over the face, m; negative inside.
    pub(crate) fn height(&self, x: &[Vec3; 4]) -> f64 {
        self.normal_at(x).dot(&(x[0] - x[1]))
    }

    /// Returns the point of the face that is closest to a point outside.
    pub(crate) fn closest(&self, x: &[Vec3; 4]) -> Closest {
        let (normal, r) = (self.normal_at(x), x[0] - x[1]);
        let height = normal.dot(&r);
        let mut weights = [1.0, -1.0, 0.0, 0.0];
        if self.corners.is_some() {
            let (u, v) = (x[2] - x[1], x[3] - x[1]);
            let area = u.cross(&v).dot(&normal);
            let (a, b) = (r.cross(&v).dot(&normal) / area, u.cross(&r).dot(&normal) / area);
            weights = [1.0, a + b - 1.0, -a, -b];
        }
        // The vector of a rotating face is exactly the combination of the nodes, as that of other pairs.
        let vector = if self.corners.is_some() { combine(&weights, x) } else { normal * height };
        Closest { squared: height * height, vector, weights }
    }

    /// Returns the proved part of the straight path of all nodes from x₀ to x₁ on which the point stays higher than
    /// `thickness` over a face that rotates.
    ///
    /// With u, v and r from the node on the face to both others and to the point, the height times |u × v| is the cubic
    /// (u × v)·r. A polynomial is not below the least of its Bernstein coefficients, and |u × v| not above the largest.
    pub(crate) fn free_until(&self, x0: &[Vec3; 4], x1: &[Vec3; 4], thickness: f64) -> f64 {
        let of = |x: &[Vec3; 4]| [x[2] - x[1], x[3] - x[1], x[0] - x[1]];
        let ([u0, v0, r0], end) = (of(x0), of(x1));
        let is_free = |t: f64| {
            let at = |start: Vec3, end: Vec3| if t == 1.0 { end } else { start + (end - start) * t };
            let [u1, v1, r1] = [at(u0, end[0]), at(v0, end[1]), at(r0, end[2])];
            let normals = [u0.cross(&v0), (u0.cross(&v1) + u1.cross(&v0)) * 0.5, u1.cross(&v1)];
            let heights = [
                normals[0].dot(&r0),
                (2.0 * normals[1].dot(&r0) + normals[0].dot(&r1)) / 3.0,
                (normals[2].dot(&r0) + 2.0 * normals[1].dot(&r1)) / 3.0,
                normals[2].dot(&r1),
            ];
            let size = |a: Vec3, b: Vec3| a.abs().sum() + b.abs().sum();
            let lost = 64.0 * U * size(u0, u1) * size(v0, v1) * size(r0, r1);
            let widest = normals.iter().map(Vec3::norm).fold(0.0, f64::max);
            heights.iter().all(|&height| height > thickness * widest * (1.0 + 16.0 * U) + lost)
        };
        if is_free(1.0) {
            return 1.0;
        }
        let (mut low, mut high) = (0.0, 1.0);
        for _ in 0..BISECTIONS {
            let middle = 0.5 * (low + high);
            *(if is_free(middle) { &mut low } else { &mut high }) = middle;
        }
        low
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::Numbers;

    /// On random paths, the proved part is free at every sampled time, and its end is near the true one.
    #[test]
    fn a_proved_path_is_free() {
        let plane = HalfSpace { node: 1, body: 0, normal: Vec3::z(), corners: Some([2, 3]) };
        let (mut numbers, mut stopped) = (Numbers::new(7), 0);
        for _ in 0..5000 {
            let base = [Vec3::new(0.3, 0.2, 0.3), Vec3::zeros(), Vec3::x(), Vec3::y()];
            let x0 = base.map(|x| x + numbers.vector() * 0.1);
            let x1 = base.map(|x| x + numbers.vector() * 0.4);
            if plane.height(&x0) < 0.02 {
                continue;
            }
            let until = plane.free_until(&x0, &x1, 0.01);
            let at = |t: f64| plane.height(&[0, 1, 2, 3].map(|k: usize| x0[k] * (1.0 - t) + x1[k] * t));
            for k in 0..=50 {
                assert!(at(until * f64::from(k) / 50.0) >= 0.01 - 1e-12);
            }
            if until < 1.0 {
                stopped += 1;
            } else {
                assert!(at(1.0) > 0.01);
            }
        }
        assert!(stopped > 100, "{stopped}");
    }
}
