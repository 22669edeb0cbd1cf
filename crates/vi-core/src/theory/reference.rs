//! The dense reference: one step of *any* scheme for a [`System`], solved directly from the definition of the
//! discrete Lagrangian ([`DiscreteLagrangian`]), for small systems and to round-off. Fast kernels are compared with
//! it, so it uses no closed formula of a scheme.

use crate::contract::scheme::Scheme;
use crate::contract::system::{State, System};
use crate::error::CoreError;
use crate::theory::discrete::lagrangian::DiscreteLagrangian;

pub use crate::contract::dense::{energy, gradient, hessian};

/// Makes one step of length h (s) of the scheme from `state`, by Newton's method to round-off.
///
/// The cost is that of dense matrices with s · `free_count` rows: for tests and small systems.
///
/// # Errors
/// - [`CoreError::Degenerate`] if the quadrature has fewer points than the degree of the interpolation, so that no
///   momentum determines the step;
/// - [`CoreError::Length`] if the state does not have one entry per free coordinate;
/// - [`CoreError::StepSize`] if h is zero or not finite;
/// - [`CoreError::SingularStep`] if D₁D₂L_d has no inverse at this h;
/// - [`CoreError::Convergence`] if Newton's method stalls.
pub fn step(system: &System, scheme: &Scheme, state: &State, h: f64) -> Result<State, CoreError> {
    DiscreteLagrangian::new(system, scheme, h)?.step(state)
}

/// Returns the discrete Lagrangian L_d (J s) of the step from `state`: the action S at its solution.
///
/// # Errors
/// Returns the errors of [`step`].
pub fn discrete_lagrangian(
    system: &System,
    scheme: &Scheme,
    state: &State,
    h: f64,
) -> Result<f64, CoreError> {
    let discrete = DiscreteLagrangian::new(system, scheme, h)?;
    Ok(discrete.action(&discrete.path_from(state)?))
}
