//! SHAKE and RATTLE (Ryckaert, Ciccotti & Berendsen 1977; Andersen 1983): Störmer–Verlet with multipliers, for
//! systems with diagonal mass.
//!
//! ```text
//! p½ = p_0 − (h/2)(∇V(q_0) + G(q_0)ᵀ λ),   q_1 = q_0 + h M⁻¹ p½   with λ from g(q_1) = 0   (SHAKE)
//! p_1 = p½ − (h/2)(∇V(q_1) + G(q_1)ᵀ μ)                   with μ from G(q_1) M⁻¹ p_1 = 0   (RATTLE)
//! ```

use nalgebra::{DMatrix, DVector};

use crate::contract::dense;
use crate::contract::system::{State, System};
use crate::error::CoreError;
use crate::theory::constraints::constraint::{Constraint, jacobian, values};

/// Largest number of Newton iterations for the multipliers.
const MAX_ITERATIONS: usize = 40;

/// RATTLE for a system on the surface g(q) = 0. Order 2, symplectic, time-symmetric.
pub struct Rattle<'a, G: Constraint> {
    system: &'a System,
    constraint: G,
}

impl<'a, G: Constraint> Rattle<'a, G> {
    /// Returns the integrator of `system` on the surface of `constraint`.
    pub fn new(system: &'a System, constraint: G) -> Self {
        Self { system, constraint }
    }

    /// Makes one step of length h (s). `state` must lie on the surface, g(q) = 0.
    ///
    /// # Errors
    /// Returns [`CoreError::Convergence`] if the surface is not reached: h is too long, or the gradients of the
    /// constraints depend on each other.
    pub fn step(&self, state: &State, h: f64) -> Result<State, CoreError> {
        let q_0 = DVector::from_column_slice(&state.q);
        let inverse_mass = DVector::from_column_slice(self.system.free_mass()).map(|m| 1.0 / m);
        let normal_0 = jacobian(&self.constraint, &state.q);
        let kicked = DVector::from_column_slice(&state.p) - self.force(state.t, &state.q) * (0.5 * h);
        let (q_1, p_half) = self.shake(&q_0, kicked, &normal_0, &inverse_mass, h)?;
        let mut p = p_half - self.force(state.t + h, q_1.as_slice()) * (0.5 * h);
        self.project(&jacobian(&self.constraint, q_1.as_slice()), &inverse_mass, &mut p)?;
        Ok(State { t: state.t + h, q: q_1.as_slice().to_vec(), p: p.as_slice().to_vec() })
    }

    /// Returns `state` with its momentum projected on the tangent of the surface, G M⁻¹ p = 0. A run starts from such
    /// a state.
    ///
    /// # Errors
    /// Returns [`CoreError::Convergence`] if the gradients of the constraints depend on each other.
    pub fn tangent(&self, state: &State) -> Result<State, CoreError> {
        let inverse_mass = DVector::from_column_slice(self.system.free_mass()).map(|m| 1.0 / m);
        let mut p = DVector::from_column_slice(&state.p);
        self.project(&jacobian(&self.constraint, &state.q), &inverse_mass, &mut p)?;
        Ok(State { p: p.as_slice().to_vec(), ..state.clone() })
    }

    /// Returns ∇V in the free coordinates.
    fn force(&self, t: f64, q: &[f64]) -> DVector<f64> {
        let coordinates = self.system.coordinates();
        let x = coordinates.positions(q, t);
        let mut slope = DVector::zeros(q.len());
        coordinates.restrict(&dense::gradient(self.system, &x, t), slope.as_mut_slice());
        slope
    }

    /// Solves g(q_1(λ)) = 0 for λ by Newton's method, to round-off. Returns (q_1, p½).
    fn shake(
        &self,
        q_0: &DVector<f64>,
        mut p: DVector<f64>,
        normal_0: &DMatrix<f64>,
        inverse_mass: &DVector<f64>,
        h: f64,
    ) -> Result<(DVector<f64>, DVector<f64>), CoreError> {
        let mut previous = f64::INFINITY;
        for iterations in 0..MAX_ITERATIONS {
            let q_1 = q_0 + inverse_mass.component_mul(&p) * h;
            let defect = values(&self.constraint, q_1.as_slice());
            let size = defect.amax();
            // Converged if the defect is round-off and no longer decreases.
            if size == 0.0 || (size < 1e-13 && size >= 0.5 * previous) {
                return Ok((q_1, p));
            }
            let failure = CoreError::Convergence { iterations, residual: size };
            if !size.is_finite() {
                return Err(failure);
            }
            previous = size;
            let normal_1 = jacobian(&self.constraint, q_1.as_slice());
            let weighted = DMatrix::from_fn(normal_0.ncols(), normal_0.nrows(), |i, j| {
                inverse_mass[i] * normal_0[(j, i)] * h
            });
            let lambda = (normal_1 * weighted).lu().solve(&defect).ok_or(failure)?;
            p -= normal_0.transpose() * lambda;
        }
        Err(CoreError::Convergence { iterations: MAX_ITERATIONS, residual: previous })
    }

    /// Returns p − Gᵀμ with G M⁻¹ p = 0. It projects twice, so that the round-off of the first solve is projected
    /// too.
    fn project(
        &self,
        normal: &DMatrix<f64>,
        inverse_mass: &DVector<f64>,
        p: &mut DVector<f64>,
    ) -> Result<(), CoreError> {
        let weighted =
            DMatrix::from_fn(normal.ncols(), normal.nrows(), |i, j| inverse_mass[i] * normal[(j, i)]);
        let metric = (normal * weighted).lu();
        for _ in 0..2 {
            let rate = normal * inverse_mass.component_mul(p);
            let residual = rate.amax();
            let mu = metric.solve(&rate).ok_or(CoreError::Convergence { iterations: 0, residual })?;
            *p -= normal.transpose() * mu;
        }
        Ok(())
    }
}
