//! Checks that the numbers of a state are finite, and reports the first coordinate whose number is not.

use vi_core::{State, System};

use crate::error::SolverError;
use crate::vectors;

/// Checks that the positions and momenta of a start are finite.
pub(crate) fn check_state(state: &State, system: &System) -> Result<(), SolverError> {
    let n = system.coordinates().free_count();
    for (what, values) in [("position", &state.q), ("momentum", &state.p)] {
        if values.len() != n {
            return Err(SolverError::Memory { missing: "state of this system" });
        }
        if !vectors::all_finite(values) {
            let k = values.iter().position(|value| !value.is_finite()).unwrap_or(0);
            let dof = system.coordinates().free()[k] as usize;
            return Err(SolverError::NotFinite { what, dof, at_start: true });
        }
    }
    Ok(())
}

/// Checks that the result of a step is finite: a result that has overflowed is an error.
pub(crate) fn check_finite(q: &[f64], p: &[f64], system: &System) -> Result<(), SolverError> {
    if vectors::all_finite(q) && vectors::all_finite(p) {
        return Ok(());
    }
    let k = q.iter().zip(p).position(|(q, p)| !(q.is_finite() && p.is_finite())).unwrap_or(0);
    let dof = system.coordinates().free()[k] as usize;
    Err(SolverError::NotFinite { what: "result of the step", dof, at_start: false })
}
