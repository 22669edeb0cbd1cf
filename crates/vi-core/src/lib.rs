//! Potentials, Lagrangians and schemes, and the quantities that they conserve.
//!
#![doc = include_str!("../README.md")]
#![forbid(unsafe_code)]

mod contract;
mod error;
mod theory;

pub use contract::acting::{Acting, Rubbing};
pub use contract::combination::{Combination, TiedMass, redistribute_lumped_mass};
pub use contract::conserved::{angular_momentum, angular_momentum_at, kinetic_energy, linear_momentum};
pub use contract::coordinates::{Coordinates, Fixed, Path, Prescribed};
pub use contract::damper::{Damper, DryFriction, EndForces};
pub use contract::discrete_gradient::{DiscreteGradient, Impulse, StepOutcome, StepSpan};
pub use contract::disjoint_sets::DisjointSets;
pub use contract::elsewhere::Elsewhere;
pub use contract::exchange::{Alone, Exchange, Message, ThreadRank, Traffic, runs_of_ranks};
pub use contract::filter::{Link, MassFilter};
pub use contract::force::{Force, ForceAccount};
pub use contract::inertia::solve_mass;
pub use contract::ledger::{EnergyLedger, StepEnergy};
pub use contract::meeting::Meeting;
pub use contract::node_axes::NodeAxes;
pub use contract::patch::{Padded, Patch, PatchArray, run_length};
pub use contract::portion::{Portion, coordinates_of_nodes};
pub use contract::potential::{
    Account, Far, Fault, Few, HessianKind, MakeFew, Potential, Stencils, Traits, packed_len,
};
pub use contract::power_of_two::binary_exponent;
pub use contract::prefetch::prefetch;
pub use contract::quadrature::Quadrature;
pub use contract::rank_solver::{BlockRows, RankSolver};
pub use contract::scheme::{Interpolation, Scheme};
pub use contract::shared::{LanczosStart, RunEnergy, SharedSolve, SharedTerms, SolverFacts};
pub use contract::system::{State, System};
pub use contract::terms::{Live, Terms};
pub use contract::tube::Tube;
pub use error::CoreError;
pub use theory::derived::{Derived, LocalEnergy};
pub use theory::{
    constraints, diagnostics, discrete, generalised, lagrange, oscillations, problems, reference, rotations,
    statics,
};

/// The pages of `docs/theory`, whose snippets are tests.
#[cfg(doctest)]
mod theory_pages {
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
