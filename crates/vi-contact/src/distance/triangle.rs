//! The closest points of a point and a point, an edge or a triangle.

use super::{Closest, Vec3};

/// Returns the closest points of node 0 and node 1.
#[inline]
pub(crate) fn point_point(x: &[Vec3; 4]) -> Closest {
    let vector = x[0] - x[1];
    Closest { squared: vector.norm_squared(), vector, weights: [1.0, -1.0, 0.0, 0.0] }
}

/// Returns the parameter t in [0, 1] of the point a + t (b − a) closest to p, and the vector from that point to p.
#[inline]
pub(super) fn closest_on_edge(p: Vec3, a: Vec3, b: Vec3) -> (f64, Vec3) {
    let (edge, from_a, from_b) = (b - a, p - a, p - b);
    let length = edge.norm_squared();
    let (along, beyond) = (from_a.dot(&edge), from_b.dot(&edge));
    if along <= 0.0 || length == 0.0 {
        (0.0, from_a)
    } else if beyond >= 0.0 {
        (1.0, from_b)
    } else {
        // Measure from the nearer end, so that a point near an end loses no digits to the length of the edge.
        let t = (along / length).min(1.0 - f64::EPSILON);
        let vector = if -beyond < along {
            from_b - edge * (beyond / length)
        } else {
            from_a - edge * (along / length)
        };
        (t, vector)
    }
}

/// Returns the closest points of node 0 and the edge of nodes 1 and 2.
#[inline]
pub(crate) fn point_edge(x: &[Vec3; 4]) -> Closest {
    let (t, vector) = closest_on_edge(x[0], x[1], x[2]);
    Closest { squared: vector.norm_squared(), vector, weights: [1.0, t - 1.0, -t, 0.0] }
}

/// Returns the closest points of node 0 and the triangle of nodes 1, 2 and 3.
///
/// Inside the prism over the triangle the distance is |(p − x_a)·n|/|n| with n = e₁ × e₂. Outside, the closest point
/// lies on an edge that has the projection of the point on its outer side.
#[inline]
pub(crate) fn point_triangle(x: &[Vec3; 4]) -> Closest {
    let [p, a, b, c] = *x;
    let normal = (b - a).cross(&(c - a));
    let square = normal.norm_squared();
    let (from_a, from_b, from_c) = (p - a, p - b, p - c);
    // Twice the signed areas of the triangles of the projection with each edge, times |n|.
    let areas = [
        normal.dot(&from_b.cross(&from_c)),
        normal.dot(&from_c.cross(&from_a)),
        normal.dot(&from_a.cross(&from_b)),
    ];
    if areas[0] > 0.0 && areas[1] > 0.0 && areas[2] > 0.0 && square > 0.0 {
        let nearest = if areas[0] >= areas[1] && areas[0] >= areas[2] {
            from_a
        } else if areas[1] >= areas[2] {
            from_b
        } else {
            from_c
        };
        let height = nearest.dot(&normal);
        let (beta, gamma) = (areas[1] / square, areas[2] / square);
        return Closest {
            squared: height * height / square,
            vector: normal * (height / square),
            weights: [1.0, beta + gamma - 1.0, -beta, -gamma],
        };
    }
    let mut best = Closest { squared: f64::INFINITY, vector: Vec3::zeros(), weights: [0.0; 4] };
    let flat = !areas.iter().any(|&area| area < 0.0) || square == 0.0;
    for (k, (first, second)) in [(2, 3), (3, 1), (1, 2)].into_iter().enumerate() {
        if areas[k] > 0.0 && !flat {
            continue;
        }
        // Put the lower index first, so that an edge gives the same bits from both of its triangles.
        let (first, second) = if first < second { (first, second) } else { (second, first) };
        let (t, vector) = closest_on_edge(p, x[first], x[second]);
        let squared = vector.norm_squared();
        if squared < best.squared {
            best = Closest { squared, vector, weights: [1.0, 0.0, 0.0, 0.0] };
            best.weights[first] = t - 1.0;
            best.weights[second] = -t;
        }
    }
    best
}
