//! The angle between two triangles at their common edge, with its derivatives, in SIMD lanes.
//!
//! The corners are the edge x₀ → x₁, the free corner x₂ of the first triangle (x₀, x₁, x₂) and the free corner x₃ of
//! the second (x₁, x₀, x₃). The angle is zero if they are coplanar, and positive if x₃ is on the side of the first
//! normal. Seen from the second triangle, as (x₁, x₀, x₃, x₂), it is the same.

use crate::lanes::real::Real;
use crate::small::tensor::{cross, dot, vec3};

type Corners<R> = [[R; 3]; 4];

#[inline(always)]
fn sub<R: Real>(a: [R; 3], b: [R; 3]) -> [R; 3] {
    vec3!(i => a[i] - b[i])
}

/// Quantities of one of the two triangles at the edge e that the gradient and the Hessian of θ use.
#[derive(Clone, Copy)]
struct Wing<R> {
    /// e × r.
    n: [R; 3],
    /// ∂θ/∂(free corner) = ± |e| n/|n|².
    slope: [R; 3],
    /// The vector r from x₀ to the free corner.
    r: [R; 3],
    /// The projection of the free corner onto the edge: 0 at x₀, 1 at x₁.
    s: R,
    /// |n|².
    square: R,
    /// ± |e|/|n|².
    factor: R,
}

/// The gradient ∂θ/∂x of the dihedral angle, in eight numbers.
pub(crate) struct Slopes<R> {
    /// ∂θ/∂x at the free corners, 1/m.
    pub(crate) free: [[R; 3]; 2],
    /// The projections of the free corners onto the edge: 0 at x₀, 1 at x₁.
    pub(crate) s: [R; 2],
}

impl<R: Real> Slopes<R> {
    /// Returns ∂θ/∂x at the four corners, 1/m.
    #[inline(always)]
    pub(crate) fn at_corners(&self) -> Corners<R> {
        let ([one, two], [s, t]) = (self.free, self.s);
        let at_start = vec3!(i => (s - 1.0) * one[i] + (t - 1.0) * two[i]);
        let at_end = vec3!(i => -(s * one[i] + t * two[i]));
        [at_start, at_end, one, two]
    }
}

/// An edge with its two triangles.
pub(crate) struct Fold<R> {
    e: [R; 3],
    square: R,
    wings: [Wing<R>; 2],
}

#[inline(always)]
fn wing<R: Real>(e: [R; 3], square: R, r: [R; 3], sign: f64) -> Wing<R> {
    let n = cross(e, r);
    let normal_square = dot(n, n);
    let factor = square.sqrt() / normal_square * sign;
    Wing { n, slope: vec3!(i => n[i] * factor), r, s: dot(r, e) / square, square: normal_square, factor }
}

impl<R: Real> Fold<R> {
    #[inline(always)]
    pub(crate) fn new(x: &Corners<R>) -> Self {
        let e = sub(x[1], x[0]);
        let square = dot(e, e);
        let wings = [wing(e, square, sub(x[2], x[0]), 1.0), wing(e, square, sub(x[3], x[0]), -1.0)];
        Self { e, square, wings }
    }

    /// Returns sin θ and cos θ.
    #[inline(always)]
    pub(crate) fn direction(&self) -> [R; 2] {
        let [one, two] = self.wings;
        // m = r × e of the second triangle.
        let m = vec3!(i => -two.n[i]);
        let size = (one.square * two.square).sqrt();
        [dot(self.e, cross(m, one.n)) / (self.square.sqrt() * size), dot(one.n, m) / size]
    }

    /// Returns ∂θ/∂x, 1/m.
    #[inline(always)]
    pub(crate) fn gradient(&self) -> Corners<R> {
        self.slopes().at_corners()
    }

    #[inline(always)]
    pub(crate) fn slopes(&self) -> Slopes<R> {
        let [one, two] = self.wings;
        Slopes { free: [one.slope, two.slope], s: [one.s, two.s] }
    }

