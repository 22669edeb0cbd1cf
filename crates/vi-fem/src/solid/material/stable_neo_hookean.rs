//! The inversion-safe neo-Hookean law of Smith, de Goes and Kim.

use super::contract::Material;
use super::near_rest::NearRest;
use super::parameters::{Isotropic, Parameters};
use crate::lanes::real::Real;
use crate::small::logarithm::minus_logarithm;
use crate::small::tensor::{Mat3, Tangent, cofactor, combine, contract, dot};

/// Ψ = μ̂/2 (I₁ − 3) − μ̂/2 ln((I₁ + 1)/4) + λ̂/2 ((J − α)² − (1 − α)²) with α = 1 + 3 μ̂/(4 λ̂) (Smith, de Goes &
/// Kim 2018, Stable Neo-Hookean Flesh Simulation, eq. 14), and their Lamé correction μ̂ = 4/3 μ, λ̂ = λ + 5/6 μ,
/// which gives the requested λ and μ at small strains. The rest state has neither stress nor energy. The law is
/// defined for every F, including inverted ones.
#[derive(Debug, Clone)]
pub struct StableNeoHookean {
    lambda: f64,
    mu: f64,
    alpha: f64,
}

impl Material for StableNeoHookean {
    type Parameters = Isotropic;

    fn new(parameters: &Isotropic) -> Self {
        let (lambda, mu) = parameters.lame();
        let (lambda, mu) = (lambda + 5.0 / 6.0 * mu, 4.0 / 3.0 * mu);
        Self { lambda, mu, alpha: 1.0 + 0.75 * mu / lambda }
    }

    #[inline(always)]
    fn energy<R: Real>(&self, f: &Mat3<R>) -> R {
        let i1 = contract(f, f);
        let j = dot(f[0], cofactor(f)[0]);
        // (J − α)² − (1 − α)² = (J − 1)(J + 1 − 2α)
        let far = (i1 - 3.0 - ((i1 + 1.0) * 0.25).ln()) * (0.5 * self.mu)
            + (j - 1.0) * (j + (1.0 - 2.0 * self.alpha)) * (0.5 * self.lambda);
        // With s = I₁ − 3 = 2 tr E, Ψ = μ̂/2 (s/4 − ln(1 + s/4)) + 3/8 μ̂ (s − 2 (J − 1)) + λ̂/2 (J − 1)².
        let rest = NearRest::of(f);
        let volume = rest.x / (j + 1.0);
        let shear = (rest.trace * volume - rest.excess) * 2.0 / (j + 1.0);
        let near = minus_logarithm(rest.trace * 0.5) * (0.5 * self.mu)
            + shear * (0.375 * self.mu)
            + volume * volume * (0.5 * self.lambda);
        j.if_positive(rest.select(near, far), far)
    }

    /// Returns P = μ̂ (1 − 1/(I₁ + 1)) F + λ̂ (J − α) cof F.
    #[inline(always)]
    fn stress<R: Real>(&self, f: &Mat3<R>) -> Mat3<R> {
        let i1 = contract(f, f);
        let cofactor = cofactor(f);
        let j = dot(f[0], cofactor[0]);
        let shear = (i1 / (i1 + 1.0)) * self.mu;
        combine(shear, f, (j - self.alpha) * self.lambda, &cofactor)
    }

    /// Returns μ̂ (1 − 1/(I₁ + 1)) I + 2μ̂/(I₁ + 1)² F ⊗ F + λ̂ (cof F ⊗ cof F + (J − α) ∂²J/∂F∂F).
    #[inline(always)]
    fn tangent<R: Real>(&self, f: &Mat3<R>) -> Tangent<R> {
        let cofactor = cofactor(f);
        let j = dot(f[0], cofactor[0]);
        let i1 = contract(f, f);
        let inverse = j.constant(1.0) / (i1 + 1.0);
        let mut tangent = Tangent::identity(i1 * inverse * self.mu);
        tangent.add_square(inverse * inverse * (2.0 * self.mu), f);
        tangent.add_square(j.constant(self.lambda), &cofactor);
        tangent.add_cofactor_derivative((j - self.alpha) * self.lambda, f);
        tangent
    }
}
