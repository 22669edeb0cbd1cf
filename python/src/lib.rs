//! The Python package of Variational: the module `variational_sim._core` over the crate `variational`.
//!
//! This crate converts and calls; it computes nothing itself. Every call into the library releases Python's lock
//! (`py.detach`), because terms written in Python take it from the threads of the simulation.

mod arrays;
mod callables;
mod errors;
mod mesh;
mod observation;
mod run;
mod scene;
mod simulation;
mod study;
mod supervise;
mod threads;

use pyo3::prelude::*;

/// The extension module of `variational_sim`; use the names of `variational_sim` instead.
#[pymodule]
mod _core {
    #[pymodule_export]
    use crate::mesh::Mesh;
    #[pymodule_export]
    use crate::run::{cli, resume, run};
    #[pymodule_export]
    use crate::scene::{Scene, schema};
    #[pymodule_export]
    use crate::simulation::Simulation;
    #[pymodule_export]
    use crate::study::{bench, convergence, modes, sweep};
}
