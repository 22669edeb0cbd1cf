//! A discrete gradient of a distance over a step.
//!
//! A pair has the distances d₀ and d₁ at the ends x₀ and x₁ of a step, between closest points with weights c₀ and c₁.
//! Let c̄ = (c₀ + c₁)/2 be the mean weights, δ = c₁ − c₀ their change, ζ = c̄ + λ δ, and ρᶜ(x) = Σ_a c_a x_a. Then
//! ```text
//! N_a = (c̄_a ρ^ζ(x_m) + ζ_a ρ^c̄(x_m))/(d₀ + d₁),   x_m = (x₀ + x₁)/2.
//! ```
//! For any λ, Σ N_a = 0 and Σ x_m,a × N_a = 0: N has neither a resultant nor a moment. With fixed weights, Σ N_a·Δx_a
//! = Δ(ρ^c̄·ρ^ζ)/(d₀ + d₁) exactly, which is d₁ − d₀ if
//! ```text
//! λ = [¼(a₁ − a₀) − (p₀ + p₁)] / [½(a₀ + a₁) + p₀ − p₁],   a_i = |ρ^δ(x_i)|²,   p_i = r_i·ρ^δ(x_i).
//! ```
//! Closest points of convex sets have p₀ ≥ 0 ≥ p₁ (both are zero while the features stay the same). So numerator and
//! denominator are sums of the same non-negative numbers with different signs, and |λ| ≤ 1. The denominator vanishes
//! only together with the numerator; λ is then set to zero. λ is also zero if a pair slides without deforming. Reversing
//! time changes the sign of δ and of λ, and leaves ζ unchanged: the rule is symmetric and therefore of order two.
//!
//! The change of N with x₁ (`turn.rs`) completes the tangents of Newton's method.

mod turn;

use crate::distance::{Closest, Vec3, combine};

pub(crate) use turn::each_turn;

/// The change of the weights of the closest points over a step, and the factor λ of the change in ζ.
struct WeightShift {
    /// Mean weights c̄, and their change δ.
    mean: [f64; 4],
    delta: [f64; 4],
    /// Positions x_m in the middle of the step, m.
    middle: [Vec3; 4],
    lambda: f64,
    /// The vectors ρ^δ(x_i) at both ends, m.
    vectors: [Vec3; 2],
    /// p₀ ≥ 0 ≥ p₁, m²; values of the wrong sign are round-off and set to zero.
    along: [f64; 2],
    /// The denominator of λ, m².
    weight: f64,
}

/// Returns λ and its denominator (m²), given the a_i and p_i at both ends (m²).
pub(super) fn lambda([a0, a1]: [f64; 2], [p0, p1]: [f64; 2]) -> (f64, f64) {
    let weight = 0.5 * (a0 + a1) + p0 - p1;
    let lambda = if weight > 0.0 { (0.25 * (a1 - a0) - (p0 + p1)) / weight } else { 0.0 };
    (lambda, weight)
}

impl WeightShift {
    #[inline]
    fn new(start: &Closest, end: &Closest, [x0, x1]: [&[Vec3; 4]; 2]) -> Self {
        let (mut mean, mut delta, mut middle) = ([0.0; 4], [0.0; 4], [Vec3::zeros(); 4]);
        for a in 0..4 {
            delta[a] = end.weights[a] - start.weights[a];
            mean[a] = 0.5 * (start.weights[a] + end.weights[a]);
            middle[a] = (x0[a] + x1[a]) * 0.5;
        }
        let vectors = [combine(&delta, x0), combine(&delta, x1)];
        let (a0, a1) = (vectors[0].norm_squared(), vectors[1].norm_squared());
        let p0 = start.vector.dot(&vectors[0]).max(0.0);
        let p1 = end.vector.dot(&vectors[1]).min(0.0);
        let (lambda, weight) = lambda([a0, a1], [p0, p1]);
        Self { mean, delta, middle, lambda, vectors, along: [p0, p1], weight }
    }
}

/// The change of a distance over a step, with its discrete gradient.
#[derive(Debug, Clone, Copy)]
pub(crate) struct DistanceChange {
    /// The discrete gradient N_a.
    pub(crate) gradient: [Vec3; 4],
    /// The gradient ∂d₁/∂x₁ of the distance at the end.
    pub(crate) at_end: [Vec3; 4],
    /// d₁ − d₀ = Σ N_a·Δx_a, without cancellation.
    pub(crate) change: f64,
    /// Mean weights c̄_a of the closest points.
    pub(crate) weights: [f64; 4],
    /// Unit vector along ρ^c̄(x_m).
    pub(crate) normal: Vec3,
}

