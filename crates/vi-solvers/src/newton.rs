//! Newton's method for the equations of an implicit step: the iteration, the measures against slow convergence, and
//! the inverse of the model.

mod anderson;
pub(crate) mod attempt;
pub(crate) mod budget;
mod descent;
pub(crate) mod equations;
pub(crate) mod free_translations;
pub(crate) mod inverse;
mod krylov;
mod lagging;
pub(crate) mod line_search;
pub(crate) mod pair_equations;
mod pairs;
mod renewal;
mod rotated_factor;
pub(crate) mod soft_bristles;
pub(crate) mod solver;
pub(crate) mod start;
mod truncated;
