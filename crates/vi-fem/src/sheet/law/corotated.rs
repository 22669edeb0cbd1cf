//! Corotated linear elasticity in plane stress.

use super::invariants::{Invariants, Uniaxial, from_invariants, invariants, relaxed, small_invariants};
use crate::lanes::real::Real;
use crate::sheet::material::{IsotropicSheet, SheetMaterial, SheetResponse};

/// W = μ Σ (σ − 1)² + λ'/2 (σ₁ + σ₂ − 2)², where σ are the singular values of F and λ' = E ν/(1 − ν²). The condition
/// P₃₃ = 0 is linear in σ₃, so its elimination is exact. The code uses σ₁ + σ₂ = √(i + 2j) and σ₁² + σ₂² = i.
#[derive(Debug, Clone)]
pub struct CorotatedSheet {
    lambda: f64,
    mu: f64,
    young: f64,
    poisson: f64,
}

impl SheetMaterial for CorotatedSheet {
    type Parameters = IsotropicSheet;

    fn new(parameters: &IsotropicSheet) -> Self {
        let (lambda, mu) = parameters.plane_stress();
        Self { lambda, mu, young: parameters.young, poisson: parameters.poisson }
    }

    #[inline(always)]
    fn response<R: Real>(&self, strain: &[R; 3]) -> SheetResponse<R> {
        let (i, j) = invariants(strain);
        let sum = (i + j * 2.0).sqrt();
        // Σ (σ − 1)² = i − 2s + 2 without its terms of first order, which cancel: with t = i − 2 and j² = 1 + t + q,
        // s − 2 = (t + 2 (j − 1))/(s + 2) and Σ (σ − 1)² = ((2t (j − 1) − 4q)/(j + 1) + t (s − 2))/(s + 2).
        let [trace, excess] = small_invariants(strain);
        let area = (trace + excess) / (j + 1.0);
        let excess_sum = (area * 2.0 + trace) / (sum + 2.0);
        let squares = ((trace * area * 2.0 - excess * 4.0) / (j + 1.0) + trace * excess_sum) / (sum + 2.0);
        // With D = μ (i − 2s + 2) + λ'/2 (s − 2)²: compute D_s, D_ss, and s_i = 1/(2s), s_j = 1/s.
        let slope = (sum - 2.0) * self.lambda - 2.0 * self.mu;
        let by_i = sum.constant(0.5) / sum;
        let curvature = by_i * by_i * self.lambda - slope * 0.25 / (sum * sum * sum);
        let law = Invariants {
            energy: squares * self.mu + excess_sum * excess_sum * (0.5 * self.lambda),
            first: [slope * by_i + self.mu, slope * by_i * 2.0],
            second: [curvature, curvature * 2.0, curvature * 4.0],
        };
        from_invariants(strain, j, law)
    }

    fn relaxed(&self, strain: &[f64; 3]) -> SheetResponse {
        relaxed(strain, |c| self.uniaxial(c), || self.response(strain))
    }
}

impl CorotatedSheet {
    /// Returns W = ½ E (σ − 1)² and the transverse stretch σ₂ = 1 − ν (σ − 1).
    fn uniaxial(&self, c: f64) -> Uniaxial {
        let stretch = c.sqrt();
        Uniaxial {
            energy: 0.5 * self.young * (stretch - 1.0).powi(2),
            first: 0.5 * self.young * (1.0 - 1.0 / stretch),
            second: 0.25 * self.young / (c * stretch),
            width: (1.0 - self.poisson * (stretch - 1.0)).max(0.0).powi(2),
        }
    }
}
