//! The theory in code, for small systems: Hamilton's principle for any Lagrangian by automatic differentiation, its
//! discretisation, constraints and rotations, instruments, and problems with known answers.

pub mod constraints;
pub(crate) mod derived;
pub mod diagnostics;
pub(crate) mod differentiate;
pub mod discrete;
pub mod generalised;
pub(crate) mod interpolation;
pub mod lagrange;
pub(crate) mod newton;
pub mod oscillations;
pub mod problems;
pub mod reference;
pub mod rotations;
pub mod statics;
