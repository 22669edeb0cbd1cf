//! Computes singular values of 3 × 3 matrices without branches, so that lanes run side by side.

use crate::lanes::real::Real;
use crate::small::tensor::{Mat3, contract, cross, dot, mat3, right_cauchy_green, transpose, vec3};

/// Number of sweeps of cyclic Jacobi rotations. Five reach round-off from any start (quadratic convergence).
const SWEEPS: usize = 5;

/// Guards quotients that are 0/0; their value does not matter then.
const TINY: f64 = 1e-290;

/// Diagonalises a symmetric A = Q diag(λ) Qᵀ. Returns (λ, Q): the columns of Q are eigenvectors, λ is not sorted. A has a norm of about 1,
/// as after [`normalised`]: the eigenvectors of equal eigenvalues depend on which squares underflow.
#[inline(always)]
pub(crate) fn symmetric_eigen<R: Real>(a: &Mat3<R>) -> ([R; 3], Mat3<R>) {
    let mut a = *a;
    let (zero, one) = (a[0][0].constant(0.0), a[0][0].constant(1.0));
    let mut q = [[one, zero, zero], [zero, one, zero], [zero, zero, one]];
    for _ in 0..SWEEPS {
        for (i, j, k) in [(0, 1, 2), (0, 2, 1), (1, 2, 0)] {
            // Rotate by the smaller of the two angles that make a_ij zero (Golub & Van Loan 2013, §8.5.2).
            let difference = a[j][j] - a[i][i];
            let twice = a[i][j] * 2.0;
            let sign = (-difference).if_positive(-one, one);
            let root = difference.mul_add(difference, twice * twice).sqrt();
            let t = twice * sign / (difference.abs() + root + TINY);
            let c = one / (t.mul_add(t, one)).sqrt();
            let s = t * c;
            a[i][i] = a[i][i] - t * a[i][j];
            a[j][j] = a[j][j] + t * a[i][j];
            (a[i][j], a[j][i]) = (zero, zero);
            let (ki, kj) = (c * a[k][i] - s * a[k][j], s * a[k][i] + c * a[k][j]);
            (a[k][i], a[i][k], a[k][j], a[j][k]) = (ki, ki, kj, kj);
            for row in &mut q {
                (row[i], row[j]) = (c * row[i] - s * row[j], s * row[i] + c * row[j]);
            }
        }
    }
    ([a[0][0], a[1][1], a[2][2]], q)
}

/// Decomposes F = U diag(σ) Vᵀ with rotations U and V (det = +1). Returns (U, σ, V) with σ₁ ≥ σ₂ ≥ |σ₃|; σ₃ < 0 if F
/// is inverted. V comes from Jacobi's method on FᵀF, U from orthonormalising F V, both for F/‖F‖. Any scale of F is
/// accepted as long as its squares do not underflow.
#[inline(always)]
pub(crate) fn svd<R: Real>(f: &Mat3<R>) -> (Mat3<R>, [R; 3], Mat3<R>) {
    let (f, norm) = normalised(f);
    let (values, q) = symmetric_eigen(&right_cauchy_green(&f));
    let zero = values[0].constant(0.0);
    let one = values[0].constant(1.0);
    // Sort the columns by their eigenvalues; each exchange reverses one column to keep det V = 1.
    let mut columns = vec3!(j => (values[j], [q[0][j], q[1][j], q[2][j]]));
    for (i, j) in [(0, 1), (0, 2), (1, 2)] {
        let ((high, a), (low, b)) = (columns[i], columns[j]);
        let rising = low - high;
        columns[i] = (rising.if_positive(low, high), vec3!(k => rising.if_positive(b[k], a[k])));
        columns[j] = (rising.if_positive(high, low), vec3!(k => rising.if_positive(-a[k], b[k])));
    }
    let v = vec3!(j => columns[j].1);
    let image = mat3!(j i => dot(f[i], v[j]));

    let sigma_0 = dot(image[0], image[0]).sqrt();
    let u0 = normalised_or(image[0], [one, zero, zero]);
    let along = dot(u0, image[1]);
    let rest = vec3!(k => image[1][k] - along * u0[k]);
    // If F has rank one, any direction normal to u₀ serves: cross u₀ with the x axis if |u₀ₓ| ≤ ½, else with the y
    // axis.
    let aside = (u0[0].abs() - 0.5).if_positive(zero, one);
    let other = one - aside;
    let across = cross(u0, [aside, other, zero]);
    let u1 = normalised_or(rest, normalised_or(across, [zero, one, zero]));
    let u2 = cross(u0, u1);
    let sigma = [sigma_0 * norm, dot(u1, image[1]) * norm, dot(u2, image[2]) * norm];
    let u = [u0, u1, u2];
    (transpose(&u), sigma, transpose(&v))
}

/// Returns F/‖F‖ and ‖F‖; zero stays zero.
#[inline(always)]
pub(crate) fn normalised<R: Real>(f: &Mat3<R>) -> (Mat3<R>, R) {
    let norm = contract(f, f).sqrt();
    let one = norm.constant(1.0);
    let scale = norm.if_positive(one / norm, one);
    (mat3!(i j => f[i][j] * scale), norm)
}

/// Returns a/‖a‖, or `otherwise` if a vanishes.
#[inline(always)]
fn normalised_or<R: Real>(a: [R; 3], otherwise: [R; 3]) -> [R; 3] {
    let square = dot(a, a);
    let inverse = square.constant(1.0) / (square + TINY).sqrt();
    let large = square - 1e-280;
    vec3!(k => large.if_positive(a[k] * inverse, otherwise[k]))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::small::tensor::{determinant, product, product_transposed};

    fn close(a: &Mat3<f64>, b: &Mat3<f64>, tolerance: f64) {
        for (x, y) in a.iter().flatten().zip(b.iter().flatten()) {
            assert!((x - y).abs() <= tolerance, "{a:?} is not {b:?}");
        }
    }

    #[test]
    fn factors_multiply_to_the_matrix_and_are_rotations() {
        let identity = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        let samples: [Mat3<f64>; 8] = [
            identity,
            [[0.0; 3]; 3],
            [[1.0, 2.0, 3.0], [2.0, 4.0, 6.0], [-1.0, -2.0, -3.0]],
            [[-1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
            [[0.3, -1.2, 0.7], [2.2, 0.1, -0.4], [0.9, 0.8, 1.5]],
            [[0.3, -1.2, 0.7], [2.2, 0.1, -0.4], [0.9, 0.8, -1.5]],
            [[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]],
            [[1e-9, 1.0, 0.0], [1.0, 1e-9, 0.0], [0.0, 0.0, 1e-5]],
        ];
        for f in samples {
            let (u, sigma, v) = svd(&f);
            let scaled = [0, 1, 2].map(|i| [0, 1, 2].map(|j| u[i][j] * sigma[j]));
            close(&product_transposed(&scaled, &v), &f, 2e-14);
            close(&product(&transpose(&u), &u), &identity, 2e-15);
            close(&product(&transpose(&v), &v), &identity, 4e-15);
            assert!((determinant(&u) - 1.0).abs() < 1e-14 && (determinant(&v) - 1.0).abs() < 1e-14);
            assert!(sigma[0] + 1e-14 >= sigma[1] && sigma[1] + 1e-14 >= sigma[2].abs(), "{sigma:?}");
        }
    }
}
