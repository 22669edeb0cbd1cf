//! Slip, computed from the change of convected coordinates.
//!
//! The first part of a pair touches the second at ρ = r + Σ_k ξ_k E_k, which is perpendicular to both E_k. For a
//! point over a triangle r = p − x₁ and E_k = −e_k, so that ξ are the coordinates of its foot; for two edges E₁ = e_a
//! and E₂ = −e_b. With A_kl = E_k·E_l and b_k = −E_k·r, ξ = A⁻¹b. It is not limited to the cell: a point just beyond
//! an edge still has both coordinates. Over a step, with the means Ā and ξ̄ of both ends, exactly
//! ```text
//! Δξ = Ā⁻¹ (Δb − ΔA ξ̄),   u = −Σ_k Δξ_k E_k(x_m).
//! ```
//! A and b are invariants of the pair, so u vanishes in rigid motion. Δb and ΔA are exact by the product rule with
//! midpoint values. Hence, with y = Ā⁻¹ (T·E_k(x_m)),
//! ```text
//! T·u = Σ_k y_k (E_k·Δr + r·ΔE_k) + Σ_kl y_k ξ̄_l (E_k·ΔE_l + E_l·ΔE_k),   all at x_m.
//! ```
//! The coefficients of Δx_a are forces without resultant or moment. With r, E, A and ξ of the end of the step instead of the middle, but
//! y still from E_k(x_m), they are the derivative of T·u with respect to x₁, but for terms of the order of u. The difference is that of
//! r, and thus great if the parts approach each other by much more than their gap. The usual slip, the difference of two velocities
//! at points a distance d apart, mistakes rotation for a slip d|ω| and produces the moment d × T.
//!
//! Between equilibria, x₁ takes the place of x_m in u and in T·u. Forces then have no moment in the second equilibrium, and they are the
//! same if a further step begins there.

use crate::distance::{Shape, Vec3, at, combine};

/// Smallest squared sine between edges, or between sides of a triangle, for which slip has a frame.
const FLAT: f64 = 1e-4;

/// Slip of a pair over a step, and the data for its forces.
#[derive(Debug, Clone, Copy)]
pub(super) struct Slip {
    pub(super) arity: usize,
    pub(super) nodes: [u32; 4],
    /// Slip u, m.
    pub(super) slip: Vec3,
    /// Orthonormal directions of slip at x_m, or x₁ between equilibria. The second is zero if slip has one direction only.
    pub(super) tangents: [Vec3; 2],
    /// Weights of the contact point on both parts.
    pub(super) weights: [f64; 4],
    /// `None` if the tangents do not rotate: over a half-space.
    frame: Option<Frame>,
}

/// The convected coordinates of a pair in the middle and at the end of a step; between equilibria, both are those of the end.
#[derive(Debug, Clone, Copy)]
struct Frame {
    shape: Shape,
    middle: Convected,
    end: Convected,
}

/// Convected coordinates of a pair: r, E, A⁻¹ and ξ.
#[derive(Debug, Clone, Copy)]
struct Convected {
    r: Vec3,
    e: [Vec3; 2],
    inverse: [[f64; 2]; 2],
    xi: [f64; 2],
}

impl Frame {
    /// Returns the coefficients of Δx_a in T·u, with y from the middle of the step and everything else from `place`.
    fn coefficients(&self, place: &Convected, traction: Vec3) -> [Vec3; 4] {
        let Convected { r, e, inverse, xi } = place;
        let y = multiply(inverse, self.middle.e.map(|e| e.dot(&traction)));
        let by_r = e[0] * y[0] + e[1] * y[1];
        let along = e[0] * xi[0] + e[1] * xi[1];
        // Σ_l (y_k ξ_l + y_l ξ_k) E_l = y_k Σ ξ_l E_l + ξ_k Σ y_l E_l.
        let by_e = [0, 1].map(|k: usize| (r + along) * y[k] + by_r * xi[k]);
        let (to_r, to_e, _) = pattern(self.shape);
        [0, 1, 2, 3].map(|a: usize| by_r * to_r[a] + by_e[0] * to_e[0][a] + by_e[1] * to_e[1][a])
    }
}

/// Returns G_a over a half-space.
fn over_half_space(traction: Vec3) -> [Vec3; 4] {
    [traction, -traction, Vec3::zeros(), Vec3::zeros()]
}

