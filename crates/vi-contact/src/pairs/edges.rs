//! Terms that only edge pairs have: the mollifier for parallel edges, and the guard for flat ones.

use crate::barrier::Barrier;
use crate::distance::Vec3;
use crate::surface::Edge;

/// Weight of the barrier that every pair of edges has below [`GUARD_REACH`] · d̂, sharp or flat. Points carry the
/// pressure between flat meshes; without a guard, edges could cross if a flat mesh is folded over an edge.
const GUARD: f64 = 1e-2;
/// Relative gap below which the guard acts. At s = ¼ points alone press with 13 κ, so the guard does not contribute
/// to the pressure between flat meshes, whose energy per area is then exact.
const GUARD_REACH: f64 = 0.25;
/// Edges count as parallel below this fraction of the squared product of their rest lengths (Li et al. 2020, IPC).
const PARALLEL: f64 = 1e-3;

/// A weighted sum, as a function of s, of the barrier over d̂ and of the guard over its part of d̂.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Blend {
    barrier: Barrier,
    full: f64,
    guard: f64,
}

impl Blend {
    /// Returns the barrier of points.
    pub(crate) fn of_points(barrier: Barrier) -> Self {
        Self { barrier, full: 1.0, guard: 0.0 }
    }

    /// Returns the barrier of two edges, χ_a χ_b B(s) + guard. If one edge is sharp, the guard has the weight of its
    /// sharpness. For a knife on a coarse cloth there may be no point under the knife; with the guard of flat edges
    /// alone the gap would decrease to a thousandth of d̂.
    pub(crate) fn of_edges(barrier: Barrier, a: &Edge, b: &Edge) -> Self {
        Self { barrier, full: a.sharpness * b.sharpness, guard: GUARD.max(a.sharpness.max(b.sharpness)) }
    }

    /// Returns full · part(B, 1) + guard · part(B, reach), where `part` is a function of B and of the divisor of s. A
    /// zero weight must not be multiplied by the infinity at touch.
    #[inline]
    fn sum(self, part: impl Fn(Barrier, f64) -> f64) -> f64 {
        let mut sum = 0.0;
        if self.full != 0.0 {
            sum += self.full * part(self.barrier, 1.0);
        }
        if self.guard != 0.0 {
            sum += self.guard * part(self.barrier, GUARD_REACH);
        }
        sum
    }

    /// Returns the relative gap from which on the pair exerts no force.
    pub(crate) fn reach(self) -> f64 {
        if self.full != 0.0 { 1.0 } else { GUARD_REACH }
    }

    /// Returns the larger of both weights, which is the scale of the pair's forces.
    pub(crate) fn weight(self) -> f64 {
        self.full.max(self.guard)
    }

    /// Returns the value at s.
    pub fn value(self, s: f64) -> f64 {
        self.sum(|barrier, reach| reach * barrier.value(s / reach))
    }

    /// Returns the derivative by s.
    pub fn slope(self, s: f64) -> f64 {
        self.sum(|barrier, reach| barrier.slope(s / reach))
    }

    /// Returns the second derivative by s.
    pub fn curvature(self, s: f64) -> f64 {
        self.sum(|barrier, reach| barrier.curvature(s / reach) / reach)
    }

    /// Returns the third derivative by s.
    pub fn third(self, s: f64) -> f64 {
        self.sum(|barrier, reach| barrier.third(s / reach) / (reach * reach))
    }

    /// Returns the difference quotient between a and b.
    pub fn quotient(self, a: f64, b: f64) -> f64 {
        self.sum(|barrier, reach| barrier.quotient(a / reach, b / reach))
    }

    /// Returns the derivative of the quotient by its second argument.
    pub fn quotient_slope(self, a: f64, b: f64) -> f64 {
        self.sum(|barrier, reach| barrier.quotient_slope(a / reach, b / reach) / reach)
    }
}

/// The mollifier m = (2 − c/ε) c/ε for c < ε, else 1, of c = |e_a × e_b|², with ε = 1e-3 of the squared product of
/// the rest lengths. The closest points of parallel edges jump; there the energy of the pair vanishes, and points
/// carry the contact.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Mollifier {
    pub(crate) scale: f64,
}

