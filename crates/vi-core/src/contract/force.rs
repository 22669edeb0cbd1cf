//! Generalised forces without a potential: follower pressure, drag, damping. Each has a name and is a sum of local
//! terms like a potential. Its work has a separate entry in the energy ledger.
//!
//! They enter the Lagrange–d'Alembert principle δ∫L dt + ∫f·δx dt = 0, so that M ẍ = −∂V/∂x + f(x, ẋ, t) (Marsden &
//! West 2001, part 3).

use std::ops::Range;

use crate::contract::potential::{Fault, Stencils};

/// The entry of the energy ledger to which the work of a force belongs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ForceAccount {
    /// [`crate::StepEnergy::force`]: the force may add or remove energy (follower loads, wind).
    Force,
    /// [`crate::StepEnergy::damping`]: the force removes energy, f·ẋ ≤ 0.
    Damping,
}

/// f(x, ẋ, t) as a sum of local terms f_s, one per stencil s.
///
/// As in [`crate::Potential`], every method fills `out` only for the stencils of `range`, and the result for a
/// stencil must not depend on `range`. `x` (m) and `v` = ẋ (m/s) hold all coordinates, including prescribed ones; `t`
/// is the time (s).
pub trait Force: Send + Sync {
    /// Returns the name for reports and errors, e.g. `beam: pressure`.
    fn name(&self) -> &str;

    /// Returns the ledger entry to which the work belongs.
    fn account(&self) -> ForceAccount;

    /// Returns the nodes of each local term.
    fn stencils(&self) -> Stencils<'_>;

    /// Returns whether f depends on ẋ. A force that depends only on position is cheaper, and preserves the order of
    /// every scheme.
    fn depends_on_velocity(&self) -> bool;

    /// Writes the forces f_s, N: n entries per stencil, n = `stencils().size()`.
    fn forces(&self, range: Range<usize>, x: &[f64], v: &[f64], t: f64, out: &mut [f64]);

    /// Writes the symmetric part of −∂f_s/∂x, N/m, as packed lower triangles as in [`crate::Potential::hessians`].
    ///
    /// It serves as the matrix of Newton's method with symmetric factors. If ∂f/∂x is not symmetric, convergence is
    /// linear instead of quadratic, and the solution is the same.
    fn stiffness(&self, range: Range<usize>, x: &[f64], v: &[f64], t: f64, out: &mut [f64]);

    /// Writes the symmetric part of −∂f_s/∂ẋ, N s/m, as packed lower triangles. It is not called if
    /// [`Force::depends_on_velocity`] is false.
    fn damping(&self, range: Range<usize>, x: &[f64], v: &[f64], t: f64, out: &mut [f64]);

    /// Returns why stencil `stencil` has no finite force at (x, ẋ, t), if this is so.
    fn fault(&self, _stencil: usize, _x: &[f64], _v: &[f64], _t: f64) -> Option<Fault> {
        None
    }
}
