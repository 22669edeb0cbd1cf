//! The theory in code: a scene is a Lagrangian L = T − V, a time integrator is a choice of
//! interpolation × quadrature, and everything else follows from Hamilton's principle.
//!
//! This crate knows potentials as sums of local terms, generalised coordinates, schemes as plain
//! data, and what they conserve. It must not know a mesh, a sparse matrix or a file.

#![forbid(unsafe_code)]

mod combination;
mod conserved;
pub mod constraints;
mod coordinates;
mod derived;
pub mod diagnostics;
mod differentiate;
pub mod discrete;
mod error;
mod force;
pub mod generalised;
mod inertia;
mod interpolation;
pub mod lagrange;
mod ledger;
mod newton;
mod node_axes;
pub mod oscillations;
mod patch;
mod potential;
mod power_of_two;
pub mod problems;
mod quadrature;
pub mod reference;
pub mod rotations;
mod scheme;
pub mod statics;
mod system;
mod terms;

pub use combination::{Combination, TiedMass, hand_on_lumped_mass};
pub use conserved::{angular_momentum, kinetic_energy, linear_momentum};
pub use coordinates::{Coordinates, Fixed, Path, Prescribed};
pub use derived::{Derived, LocalEnergy};
pub use error::CoreError;
pub use force::{Force, ForceAccount};
pub use inertia::solve_mass;
pub use ledger::{EnergyLedger, StepEnergy};
pub use node_axes::NodeAxes;
pub use patch::{Padded, Patch, PatchArray, run_length};
pub use potential::{Account, Fault, HessianKind, Potential, Stencils, Traits, packed_len};
pub use power_of_two::binary_exponent;
pub use quadrature::Quadrature;
pub use scheme::{Interpolation, Scheme};
pub use system::{State, System};
pub use terms::{DiscreteGradient, Live, Terms};

/// The pages of `docs/theory`, whose snippets are tests.
#[cfg(doctest)]
mod theory {
    #[doc = include_str!("../../../docs/theory/01-hamilton.md")]
    mod hamilton {}
    #[doc = include_str!("../../../docs/theory/02-discrete.md")]
    mod discrete {}
    #[doc = include_str!("../../../docs/theory/03-generalised.md")]
    mod generalised {}
    #[doc = include_str!("../../../docs/theory/04-constraints.md")]
    mod constraints {}
    #[doc = include_str!("../../../docs/theory/05-rotations.md")]
    mod rotations {}
    #[doc = include_str!("../../../docs/theory/06-diagnostics.md")]
    mod diagnostics {}
    #[doc = include_str!("../../../docs/theory/07-finite-elements.md")]
    mod finite_elements {}
}
