//! St. Venant–Kirchhoff.

use super::contract::Material;
use super::parameters::{Isotropic, Parameters};
use crate::lanes::real::Real;
use crate::small::tensor::{Mat3, Tangent, contract, left_cauchy_green, mat3, product, right_cauchy_green};

/// Ψ = μ E:E + λ/2 (tr E)² with E = (FᵀF − I)/2.
///
/// Use it for large rotations and small strains. It softens under strong compression (the tangent vanishes at the
/// stretch 1/√3, and below it the force decreases) and gives a finite energy for J ≤ 0. It is defined for every F.
#[derive(Debug, Clone)]
pub struct StVenantKirchhoff {
    lambda: f64,
    mu: f64,
}

/// Returns the Green–Lagrange strain E.
#[inline(always)]
fn strain<R: Real>(f: &Mat3<R>) -> Mat3<R> {
    let c = right_cauchy_green(f);
    let mut e = mat3!(i j => c[i][j] * 0.5);
    for i in 0..3 {
        e[i][i] = e[i][i] - 0.5;
    }
    e
}

impl StVenantKirchhoff {
    /// Returns the second Piola–Kirchhoff stress S = 2μ E + λ tr(E) I = μ C + (λ/2 (tr C − 3) − μ) I.
    #[inline(always)]
    fn second_stress<R: Real>(&self, f: &Mat3<R>) -> Mat3<R> {
        let c = right_cauchy_green(f);
        let pressure = (c[0][0] + c[1][1] + c[2][2] - 3.0) * (0.5 * self.lambda) - self.mu;
        let mu = pressure.constant(self.mu);
        let mut s = mat3!(i j => c[i][j] * mu);
        for i in 0..3 {
            s[i][i] = c[i][i].mul_add(mu, pressure);
        }
        s
    }
}

impl Material for StVenantKirchhoff {
    type Parameters = Isotropic;

    fn new(parameters: &Isotropic) -> Self {
        let (lambda, mu) = parameters.lame();
        Self { lambda, mu }
    }

    #[inline(always)]
    fn energy<R: Real>(&self, f: &Mat3<R>) -> R {
        let e = strain(f);
        let trace = e[0][0] + e[1][1] + e[2][2];
        contract(&e, &e) * self.mu + trace * trace * (0.5 * self.lambda)
    }

    /// Returns P = F S.
    #[inline(always)]
    fn stress<R: Real>(&self, f: &Mat3<R>) -> Mat3<R> {
        product(f, &self.second_stress(f))
    }

    /// Returns δ_ik S_jl + λ F_ij F_kl + μ (F_il F_kj + (FFᵀ)_ik δ_jl).
    #[inline(always)]
    fn tangent<R: Real>(&self, f: &Mat3<R>) -> Tangent<R> {
        let one = f[0][0].constant(1.0);
        let (lambda, mu) = (one * self.lambda, one * self.mu);
        let mut tangent = Tangent::identity(one * 0.0);
        tangent.add_material_blocks(one, &self.second_stress(f));
        tangent.add_square(lambda, f);
        tangent.add_crossed(mu, f);
        tangent.add_spatial_blocks(mu, &left_cauchy_green(f));
        tangent
    }
}
