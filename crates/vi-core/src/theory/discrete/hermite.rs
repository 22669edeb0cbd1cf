//! The discrete Lagrangian on Hermite cubics. Each step is the cubic with given positions and velocities at both
//! ends, so paths have continuous velocities, as a Lagrangian with accelerations requires. z = (q, v) is the position
//! of this integrator and P = (p, π) its momentum.
//!
//! For an ordinary Lagrangian the same cubics can solve boundary value problems. They cannot be marched: the velocities
//! at the nodes are then unknowns of their own, and parasitic modes in them grow from step to step. To march, use the
//! polynomial of degree 3 in [`DiscreteLagrangian`](super::DiscreteLagrangian), where the unknowns in the interior of a
//! step are eliminated.

use nalgebra::{DMatrix, DVector};

use crate::contract::quadrature::Quadrature;
use crate::error::CoreError;
use crate::theory::differentiate::Function;
use crate::theory::lagrange::higher::HigherLagrangian;
use crate::theory::lagrange::lagrangian::Scalar;
use crate::theory::{differentiate, newton};

/// Position and velocity at a node of the path, n each.
#[derive(Debug, Clone, PartialEq)]
pub struct HermiteState {
    /// Position q.
    pub q: Vec<f64>,
    /// Velocity v = q̇.
    pub v: Vec<f64>,
}

impl HermiteState {
    /// Returns z = (q, v), 2n entries.
    pub fn stacked(&self) -> DVector<f64> {
        DVector::from_iterator(2 * self.q.len(), self.q.iter().chain(&self.v).copied())
    }

    /// Returns the state for z = (q, v).
    pub fn from_stacked(z: &DVector<f64>) -> Self {
        let n = z.len() / 2;
        Self { q: z.rows(0, n).as_slice().to_vec(), v: z.rows(n, n).as_slice().to_vec() }
    }
}

/// L_d(z_0, z_1) = h Σ_i b_i L(t_i, q(t_i), q̇(t_i), q̈(t_i)), where q is the Hermite cubic of the step.
pub struct HermiteLagrangian<'a, L: HigherLagrangian> {
    lagrangian: &'a L,
    quadrature: Quadrature,
    h: f64,
}

impl<'a, L: HigherLagrangian> HermiteLagrangian<'a, L> {
    /// Returns the discrete Lagrangian of one step h, s.
    ///
    /// # Errors
    /// Returns [`CoreError::StepSize`] if h is zero or not finite.
    pub fn new(lagrangian: &'a L, quadrature: Quadrature, h: f64) -> Result<Self, CoreError> {
        if h == 0.0 || !h.is_finite() {
            return Err(CoreError::StepSize { h });
        }
        Ok(Self { lagrangian, quadrature, h })
    }

    /// Returns the step h, s.
    pub fn step_size(&self) -> f64 {
        self.h
    }

    /// Evaluates L_d for any number type; `z` is (q_0, v_0, q_1, v_1), 4n entries.
    fn evaluate<D: Scalar>(&self, t: f64, z: &[D]) -> D {
        let n = z.len() / 4;
        let h = self.h;
        let mut sum = D::from(0.0);
        for (&c, &b) in self.quadrature.nodes().iter().zip(self.quadrature.weights()) {
            // Weights of q_0, v_0, q_1, v_1 in the Hermite cubic at c, and their time derivatives.
            let d = 1.0 - c;
            let value = [d * d * (1.0 + 2.0 * c), h * c * d * d, c * c * (3.0 - 2.0 * c), -h * c * c * d];
            let slope = [-6.0 * c * d / h, d * (1.0 - 3.0 * c), 6.0 * c * d / h, c * (3.0 * c - 2.0)];
            let curvature = [
                (12.0 * c - 6.0) / (h * h),
                (6.0 * c - 4.0) / h,
                (6.0 - 12.0 * c) / (h * h),
                (6.0 * c - 2.0) / h,
            ];
            let combine = |weights: [f64; 4]| -> Vec<D> {
                (0..n).map(|i| (0..4).map(|k| z[k * n + i] * weights[k]).sum()).collect()
            };
            let (q, v, a) = (combine(value), combine(slope), combine(curvature));
            sum += self.lagrangian.value(D::from(t + c * h), &q, &v, &a) * (h * b);
        }
        sum
    }

    /// Returns L_d(z_0, z_1).
    pub fn value(&self, t: f64, z_0: &DVector<f64>, z_1: &DVector<f64>) -> f64 {
        self.evaluate(t, &ends(z_0, z_1))
    }

    /// Returns (D₁L_d, D₂L_d) = (−P_0, P_1), 4n entries.
    pub fn gradient(&self, t: f64, z_0: &DVector<f64>, z_1: &DVector<f64>) -> DVector<f64> {
        differentiate::gradient(&StepAction { discrete: self, t }, &ends(z_0, z_1))
    }

    /// Returns the second derivatives of L_d, 4n × 4n.
    pub fn hessian(&self, t: f64, z_0: &DVector<f64>, z_1: &DVector<f64>) -> DMatrix<f64> {
        differentiate::hessian(&StepAction { discrete: self, t }, &ends(z_0, z_1))
    }

    /// Makes one step from z_0 and its momentum P_0 = (p, π) to z_1 and P_1, where p = ∂L/∂q̇ − d/dt ∂L/∂q̈ and
    /// π = ∂L/∂q̈ (Ostrogradsky).
    ///
    /// # Errors
    /// Returns [`CoreError::SingularStep`] if D₁D₂L_d has no inverse, [`CoreError::Convergence`].
    pub fn step(
        &self,
        t: f64,
        z_0: &DVector<f64>,
        momentum: &DVector<f64>,
    ) -> Result<(DVector<f64>, DVector<f64>), CoreError> {
        let m = z_0.len();
        let n = m / 2;
        let guess = DVector::from_fn(m, |i, _| if i < n { z_0[i] + self.h * z_0[n + i] } else { z_0[i] });
        let singular = CoreError::SingularStep { h: self.h };
        let z_1 = newton::solve(
            guess,
            z_0.amax(),
            singular,
            |z_1| self.gradient(t, z_0, z_1).rows(0, m) + momentum,
            |z_1| self.hessian(t, z_0, z_1).view((0, m), (m, m)).into_owned(),
        )?;
        let next = self.gradient(t, z_0, &z_1).rows(m, m).into_owned();
        Ok((z_1, next))
    }
}

/// L_d as a function of (z_0, z_1) alone.
struct StepAction<'a, 'b, L: HigherLagrangian> {
    discrete: &'a HermiteLagrangian<'b, L>,
    t: f64,
}

impl<L: HigherLagrangian> Function for StepAction<'_, '_, L> {
    fn value<D: Scalar>(&self, z: &[D]) -> D {
        self.discrete.evaluate(self.t, z)
    }
}

fn ends(z_0: &DVector<f64>, z_1: &DVector<f64>) -> Vec<f64> {
    z_0.iter().chain(z_1.iter()).copied().collect()
}
