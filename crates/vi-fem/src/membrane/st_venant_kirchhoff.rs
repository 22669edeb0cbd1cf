//! St. Venant–Kirchhoff in plane stress.

use super::invariants::{Uniaxial, relaxed};
use crate::sheet_material::{IsotropicSheet, SheetMaterial, SheetResponse};

/// W = μ E:E + λ'/2 (tr E)², λ' = E ν/(1 − ν²): S₃₃ = 0 is linear in E₃₃, so the condensation is exact.
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

    /// Written in E itself, which is exact near rest.
    fn response(&self, &[e11, e22, gamma]: &[f64; 3]) -> SheetResponse {
        let (lambda, mu) = (self.lambda, self.mu);
        let trace = e11 + e22;
        let axial = lambda + 2.0 * mu;
        SheetResponse {
            energy: mu * (e11 * e11 + e22 * e22 + 0.5 * gamma * gamma) + 0.5 * lambda * trace * trace,
            stress: [2.0 * mu * e11 + lambda * trace, 2.0 * mu * e22 + lambda * trace, mu * gamma],
            tangent: [[axial, lambda, 0.0], [lambda, axial, 0.0], [0.0, 0.0, mu]],
        }
    }

    fn relaxed(&self, strain: &[f64; 3]) -> SheetResponse {
        relaxed(strain, |c| self.uniaxial(c), || self.response(strain))
    }
}

impl StVenantKirchhoffSheet {
    /// W = ½ E E₁², width E₂ = −ν E₁.
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
