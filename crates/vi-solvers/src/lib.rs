//! Time integrators, assembly, nonlinear and sparse solves for `vi-core` systems.
//!
//! This crate knows stencils, small dense blocks, sparse systems and time steps. It must not know
//! an element or a material.

mod accounts;
mod assembly;
mod balance;
mod comparison;
mod constrained;
mod cost;
mod energy;
mod energy_momentum;
mod error;
mod factor;
mod force_sum;
mod forces;
mod gather;
mod gauss;
mod hessian;
mod inertia;
mod inverse;
mod kick_drift;
mod linear;
mod live;
mod matrix;
mod matrix_sum;
mod method;
mod minres;
mod modes;
mod newton;
mod nodal_forces;
mod ordering;
mod path_following;
mod pcg;
mod quasi_static;
mod schemes;
mod stability;
mod stages;
mod statics;
mod stepper;
mod surface;
mod sweep;
mod tied;
mod units;
mod vectors;
mod warp;

pub use assembly::{Assembler, AssemblyWork, HessianEvaluation};
pub use cost::UnitCosts;
pub use energy::Energies;
pub use error::{NotPositiveDefinite, SolverError, TermFault};
pub use factor::{Cholesky, Columns, Factor, FactorFacts, Scalar, SingleFactor};
pub use matrix::SymmetricMatrix;
pub use method::{AcceptedForces, Accepts, Conserves, Method, MethodFacts, stepper};
pub use modes::{Mode, ModeOptions, Modes, modes};
pub use nodal_forces::{accelerations, external_forces, net_forces};
pub use path_following::{PathControl, path_following};
pub use pcg::{Pcg, PcgFacts, PcgReport, Preconditioner};
pub use quasi_static::quasi_static;
pub use stability::{HighestFrequency, highest_frequency};
pub use statics::{
    CriticalKind, CriticalPoint, LoadStep, PathFunction, StaticOptions, StaticReport, equilibrium,
    equilibrium_path, reactions,
};
pub use stepper::{LinearSolver, SolverOptions, StepError, StepReport, Stepper, StepperMemory, Work};
pub use surface::make_tangent;
