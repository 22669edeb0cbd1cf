//! The discrete Lagrangian of one step, directly from its definition (Marsden & West 2001, §2.6.3):
//!
//! ```text
//! S(Q_0 … Q_s) = h Σ_i b_i L(t_i, q(t_i), q̇(t_i)),   q the polynomial through Q_0 = q_0 … Q_s = q_1
//! L_d(q_0, q_1) = ext over Q_1 … Q_{s−1} of S
//! p_0 = −∂L_d/∂q_0,   p_1 = ∂L_d/∂q_1               (discrete Legendre transforms)
//! ```
//!
//! For given (q_0, p_0), the s vector equations ∂S/∂Q_0 = −p_0, ∂S/∂Q_k = 0 (0 < k < s) have the unknowns Q_1 … Q_s.
//! Then p_1 = ∂S/∂Q_s. The discrete Euler–Lagrange equation states that p_1 of one step is p_0 of the next.

use nalgebra::{DMatrix, DVector};

use crate::contract::scheme::Scheme;
use crate::contract::system::State;
use crate::error::CoreError;
use crate::theory::interpolation::Basis;
use crate::theory::lagrange::equations::velocities;
use crate::theory::lagrange::expansion::Expand;
use crate::theory::newton;

/// L_d of a Lagrangian L, a scheme and a step h.
pub struct DiscreteLagrangian<'a, L: Expand> {
    lagrangian: &'a L,
    h: f64,
    control_points: Vec<f64>,
    samples: Vec<Sample>,
}

/// A quadrature point: its position c_i, its weight b_i, and the basis values and slopes there.
struct Sample {
    place: f64,
    weight: f64,
    values: Vec<f64>,
    slopes: Vec<f64>,
}

/// The path of one step: the polynomial through q_0 and q_0 + U_j, j = 1 … s. It stores increments, not positions, so
/// that velocities are exact to round-off far from the origin.
#[derive(Debug, Clone, PartialEq)]
pub struct Polynomial {
    /// Start of the step, s.
    pub t: f64,
    /// q_0, n.
    pub start: DVector<f64>,
    /// U_1 … U_s, one after the other, s · n.
    pub increments: DVector<f64>,
}

impl Polynomial {
    /// Returns q_1 = q_0 + U_s.
    pub fn end(&self) -> DVector<f64> {
        let n = self.start.len();
        &self.start + self.increments.rows(self.increments.len() - n, n)
    }
}

impl<'a, L: Expand> DiscreteLagrangian<'a, L> {
    /// Returns the discrete Lagrangian of one step h (s, negative to run backwards).
    ///
    /// # Errors
    /// - [`CoreError::Degenerate`] if the quadrature has fewer points than the degree of the interpolation. Some
    ///   velocity then does not change the action, and no momentum determines the step;
    /// - [`CoreError::StepSize`] if h is zero or not finite;
    /// - [`CoreError::Points`] for a polynomial of degree 0.
    pub fn new(lagrangian: &'a L, scheme: &Scheme, h: f64) -> Result<Self, CoreError> {
        if h == 0.0 || !h.is_finite() {
            return Err(CoreError::StepSize { h });
        }
        let degree = scheme.interpolation.degree();
        let basis = Basis::new(degree)?;
        let rule = &scheme.quadrature;
        let samples = rule.nodes().iter().zip(rule.weights()).map(|(&place, &weight)| Sample {
            place,
            weight,
            values: basis.values(place),
            slopes: basis.slopes(place),
        });
        let control_points = basis.points().to_vec();
        let discrete = Self { lagrangian, h, control_points, samples: samples.collect() };
        if discrete.kinetic_form_is_singular() {
            return Err(CoreError::Degenerate { degree, points: rule.nodes().len() });
        }
        Ok(discrete)
    }

    /// Returns the degree s of the interpolation.
    pub fn degree(&self) -> usize {
        self.control_points.len() - 1
    }

    /// Returns the step h, s.
    pub fn step_size(&self) -> f64 {
        self.h
    }

