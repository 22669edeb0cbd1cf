//! The data that a stepper keeps between steps, as plain values for a checkpoint.

use crate::error::SolverError;

/// Everything besides (t, q, p) on which the bits of the next step depend.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct StepperMemory {
    /// Name of the scheme in scene files.
    pub method: String,
    /// Named arrays.
    pub arrays: Vec<(String, Vec<f64>)>,
    /// Named counts.
    pub counts: Vec<(String, u64)>,
    /// Named texts. They are reported; no bits depend on them.
    pub texts: Vec<(String, String)>,
}

impl StepperMemory {
    /// Returns the array of this name.
    ///
    /// # Errors
    /// Returns [`SolverError::Memory`] if there is none.
    pub fn array(&self, name: &'static str) -> Result<&[f64], SolverError> {
        let found = self.arrays.iter().find(|(key, _)| key == name);
        found.map(|(_, value)| value.as_slice()).ok_or(SolverError::Memory { missing: name })
    }

    /// Returns the count of this name.
    ///
    /// # Errors
    /// Returns [`SolverError::Memory`] if there is none.
    pub fn count(&self, name: &'static str) -> Result<u64, SolverError> {
        let found = self.counts.iter().find(|(key, _)| key == name);
        found.map(|&(_, value)| value).ok_or(SolverError::Memory { missing: name })
    }

    /// Returns the text of this name.
    ///
    /// # Errors
    /// Returns [`SolverError::Memory`] if there is none.
    pub fn text(&self, name: &'static str) -> Result<&str, SolverError> {
        let found = self.texts.iter().find(|(key, _)| key == name);
        found.map(|(_, value)| value.as_str()).ok_or(SolverError::Memory { missing: name })
    }
}

/// Checks that `memory` belongs to the scheme `name`.
pub(crate) fn expect_method(memory: &StepperMemory, name: &'static str) -> Result<(), SolverError> {
    if memory.method == name { Ok(()) } else { Err(SolverError::Memory { missing: name }) }
}
