//! A small library of mechanical problems with known answers, shared by tests and documentation: systems of
//! potentials, Lagrangians, embeddings, bodies.

pub(crate) mod bar;
pub(crate) mod bead;
pub(crate) mod bodies;
pub(crate) mod chain;
pub(crate) mod elliptic;
pub(crate) mod henon_heiles;
pub(crate) mod kepler;
pub(crate) mod lever;
pub(crate) mod oscillator;
pub(crate) mod pais_uhlenbeck;
pub(crate) mod pendulum;
pub(crate) mod spherical;
pub(crate) mod term;

pub use bar::Bar;
pub use bead::BeadOnHoop;
pub use bodies::{double_pendulum, flip_period, free_body, heavy_top, principal_inertia};
pub use chain::SpringChain;
pub use elliptic::{Jacobi, complete_elliptic_k, jacobi};
pub use henon_heiles::HenonHeiles;
pub use kepler::Kepler;
pub use lever::Lever;
pub use oscillator::Oscillator;
pub use pais_uhlenbeck::PaisUhlenbeck;
pub use pendulum::Pendulum;
pub use spherical::{Sphere, SphericalPendulum};
pub use term::{Jet, Term};
