//! The contract between the crates of the workspace: coordinates, local terms, systems and states, the energy ledger,
//! constraints, and schemes as data. Nothing here needs automatic differentiation.

pub(crate) mod acting;
pub(crate) mod combination;
pub(crate) mod conserved;
pub(crate) mod constraint;
pub(crate) mod coordinates;
pub(crate) mod damper;
pub(crate) mod dense;
pub(crate) mod discrete_gradient;
pub(crate) mod disjoint_sets;
pub(crate) mod elsewhere;
pub(crate) mod exchange;
pub(crate) mod filter;
pub(crate) mod force;
pub(crate) mod inertia;
pub(crate) mod ledger;
pub(crate) mod meeting;
pub(crate) mod node_axes;
pub(crate) mod patch;
pub(crate) mod portion;
pub(crate) mod potential;
pub(crate) mod power_of_two;
pub(crate) mod prefetch;
pub(crate) mod quadrature;
pub(crate) mod rank_solver;
pub(crate) mod scheme;
pub(crate) mod shared;
pub(crate) mod system;
pub(crate) mod terms;
pub(crate) mod tube;
