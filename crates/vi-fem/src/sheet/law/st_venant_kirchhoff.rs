//! St. Venant–Kirchhoff in plane stress.

use super::invariants::{Uniaxial, relaxed};
use crate::lanes::real::Real;
use crate::sheet::material::{IsotropicSheet, SheetMaterial, SheetResponse};

/// W = μ E:E + λ'/2 (tr E)² with λ' = E ν/(1 − ν²). The condition S₃₃ = 0 is linear in E₃₃, so its elimination is
/// exact.
#[derive(Debug, Clone)]
pub struct StVenantKirchhoffSheet {
    lambda: f64,
    mu: f64,
    young: f64,
    poisson: f64,
}

impl SheetMaterial for StVenantKirchhoffSheet {
    type Parameters = IsotropicSheet;

    fn new(parameters: &IsotropicSheet) -> Self {
        let (lambda, mu) = parameters.plane_stress();
        Self { lambda, mu, young: parameters.young, poisson: parameters.poisson }
    }

    /// Uses E itself, which avoids cancellation near rest.
    #[inline(always)]
    fn response<R: Real>(&self, &[e11, e22, gamma]: &[R; 3]) -> SheetResponse<R> {
        let (zero, lambda, mu) = (e11.constant(0.0), e11.constant(self.lambda), e11.constant(self.mu));
        let trace = e11 + e22;
        let (axial, volume) = (mu * 2.0 + lambda, lambda * trace);
        SheetResponse {
            energy: mu * (e11 * e11 + e22 * e22 + gamma * gamma * 0.5) + volume * trace * 0.5,
            stress: [mu * 2.0 * e11 + volume, mu * 2.0 * e22 + volume, mu * gamma],
            tangent: [[axial, lambda, zero], [lambda, axial, zero], [zero, zero, mu]],
        }
    }

    fn relaxed(&self, strain: &[f64; 3]) -> SheetResponse {
        relaxed(strain, |c| self.uniaxial(c), || self.response(strain))
    }
}

impl StVenantKirchhoffSheet {
    /// Returns W = ½ E E₁² and the transverse strain E₂ = −ν E₁.
    fn uniaxial(&self, c: f64) -> Uniaxial {
        let strain = 0.5 * (c - 1.0);
        Uniaxial {
            energy: 0.5 * self.young * strain * strain,
            first: 0.5 * self.young * strain,
            second: 0.25 * self.young,
            width: 1.0 - 2.0 * self.poisson * strain,
        }
    }
}
