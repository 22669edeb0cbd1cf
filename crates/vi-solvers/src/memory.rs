//! What a stepper keeps between steps, as plain data for a checkpoint.

use crate::error::SolverError;

/// Everything beyond (t, q, p) that the next step's bits depend on, as plain data for a checkpoint.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct StepperMemory {
    /// Scene name of the scheme.
    pub method: String,
    /// Named arrays.
    pub arrays: Vec<(String, Vec<f64>)>,
    /// Named counts.
    pub counts: Vec<(String, u64)>,
}

impl StepperMemory {
    /// The array of this name.
    ///
    /// # Errors
    /// [`SolverError::Memory`] where there is none.
    pub fn array(&self, name: &'static str) -> Result<&[f64], SolverError> {
        let found = self.arrays.iter().find(|(key, _)| key == name);
        found.map(|(_, value)| value.as_slice()).ok_or(SolverError::Memory { missing: name })
    }

    /// The count of this name.
    ///
    /// # Errors
    /// [`SolverError::Memory`] where there is none.
    pub fn count(&self, name: &'static str) -> Result<u64, SolverError> {
        let found = self.counts.iter().find(|(key, _)| key == name);
        found.map(|&(_, value)| value).ok_or(SolverError::Memory { missing: name })
    }
}

/// Is `memory` that of the scheme `name`?
pub(crate) fn expect_method(memory: &StepperMemory, name: &'static str) -> Result<(), SolverError> {
    if memory.method == name { Ok(()) } else { Err(SolverError::Memory { missing: name }) }
}
