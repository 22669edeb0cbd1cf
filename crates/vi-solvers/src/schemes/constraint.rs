//! Constraints in a time step: projections onto their manifold, the multipliers of an implicit step, and steps in the
//! tangent spaces of the bodies.

pub(crate) mod cluster;
pub(crate) mod manifold;
pub(crate) mod middle;
pub(crate) mod multipliers;
pub(super) mod units;
