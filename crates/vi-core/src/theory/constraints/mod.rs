//! Holonomic constraints g(q) = 0 with multipliers: the motion remains on the surface to round-off, and the
//! multipliers give the constraint forces.
//!
//! [`Constraint`] describes any surface. A [`QuadraticConstraint`] can be part of a [`System`](crate::System) for the
//! sparse steppers of other crates. There are two integrators for small systems: [`Rattle`] for a
//! [`System`](crate::System), explicit in the potential, and [`Constrained`] for any Lagrangian, with polynomials of
//! degree s on Lobatto points and of order 2s; its first member is RATTLE. Both accept any [`Constraint`].

pub(crate) mod constrained;
pub(crate) mod constraint;
pub(crate) mod quadratic;
pub(crate) mod rattle;

pub use crate::contract::constraint::{Place, QuadraticConstraint};
pub use constrained::Constrained;
pub use constraint::Constraint;

pub use rattle::Rattle;
