//! Steps along a path of equilibria whose load factor t is unknown, through limit points. The step is controlled by
//! arc length, or by a function of the positions that takes given values.
//!
//! The unknowns are q and t. Newton's method solves r(q, t) = 0 with one more equation, linearised at every iterate.
//! This is either Crisfield's sphere Δqᵀ M Δq / m + ψ² Δt² = Δl² with the total mass m, where ψ is the root mean
//! square of dq/dt at the start (Crisfield 1981; Ramm 1981), or c(q, t) = c₁. Beyond a limit point K is indefinite;
//! then systems are solved by minimal residuals, preconditioned by a Cholesky factor of K + σM.

mod bifurcation;
pub(super) mod branch;
mod corrector;
pub(super) mod follow;
mod turning;
