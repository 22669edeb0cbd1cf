//! Hamilton's principle for any Lagrangian L(t, q, q̇) given as an expression: equations of motion, action,
//! variations and momenta by automatic differentiation (dual numbers, `num-dual`).
//!
//! ```
//! use vi_core::lagrange::{Scalar, accelerations};
//! let omega = 2.0;
//! let oscillator = vi_core::lagrangian!(1; [omega] |_t, q, v| {
//!     v[0] * v[0] * 0.5 - q[0] * q[0] * (0.5 * omega * omega)
//! });
//! let a = accelerations(&oscillator, 0.0, &[0.3], &[0.0]).unwrap();
//! assert!((a[0] + 4.0 * 0.3).abs() < 1e-15);
//! ```

pub(crate) mod action;
pub(crate) mod equations;
pub(crate) mod expansion;
pub(crate) mod higher;
pub(crate) mod lagrangian;
pub(crate) mod noether;
pub(crate) mod trajectory;

pub use action::{action, along, along_varied, total_derivative, variation};
pub use equations::{accelerations, energy, momenta, residual, velocities};
pub use expansion::{Expand, Expansion};
pub use higher::{FirstOrder, HigherLagrangian, higher_residual};
pub use lagrangian::{Lagrangian, Scalar};
pub use noether::{Symmetry, momentum_map, symmetry_defect};
pub use trajectory::{Trajectory, motion};
