//! The closest points of two edges.

use super::triangle::closest_on_edge;
use super::{Closest, Vec3};

/// Two edges count as parallel below this squared sine of their angle. Then closest points at their ends give d² up
/// to (L sin)², which is below the round-off of positions.
const PARALLEL: f64 = 1e-16;
/// Below this squared sine the common normal is less exact than the difference of the two closest points.
const NEARLY_PARALLEL: f64 = 1e-6;

/// Returns the closest points of the edge of nodes 0 and 1 and that of nodes 2 and 3.
#[inline]
pub(crate) fn edge_edge(x: &[Vec3; 4]) -> Closest {
    let [a, b, c, d] = *x;
    let (first, second, r) = (b - a, d - c, a - c);
    let normal = first.cross(&second);
    let square = normal.norm_squared();
    let product = first.norm_squared() * second.norm_squared();
    if square > PARALLEL * product {
        let alpha = -r.cross(&second).dot(&normal) / square;
        let beta = -r.cross(&first).dot(&normal) / square;
        if alpha > 0.0 && alpha < 1.0 && beta > 0.0 && beta < 1.0 {
            if square > NEARLY_PARALLEL * product {
                let height = r.dot(&normal);
                return Closest {
                    squared: height * height / square,
                    vector: normal * (height / square),
                    weights: [1.0 - alpha, alpha, beta - 1.0, -beta],
                };
            }
            // The round-off of both parameters is along the edges; projecting to the other edge and back removes it.
            let (beta, _) = closest_on_edge(a + first * alpha, c, d);
            let (alpha, _) = closest_on_edge(c + second * beta, a, b);
            let inside = |t: f64| t > 0.0 && t < 1.0;
            if inside(alpha) && inside(beta) {
                let vector = r + first * alpha - second * beta;
                let squared = vector.norm_squared();
                return Closest { squared, vector, weights: [1.0 - alpha, alpha, beta - 1.0, -beta] };
            }
        }
    }
    let mut best = Closest { squared: f64::INFINITY, vector: Vec3::zeros(), weights: [0.0; 4] };
    for end in 0..2 {
        let (t, vector) = closest_on_edge(x[end], c, d);
        let squared = vector.norm_squared();
        if squared < best.squared {
            best = Closest { squared, vector, weights: [0.0, 0.0, t - 1.0, -t] };
            best.weights[end] = 1.0;
        }
    }
    for end in 2..4 {
        let (t, vector) = closest_on_edge(x[end], a, b);
        let squared = vector.norm_squared();
        if squared < best.squared {
            best = Closest { squared, vector: -vector, weights: [1.0 - t, t, 0.0, 0.0] };
            best.weights[end] = -1.0;
        }
    }
    best
}
