//! Compressible neo-Hookean with logarithmic volume terms, in plane stress.

use super::invariants::{Invariants, Uniaxial, from_invariants, invariants, relaxed, small_invariants};
use crate::lanes::real::Real;
use crate::sheet::material::{IsotropicSheet, SheetMaterial, SheetResponse};
use crate::small::logarithm::minus_logarithm;

/// Ψ = μ/2 (I₁ − 3 − 2 ln J) + λ/2 ln²J (Bonet & Wood 2008, eq. 6.27) with the stretch s across the thickness
/// eliminated: I₁ = i + s², J = j s, and P₃₃ = 0 gives μ (s² − 1) + λ ln(j s) = 0.
#[derive(Debug, Clone)]
pub struct NeoHookeanSheet {
    lambda: f64,
    mu: f64,
}

impl SheetMaterial for NeoHookeanSheet {
    type Parameters = IsotropicSheet;

    fn new(parameters: &IsotropicSheet) -> Self {
        let (lambda, mu) = parameters.lame();
        Self { lambda, mu }
    }

    #[inline(always)]
    fn response<R: Real>(&self, strain: &[R; 3]) -> SheetResponse<R> {
        let (lambda, mu) = (self.lambda, self.mu);
        let (_, j) = invariants(strain);
        // NaN outside the domain; it propagates to all that follows.
        let log_j = j.ln();
        let square = log_j.map(|log| self.thickness_square(log, 1.0));
        let log = square.ln() * 0.5 + log_j;
        let slope = (log * lambda - mu) / j;
        // The energy is stationary in s, so only the second derivative contains ∂ ln s/∂ ln j.
        let stiffness = square * (2.0 * mu * lambda) / (square * (2.0 * mu) + lambda);
        // I₁ − 3 − 2 ln J = (j² − 1 − q) − ln j² + (s² − 1) − ln s², without the terms of first order, which cancel.
        let [trace, excess] = small_invariants(strain);
        let shear = minus_logarithm(trace + excess) - excess + minus_logarithm(square - 1.0);
        let energy = shear * (0.5 * mu) + log * log * (0.5 * lambda);
        let zero = j.constant(0.0);
        let law = Invariants {
            energy: j.if_positive(energy, j.constant(f64::INFINITY)),
            first: [j.constant(0.5 * mu), slope],
            second: [zero, zero, (stiffness / j - slope) / j],
        };
        from_invariants(strain, j, law)
    }

    fn relaxed(&self, strain: &[f64; 3]) -> SheetResponse {
        relaxed(strain, |c| self.uniaxial(c), || self.response(strain))
    }
}

impl NeoHookeanSheet {
    /// Returns the square a of `count` equal free stretches, the root of μ (a − 1) + λ (ln j + count/2 ln a) = 0.
    /// Newton's method in ln a for a convex, increasing function: from the right of the root it decreases towards it.
    fn thickness_square(&self, log_j: f64, count: f64) -> f64 {
        let (lambda, mu) = (self.lambda, self.mu);
        // For a positive λ the root lies on the other side of 1 than j; start from linear theory.
        let mut log_a = -lambda * log_j / (mu + 0.5 * count * lambda);
        for _ in 0..60 {
            let a = log_a.exp();
            let step =
                (mu * (a - 1.0) + lambda * (log_j + 0.5 * count * log_a)) / (mu * a + 0.5 * count * lambda);
            log_a -= step;
            if step.abs() <= 1e-15 * (1.0 + log_a.abs()) {
                break;
            }
        }
        log_a.exp()
    }

    /// Both transverse stretches are free: μ (a − 1) + λ (½ ln c + ln a) = 0.
    fn uniaxial(&self, c: f64) -> Uniaxial {
        let (lambda, mu) = (self.lambda, self.mu);
        let width = self.thickness_square(0.5 * c.ln(), 2.0);
        let log = 0.5 * c.ln() + width.ln();
        let slope = lambda * log - mu;
        let log_rate = 0.5 / c * mu * width / (mu * width + lambda);
        Uniaxial {
            energy: 0.5 * mu * (minus_logarithm(c - 1.0) + 2.0 * minus_logarithm(width - 1.0))
                + 0.5 * lambda * log * log,
            first: 0.5 * mu + 0.5 * slope / c,
            second: 0.5 / c * (lambda * log_rate - slope / c),
            width,
        }
    }
}
