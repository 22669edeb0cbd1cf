//! The angle between two triangles at their common edge, with its derivatives. It must not know
//! stiffness.
//!
//! Corners: the edge x₀ → x₁, x₂ of the first triangle (x₀, x₁, x₂) and x₃ of the second (x₁, x₀, x₃).
//! The angle is zero where they are coplanar, positive where x₃ leans to the side of the first normal.

use crate::tensor::{cross, dot};

type Vec3 = [f64; 3];

fn sub(a: Vec3, b: Vec3) -> Vec3 {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

/// θ ∈ (−π, π].
pub(crate) fn angle(x: &[Vec3; 4]) -> f64 {
    let e = sub(x[1], x[0]);
    let n = cross(e, sub(x[2], x[0]));
    let m = cross(sub(x[3], x[0]), e);
    let length = dot(e, e).sqrt();
    (dot(e, cross(m, n)) / length).atan2(dot(n, m))
}

/// A triangle on the edge: what both derivatives need.
struct Wing {
    /// ∂θ/∂(free corner) = ± |e| n/|n|², n = e × r.
    slope: Vec3,
    /// r, from x₀ to the free corner.
    r: Vec3,
    /// Where the free corner projects onto the edge: 0 at x₀, 1 at x₁.
    s: f64,
}

impl Wing {
    fn new(e: Vec3, r: Vec3, sign: f64) -> Self {
        let n = cross(e, r);
        let (square, length) = (dot(e, e), dot(n, n));
        let factor = sign * square.sqrt() / length;
        Self { slope: n.map(|c| factor * c), r, s: dot(r, e) / square }
    }
}

fn wings(x: &[Vec3; 4]) -> (Vec3, [Wing; 2]) {
    let e = sub(x[1], x[0]);
    (e, [Wing::new(e, sub(x[2], x[0]), 1.0), Wing::new(e, sub(x[3], x[0]), -1.0)])
}

/// ∂θ/∂x, 1/m.
pub(crate) fn gradient(x: &[Vec3; 4]) -> [Vec3; 4] {
    let (_, [one, two]) = wings(x);
    let at = |i: usize| {
        [
            -(1.0 - one.s) * one.slope[i] - (1.0 - two.s) * two.slope[i],
            -one.s * one.slope[i] - two.s * two.slope[i],
        ]
    };
    [[0, 1, 2].map(|i| at(i)[0]), [0, 1, 2].map(|i| at(i)[1]), one.slope, two.slope]
}

/// ∂²θ/∂x², 1/m²; symmetric.
///
/// The gradient is a sum over the two triangles, A at the free corner, −(1 − s) A and −s A at the ends
/// of the edge, A = ± |e| n/|n|²; its derivative follows from
/// dA = ± (|e|/|n|²)(I − 2 n nᵀ/|n|²) dn + (A/|e|²) e·de and ds, with dn linear in the corners.
pub(crate) fn hessian(x: &[Vec3; 4]) -> [[f64; 12]; 12] {
    let (e, wings) = wings(x);
    let square = dot(e, e);
    let mut out = [[0.0; 12]; 12];
    for (side, Wing { slope, r, s }) in wings.into_iter().enumerate() {
        let n = cross(e, r);
        let factor = square.sqrt() / dot(n, n) * if side == 0 { 1.0 } else { -1.0 };
        // ∂n/∂x of x₀, x₁ and the free corner is the cross product with these vectors.
        let arms = [sub(r, e), r.map(|c| -c), e];
        let along = [e.map(|c| -c), e, [0.0; 3]];
        let ds = [
            [0, 1, 2].map(|k| (2.0 * s * e[k] - e[k] - r[k]) / square),
            [0, 1, 2].map(|k| (r[k] - 2.0 * s * e[k]) / square),
            e.map(|c| c / square),
        ];
        let corner = [0, 1, 2 + side];
        for (q, &column) in corner.iter().enumerate() {
            for k in 0..3 {
                let mut unit = [0.0; 3];
                unit[k] = 1.0;
                let dn = cross(arms[q], unit);
                let turn = 2.0 * dot(n, dn) / dot(n, n);
                let stretch = along[q][k] / square;
                for i in 0..3 {
                    let da = factor * (dn[i] - turn * n[i]) + slope[i] * stretch;
                    let shift = slope[i] * ds[q][k];
                    out[3 * corner[2] + i][3 * column + k] += da;
                    out[i][3 * column + k] += shift - (1.0 - s) * da;
                    out[3 + i][3 * column + k] += -s * da - shift;
                }
            }
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    const CORNERS: [Vec3; 4] = [[0.1, 0.0, 0.2], [1.3, 0.1, -0.1], [0.4, 0.9, 0.3], [0.7, -0.8, 0.6]];

    #[test]
    fn derivatives_are_those_of_the_angle() {
        let step = 1e-6;
        let analytic = (gradient(&CORNERS), hessian(&CORNERS));
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
            for m in 0..12 {
                let slope = (plus[m / 3][m % 3] - minus[m / 3][m % 3]) / (2.0 * step);
                assert!((slope - analytic.1[m][n]).abs() < 1e-7, "{m} {n}");
                assert!((analytic.1[n][m] - analytic.1[m][n]).abs() < 1e-12);
            }
        }
    }

    #[test]
    fn a_valley_is_positive() {
        let mut x = [[0.0; 3], [1.0, 0.0, 0.0], [0.5, 1.0, 0.0], [0.5, -1.0, 0.0]];
        assert_eq!(angle(&x), 0.0);
        x[3] = [0.5, -1.0, 1.0];
        assert!((angle(&x) - std::f64::consts::FRAC_PI_4).abs() < 1e-15);
    }
}
