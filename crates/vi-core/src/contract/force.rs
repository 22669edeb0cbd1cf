//! Generalised forces that no potential gives: follower pressure, drag, damping. Each is named and a
//! sum of local terms like a potential, and its work has its own line in the energy ledger.
//!
//! They enter the Lagrange–d'Alembert principle δ∫L dt + ∫f·δx dt = 0, so that M ẍ = −∂V/∂x + f(x, ẋ, t) (Marsden &
//! West 2001, part 3).

use std::ops::Range;

use crate::contract::potential::{Fault, Stencils};

/// The entry of the energy ledger that the work of a force goes to.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ForceAccount {
    /// [`crate::StepEnergy::force`]: may give or take energy (follower loads, wind).
    Force,
    /// [`crate::StepEnergy::damping`]: takes energy, f·ẋ ≤ 0.
    Damping,
}

/// f(x, ẋ, t) as a sum of local terms f_s, one per stencil s.
///
/// Like [`crate::Potential`], every method fills `out` for the stencils of `range` only, and the result
/// for a stencil must not depend on the range it is asked in. `x` (m) and `v` = ẋ (m/s) hold all
/// coordinates, prescribed ones included; `t` is the time (s).
pub trait Force: Send + Sync {
    /// Name for reports and errors, e.g. `beam: pressure`.
    fn name(&self) -> &str;

    /// Where its work is entered.
    fn account(&self) -> ForceAccount;

    /// Which nodes each term touches.
    fn stencils(&self) -> Stencils<'_>;

    /// Does f depend on ẋ? A force of position alone is cheaper, and keeps the order of every scheme.
    fn depends_on_velocity(&self) -> bool;

    /// Forces f_s, N: n a stencil, n = `stencils().size()`.
    fn forces(&self, range: Range<usize>, x: &[f64], v: &[f64], t: f64, out: &mut [f64]);

    /// Symmetric part of −∂f_s/∂x, N/m: packed lower triangles as in [`crate::Potential::hessians`].
    ///
    /// It serves as the matrix of Newton's method with symmetric factors; where ∂f/∂x is not
    /// symmetric, convergence is linear instead of quadratic, and the solution is the same.
    fn stiffness(&self, range: Range<usize>, x: &[f64], v: &[f64], t: f64, out: &mut [f64]);

    /// Symmetric part of −∂f_s/∂ẋ, N s/m: packed lower triangles. Not called where
    /// [`Force::depends_on_velocity`] is false.
    fn damping(&self, range: Range<usize>, x: &[f64], v: &[f64], t: f64, out: &mut [f64]);

    /// Why stencil `stencil` has no finite force at (x, ẋ, t), if so.
    fn fault(&self, _stencil: usize, _x: &[f64], _v: &[f64], _t: f64) -> Option<Fault> {
        None
    }
}
