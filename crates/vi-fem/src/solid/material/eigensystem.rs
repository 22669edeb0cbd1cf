//! The eigensystem of the tangent of every isotropic law, and the positive semidefinite part of a tangent.
//!
//! In the frame of the singular values, F = UΣVᵀ, the tangent of an isotropic law consists of a 3 × 3 block of
//! stretches and three 2 × 2 blocks [[a, b], [b, a]], one per pair of axes, with the eigenvalues a + b (flip) and a −
//! b (twist) (Smith, de Goes & Kim 2019, Analytic Eigensystems for Isotropic Distortion Energies).

use super::contract::Material;
use crate::lanes::real::Real;
use crate::small::svd::{normalised, svd, symmetric_eigen};
use crate::small::tensor::{Mat3, Tangent, mat3, product_transposed};

const PAIRS: [(usize, usize); 3] = [(0, 1), (0, 2), (1, 2)];

/// Returns the rotation R = U Vᵀ nearest to F.
#[inline(always)]
pub(super) fn rotations<R: Real>(u: &Mat3<R>, v: &Mat3<R>) -> Mat3<R> {
    product_transposed(u, v)
}

/// Returns the three unit twists (u_i ⊗ v_j − u_j ⊗ v_i)/√2 with their axes (i, j).
#[inline(always)]
pub(super) fn twists<R: Real>(u: &Mat3<R>, v: &Mat3<R>) -> [(usize, usize, Mat3<R>); 3] {
    let twist = -std::f64::consts::FRAC_1_SQRT_2;
    [(0, 1, pair(u, v, 0, 1, twist)), (0, 2, pair(u, v, 0, 2, twist)), (1, 2, pair(u, v, 1, 2, twist))]
}

/// Returns (u_i ⊗ v_j)/√2 + s u_j ⊗ v_i.
#[inline(always)]
fn pair<R: Real>(u: &Mat3<R>, v: &Mat3<R>, i: usize, j: usize, s: f64) -> Mat3<R> {
    let half = std::f64::consts::FRAC_1_SQRT_2;
    mat3!(row column => (u[row][i] * half).mul_add(v[column][j], u[row][j] * s * v[column][i]))
}

/// Returns max(value, 0); NaN for NaN.
#[inline(always)]
fn positive<R: Real>(value: R) -> R {
    (value + value.abs()) * 0.5
}

/// Returns the tangent with its negative eigenvalues set to zero.
#[inline(always)]
pub(super) fn projected_tangent<M: Material, R: Real>(material: &M, f: &Mat3<R>) -> Tangent<R> {
    if M::LINEAR {
        return material.tangent(f);
    }
    let (u, sigma, v) = svd(f);
    let zero = sigma[0].constant(0.0);
    let stretch = [[sigma[0], zero, zero], [zero, sigma[1], zero], [zero, zero, sigma[2]]];
    let principal = material.tangent(&stretch);

    // Without its unit, the block gives the same eigenvectors in all units.
    let (block, size) = normalised(&mat3!(i j => principal.entry(4 * i, 4 * j)));
    let (values, vectors) = symmetric_eigen(&block);
    let mut tangent = Tangent::identity(zero);
    for k in 0..3 {
        let weighted = mat3!(i j => u[i][j] * vectors[j][k]);
        tangent.add_square(positive(values[k]) * size, &product_transposed(&weighted, &v));
    }
    for (i, j) in PAIRS {
        let (a, b) = (principal.entry(3 * i + j, 3 * i + j), principal.entry(3 * i + j, 3 * j + i));
        let half = std::f64::consts::FRAC_1_SQRT_2;
        tangent.add_square(positive(a + b), &pair(&u, &v, i, j, half));
        tangent.add_square(positive(a - b), &pair(&u, &v, i, j, -half));
    }
    tangent
}

#[cfg(test)]
mod tests {
    use super::super::corotated::Corotated;
    use super::super::parameters::Isotropic;
    use super::*;

    #[test]
    fn the_unit_of_stress_does_not_change_bits() {
        // Two eigenvalues of the block of stretches are equal up to round-off.
        for k in 1..400 {
            let (poisson, shear) = (1e-3 * f64::from(k), 0.01 * f64::from(k));
            let f = [[1.0, shear, 0.0], [0.0, 0.9 - 0.3 * shear, -0.2], [0.1, 0.0, 0.8]];
            let of = |young: f64| {
                let parameters = Isotropic { young, poisson, density: 1.0 };
                projected_tangent(&Corotated::new(&parameters), &f)
            };
            let own = of(328_412.5);
            for exponent in [-40, -3, -1, 1, 2, 7, 30] {
                let unit = 2.0_f64.powi(exponent);
                let other = of(328_412.5 * unit);
                let is_same = own.0.iter().zip(&other.0).all(|(a, b)| a * unit == *b);
                assert!(is_same, "F = {f:?}, Poisson's ratio {poisson}, unit 2^{exponent}");
            }
        }
    }
}
