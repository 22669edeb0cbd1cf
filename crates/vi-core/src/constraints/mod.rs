//! Holonomic constraints g(q) = 0 with multipliers: the motion stays on its surface to round-off,
//! and the multipliers are the forces that keep it there.
//!
//! Two rooms: [`Rattle`] for a [`System`](crate::System), explicit in the potential; and
//! [`Constrained`], any Lagrangian with polynomials of degree s on Lobatto points, of order 2s,
//! whose first member is RATTLE. Neither must know which surface it is.

mod constrained;
mod constraint;
mod rattle;

pub use constrained::Constrained;
pub use constraint::Constraint;
pub use rattle::Rattle;