impl DistanceChange {
    /// Computes the change from the closest points at both ends, where the positions are x₀ and x₁.
    #[inline]
    pub(crate) fn new(start: &Closest, end: &Closest, x: [&[Vec3; 4]; 2]) -> Self {
        let [x0, x1] = x;
        let WeightShift { mean, delta, middle, lambda, .. } = WeightShift::new(start, end, x);
        let mut step = [Vec3::zeros(); 4];
        for a in 0..4 {
            step[a] = x1[a] - x0[a];
        }
        let mut other = [0.0; 4];
        for a in 0..4 {
            other[a] = mean[a] + lambda * delta[a];
        }
        let inverse = 1.0 / (start.distance() + end.distance());
        let (rho, rho_other) = (combine(&mean, &middle), combine(&other, &middle));
        let mut gradient = [Vec3::zeros(); 4];
        for a in 0..4 {
            gradient[a] = (rho_other * mean[a] + rho * other[a]) * inverse;
        }
        let change = (rho_other.dot(&combine(&mean, &step)) + rho.dot(&combine(&other, &step))) * inverse;
        let length = rho.norm();
        let normal = if length > 0.0 { rho / length } else { Vec3::zeros() };
        let direction = end.vector / end.distance();
        Self { gradient, at_end: end.weights.map(|weight| direction * weight), change, weights: mean, normal }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::distance::Shape;
    use crate::testing::Numbers;

    fn turned(x: &[Vec3; 4], rotation: &nalgebra::Rotation3<f64>, shift: Vec3) -> [Vec3; 4] {
        x.map(|x| rotation * x + shift)
    }

    /// Both ends are random, so that closest features differ; steps range from 1 to 1e-12.
    #[test]
    fn work_is_the_change_of_distance_and_both_momenta_are_kept() {
        let mut numbers = Numbers::new(1);
        for round in 0..20_000 {
            let shape =
                [Shape::PointPoint, Shape::PointEdge, Shape::PointTriangle, Shape::EdgeEdge][round % 4];
            let size = 10_f64.powf(-12.0 * numbers.unit());
            let x0 = [(); 4].map(|()| numbers.vector());
            let x1 = x0.map(|x| x + numbers.vector() * size);
            let (start, end) = (shape.closest(&x0), shape.closest(&x1));
            if start.distance().min(end.distance()) < 1e-3 {
                continue;
            }
            let change = DistanceChange::new(&start, &end, [&x0, &x1]);
            let work: f64 = (0..4).map(|a| change.gradient[a].dot(&(x1[a] - x0[a]))).sum();
            let true_change = end.distance() - start.distance();
            assert!((work - true_change).abs() <= 2e-14, "{shape:?} {size:e}: {work:e} {true_change:e}");
            assert!((work - change.change).abs() <= 1e-14);
            let force: Vec3 = change.gradient.iter().sum();
            let torque: Vec3 = (0..4).map(|a| ((x0[a] + x1[a]) * 0.5).cross(&change.gradient[a])).sum();
            let largest = change.gradient.iter().map(Vec3::norm).fold(0.0, f64::max);
            assert!(force.norm() <= 1e-15 * largest.max(1.0), "{force:?}");
            assert!(torque.norm() <= 1e-14 * largest.max(1.0), "{torque:?}");
        }
    }

    /// The gradient has a norm near one: |c̄| and |ζ| are bounded, and so is the force of a pair.
    #[test]
    fn it_tends_to_the_gradient_at_order_two_and_is_bounded() {
        let mut numbers = Numbers::new(2);
        for _ in 0..200 {
            let x = [
                Vec3::new(0.3, 0.25, 0.2),
                Vec3::zeros(),
                Vec3::new(1.0, 0.1, 0.0),
                Vec3::new(0.0, 1.0, 0.1),
            ];
            let motion = [(); 4].map(|()| numbers.vector());
            let error = |size: f64| {
                let ends = [-0.5, 0.5].map(|s| [0, 1, 2, 3].map(|a: usize| x[a] + motion[a] * (s * size)));
                let [start, end] = [0, 1].map(|k: usize| Shape::PointTriangle.closest(&ends[k]));
                let found = DistanceChange::new(&start, &end, [&ends[0], &ends[1]]);
                let exact = Shape::PointTriangle.closest(&x);
                (0..4)
                    .map(|a| {
                        (found.gradient[a] - exact.vector * (exact.weights[a] / exact.distance())).norm()
                    })
                    .sum::<f64>()
            };
            let (coarse, fine) = (error(2e-2), error(1e-2));
            assert!(fine < 1e-2 && coarse / fine > 3.7, "{coarse:e} {fine:e}");
        }
    }

    #[test]
    fn a_rigid_motion_does_no_work() {
        let mut numbers = Numbers::new(3);
        for round in 0..2000 {
            let shape = [Shape::PointTriangle, Shape::EdgeEdge][round % 2];
            let x0 = [(); 4].map(|()| numbers.vector());
            let rotation = nalgebra::Rotation3::from_scaled_axis(numbers.vector() * 3.0);
            let x1 = turned(&x0, &rotation, numbers.vector());
            let (start, end) = (shape.closest(&x0), shape.closest(&x1));
            if start.distance() < 1e-2 {
                continue;
            }
            let change = DistanceChange::new(&start, &end, [&x0, &x1]).change;
            assert!(change.abs() <= 1e-13, "{shape:?} {change:e}");
        }
    }
}