/// Returns the weights of r and of E_k for the nodes of a pair, and the number of E_k.
fn pattern(shape: Shape) -> ([f64; 4], [[f64; 4]; 2], usize) {
    match shape {
        Shape::PointPoint => ([1.0, -1.0, 0.0, 0.0], [[0.0; 4]; 2], 0),
        Shape::PointEdge => ([1.0, -1.0, 0.0, 0.0], [[0.0, 1.0, -1.0, 0.0], [0.0; 4]], 1),
        Shape::PointTriangle => ([1.0, -1.0, 0.0, 0.0], [[0.0, 1.0, -1.0, 0.0], [0.0, 1.0, 0.0, -1.0]], 2),
        Shape::EdgeEdge => ([1.0, 0.0, -1.0, 0.0], [[-1.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, -1.0]], 2),
    }
}

/// Returns A⁻¹ for one or two directions.
pub(super) fn invert(a: [[f64; 2]; 2], count: usize) -> Option<[[f64; 2]; 2]> {
    if count == 1 {
        return (a[0][0] > 0.0).then(|| [[1.0 / a[0][0], 0.0], [0.0; 2]]);
    }
    let determinant = a[0][0] * a[1][1] - a[0][1] * a[0][1];
    (determinant > FLAT * a[0][0] * a[1][1]).then(|| {
        let scaled = a.map(|row| row.map(|value| value / determinant));
        [[scaled[1][1], -scaled[0][1]], [-scaled[0][1], scaled[0][0]]]
    })
}

pub(super) fn multiply(a: &[[f64; 2]; 2], v: [f64; 2]) -> [f64; 2] {
    [a[0][0] * v[0] + a[0][1] * v[1], a[1][0] * v[0] + a[1][1] * v[1]]
}

/// Returns the squared sine of the angle between r ≠ 0, from a cell to a point, and the plane or line of the cell: 1 if r is normal
/// to it, and 0 if the point is beyond the cell in its plane.
pub(super) fn facing(shape: Shape, x: &[Vec3; 4], r: Vec3) -> f64 {
    let (_, to_e, count) = pattern(shape);
    let [first, second] = to_e.map(|weights| combine(&weights, x));
    match count {
        0 => 1.0,
        1 => first.cross(&r).norm_squared() / (first.norm_squared() * r.norm_squared()),
        _ => {
            let normal = first.cross(&second);
            normal.dot(&r).powi(2) / (normal.norm_squared() * r.norm_squared())
        }
    }
}

impl Slip {
    /// Returns the slip of a pair between the positions x₀ and x₁; `None` if it has no frame: a point against a
    /// point, or parallel edges. The tangents follow the vector between two of its nodes. If `at_end`, forces are those between equilibria.
    pub(super) fn new(
        shape: Shape,
        nodes: [u32; 4],
        followed: [usize; 2],
        x: [&[f64]; 2],
        at_end: bool,
    ) -> Option<Self> {
        let (to_r, to_e, count) = pattern(shape);
        if count == 0 {
            return None;
        }
        let ends = x.map(|x| nodes.map(|node| at(x, node)));
        let r = ends.map(|x| combine(&to_r, &x));
        let e = ends.map(|x| to_e.map(|weights| combine(&weights, &x)));
        let gram =
            |e: &[Vec3; 2]| [[e[0].norm_squared(), e[0].dot(&e[1])], [e[0].dot(&e[1]), e[1].norm_squared()]];
        let grams = [gram(&e[0]), gram(&e[1])];
        let (mut xi, mut inverses) = ([[0.0; 2]; 2], [[[0.0; 2]; 2]; 2]);
        for end in 0..2 {
            inverses[end] = invert(grams[end], count)?;
            xi[end] = multiply(&inverses[end], e[end].map(|e| -e.dot(&r[end])));
        }
        let end = Convected { r: r[1], e: e[1], inverse: inverses[1], xi: xi[1] };
        let middle = if at_end {
            end
        } else {
            let mut average = grams[0];
            for k in 0..2 {
                for l in 0..2 {
                    average[k][l] = 0.5 * (grams[0][k][l] + grams[1][k][l]);
                }
            }
            Convected {
                r: (r[0] + r[1]) * 0.5,
                e: [0, 1].map(|k: usize| (e[0][k] + e[1][k]) * 0.5),
                inverse: invert(average, count)?,
                xi: [0, 1].map(|k: usize| 0.5 * (xi[0][k] + xi[1][k])),
            }
        };
        let Convected { e, xi: mean, .. } = middle;
        let slip = -(e[0] * (xi[1][0] - xi[0][0]) + e[1] * (xi[1][1] - xi[0][1]));
        let place = |k: usize| if at_end { ends[1][k] } else { (ends[0][k] + ends[1][k]) * 0.5 };
        let first = (place(followed[1]) - place(followed[0])).normalize();
        let second = e[0].cross(&e[1]).cross(&first);
        let second = if count == 2 { second.normalize() } else { Vec3::zeros() };
        let weights = [0, 1, 2, 3].map(|a: usize| to_r[a] + mean[0] * to_e[0][a] + mean[1] * to_e[1][a]);
        let frame = Frame { shape, middle, end };
        Some(Self {
            arity: shape.arity(),
            nodes,
            slip,
            tangents: [first, second],
            weights,
            frame: Some(frame),
        })
    }

