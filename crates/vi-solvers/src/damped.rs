//! Forces that no potential gives, as the steppers see them: which schemes take them, and their sums.
//! It must not know what a force is.

use vi_core::System;

use crate::{Method, SolverError};

/// Refuses the forces that a scheme has no place for.
///
/// # Errors
/// [`SolverError::Force`] with the force and the schemes that take it.
pub(crate) fn check_forces(method: &Method, system: &System) -> Result<(), SolverError> {
    match system.forces().first() {
        None => Ok(()),
        Some(force) => Err(SolverError::Force {
            scheme: method.name(),
            force: force.name().to_owned(),
            reason: "has no potential",
            schemes: "none yet",
        }),
    }
}
