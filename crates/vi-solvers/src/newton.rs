//! Newton's method for the equations of an implicit step: the iteration, what it does when it converges slowly, and the
//! inverse of the model that it uses.

mod anderson;
mod attempt;
mod descent;
pub(crate) mod equations;
pub(crate) mod inverse;
mod krylov;
mod line_search;
mod renewal;
mod rotated_factor;
pub(crate) mod solver;
pub(crate) mod start;
