//! Quadrature rules on [0, 1].

use std::f64::consts::PI;

use crate::error::CoreError;

/// The rule ∫₀¹ f ≈ Σ b_i f(c_i) with nodes c in ascending order and weights b.
#[derive(Debug, Clone, PartialEq)]
pub struct Quadrature {
    nodes: Vec<f64>,
    weights: Vec<f64>,
}

impl Quadrature {
    /// Returns the rule f(0).
    pub fn left() -> Self {
        Self { nodes: vec![0.0], weights: vec![1.0] }
    }

    /// Returns the rule f(1).
    pub fn right() -> Self {
        Self { nodes: vec![1.0], weights: vec![1.0] }
    }

    /// Returns the rule (f(0) + f(1))/2.
    pub fn trapezoid() -> Self {
        Self { nodes: vec![0.0, 1.0], weights: vec![0.5, 0.5] }
    }

    /// Returns the rule f(½).
    pub fn midpoint() -> Self {
        Self { nodes: vec![0.5], weights: vec![1.0] }
    }

    /// Returns the Gauss–Legendre rule with s points, exact for polynomials of degree 2s − 1.
    ///
    /// # Errors
    /// Returns [`CoreError::Points`] for s = 0.
    pub fn gauss_legendre(s: usize) -> Result<Self, CoreError> {
        if s == 0 {
            return Err(CoreError::Points {
                what: "Gauss-Legendre quadrature",
                count: s,
                allowed: "it needs at least 1",
            });
        }
        let mut nodes = vec![0.5; s];
        let mut weights = vec![0.0; s];
        for i in 0..s.div_ceil(2) {
            // Newton's method on P_s starts from Tricomi's estimate of the roots.
            let mut x = (PI * (i as f64 + 0.75) / (s as f64 + 0.5)).cos();
            if 2 * i + 1 == s {
                x = 0.0;
            }
            for _ in 0..20 {
                let (value, slope) = legendre(s, x);
                x -= value / slope;
            }
            let (_, slope) = legendre(s, x);
            let weight = 1.0 / ((1.0 - x * x) * slope * slope);
            (nodes[i], nodes[s - 1 - i]) = (0.5 * (1.0 - x), 0.5 * (1.0 + x));
            (weights[i], weights[s - 1 - i]) = (weight, weight);
        }
        Ok(Self { nodes, weights })
    }

    /// Returns the Gauss–Lobatto rule with s ≥ 2 points (both ends are nodes), exact for degree 2s − 3.
    ///
    /// # Errors
    /// Returns [`CoreError::Points`] for s < 2.
    pub fn lobatto(s: usize) -> Result<Self, CoreError> {
        if s < 2 {
            return Err(CoreError::Points {
                what: "Lobatto quadrature",
                count: s,
                allowed: "it needs at least 2",
            });
        }
        let n = s - 1;
        let end_weight = 1.0 / (n * s) as f64;
        let mut nodes = vec![0.0; s];
        let mut weights = vec![end_weight; s];
        nodes[n] = 1.0;
        for i in 1..=n / 2 {
            // Interior nodes are the roots of P'_n, found by Newton's method with P'' from Legendre's equation.
            let mut x = (PI * i as f64 / n as f64).cos();
            if 2 * i == n {
                x = 0.0;
            }
            for _ in 0..20 {
                let (value, slope) = legendre(n, x);
                let curvature = (2.0 * x * slope - (n * s) as f64 * value) / (1.0 - x * x);
                x -= slope / curvature;
            }
            let (value, _) = legendre(n, x);
            let weight = end_weight / (value * value);
            (nodes[i], nodes[n - i]) = (0.5 * (1.0 - x), 0.5 * (1.0 + x));
            (weights[i], weights[n - i]) = (weight, weight);
        }
        Ok(Self { nodes, weights })
    }

    /// Returns the nodes c_i in [0, 1], ascending.
    pub fn nodes(&self) -> &[f64] {
        &self.nodes
    }

    /// Returns the weights b_i; their sum is 1.
    pub fn weights(&self) -> &[f64] {
        &self.weights
    }

    /// Returns whether the rule is invariant under c → 1 − c.
    pub fn is_symmetric(&self) -> bool {
        let n = self.nodes.len();
        (0..n).all(|i| {
            (self.nodes[i] + self.nodes[n - 1 - i] - 1.0).abs() < 1e-14
                && (self.weights[i] - self.weights[n - 1 - i]).abs() < 1e-14
        })
    }
}

/// Returns the Legendre polynomial P_n(x) and its derivative, for |x| < 1, by the three-term recurrence.
fn legendre(n: usize, x: f64) -> (f64, f64) {
    let (mut previous, mut current) = (1.0, x);
    if n == 0 {
        return (1.0, 0.0);
    }
    for k in 2..=n {
        let k = k as f64;
        (previous, current) = (current, ((2.0 * k - 1.0) * x * current - (k - 1.0) * previous) / k);
    }
    (current, n as f64 * (previous - x * current) / (1.0 - x * x))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn integrates_up_to(rule: &Quadrature, degree: usize) {
        for k in 0..=degree {
            let sum: f64 = rule.nodes().iter().zip(rule.weights()).map(|(c, b)| b * c.powi(k as i32)).sum();
            assert!((sum - 1.0 / (k as f64 + 1.0)).abs() < 4e-16 * (k + 4) as f64, "degree {k}: {sum}");
        }
    }

    #[test]
    fn rules_are_exact_to_their_degree() {
        integrates_up_to(&Quadrature::trapezoid(), 1);
        for s in 1..=8 {
            integrates_up_to(&Quadrature::gauss_legendre(s).unwrap(), 2 * s - 1);
            integrates_up_to(&Quadrature::lobatto(s + 1).unwrap(), 2 * s - 1);
        }
    }

    #[test]
    fn symmetry_is_seen() {
        assert!(Quadrature::lobatto(5).unwrap().is_symmetric());
        assert!(!Quadrature::left().is_symmetric());
    }
}