    /// Returns whether the matrix Σ_i b_i ℓ'_k(c_i) ℓ'_j(c_i), k = 0 … s−1, j = 1 … s, is singular.
    fn kinetic_form_is_singular(&self) -> bool {
        let s = self.degree();
        let entry = |k: usize, j: usize| -> f64 {
            self.samples.iter().map(|point| point.weight * point.slopes[k] * point.slopes[j + 1]).sum()
        };
        let singular = DMatrix::from_fn(s, s, entry).singular_values();
        singular.min() <= 1e-10 * singular.max()
    }

    /// Returns (t, q, q̇) at a quadrature point. The slopes of the basis sum to zero, so q̇ does not depend on q_0.
    fn motion(&self, sample: &Sample, path: &Polynomial) -> (f64, DVector<f64>, DVector<f64>) {
        let n = path.start.len();
        let mut q = path.start.clone();
        let mut v = DVector::zeros(n);
        for j in 1..=self.degree() {
            let u = path.increments.rows((j - 1) * n, n);
            q.axpy(sample.values[j], &u, 1.0);
            v.axpy(sample.slopes[j] / self.h, &u, 1.0);
        }
        (path.t + sample.place * self.h, q, v)
    }

    /// Returns the action S of a path over one step, J s.
    pub fn action(&self, path: &Polynomial) -> f64 {
        let term = |sample| {
            let (t, q, v) = self.motion(sample, path);
            self.h * sample.weight * self.lagrangian.lagrangian(t, q.as_slice(), v.as_slice())
        };
        self.samples.iter().map(term).sum()
    }

    /// Returns ∂S/∂Q_k = Σ_i b_i (h ℓ_k ∂L/∂q + ℓ'_k ∂L/∂q̇) for k = 0 … s, (s+1) · n entries.
    pub fn gradient(&self, path: &Polynomial) -> DVector<f64> {
        let n = path.start.len();
        let mut out = DVector::zeros((self.degree() + 1) * n);
        for sample in &self.samples {
            let (t, q, v) = self.motion(sample, path);
            let (force, momentum) = self.lagrangian.gradient(t, q.as_slice(), v.as_slice());
            for k in 0..=self.degree() {
                let mut block = out.rows_mut(k * n, n);
                block.axpy(sample.weight * sample.slopes[k], &momentum, 1.0);
                // A basis function that vanishes here receives no force, even a non-finite one.
                if sample.values[k] != 0.0 {
                    block.axpy(self.h * sample.weight * sample.values[k], &force, 1.0);
                }
            }
        }
        out
    }

    /// Returns ∂²S/∂Q_k∂Q_j for k, j = 0 … s, a symmetric matrix of (s+1) · n rows.
    pub fn hessian(&self, path: &Polynomial) -> DMatrix<f64> {
        let n = path.start.len();
        let blocks = self.degree() + 1;
        let mut out = DMatrix::zeros(blocks * n, blocks * n);
        for sample in &self.samples {
            let (t, q, v) = self.motion(sample, path);
            let at = self.lagrangian.expansion(t, q.as_slice(), v.as_slice());
            let qv = at.vq.transpose();
            for k in 0..blocks {
                for j in 0..blocks {
                    let (value_k, slope_k) = (sample.values[k], sample.slopes[k] / self.h);
                    let (value_j, slope_j) = (sample.values[j], sample.slopes[j] / self.h);
                    let weight = self.h * sample.weight;
                    let mut block = out.view_mut((k * n, j * n), (n, n));
                    for (factor, part) in [
                        (value_k * value_j, &at.qq),
                        (value_k * slope_j, &qv),
                        (slope_k * value_j, &at.vq),
                        (slope_k * slope_j, &at.vv),
                    ] {
                        if factor != 0.0 {
                            block += part * (weight * factor);
                        }
                    }
                }
            }
        }
        out
    }

