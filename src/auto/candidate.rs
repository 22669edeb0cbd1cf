//! The result of trials: a scheme with its step, its cost and its error.

use serde::Serialize;

use super::trial::Choice;

/// Factor on the cost of a candidate with an extrapolated error, because the error may be wrong.
const DOUBT: f64 = 3.0;

/// One way to reach the required error.
#[derive(Debug, Clone, Serialize)]
pub struct Candidate {
    /// Name of the scheme, with the number of its stages if it has several.
    pub scheme: String,
    /// The scheme with its step, as a scene sets them.
    #[serde(skip)]
    pub choice: Choice,
    /// Number of steps from 0 to the end.
    pub steps: u64,
    /// Cost of a step, s of one core of the reference machine.
    pub seconds_per_step: f64,
    /// Cost of the run, s of one core of the reference machine.
    pub predicted_seconds: f64,
    /// Expected relative error at the end; NaN (`null` in report.json) if no trial gave an estimate.
    pub predicted_error: f64,
    /// Whether the error was measured at the end of a whole run with these steps; otherwise it is extrapolated.
    pub measured: bool,
}

impl Candidate {
    pub(super) fn new(choice: Choice, seconds_per_step: f64, predicted_error: f64, measured: bool) -> Self {
        Self {
            scheme: choice.label(),
            choice,
            steps: choice.steps,
            seconds_per_step,
            predicted_seconds: seconds_per_step * choice.steps as f64,
            predicted_error,
            measured,
        }
    }

    /// Returns the cost by which candidates are ordered, s: the predicted one, multiplied by [`DOUBT`] if the error is
    /// extrapolated.
    pub(super) fn cost_with_doubt(&self) -> f64 {
        self.predicted_seconds * if self.measured { 1.0 } else { DOUBT }
    }
}