    /// Returns the lower triangle of ∂²θ/∂x², 1/m².
    ///
    /// The gradient is a sum over the two triangles: A at the free corner, −(1 − s) A and −s A at the ends of the
    /// edge, with A = ± |e| n/|n|². Its derivative follows from dA = ± (|e|/|n|²)(I − 2 n nᵀ/|n|²) dn + (A/|e|²) e·de
    /// and from ds; dn is linear in the corners.
    #[inline(always)]
    pub(crate) fn hessian(&self) -> [[R; 12]; 12] {
        let e = self.e;
        let zero = e[0].constant(0.0);
        let one = e[0].constant(1.0);
        let inverse = one / self.square;
        let mut out = [[zero; 12]; 12];
        for side in 0..2 {
            let Wing { n, slope, r, s, square, factor } = self.wings[side];
            let over = (one / square) * 2.0;
            // The derivatives of n by x₀, x₁ and the free corner are cross products with these vectors.
            let arms = [sub(r, e), vec3!(i => -r[i]), e];
            let along = [vec3!(i => -e[i] * inverse), vec3!(i => e[i] * inverse), [zero; 3]];
            let ds = [
                vec3!(k => ((s * 2.0 - 1.0) * e[k] - r[k]) * inverse),
                vec3!(k => (r[k] - s * 2.0 * e[k]) * inverse),
                vec3!(k => e[k] * inverse),
            ];
            let corner = [0, 1, 2 + side];
            for q in 0..3 {
                for k in 0..3 {
                    let column = 3 * corner[q] + k;
                    let [a, b] = [(k + 1) % 3, (k + 2) % 3];
                    // Form arm × (unit vector k).
                    let mut dn = [zero; 3];
                    dn[a] = arms[q][b];
                    dn[b] = -arms[q][a];
                    let turn = (n[a] * dn[a] + n[b] * dn[b]) * over;
                    for i in 0..3 {
                        let da = factor * (dn[i] - turn * n[i]) + slope[i] * along[q][k];
                        let shift = slope[i] * ds[q][k];
                        let free = 3 * corner[2] + i;
                        if column <= free {
                            out[free][column] = out[free][column] + da;
                        }
                        if column <= i {
                            out[i][column] = out[i][column] + shift + (s - 1.0) * da;
                        }
                        if column <= 3 + i {
                            out[3 + i][column] = out[3 + i][column] - s * da - shift;
                        }
                    }
                }
            }
        }
        out
    }
}

/// Returns the angle θ ∈ (−π, π] of one pair of triangles.
pub(crate) fn angle(x: &[[f64; 3]; 4]) -> f64 {
    let [sine, cosine] = Fold::new(x).direction();
    sine.atan2(cosine)
}

#[cfg(test)]
mod tests {
    use super::*;

    type Vec3 = [f64; 3];

    const CORNERS: [Vec3; 4] = [[0.1, 0.0, 0.2], [1.3, 0.1, -0.1], [0.4, 0.9, 0.3], [0.7, -0.8, 0.6]];

    fn gradient(x: &[Vec3; 4]) -> [Vec3; 4] {
        Fold::new(x).gradient()
    }

    #[test]
    fn derivatives_are_those_of_the_angle() {
        let step = 1e-6;
        let analytic = (gradient(&CORNERS), Fold::new(&CORNERS).hessian());
        for n in 0..12 {
            let moved = |h: f64| {
                let mut x = CORNERS;
                x[n / 3][n % 3] += h;
                x
            };
            let (plus, minus) = (moved(step), moved(-step));
            let slope = (angle(&plus) - angle(&minus)) / (2.0 * step);
            assert!((slope - analytic.0[n / 3][n % 3]).abs() < 1e-8);
            let (plus, minus) = (gradient(&plus), gradient(&minus));
            for m in n..12 {
                let slope = (plus[m / 3][m % 3] - minus[m / 3][m % 3]) / (2.0 * step);
                assert!((slope - analytic.1[m][n]).abs() < 1e-7, "{m} {n}");
            }
        }
    }

    #[test]
    fn a_valley_is_positive_from_both_sides() {
        let mut x = [[0.0; 3], [1.0, 0.0, 0.0], [0.5, 1.0, 0.0], [0.5, -1.0, 0.0]];
        assert_eq!(angle(&x), 0.0);
        x[3] = [0.5, -1.0, 1.0];
        assert!((angle(&x) - std::f64::consts::FRAC_PI_4).abs() < 1e-15);
        assert!((angle(&[x[1], x[0], x[3], x[2]]) - angle(&x)).abs() < 1e-15);
    }
}
