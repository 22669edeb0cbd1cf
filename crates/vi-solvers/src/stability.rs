//! The highest frequency of a body, which limits the step of every explicit scheme.
//! It must not build a Hessian: an explicit run has none.

use vi_core::{State, System};

use crate::SolverError;

/// An estimate of the highest frequency about a state.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HighestFrequency {
    /// ω_max = √λ_max(M⁻¹K), rad/s.
    pub omega: f64,
    /// Products with K made for it, two gradients each.
    pub iterations: u32,
}

/// ω_max about `state`.
///
/// # Errors
/// [`SolverError::Term`] or [`SolverError::NotFinite`] where the state has no finite force.
pub fn highest_frequency(_system: &System, _state: &State) -> Result<HighestFrequency, SolverError> {
    Err(SolverError::Memory { missing: "not built yet" })
}
