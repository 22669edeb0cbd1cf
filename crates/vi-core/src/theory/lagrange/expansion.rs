//! A Lagrangian and its first and second derivatives at one point, as a discrete Lagrangian and a Newton iteration
//! need them.

use nalgebra::{DMatrix, DVector};
use num_dual::{Dual64, HyperDual64};

use crate::contract::dense;
use crate::contract::system::System;
use crate::theory::lagrange::lagrangian::Lagrangian;

/// Derivatives of L at one (t, q, v), n coordinates.
#[derive(Debug, Clone, PartialEq)]
pub struct Expansion {
    /// ∂L/∂q, n entries.
    pub d_q: DVector<f64>,
    /// ∂L/∂v, n entries: the momenta.
    pub d_v: DVector<f64>,
    /// ∂²L/∂q∂q, n × n.
    pub qq: DMatrix<f64>,
    /// ∂²L/∂v∂q, n × n: row v, column q.
    pub vq: DMatrix<f64>,
    /// ∂²L/∂v∂v, n × n: the mass.
    pub vv: DMatrix<f64>,
}

/// A function with an expansion to second order in (q, v): every [`Lagrangian`], by dual numbers, and every
/// [`System`], from the blocks of its potentials.
pub trait Expand {
    /// Returns the number of coordinates n.
    fn coordinate_count(&self) -> usize;
    /// Returns L(t, q, v), J.
    fn lagrangian(&self, t: f64, q: &[f64], v: &[f64]) -> f64;
    /// Returns (∂L/∂q, ∂L/∂v), n entries each.
    fn gradient(&self, t: f64, q: &[f64], v: &[f64]) -> (DVector<f64>, DVector<f64>);
    /// Returns the first and second derivatives.
    fn expansion(&self, t: f64, q: &[f64], v: &[f64]) -> Expansion;
}

impl<L: Lagrangian> Expand for L {
    fn coordinate_count(&self) -> usize {
        self.dof_count()
    }

    fn lagrangian(&self, t: f64, q: &[f64], v: &[f64]) -> f64 {
        self.value(t, q, v)
    }

    fn gradient(&self, t: f64, q: &[f64], v: &[f64]) -> (DVector<f64>, DVector<f64>) {
        let mut point: Vec<Dual64> = q.iter().chain(v).map(|&x| Dual64::from_re(x)).collect();
        let n = q.len();
        let time = Dual64::from_re(t);
        let mut slope = |i: usize| {
            point[i].eps = 1.0;
            let slope = self.value(time, &point[..n], &point[n..]).eps;
            point[i].eps = 0.0;
            slope
        };
        (DVector::from_fn(n, |i, _| slope(i)), DVector::from_fn(n, |i, _| slope(n + i)))
    }

    fn expansion(&self, t: f64, q: &[f64], v: &[f64]) -> Expansion {
        let n = q.len();
        let mut point: Vec<HyperDual64> = q.iter().chain(v).map(|&x| HyperDual64::from_re(x)).collect();
        let time = HyperDual64::from_re(t);
        let mut slopes = DVector::zeros(2 * n);
        let mut curvatures = DMatrix::zeros(2 * n, 2 * n);
        for i in 0..2 * n {
            point[i].eps1 = 1.0;
            for j in 0..=i {
                point[j].eps2 = 1.0;
                let value = self.value(time, &point[..n], &point[n..]);
                point[j].eps2 = 0.0;
                slopes[i] = value.eps1;
                curvatures[(i, j)] = value.eps1eps2;
                curvatures[(j, i)] = value.eps1eps2;
            }
            point[i].eps1 = 0.0;
        }
        Expansion {
            d_q: slopes.rows(0, n).into_owned(),
            d_v: slopes.rows(n, n).into_owned(),
            qq: curvatures.view((0, 0), (n, n)).into_owned(),
            vq: curvatures.view((n, 0), (n, n)).into_owned(),
            vv: curvatures.view((n, n), (n, n)).into_owned(),
        }
    }
}

/// L = ½ vᵀM v − V(x(q, t), t) over the free coordinates.
impl Expand for System {
    fn coordinate_count(&self) -> usize {
        self.coordinates().free_count()
    }

    fn lagrangian(&self, t: f64, q: &[f64], v: &[f64]) -> f64 {
        let kinetic: f64 = v.iter().zip(self.momentum(v)).map(|(v, p)| 0.5 * p * v).sum();
        kinetic - dense::energy(self, &self.coordinates().positions(q, t), t)
    }

    fn gradient(&self, t: f64, q: &[f64], v: &[f64]) -> (DVector<f64>, DVector<f64>) {
        let mut force = DVector::zeros(q.len());
        let slope = dense::gradient(self, &self.coordinates().positions(q, t), t);
        self.coordinates().restrict(&slope, force.as_mut_slice());
        (-force, DVector::from_vec(self.momentum(v)))
    }

    fn expansion(&self, t: f64, q: &[f64], v: &[f64]) -> Expansion {
        let (d_q, d_v) = self.gradient(t, q, v);
        let full = dense::hessian(self, &self.coordinates().positions(q, t), t);
        let free = self.coordinates().free();
        let n = q.len();
        Expansion {
            d_q,
            d_v,
            qq: DMatrix::from_fn(n, n, |i, j| -full[(free[i] as usize, free[j] as usize)]),
            vq: DMatrix::zeros(n, n),
            vv: self.dense_mass(),
        }
    }
}
