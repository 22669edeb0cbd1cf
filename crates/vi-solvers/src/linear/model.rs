//! The symmetric matrix A = M + cK of Newton's method, as the linear solvers take it.

use crate::linear::matrix::SymmetricMatrix;

/// A = M + cK with M = diag(`mass`), at these positions of the free coordinates.
#[derive(Clone, Copy)]
pub(crate) struct Model<'a> {
    /// Lumped masses of the free coordinates, kg; empty if M is zero.
    pub(crate) mass: &'a [f64],
    /// Coefficient c of K, s² if M is a mass.
    pub(crate) c: f64,
    pub(crate) k: &'a SymmetricMatrix,
    /// Positions of the free coordinates, m.
    pub(crate) positions: &'a [f64],
}
