//! Gradient and Hessian of a scalar function of many variables, by dual numbers.

use nalgebra::{DMatrix, DVector};
use num_dual::{Dual64, HyperDual64};

use crate::theory::lagrange::lagrangian::Scalar;

/// A scalar function f(x).
pub(crate) trait Function {
    fn value<D: Scalar>(&self, x: &[D]) -> D;
}

/// Returns ∂f/∂x.
pub(crate) fn gradient(f: &impl Function, x: &[f64]) -> DVector<f64> {
    let mut point: Vec<Dual64> = x.iter().map(|&x| Dual64::from_re(x)).collect();
    DVector::from_fn(x.len(), |i, _| {
        point[i].eps = 1.0;
        let slope = f.value(&point).eps;
        point[i].eps = 0.0;
        slope
    })
}

/// Returns ∂²f/∂x².
pub(crate) fn hessian(f: &impl Function, x: &[f64]) -> DMatrix<f64> {
    let mut point: Vec<HyperDual64> = x.iter().map(|&x| HyperDual64::from_re(x)).collect();
    let mut out = DMatrix::zeros(x.len(), x.len());
    for i in 0..x.len() {
        point[i].eps1 = 1.0;
        for j in 0..=i {
            point[j].eps2 = 1.0;
            let mixed = f.value(&point).eps1eps2;
            point[j].eps2 = 0.0;
            out[(i, j)] = mixed;
            out[(j, i)] = mixed;
        }
        point[i].eps1 = 0.0;
    }
    out
}
