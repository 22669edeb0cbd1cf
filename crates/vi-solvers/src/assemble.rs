//! Sums local terms: energy, gradient and Hessian of a system, forces without a potential, live terms and the mass
//! matrix. Also holds the evaluator that steppers call. All sums give the same bits on any number of threads.

pub(crate) mod assembler;
pub(crate) mod carried;
pub(crate) mod compliance;
pub(crate) mod energy;
pub(crate) mod evaluator;
pub(crate) mod filtered;
pub(crate) mod finite;
pub(crate) mod fixed;
pub(crate) mod force_sum;
pub(crate) mod free_path;
pub(crate) mod gather;
pub(crate) mod hessian;
pub(crate) mod inertia;
pub(crate) mod invariance;
pub(crate) mod links;
pub(crate) mod live;
pub(crate) mod pairs;
pub(crate) mod passage;
pub(crate) mod spans;
pub(crate) mod stencil_forces;
pub(crate) mod sweep;
mod tied;
