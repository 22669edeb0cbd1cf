//! Polynomials of one step through s + 1 control points: values and slopes of their basis.

use crate::contract::quadrature::Quadrature;
use crate::error::CoreError;

/// The Lagrange basis ℓ_0 … ℓ_s on [0, 1]: ℓ_j(d_k) = δ_jk, Σ_j ℓ_j = 1.
///
/// The control points d are the Lobatto points. They include both ends of the step, and the basis is well conditioned
/// for every degree. The discrete Lagrangian does not depend on the interior control points, because they are
/// eliminated.
#[derive(Debug, Clone)]
pub(crate) struct Basis {
    points: Vec<f64>,
}

impl Basis {
    /// Returns the basis of degree s ≥ 1.
    pub(crate) fn new(degree: usize) -> Result<Self, CoreError> {
        if degree == 0 {
            return Err(CoreError::Points {
                what: "polynomial interpolation of degree (points - 1)",
                count: 1,
                allowed: "a trajectory needs its two ends, degree 1 or more",
            });
        }
        Ok(Self { points: Quadrature::lobatto(degree + 1)?.nodes().to_vec() })
    }

    /// Returns the control points d_0 = 0 < … < d_s = 1.
    pub(crate) fn points(&self) -> &[f64] {
        &self.points
    }

    /// Returns ℓ_j(c), one per control point.
    pub(crate) fn values(&self, c: f64) -> Vec<f64> {
        let d = &self.points;
        (0..d.len())
            .map(|j| (0..d.len()).filter(|&k| k != j).map(|k| (c - d[k]) / (d[j] - d[k])).product())
            .collect()
    }

    /// Returns ℓ'_j(c), one per control point.
    pub(crate) fn slopes(&self, c: f64) -> Vec<f64> {
        let d = &self.points;
        let without = |j: usize, l: usize| -> f64 {
            (0..d.len()).filter(|&k| k != j && k != l).map(|k| (c - d[k]) / (d[j] - d[k])).product()
        };
        (0..d.len())
            .map(|j| (0..d.len()).filter(|&l| l != j).map(|l| without(j, l) / (d[j] - d[l])).sum())
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn reproduces_polynomials_and_their_slopes() {
        for degree in 1..=6 {
            let basis = Basis::new(degree).unwrap();
            for power in 0..=degree as i32 {
                for c in [0.0, 0.21, 0.5, 0.83, 1.0_f64] {
                    let sum = |weights: &[f64]| -> f64 {
                        weights.iter().zip(basis.points()).map(|(w, d)| w * d.powi(power)).sum()
                    };
                    assert!((sum(&basis.values(c)) - c.powi(power)).abs() < 1e-14);
                    let slope = if power == 0 { 0.0 } else { power as f64 * c.powi(power - 1) };
                    assert!((sum(&basis.slopes(c)) - slope).abs() < 1e-12);
                }
            }
        }
    }
}
