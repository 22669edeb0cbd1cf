//! Compressible neo-Hookean with logarithmic volume terms.

use super::contract::{Material, Outside, positive_determinant};
use super::near_rest::NearRest;
use super::parameters::{Isotropic, Parameters};
use crate::lanes::real::Real;
use crate::small::logarithm::minus_logarithm;
use crate::small::tensor::{Mat3, Tangent, cofactor, combine, contract, dot};

/// Ψ = μ/2 (I₁ − 3 − 2 ln J) + λ/2 (ln J)² with I₁ = F:F and J = det F > 0 (Bonet & Wood 2008, eq. 6.27).
#[derive(Debug, Clone)]
pub struct NeoHookean {
    lambda: f64,
    mu: f64,
}

impl Material for NeoHookean {
    type Parameters = Isotropic;

    fn new(parameters: &Isotropic) -> Self {
        let (lambda, mu) = parameters.lame();
        Self { lambda, mu }
    }

    #[inline(always)]
    fn energy<R: Real>(&self, f: &Mat3<R>) -> R {
        let j = dot(f[0], cofactor(f)[0]);
        let log = j.ln();
        let far = contract(f, f) - 3.0 - log * 2.0;
        // I₁ − 3 = 2 tr E = x − (x − 2 tr E) and 2 ln J = ln(1 + x)
        let rest = NearRest::of(f);
        let shear = rest.select(minus_logarithm(rest.x) - rest.excess, far);
        let energy = shear * (0.5 * self.mu) + log * log * (0.5 * self.lambda);
        j.if_positive(energy, j.constant(f64::INFINITY))
    }

    /// Returns P = μ F + (λ ln J − μ) F⁻ᵀ with F⁻ᵀ = cof F / J.
    #[inline(always)]
    fn stress<R: Real>(&self, f: &Mat3<R>) -> Mat3<R> {
        let cofactor = cofactor(f);
        let j = dot(f[0], cofactor[0]);
        let factor = (j.ln() * self.lambda - self.mu) / j;
        combine(j.constant(self.mu), f, factor, &cofactor)
    }

    /// Returns μ I + Ψ_J ∂²J/∂F∂F + Ψ_JJ cof F ⊗ cof F with Ψ_J = (λ ln J − μ)/J.
    #[inline(always)]
    fn tangent<R: Real>(&self, f: &Mat3<R>) -> Tangent<R> {
        let cofactor = cofactor(f);
        let j = dot(f[0], cofactor[0]);
        let inverse = j.constant(1.0) / j;
        let first = (j.ln() * self.lambda - self.mu) * inverse;
        let second = (inverse * self.lambda - first) * inverse;
        let mut tangent = Tangent::identity(j.constant(self.mu));
        tangent.add_square(second, &cofactor);
        tangent.add_cofactor_derivative(first, f);
        tangent
    }

    fn inside(&self, f: &Mat3<f64>) -> Result<(), Outside> {
        positive_determinant(f)
    }
}