    /// Returns the slip of node 0 over a half-space that moves with node 1.
    pub(super) fn over_plane(nodes: [u32; 4], normal: Vec3, x: [&[f64]; 2]) -> Self {
        let step = |node: u32| at(x[1], node) - at(x[0], node);
        let relative = step(nodes[0]) - step(nodes[1]);
        let axis = normal.iamin();
        let first = normal.cross(&Vec3::ith(axis, 1.0)).normalize();
        let tangents = [first, normal.cross(&first)];
        let slip = relative - normal * normal.dot(&relative);
        Self { arity: 2, nodes, slip, tangents, weights: [1.0, -1.0, 0.0, 0.0], frame: None }
    }

    /// Returns G_a with Σ G·Δx = T·u for a traction T along the tangents.
    pub(super) fn gradient(&self, traction: Vec3) -> [Vec3; 4] {
        match &self.frame {
            Some(frame) => frame.coefficients(&frame.middle, traction),
            None => over_half_space(traction),
        }
    }

    /// Returns the derivative of T·u with respect to the positions of the nodes at the end of the step, for a traction T along the
    /// tangents, without terms of the order of u.
    pub(super) fn change(&self, traction: Vec3) -> [Vec3; 4] {
        match &self.frame {
            Some(frame) => frame.coefficients(&frame.end, traction),
            None => over_half_space(traction),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::Numbers;

    /// The derivative of T·u is exact for a pair that sticks, however far its parts approach and turn within the step.
    #[test]
    fn the_change_of_slip_is_its_derivative_where_there_is_none() {
        let mut numbers = Numbers::new(23);
        let shapes = [
            (Shape::PointEdge, [0, 1, 2, 2]),
            (Shape::PointTriangle, [0, 1, 2, 3]),
            (Shape::EdgeEdge, [0, 1, 2, 3]),
        ];
        let rest = [
            [0.3, 0.2, 0.3, 0.0, 0.0, 0.0, 1.0, 0.1, 0.0, 0.2, 1.0, 0.0],
            [-0.5, 0.1, 0.3, 0.6, 0.0, 0.3, 0.0, -0.5, 0.0, 0.1, 0.6, 0.0],
        ];
        let mut largest = 0.0_f64;
        for round in 0..300 {
            let (shape, nodes) = shapes[round % 3];
            let rest = rest[usize::from(shape == Shape::EdgeEdge)];
            let mut shake = |size: f64| rest.map(|x| x + size * (numbers.unit() - 0.5));
            let (start, mut end) = (shake(0.2), shake(0.3));
            let slip = |end: &[f64]| {
                Slip::new(shape, nodes, [nodes.len() - 3, nodes.len() - 2], [&start, end], false)
            };
            for _ in 0..100 {
                let Some(found) = slip(&end) else { break };
                for node in 0..shape.first_count() {
                    (0..3).for_each(|k| end[3 * node + k] -= found.slip[k]);
                }
            }
            let found = slip(&end).expect("a pair with a frame");
            assert!(found.slip.norm() < 1e-12, "{shape:?}: {:?}", found.slip);
            let direction = end.map(|_| numbers.unit() - 0.5);
            let along = |by: f64| {
                let end: Vec<f64> = end.iter().zip(direction).map(|(x, d)| x + by * d).collect();
                slip(&end).expect("a pair with a frame").slip
            };
            let slope = (along(1e-6) - along(-1e-6)) / 2e-6;
            for tangent in found.tangents {
                let product = |covectors: [Vec3; 4]| -> f64 {
                    (0..shape.arity()).map(|a| covectors[a].dot(&at(&direction, nodes[a]))).sum()
                };
                let (exact, expected) = (product(found.change(tangent)), tangent.dot(&slope));
                assert!((exact - expected).abs() < 1e-7, "{shape:?}: {exact:e} {expected:e}");
                largest = largest.max((product(found.gradient(tangent)) - expected).abs());
            }
        }
        // The coefficients of the force differ from it.
        assert!(largest > 1e-2, "{largest:e}");
    }
}
