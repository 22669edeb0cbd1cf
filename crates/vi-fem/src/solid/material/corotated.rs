//! Corotated linear elasticity.

use super::contract::Material;
use super::eigensystem::{rotations, twists};
use super::parameters::{Isotropic, Parameters};
use crate::lanes::real::Real;
use crate::small::rotation::nearest_rotation;
use crate::small::svd::svd;
use crate::small::tensor::{Mat3, Tangent, contract, mat3};

/// Ψ = μ ‖F − R‖² + λ/2 (tr(RᵀF) − 3)², where R is the rotation nearest to F (Müller et al. 2002; analytic tangent
/// after Kim & Eberle 2022, §5). It is defined for every F, because R is a rotation for inverted F too. If the two
/// smallest singular values cancel (σ₂ + σ₃ = 0, deep inversion), R is discontinuous; there the tangent takes the
/// value at a nearby F.
#[derive(Debug, Clone)]
pub struct Corotated {
    lambda: f64,
    mu: f64,
}

impl Material for Corotated {
    type Parameters = Isotropic;

    fn new(parameters: &Isotropic) -> Self {
        let (lambda, mu) = parameters.lame();
        Self { lambda, mu }
    }

    /// Returns Ψ; in singular values it is μ Σ (σ_i − 1)² + λ/2 (Σ σ_i − 3)².
    #[inline(always)]
    fn energy<R: Real>(&self, f: &Mat3<R>) -> R {
        let r = nearest_rotation(f);
        let difference = mat3!(i j => f[i][j] - r[i][j]);
        let trace = contract(&r, &difference);
        contract(&difference, &difference) * self.mu + trace * trace * (0.5 * self.lambda)
    }

    /// Returns P = 2μ (F − R) + λ (tr(RᵀF) − 3) R.
    #[inline(always)]
    fn stress<R: Real>(&self, f: &Mat3<R>) -> Mat3<R> {
        let r = nearest_rotation(f);
        let difference = mat3!(i j => f[i][j] - r[i][j]);
        let trace = contract(&r, &difference) * self.lambda;
        mat3!(i j => trace.mul_add(r[i][j], difference[i][j] * (2.0 * self.mu)))
    }

    /// Returns 2μ I + λ R ⊗ R + (λ (tr(RᵀF) − 3) − 2μ) ∂R/∂F, where ∂R/∂F = Σ 2/(σ_i + σ_j) T_ij ⊗ T_ij over the
    /// three twists T_ij.
    #[inline(always)]
    fn tangent<R: Real>(&self, f: &Mat3<R>) -> Tangent<R> {
        let (u, sigma, v) = svd(f);
        let r = rotations(&u, &v);
        let trace = (sigma[0] + sigma[1] + sigma[2] - 3.0) * self.lambda;
        let mut tangent = Tangent::identity(trace.constant(2.0 * self.mu));
        tangent.add_square(trace.constant(self.lambda), &r);
        let factor = (trace - 2.0 * self.mu) * 2.0;
        for (i, j, twist) in twists(&u, &v) {
            let sum = sigma[i] + sigma[j];
            let floor = sum.constant(1e-12);
            tangent.add_square(factor / (sum - floor).if_positive(sum, floor), &twist);
        }
        tangent
    }
}