impl Mollifier {
    pub(crate) fn new(a: &Edge, b: &Edge) -> Self {
        Self { scale: PARALLEL * a.square * b.square }
    }

    /// Returns c.
    pub(crate) fn argument(x: &[Vec3; 4]) -> f64 {
        (x[1] - x[0]).cross(&(x[3] - x[2])).norm_squared()
    }

    pub(crate) fn value(self, c: f64) -> f64 {
        let u = c / self.scale;
        if u < 1.0 { u * (2.0 - u) } else { 1.0 }
    }

    pub(crate) fn slope(self, c: f64) -> f64 {
        let u = c / self.scale;
        if u < 1.0 { 2.0 * (1.0 - u) / self.scale } else { 0.0 }
    }

    pub(crate) fn curvature(self, c: f64) -> f64 {
        if c < self.scale { -2.0 / (self.scale * self.scale) } else { 0.0 }
    }

    /// Returns the difference quotient of m, without cancellation.
    pub(crate) fn quotient(self, c0: f64, c1: f64) -> f64 {
        let (u0, u1) = (c0 / self.scale, c1 / self.scale);
        if u0 < 1.0 && u1 < 1.0 {
            (2.0 - u0 - u1) / self.scale
        } else if u0 >= 1.0 && u1 >= 1.0 {
            0.0
        } else {
            (self.value(c1) - self.value(c0)) / (c1 - c0)
        }
    }

    /// Returns the derivative of the quotient by its second argument.
    pub(crate) fn quotient_slope(self, c0: f64, c1: f64) -> f64 {
        let (u0, u1) = (c0 / self.scale, c1 / self.scale);
        if u0 < 1.0 && u1 < 1.0 {
            -1.0 / (self.scale * self.scale)
        } else if u0 >= 1.0 && u1 >= 1.0 {
            0.0
        } else {
            (self.slope(c1) - self.quotient(c0, c1)) / (c1 - c0)
        }
    }

    /// Returns a discrete gradient of c. It is exact for c = A B − G² with A = e_a·e_a, B = e_b·e_b, G = e_a·e_b,
    /// each of which is quadratic in positions, so that ΔA = 2 e_a(x_m)·Δe_a etc.
    pub(crate) fn discrete_gradient(x0: &[Vec3; 4], x1: &[Vec3; 4]) -> [Vec3; 4] {
        let edges = |x: &[Vec3; 4]| [x[1] - x[0], x[3] - x[2]];
        let ([a0, b0], [a1, b1]) = (edges(x0), edges(x1));
        let (a, b) = ((a0 + a1) * 0.5, (b0 + b1) * 0.5);
        let mean = |u: f64, v: f64| 0.5 * (u + v);
        let square_a = mean(a0.norm_squared(), a1.norm_squared());
        let square_b = mean(b0.norm_squared(), b1.norm_squared());
        let product = mean(a0.dot(&b0), a1.dot(&b1));
        let along_a = (a * square_b - b * product) * 2.0;
        let along_b = (b * square_a - a * product) * 2.0;
        [-along_a, along_a, -along_b, along_b]
    }

    /// Returns ∂²c/∂e_i∂e_j as a function of the six components of e_a and e_b.
    pub(crate) fn hessian(x: &[Vec3; 4]) -> [[f64; 6]; 6] {
        let (a, b) = (x[1] - x[0], x[3] - x[2]);
        let (aa, bb, ab) = (a.norm_squared(), b.norm_squared(), a.dot(&b));
        let mut h = [[0.0; 6]; 6];
        for i in 0..3 {
            for j in 0..3 {
                let delta = if i == j { 1.0 } else { 0.0 };
                h[i][j] = 2.0 * (bb * delta - b[i] * b[j]);
                h[3 + i][3 + j] = 2.0 * (aa * delta - a[i] * a[j]);
                h[i][3 + j] = 4.0 * a[i] * b[j] - 2.0 * b[i] * a[j] - 2.0 * ab * delta;
                h[3 + j][i] = h[i][3 + j];
            }
        }
        h
    }
}
