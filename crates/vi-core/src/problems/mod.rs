//! A small library of mechanical problems with known answers, shared by tests and documentation.
//! Each is a [`System`](crate::System) built from potentials. This room must not know a scheme.

mod chain;
mod elliptic;
mod kepler;
mod oscillator;
mod pendulum;
mod term;

pub use chain::SpringChain;
pub use elliptic::{Jacobi, complete_elliptic_k, jacobi};
pub use kepler::Kepler;
pub use oscillator::Oscillator;
pub use pendulum::Pendulum;
pub use term::{Jet, Term};
