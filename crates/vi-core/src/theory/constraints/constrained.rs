//! Constraints in the discrete Hamilton principle: polynomials of degree s whose control points are the s + 1 Lobatto
//! points of the quadrature, with g = 0 and a multiplier at each of them (Marsden & West 2001, §3.5; the Lobatto
//! IIIA–IIIB pairs of Jay 1996 are of this kind). s = 1 is RATTLE.
//!
//! ```text
//! ∂S/∂Q_0 − Gᵀ(q_0) λ_0 = −p_0;   ∂S/∂Q_k − Gᵀ(Q_k) λ_k = 0,  0 < k < s;   g(Q_k) = 0,  0 < k ≤ s
//! p_1 = ∂S/∂Q_s − Gᵀ(q_1) λ_s   with λ_s from G(q_1) q̇(q_1, p_1) = 0
//! ```

use nalgebra::{DMatrix, DVector};

use crate::contract::quadrature::Quadrature;
use crate::contract::scheme::{Interpolation, Scheme};
use crate::contract::system::State;
use crate::error::CoreError;
use crate::theory::constraints::constraint::{Constraint, curvature, jacobian, values};
use crate::theory::discrete::lagrangian::{DiscreteLagrangian, Polynomial};
use crate::theory::lagrange::equations::velocities;
use crate::theory::lagrange::expansion::Expand;
use crate::theory::newton;

/// A Lagrangian system on the surface g(q) = 0, integrated with order 2s.
pub struct Constrained<'a, L: Expand, G: Constraint> {
    lagrangian: &'a L,
    constraint: G,
    discrete: DiscreteLagrangian<'a, L>,
}

impl<'a, L: Expand, G: Constraint> Constrained<'a, L, G> {
    /// Returns the integrator of degree s ≥ 1 with step h, s.
    ///
    /// # Errors
    /// Returns [`CoreError::Points`] for s = 0, [`CoreError::StepSize`].
    pub fn new(lagrangian: &'a L, constraint: G, degree: usize, h: f64) -> Result<Self, CoreError> {
        let quadrature = Quadrature::lobatto(degree + 1)?;
        let scheme = Scheme { interpolation: Interpolation::Polynomial(degree), quadrature };
        let discrete = DiscreteLagrangian::new(lagrangian, &scheme, h)?;
        Ok(Self { lagrangian, constraint, discrete })
    }

    /// Makes one step from a state on the surface: g(q) = 0 and G q̇ = 0.
    ///
    /// # Errors
    /// Returns [`CoreError::Convergence`] if Newton's method stalls, [`CoreError::SingularStep`] if the gradients of
    /// the constraints depend on each other, [`CoreError::SingularMass`].
    pub fn step(&self, state: &State) -> Result<State, CoreError> {
        let (n, m, s) = (state.q.len(), self.constraint.count(), self.discrete.degree());
        let start = DVector::from_column_slice(&state.q);
        let p = DVector::from_column_slice(&state.p);
        let normal_0 = jacobian(&self.constraint, &state.q);
        let through = |z: &DVector<f64>| Polynomial {
            t: state.t,
            start: start.clone(),
            increments: z.rows(0, s * n).into_owned(),
        };
        let node = |z: &DVector<f64>, k: usize| (&start + z.rows((k - 1) * n, n)).as_slice().to_vec();
        let multiplier = |z: &DVector<f64>, k: usize| z.rows(s * n + k * m, m).into_owned();
        let residual = |z: &DVector<f64>| {
            let mut out = DVector::zeros(s * (n + m));
            out.rows_mut(0, s * n).copy_from(&self.discrete.gradient(&through(z)).rows(0, s * n));
            let mut first = out.rows_mut(0, n);
            first += &p - normal_0.transpose() * multiplier(z, 0);
            for k in 1..=s {
                let q = node(z, k);
                if k < s {
                    let mut row = out.rows_mut(k * n, n);
                    row -= jacobian(&self.constraint, &q).transpose() * multiplier(z, k);
                }
                out.rows_mut(s * n + (k - 1) * m, m).copy_from(&values(&self.constraint, &q));
            }
            out
        };
        let matrix = |z: &DVector<f64>| {
            let mut out = DMatrix::zeros(s * (n + m), s * (n + m));
            let action = self.discrete.hessian(&through(z));
            out.view_mut((0, 0), (s * n, s * n)).copy_from(&action.view((0, n), (s * n, s * n)));
            out.view_mut((0, s * n), (n, m)).copy_from(&(-normal_0.transpose()));
            for k in 1..=s {
                let q = node(z, k);
                let normal = jacobian(&self.constraint, &q);
                out.view_mut((s * n + (k - 1) * m, (k - 1) * n), (m, n)).copy_from(&normal);
                if k < s {
                    let bend = curvature(&self.constraint, &q, &multiplier(z, k));
                    let mut block = out.view_mut((k * n, (k - 1) * n), (n, n));
                    block -= bend;
                    out.view_mut((k * n, s * n + k * m), (n, m)).copy_from(&(-normal.transpose()));
                }
            }
            out
        };
        let h = self.discrete.step_size();
        let v = velocities(self.lagrangian, state.t, &state.q, &state.p)?;
        let points = Quadrature::lobatto(s + 1)?;
        let mut guess = DVector::zeros(s * (n + m));
        for (k, c) in points.nodes()[1..].iter().enumerate() {
            guess.rows_mut(k * n, n).copy_from(&(&v * (c * h)));
        }
        let singular = CoreError::SingularStep { h };
        let z = newton::solve(guess, start.amax(), singular, residual, matrix)?;
        let path = through(&z);
        let unconstrained = self.discrete.gradient(&path).rows(s * n, n).into_owned();
        let q = path.end();
        let p = self.tangent_momentum(state.t + h, q.as_slice(), unconstrained)?;
        Ok(State { t: state.t + h, q: q.as_slice().to_vec(), p: p.as_slice().to_vec() })
    }

    /// Returns the momentum p − Gᵀλ with a velocity tangent to the surface, by Newton's method.
    ///
    /// # Errors
    /// Returns [`CoreError::Convergence`], [`CoreError::SingularMass`].
    pub fn tangent_momentum(&self, t: f64, q: &[f64], p: DVector<f64>) -> Result<DVector<f64>, CoreError> {
        const MAX_ITERATIONS: usize = 20;
        let normal = jacobian(&self.constraint, q);
        let (mut p, mut residual) = (p, f64::INFINITY);
        for _ in 0..MAX_ITERATIONS {
            let v = velocities(self.lagrangian, t, q, p.as_slice())?;
            let rate = &normal * &v;
            let singular = CoreError::SingularMass { t };
            let mass = self.lagrangian.expansion(t, q, v.as_slice()).vv.lu();
            let mobility = mass.solve(&normal.transpose()).ok_or_else(|| singular.clone())?;
            let lambda = (&normal * mobility).lu().solve(&rate).ok_or(singular)?;
            p -= normal.transpose() * &lambda;
            residual = rate.amax();
            if residual <= 1e-14 * normal.amax() * v.amax() {
                return Ok(p);
            }
        }
        Err(CoreError::Convergence { iterations: MAX_ITERATIONS, residual })
    }
}
