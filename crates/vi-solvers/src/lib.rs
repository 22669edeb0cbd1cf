//! Time integrators, assembly, Newton's method and sparse factors.
//!
#![doc = include_str!("../README.md")]

mod assemble;
mod equilibrium;
mod error;
mod index;
mod interrupt;
mod linear;
mod memory;
mod modes;
mod newton;
mod options;
mod ranks;
mod schemes;
mod scratch;
mod unit_of_mass;
mod vectors;
mod work;

pub use assemble::assembler::Assembler;
pub use assemble::energy::Energies;
pub use assemble::fixed::AssemblyWork;
pub use assemble::hessian::HessianEvaluation;
pub use assemble::stencil_forces::SeeForces;
pub use equilibrium::circulation::circulatory;
pub use equilibrium::function::PathFunction;
pub use equilibrium::load_control::{equilibrium, equilibrium_path};
pub use equilibrium::nodal_forces::{
    EdgeCouple, accelerations, couple_at, edge_couples, external_forces, net_forces, reactions,
};
pub use equilibrium::options::{CriticalKind, CriticalPoint, LoadStep, StaticOptions, StaticReport};
pub use equilibrium::path_following::{PathControl, path_following};
pub use equilibrium::quasi_static::quasi_static;
pub use error::{NotPositiveDefinite, PairInContact, SolverError, TermFault};
pub use interrupt::Interrupt;
pub use linear::cost::UnitCosts;
pub use linear::factor::{Factor, FactorFacts, SingleFactor};
pub use linear::matrix::SymmetricMatrix;
pub use linear::pcg::block::Preconditioner;
pub use linear::pcg::{Pcg, PcgReport};
pub use memory::StepperMemory;
pub use modes::{Mode, ModeOptions, Modes, modes};
pub use newton::budget::Budget;
pub use options::{LinearSolver, SolverOptions};
pub use ranks::conductor::stepper_of_ranks;
pub use ranks::member::Member;
pub use ranks::partners::Partners;
pub use schemes::constraint::manifold::make_tangent;
pub use schemes::filter::mass_filter;
pub use schemes::held::HeldWork;
pub use schemes::lanczos::HighestFrequency;
pub use schemes::method::{AcceptedForces, Accepts, Conserves, Method, MethodFacts, stepper};
pub use schemes::motion::{Frequencies, Motion};
pub use schemes::stability::highest_frequency;
pub use schemes::stepper::{StepError, StepReport, Stepper};
pub use work::Work;
