//! The Hessian of a squared distance.
//!
//! d² = min_β |r(β, x)|² with r = Σ c_a(β) x_a. With ∂r/∂β_k = E_k and ∂c_a/∂β_k = c_{a,k}, the envelope theorem
//! gives
//! ```text
//! ∂d²/∂x_a = 2 c_a r,
//! ∂²d²/∂x_a∂x_b = 2 [c_a c_b I − Σ_kl (c_a E_k + c_{a,k} r)(A⁻¹)_kl (c_b E_l + c_{b,l} r)ᵀ],   A_kl = E_k·E_l.
//! ```
//! Here β runs over the free parameters: two on a face or for two crossing edges, one on an edge.

use super::{Closest, Shape, Vec3};

/// Below this sine of their angle, the second of two free parameters moves the closest points as the first one does, up to
/// round-off, and is left out. Edges that are parallel in the middle of a step have two, if neither is at an end there.
const PARALLEL: f64 = 1e-8;

/// Returns the directions of the free parameters, as weights c_{a,k}, and their number.
fn free_directions(shape: Shape, closest: &Closest) -> ([[f64; 4]; 2], usize) {
    let mut directions = [[0.0; 4]; 2];
    let mut count = 0;
    let mut push = |from: usize, to: usize, sign: f64| {
        directions[count][from] = -sign;
        directions[count][to] = sign;
        count += 1;
    };
    let has = |a: usize| closest.weights[a] != 0.0;
    match shape {
        Shape::PointPoint => {}
        Shape::EdgeEdge => {
            if has(0) && has(1) {
                push(0, 1, 1.0);
            }
            if has(2) && has(3) {
                push(2, 3, -1.0);
            }
        }
        Shape::PointEdge | Shape::PointTriangle => {
            let mut nodes = (1..4).filter(|&a| has(a));
            let first = nodes.next().unwrap_or(1);
            for other in nodes {
                push(first, other, -1.0);
            }
        }
    }
    (directions, count)
}

/// A direction in which the closest points are free to move, of unit length and perpendicular to the others.
#[derive(Debug, Clone, Copy)]
pub(crate) struct FreeMotion {
    /// Change of the weights c_a with the parameter of this direction, 1/m.
    pub(crate) weights: [f64; 4],
    /// v_a = c_a e + c_a' r, with the unit vector e of the direction. The parameter changes by −Σ v_a·dx_a.
    pub(crate) change: [Vec3; 4],
}

/// Returns up to two directions in which the closest points are free to move, with Σ_k v_k v_kᵀ = Σ_kl (c_a E_k + c_{a,k} r)(A⁻¹)_kl
/// (c_b E_l + c_{b,l} r)ᵀ, and their number.
pub(crate) fn free_motions(shape: Shape, closest: &Closest, x: &[Vec3; 4]) -> ([FreeMotion; 2], usize) {
    let (mut directions, mut count) = free_directions(shape, closest);
    let (r, c) = (closest.vector, &closest.weights);
    let edges = directions.map(|weights| super::combine(&weights, x));
    // A⁻¹ = LᵀL for the one or two free parameters.
    let mut rows = [[Vec3::zeros(); 4]; 2];
    for k in 0..count {
        for a in 0..4 {
            rows[k][a] = edges[k] * c[a] + r * directions[k][a];
        }
    }
    let mut first_edge = edges[0];
    if count > 0 {
        let length = first_edge.norm();
        first_edge /= length;
        rows[0].iter_mut().for_each(|row| *row /= length);
        directions[0].iter_mut().for_each(|weight| *weight /= length);
    }
    if count > 1 {
        let along = first_edge.dot(&edges[1]);
        let across = (edges[1] - first_edge * along).norm();
        if across <= PARALLEL * edges[1].norm() {
            count = 1;
        } else {
            for a in 0..4 {
                rows[1][a] = (rows[1][a] - rows[0][a] * along) / across;
                directions[1][a] = (directions[1][a] - directions[0][a] * along) / across;
            }
        }
    }
    let [first, second] = [0, 1].map(|k: usize| FreeMotion { weights: directions[k], change: rows[k] });
    ([first, second], count)
}

/// Writes ∂²d²/∂x_a∂x_b of a pair as the packed lower triangle of its n = 3·arity coordinates, n(n+1)/2 entries.
pub(crate) fn squared_hessian(shape: Shape, closest: &Closest, x: &[Vec3; 4], out: &mut [f64]) {
    let (motions, count) = free_motions(shape, closest, x);
    let c = &closest.weights;
    let mut entry = out.iter_mut();
    for i in 0..3 * shape.arity() {
        let (a, axis) = (i / 3, i % 3);
        for j in 0..=i {
            let (b, other) = (j / 3, j % 3);
            let mut value = if axis == other { c[a] * c[b] } else { 0.0 };
            for FreeMotion { change, .. } in &motions[..count] {
                value -= change[a][axis] * change[b][other];
            }
            if let Some(entry) = entry.next() {
                *entry = 2.0 * value;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two parallel edges at a distance h slide along each other with free closest points; turning one of them is resisted
    /// as by a point on an edge.
    #[test]
    fn parallel_edges_have_finite_motions() {
        let x = [[0.0, 0.0, 0.1], [1.0, 0.0, 0.1], [0.0, 0.0, 0.0], [2.0, 0.0, 0.0]].map(Vec3::from);
        let weights = [0.5, 0.5, -0.75, -0.25];
        let vector = Vec3::new(0.0, 0.0, 0.1);
        let closest = Closest { squared: vector.norm_squared(), vector, weights };
        let (motions, count) = free_motions(Shape::EdgeEdge, &closest, &x);
        assert_eq!(count, 1);
        assert!(motions[0].change.iter().all(|motion| motion.iter().all(|value| value.is_finite())));
        // A common translation changes no distance.
        assert!(motions[0].change.iter().sum::<Vec3>().norm() < 1e-15);
    }
}
