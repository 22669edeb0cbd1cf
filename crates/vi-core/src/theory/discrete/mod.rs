//! Hamilton's principle after discretisation. A discrete Lagrangian is an interpolation of the path × a quadrature of
//! the action, and its discrete Euler–Lagrange equations define the integrator (Marsden & West 2001).
//!
//! ```
//! use vi_core::{Scheme, discrete::DiscreteLagrangian};
//! let pendulum = vi_core::lagrangian!(1; |_t, q, v| v[0] * v[0] * 0.5 + q[0].cos());
//! let integrator = DiscreteLagrangian::new(&pendulum, &Scheme::gauss(2)?, 0.1)?;
//! let start = vi_core::State { t: 0.0, q: vec![1.0], p: vec![0.0] };
//! let next = integrator.step(&start)?;
//! let exact = vi_core::problems::Pendulum::unit().exact(1.0, 0.1);
//! assert!((next.q[0] - exact.q[0]).abs() < 1e-7);
//! # Ok::<(), vi_core::CoreError>(())
//! ```

pub(crate) mod boundary;
pub(crate) mod hermite;
pub(crate) mod lagrangian;

pub use boundary::{stationary_hermite_path, stationary_path};
pub use hermite::{HermiteLagrangian, HermiteState};
pub use lagrangian::{DiscreteLagrangian, Polynomial};
