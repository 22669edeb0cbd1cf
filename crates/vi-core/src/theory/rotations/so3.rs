//! The rotation group in the Cayley chart: for x ∈ ℝ³, cay(x) = (I − x̂/2)⁻¹(I + x̂/2) = I + 4/(4 + |x|²)
//! (x̂ + x̂²/2), a rotation by 2 atan(|x|/2) about x. It is rational, so that it and its derivatives are regular at 0.

use crate::theory::lagrange::lagrangian::Scalar;

/// A vector of ℝ³.
pub type Vector3<D> = [D; 3];
/// A matrix, by rows.
pub type Matrix3<D> = [[D; 3]; 3];

/// Returns the unit matrix.
pub fn identity<D: Scalar>() -> Matrix3<D> {
    let (one, zero) = (D::from(1.0), D::from(0.0));
    [[one, zero, zero], [zero, one, zero], [zero, zero, one]]
}

/// Returns A B.
pub fn product<D: Scalar>(a: &Matrix3<D>, b: &Matrix3<D>) -> Matrix3<D> {
    std::array::from_fn(|i| {
        std::array::from_fn(|j| a[i][0] * b[0][j] + a[i][1] * b[1][j] + a[i][2] * b[2][j])
    })
}

/// Returns Aᵀ.
pub fn transpose<D: Scalar>(a: &Matrix3<D>) -> Matrix3<D> {
    std::array::from_fn(|i| std::array::from_fn(|j| a[j][i]))
}

/// Returns A x.
pub fn rotate<D: Scalar>(a: &Matrix3<D>, x: &Vector3<D>) -> Vector3<D> {
    std::array::from_fn(|i| dot(&a[i], x))
}

pub(super) fn dot<D: Scalar>(a: &Vector3<D>, b: &Vector3<D>) -> D {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

pub(super) fn cross<D: Scalar>(a: &Vector3<D>, b: &Vector3<D>) -> Vector3<D> {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

/// Converts a matrix of numbers to one of constants of any scalar type.
pub(super) fn constant<D: Scalar>(a: &Matrix3<f64>) -> Matrix3<D> {
    a.map(|row| row.map(D::from))
}

/// Returns cay(x).
pub fn cayley<D: Scalar>(x: &Vector3<D>) -> Matrix3<D> {
    let scale = (dot(x, x) + 4.0).recip() * 4.0;
    // x̂² = x xᵀ − |x|² I.
    let square = dot(x, x);
    let zero = D::from(0.0);
    let hat = [[zero, -x[2], x[1]], [x[2], zero, -x[0]], [-x[1], x[0], zero]];
    std::array::from_fn(|i| {
        std::array::from_fn(|j| {
            let (unit, trace) = if i == j { (D::from(1.0), square) } else { (zero, zero) };
            unit + scale * (hat[i][j] + (x[i] * x[j] - trace) * 0.5)
        })
    })
}

/// Returns the chart coordinates of cay(a)ᵀ cay(b): (b − a − a × b/2)/(1 + a·b/4).
pub(super) fn relative<D: Scalar>(a: &Vector3<D>, b: &Vector3<D>) -> Vector3<D> {
    let scale = (dot(a, b) * 0.25 + 1.0).recip();
    let turn = cross(a, b);
    std::array::from_fn(|i| (b[i] - a[i] - turn[i] * 0.5) * scale)
}

/// Returns the angular velocity in the body frame, ω̂ = RᵀṘ for R = cay(x): ω = 4/(4 + |x|²) (ẋ − x × ẋ/2).
pub(super) fn body_rate<D: Scalar>(x: &Vector3<D>, x_dot: &Vector3<D>) -> Vector3<D> {
    let scale = (dot(x, x) + 4.0).recip() * 4.0;
    let turn = cross(x, x_dot);
    std::array::from_fn(|i| (x_dot[i] - turn[i] * 0.5) * scale)
}

/// Returns the momentum Π conjugate to the body rate from p conjugate to ẋ: p = BᵀΠ with ω = B ẋ, hence Π = p −
/// x × p/2 + x (x·p)/4.
pub(super) fn body_momentum(x: &Vector3<f64>, p: &Vector3<f64>) -> Vector3<f64> {
    let turn = cross(x, p);
    let along = 0.25 * dot(x, p);
    std::array::from_fn(|i| p[i] - 0.5 * turn[i] + along * x[i])
}

#[cfg(test)]
mod tests {
    use num_dual::Dual64;

    use super::*;

    const X: Vector3<f64> = [0.4, -1.1, 0.7];
    const V: Vector3<f64> = [0.3, 0.5, -0.9];

    #[test]
    fn cayley_is_a_rotation_and_knows_its_rate() {
        let moving: Vector3<Dual64> = std::array::from_fn(|i| Dual64::new(X[i], V[i]));
        let turn = cayley(&moving);
        let at = turn.map(|row| row.map(|entry| entry.re));
        let rate = turn.map(|row| row.map(|entry| entry.eps));
        let unit = product(&transpose(&at), &at);
        let omega_hat = product(&transpose(&at), &rate);
        let omega = body_rate(&X, &V);
        let expected = [[0.0, -omega[2], omega[1]], [omega[2], 0.0, -omega[0]], [-omega[1], omega[0], 0.0]];
        for i in 0..3 {
            for j in 0..3 {
                assert!((unit[i][j] - identity::<f64>()[i][j]).abs() < 1e-15);
                assert!((omega_hat[i][j] - expected[i][j]).abs() < 1e-15);
            }
        }
    }

    #[test]
    fn relative_coordinates_compose() {
        let between = cayley(&relative(&X, &V));
        let expected = product(&transpose(&cayley(&X)), &cayley(&V));
        for i in 0..3 {
            for j in 0..3 {
                assert!((between[i][j] - expected[i][j]).abs() < 1e-15);
            }
        }
    }

    #[test]
    fn momenta_pair_with_rates() {
        // p·ẋ = Π·ω for all ẋ.
        let p = [0.2, -0.6, 1.3];
        assert!((dot(&p, &V) - dot(&body_momentum(&X, &p), &body_rate(&X, &V))).abs() < 1e-15);
    }
}
