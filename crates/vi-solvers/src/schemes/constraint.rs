//! Constraints in a time step: projections onto their manifold, and the multipliers of an implicit step.

mod cluster;
pub(crate) mod manifold;
pub(crate) mod multipliers;
mod units;
