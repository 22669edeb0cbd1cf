//! The theory in code: a scene is a Lagrangian L = T − V, a time integrator is a choice of
//! interpolation × quadrature, and everything else follows from Hamilton's principle.
//!
//! This crate knows potentials as sums of local terms, generalised coordinates, schemes as plain
//! data, and what they conserve. It must not know a mesh, a sparse matrix or a file.

mod conserved;
pub mod constraints;
mod coordinates;
pub mod diagnostics;
mod differentiate;
pub mod discrete;
mod error;
pub mod generalised;
mod interpolation;
pub mod lagrange;
mod ledger;
mod newton;
mod potential;
pub mod problems;
mod quadrature;
pub mod reference;
pub mod rotations;
mod scheme;
pub mod statics;
mod system;

pub use conserved::{angular_momentum, kinetic_energy, linear_momentum};
pub use coordinates::{Coordinates, Fixed, Path, Prescribed};
pub use error::CoreError;
pub use ledger::{EnergyLedger, StepEnergy};
pub use potential::{Account, Fault, HessianKind, Potential, Stencils, Traits, packed_len};
pub use quadrature::Quadrature;
pub use scheme::{Interpolation, Scheme};
pub use system::{State, System};
