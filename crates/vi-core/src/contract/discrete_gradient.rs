//! Discrete gradients: forces that exchange exactly the energy of a term over a step.

use std::ops::Range;

/// A discrete gradient G(x₀, x₁) of a potential V, one G_s per stencil s, with the property
/// ```text
/// G_s(x₀, x₁)·(x₁ − x₀) = V_s(x₁) − V_s(x₀)
/// ```
/// exactly, and G_s(x, x) = ∂V_s/∂x (O. Gonzalez, J. Nonlinear Sci. 6 (1996) 449–467). A term that acts by it over a
/// step exchanges exactly its energy with the body. `start` and `end` hold all coordinates, m.
pub trait DiscreteGradient {
    /// G_s, N: n a stencil, as in [`Potential::gradients`](crate::Potential::gradients).
    fn gradients(&self, range: Range<usize>, start: &[f64], end: &[f64], out: &mut [f64]);

    /// Symmetric part of ∂G_s/∂x₁, N/m: packed lower triangles as in [`Potential::hessians`](crate::Potential::hessians). It is the matrix of
    /// Newton's method with symmetric factors. Where ∂G_s/∂x₁ is not symmetric, convergence is linear instead of
    /// quadratic, and the solution is the same.
    fn tangents(&self, range: Range<usize>, start: &[f64], end: &[f64], out: &mut [f64]);
}