    /// Returns the path of the step from (q_0, p_0), by Newton's method to round-off.
    ///
    /// # Errors
    /// Returns [`CoreError::Length`] if the state has the wrong size, [`CoreError::SingularStep`] if D₁D₂L_d has no
    /// inverse at this h, [`CoreError::Convergence`] if Newton's method stalls.
    pub fn path_from(&self, state: &State) -> Result<Polynomial, CoreError> {
        let n = self.lagrangian.coordinate_count();
        for (what, array) in [("q of the state", &state.q), ("p of the state", &state.p)] {
            if array.len() != n {
                return Err(CoreError::Length { what, expected: n, found: array.len() });
            }
        }
        let start = DVector::from_column_slice(&state.q);
        let p = DVector::from_column_slice(&state.p);
        let through = |increments: &DVector<f64>| Polynomial {
            t: state.t,
            start: start.clone(),
            increments: increments.clone(),
        };
        let rows = self.degree() * n;
        let residual = |u: &DVector<f64>| {
            let mut residual = self.gradient(&through(u)).rows(0, rows).into_owned();
            let mut first = residual.rows_mut(0, n);
            first += &p;
            residual
        };
        let jacobian = |u: &DVector<f64>| self.hessian(&through(u)).view((0, n), (rows, rows)).into_owned();
        // The first guess is uniform motion, or rest if that leaves the domain of L.
        let v = velocities(self.lagrangian, state.t, &state.q, &state.p)?;
        let mut guess = DVector::from_fn(rows, |i, _| self.h * self.control_points[i / n + 1] * v[i % n]);
        if residual(&guess).iter().any(|r| !r.is_finite()) {
            guess.fill(0.0);
        }
        let singular = CoreError::SingularStep { h: self.h };
        Ok(through(&newton::solve(guess, start.amax(), singular, residual, jacobian)?))
    }

    /// Makes one step of the integrator: returns the state at t + h.
    ///
    /// # Errors
    /// Returns the errors of [`DiscreteLagrangian::path_from`].
    pub fn step(&self, state: &State) -> Result<State, CoreError> {
        let path = self.path_from(state)?;
        let n = path.start.len();
        let p = self.gradient(&path).rows(self.degree() * n, n).as_slice().to_vec();
        Ok(State { t: state.t + self.h, q: path.end().as_slice().to_vec(), p })
    }

    /// Returns the path between two positions over one step; its interior control points make S stationary.
    ///
    /// # Errors
    /// Returns the errors of [`DiscreteLagrangian::path_from`].
    pub fn path_between(&self, t: f64, q_0: &[f64], q_1: &[f64]) -> Result<Polynomial, CoreError> {
        let n = self.lagrangian.coordinate_count();
        for (what, array) in [("q_0", q_0), ("q_1", q_1)] {
            if array.len() != n {
                return Err(CoreError::Length { what, expected: n, found: array.len() });
            }
        }
        let start = DVector::from_column_slice(q_0);
        let whole = DVector::from_column_slice(q_1) - &start;
        let through = |interior: &DVector<f64>| Polynomial {
            t,
            start: start.clone(),
            increments: DVector::from_iterator(
                interior.len() + n,
                interior.iter().chain(whole.iter()).copied(),
            ),
        };
        let rows = (self.degree() - 1) * n;
        let straight = DVector::from_fn(rows, |i, _| self.control_points[i / n + 1] * whole[i % n]);
        if rows == 0 {
            return Ok(through(&straight));
        }
        let residual = |u: &DVector<f64>| self.gradient(&through(u)).rows(n, rows).into_owned();
        let jacobian = |u: &DVector<f64>| self.hessian(&through(u)).view((n, n), (rows, rows)).into_owned();
        let singular = CoreError::SingularStep { h: self.h };
        let extent = start.amax() + whole.amax();
        Ok(through(&newton::solve(straight, extent, singular, residual, jacobian)?))
    }

    /// Returns L_d(q_0, q_1), J s.
    ///
    /// # Errors
    /// Returns the errors of [`DiscreteLagrangian::path_from`].
    pub fn value(&self, t: f64, q_0: &[f64], q_1: &[f64]) -> Result<f64, CoreError> {
        Ok(self.action(&self.path_between(t, q_0, q_1)?))
    }

    /// Returns the discrete Legendre transforms (p⁻, p⁺) = (−D₁L_d, D₂L_d) of a step from q_0 to q_1.
    ///
    /// # Errors
    /// Returns the errors of [`DiscreteLagrangian::path_from`].
    pub fn legendre(
        &self,
        t: f64,
        q_0: &[f64],
        q_1: &[f64],
    ) -> Result<(DVector<f64>, DVector<f64>), CoreError> {
        let gradient = self.gradient(&self.path_between(t, q_0, q_1)?);
        let n = q_0.len();
        Ok((-gradient.rows(0, n), gradient.rows(self.degree() * n, n).into_owned()))
    }
}
