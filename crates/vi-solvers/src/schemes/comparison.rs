//! Integrators that are not variational, for comparison runs only. They gain or lose energy numerically; the ledger
//! shows it as the energy of the scheme.

mod backward_euler;
mod bdf2;
mod carried;
mod forward_euler;
mod generalized_alpha;
mod newmark;
mod truncated_euler;

pub(crate) use backward_euler::BackwardEuler;

pub(crate) use bdf2::Bdf2;
pub(crate) use forward_euler::ForwardEuler;
pub(crate) use generalized_alpha::GeneralizedAlpha;
pub(crate) use newmark::Newmark;
pub(crate) use truncated_euler::TruncatedEuler;
