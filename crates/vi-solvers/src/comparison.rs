//! Integrators that are not variational, for comparison runs only: they gain or lose energy by
//! themselves, and the ledger shows it as the scheme's part.

mod forward_euler;

pub(crate) use forward_euler::ForwardEuler;
