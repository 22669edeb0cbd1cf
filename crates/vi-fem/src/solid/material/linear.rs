//! Small-strain linear elasticity.

use super::contract::Material;
use super::parameters::{Isotropic, Parameters};
use crate::lanes::real::Real;
use crate::small::tensor::{Mat3, Tangent, contract, mat3};

/// Ψ = μ ε:ε + λ/2 (tr ε)² with ε = sym(F) − I.
///
/// It is valid for small displacement gradients only: a rotation by an angle θ produces a spurious strain of order
/// θ². The Hessian is constant, so that an implicit run factors it once.
#[derive(Debug, Clone)]
pub struct Linear {
    lambda: f64,
    mu: f64,
}

#[inline(always)]
fn strain<R: Real>(f: &Mat3<R>) -> Mat3<R> {
    let (e01, e02, e12) = ((f[0][1] + f[1][0]) * 0.5, (f[0][2] + f[2][0]) * 0.5, (f[1][2] + f[2][1]) * 0.5);
    [[f[0][0] - 1.0, e01, e02], [e01, f[1][1] - 1.0, e12], [e02, e12, f[2][2] - 1.0]]
}

impl Material for Linear {
    type Parameters = Isotropic;
    const LINEAR: bool = true;

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

    #[inline(always)]
    fn stress<R: Real>(&self, f: &Mat3<R>) -> Mat3<R> {
        let e = strain(f);
        let pressure = (e[0][0] + e[1][1] + e[2][2]) * self.lambda;
        let mut p = mat3!(i j => e[i][j] * (2.0 * self.mu));
        for i in 0..3 {
            p[i][i] = p[i][i] + pressure;
        }
        p
    }

    #[inline(always)]
    fn tangent<R: Real>(&self, f: &Mat3<R>) -> Tangent<R> {
        let (zero, mu, lambda) =
            (f[0][0].constant(0.0), f[0][0].constant(self.mu), f[0][0].constant(self.lambda));
        let identity = mat3!(i j => zero.constant(if i == j { 1.0 } else { 0.0 }));
        // μ (δ_ik δ_jl + δ_il δ_jk) + λ δ_ij δ_kl
        let mut tangent = Tangent::identity(mu);
        tangent.add_crossed(mu, &identity);
        tangent.add_square(lambda, &identity);
        tangent
    }
}
