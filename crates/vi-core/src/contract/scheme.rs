//! A variational integrator as plain data: an interpolation of the trajectory × a quadrature of the action (Marsden &
//! West 2001, §2.6).

use crate::contract::quadrature::Quadrature;
use crate::error::CoreError;

/// Interpolation of the trajectory q(t) over one step.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Interpolation {
    /// A polynomial of this degree ≥ 1 through the two ends (and interior points).
    Polynomial(usize),
}

impl Interpolation {
    /// Returns the degree of the polynomial.
    pub fn degree(self) -> usize {
        let Self::Polynomial(degree) = self;
        degree
    }
}

/// An integrator: L_d(q₀, q₁) = ext h Σ_i b_i L(q(c_i h), q̇(c_i h)) over interpolants q.
#[derive(Debug, Clone, PartialEq)]
pub struct Scheme {
    /// Interpolation of the trajectory.
    pub interpolation: Interpolation,
    /// Quadrature of the action.
    pub quadrature: Quadrature,
}

impl Scheme {
    /// Returns symplectic Euler A, linear × left point: kick h, then drift h. Order 1, explicit.
    pub fn symplectic_euler_a() -> Self {
        Self { interpolation: Interpolation::Polynomial(1), quadrature: Quadrature::left() }
    }

    /// Returns symplectic Euler B, linear × right point: drift h, then kick h. Order 1, explicit.
    pub fn symplectic_euler_b() -> Self {
        Self { interpolation: Interpolation::Polynomial(1), quadrature: Quadrature::right() }
    }

    /// Returns the Störmer–Verlet method, linear × trapezoid: kick h/2, drift h, kick h/2. Order 2, explicit.
    pub fn stormer_verlet() -> Self {
        Self { interpolation: Interpolation::Polynomial(1), quadrature: Quadrature::trapezoid() }
    }

    /// Returns the implicit midpoint rule, linear × midpoint. Order 2, implicit.
    pub fn implicit_midpoint() -> Self {
        Self { interpolation: Interpolation::Polynomial(1), quadrature: Quadrature::midpoint() }
    }

    /// Returns the Gauss collocation method of order 2s: degree s × Gauss–Legendre with s points.
    ///
    /// # Errors
    /// Returns [`CoreError::Points`] for s = 0.
    pub fn gauss(s: usize) -> Result<Self, CoreError> {
        let quadrature = Quadrature::gauss_legendre(s)?;
        Ok(Self { interpolation: Interpolation::Polynomial(s), quadrature })
    }

    /// Returns whether a step is explicit for T = ½ q̇ᵀM q̇. It is if the trajectory is linear and V is only
    /// evaluated at the two ends of the step.
    pub fn is_explicit(&self) -> bool {
        self.interpolation.degree() == 1 && self.quadrature.nodes().iter().all(|&c| c == 0.0 || c == 1.0)
    }

    /// Returns whether the scheme is its own adjoint. It is if the quadrature is symmetric about ½.
    pub fn is_symmetric(&self) -> bool {
        self.quadrature.is_symmetric()
    }
}
