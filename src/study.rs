//! Studies: many runs of a scene, or of scenes made for the purpose, that answer one question. They start simulations
//! and runs; nothing below knows them.

pub mod bench;
pub mod convergence;
mod hinged;
pub mod modes;
#[cfg(feature = "cli")]
pub mod stress;
#[cfg(feature = "cli")]
pub mod sweep;
