//! Variational simulates deformable bodies, cloth and solids, by the finite element method.
//!
//! A scene is a Lagrangian L = T − V. A time integrator is a choice of an interpolation of the trajectory × a
//! quadrature of the action. The rest follows from Hamilton's principle.
//!
//! ```
//! use variational::prelude::*;
//!
//! let rubber = Law::NeoHookean(Isotropic { young: 1e6, poisson: 0.3, density: 1000.0 });
//! let shape = BoxMesh { size: [1.0, 0.2, 0.2], cells: [5, 1, 1], element: CellKind::Tet4, origin: [0.0; 3] };
//! let scene = Scene::new(Time::new(0.1, 1e-3, SchemeName::StormerVerlet))
//!     .gravity([0.0, -9.81, 0.0])
//!     .body(Body::from_box("beam", shape, rubber))
//!     .fix(Fix::region("beam", "x-min"));
//! let mut simulation = Simulation::new(scene).expect("a valid scene");
//! while !simulation.is_done() {
//!     simulation.step().expect("a stable step");
//! }
//! assert!(simulation.observe().elastic > 0.0);
//! ```
//!
//! [`scene::Scene`] describes a scene, [`simulation::Simulation`] steps it, [`run::run`] writes the results.
//! The layers below are re-exported as [`core`], [`mesh`], [`fem`], [`solvers`] and [`io`].

#![forbid(unsafe_code)]
// A closed pipe makes `println!` panic: `cli::say` writes instead.
#![deny(clippy::print_stdout, clippy::print_stderr)]

pub mod auto;
mod chart;
#[cfg(feature = "cli")]
pub mod cli;
pub mod intersections;
pub mod model;
pub mod record;
pub mod run;
pub mod scene;
pub mod simulation;
pub mod study;

pub use vi_core as core;
pub use vi_fem as fem;
pub use vi_io as io;
pub use vi_mesh as mesh;
pub use vi_solvers as solvers;

/// The names that most programs need.
pub mod prelude {
    pub use crate::auto::settle;
    pub use crate::run::{RunError, Watch, run};
    pub use crate::scene::{
        About, Assert, Attach, Axis, Body, Cache, Checkpoints, Control, Damping, Field, FieldComponent, Fix,
        Guard, GuardAction, HeldAxis, Inertia, Joint, Load, LocalAxis, MassKind, Output, Periodic, Precision,
        Probe, Refine, RefineAlong, Rigid, RigidShape, Scene, SchemeName, Seam, Selection, Solver, Spring,
        SpringEnd, Static, Statistic, Strike, Substance, Time, Turn,
    };
    pub use crate::simulation::{Observation, Simulation};
    pub use vi_fem::{
        Amplitude, Bending, Isotropic, IsotropicSheet, Law, LockingCure, Motion, SheetLaw, Wind,
    };
    pub use vi_mesh::{BoxMesh, CellKind, SheetMesh, SheetPattern};
    pub use vi_solvers::Interrupt;
}

/// The page of `docs/theory` that needs crates besides `vi-core`.
#[cfg(doctest)]
#[doc = include_str!("../docs/theory/08-embedding.md")]
pub struct Embedding;

/// The tutorial for library users.
#[cfg(doctest)]
#[doc = include_str!("../docs/tutorials/library.md")]
pub struct LibraryTutorial;

/// The code of the README is tested with the documentation.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
pub struct Readme;
