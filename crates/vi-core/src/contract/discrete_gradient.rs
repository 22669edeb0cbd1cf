//! Discrete gradients: forces that exchange exactly the energy of a term over a step.

use std::ops::Range;
use std::sync::Arc;

use super::acting::Acting;
use super::damper::EndForces;

/// A discrete gradient G(x₀, x₁) of a potential V, one G_s per stencil s, with the property
/// ```text
/// G_s(x₀, x₁)·(x₁ − x₀) = V_s(x₁) − V_s(x₀)
/// ```
/// exactly, and G_s(x, x) = ∂V_s/∂x (O. Gonzalez, J. Nonlinear Sci. 6 (1996) 449–467). A term that acts through G
/// over a step exchanges exactly its change of energy with the body. `start` and `end` hold all coordinates, m.
pub trait DiscreteGradient: Send + Sync {
    /// Writes G_s, N: n entries per stencil, as in [`Potential::gradients`](crate::Potential::gradients).
    fn gradients(&self, range: Range<usize>, start: &[f64], end: &[f64], out: &mut [f64]);

    /// Writes the symmetric part of ∂G_s/∂x₁, N/m, as packed lower triangles as in
    /// [`Potential::hessians`](crate::Potential::hessians). It is the matrix of Newton's method with symmetric
    /// factors. If ∂G_s/∂x₁ is not symmetric, convergence is linear instead of quadratic, and the solution is the
    /// same.
    fn tangents(&self, range: Range<usize>, start: &[f64], end: &[f64], out: &mut [f64]);

    /// Appends the forces that act between `start` and `end` to `out`, pair by pair, if the term belongs to a live term
    /// that [lists its pairs](crate::Live::lists_pairs). Other terms append nothing.
    fn acting(&self, _start: &[f64], _end: &[f64], _out: &mut Acting) {}

    /// Returns the term for one step, if it has dissipative forces in addition to V. These may
    /// depend on earlier steps, as dry friction does: `memory` comes from [`DiscreteGradient::outcome`] of the last
    /// step. The stencils are those of this term. Returns `None` if the term has no such forces.
    fn over_step(&self, _span: StepSpan, _memory: &[f64]) -> Option<Arc<dyn DiscreteGradient>> {
        None
    }

    /// Appends the dampers and the friction that act on velocities at the end of a step to `out`, at the positions x
    /// (m) and velocities (m/s) of all coordinates. The term is that of [`DiscreteGradient::over_step`] with the memory
    /// of the end of the step, and a span that [damps the end](StepSpan::damps_end).
    fn end_forces(&self, _x: &[f64], _velocity: &[f64], _out: &mut EndForces) {}

    /// Returns the work and the memory of the dissipative forces for a step from `start` to `end`.
    fn outcome(&self, _start: &[f64], _end: &[f64]) -> StepOutcome {
        StepOutcome::default()
    }
}

/// The step over which dissipative forces act.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct StepSpan {
    /// Duration, s. An infinite duration leads from one equilibrium to the next. Then the forces are the dissipative ones alone,
    /// and [`StepOutcome::impulses`] are those of one second.
    pub duration: f64,
    /// Whether forces act with the values that they have at the end x₁, as in backward Euler: ∂V/∂x(x₁), and the friction that slip
    /// from x₀ to x₁ leaves there. If not, they act between x₀ and x₁ by G.
    pub acts_at_end: bool,
    /// Whether the scheme applies [`DiscreteGradient::end_forces`] to the velocities at the end of the step. If not, all damping acts
    /// over the step.
    pub damps_end: bool,
}

/// Result of one step for the forces of a term that have no potential. With G of the term over the step,
/// ```text
/// Σ G·Δx = ΔV + Δstored + friction + damping.
/// ```
#[derive(Debug, Clone, PartialEq, Default)]
pub struct StepOutcome {
    /// Memory for the next step.
    pub memory: Vec<f64>,
    /// Energy stored in the memory, J.
    pub stored: f64,
    /// Energy dissipated by friction, J (≥ 0).
    pub friction: f64,
    /// Energy dissipated by the damping of the term over the step, J (≥ 0).
    pub damping: f64,
    /// Whether [`DiscreteGradient::end_forces`] may return any at the end of the step.
    pub has_dampers: bool,
    /// Impulses between parts of the system.
    pub impulses: Vec<Impulse>,
    /// The smallest gap of the pairs that acted, at either end, m; `None` if no pair acted.
    pub smallest_gap: Option<f64>,
    /// The smallest gaps of the pairs that acted, at the start and at the end of the step, relative to the distance
    /// below which a pair acts; `None` if no pair acted.
    pub narrowest: Option<[f64; 2]>,
}

/// The impulse of the second of two parts on the first over a step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Impulse {
    /// The two parts, in the numbering of the term; the impulse acts on the first.
    pub between: [u32; 2],
    /// The impulse, N s.
    pub value: [f64; 3],
}
