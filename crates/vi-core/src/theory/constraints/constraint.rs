//! A surface g(q) = 0, its Jacobian and its curvature, computed with dual numbers.

use nalgebra::{DMatrix, DVector};
use num_dual::{Dual64, HyperDual64};

use crate::theory::lagrange::lagrangian::Scalar;

/// m holonomic constraints g(q) = 0 with independent gradients.
pub trait Constraint {
    /// Returns the number m of constraints.
    fn count(&self) -> usize;
    /// Returns g(q), m entries.
    fn value<D: Scalar>(&self, q: &[D]) -> Vec<D>;
}

impl<G: Constraint> Constraint for &G {
    fn count(&self) -> usize {
        (**self).count()
    }
    fn value<D: Scalar>(&self, q: &[D]) -> Vec<D> {
        (**self).value(q)
    }
}

/// Returns g(q) as a vector.
pub(super) fn values(constraint: &impl Constraint, q: &[f64]) -> DVector<f64> {
    DVector::from_vec(constraint.value(q))
}

/// Returns G = ∂g/∂q, m × n.
pub(super) fn jacobian(constraint: &impl Constraint, q: &[f64]) -> DMatrix<f64> {
    let mut point: Vec<Dual64> = q.iter().map(|&q| Dual64::from_re(q)).collect();
    let mut out = DMatrix::zeros(constraint.count(), q.len());
    for j in 0..q.len() {
        point[j].eps = 1.0;
        for (i, value) in constraint.value(&point).iter().enumerate() {
            out[(i, j)] = value.eps;
        }
        point[j].eps = 0.0;
    }
    out
}

/// Returns Σ_i λ_i ∂²g_i/∂q², n × n.
pub(super) fn curvature(constraint: &impl Constraint, q: &[f64], lambda: &DVector<f64>) -> DMatrix<f64> {
    let mut point: Vec<HyperDual64> = q.iter().map(|&q| HyperDual64::from_re(q)).collect();
    let mut out = DMatrix::zeros(q.len(), q.len());
    for i in 0..q.len() {
        point[i].eps1 = 1.0;
        for j in 0..=i {
            point[j].eps2 = 1.0;
            let sum: f64 =
                constraint.value(&point).iter().zip(lambda.iter()).map(|(g, l)| l * g.eps1eps2).sum();
            point[j].eps2 = 0.0;
            out[(i, j)] = sum;
            out[(j, i)] = sum;
        }
        point[i].eps1 = 0.0;
    }
    out
}
