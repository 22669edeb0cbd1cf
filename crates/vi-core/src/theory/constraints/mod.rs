//! Holonomic constraints g(q) = 0 with multipliers: the motion stays on its surface to round-off,
//! and the multipliers are the forces that keep it there.
//!
//! [`Constraint`] is any surface; [`QuadraticConstraint`] one that a [`System`](crate::System) carries
//! to the sparse steppers of other crates. Two integrators for small systems: [`Rattle`] for a system,
//! explicit in the potential; and [`Constrained`], any Lagrangian with polynomials of degree s on
//! Lobatto points, of order 2s, whose first member is RATTLE. Neither must know which surface it is.

pub(crate) mod constrained;
pub(crate) mod constraint;
pub(crate) mod quadratic;
pub(crate) mod rattle;

pub use crate::contract::constraint::{Place, QuadraticConstraint};
pub use constrained::Constrained;
pub use constraint::Constraint;

pub use rattle::Rattle;
