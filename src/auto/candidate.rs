//! What trials found: a scheme with its step, its cost and its error.

use serde::Serialize;

use super::trial::Choice;

/// An error that is extrapolated counts as this much dearer: it may prove wrong.
const DOUBT: f64 = 3.0;

/// One way to reach the wanted error.
#[derive(Debug, Clone, Serialize)]
pub struct Candidate {
    /// Scheme with its stages.
    pub scheme: String,
    /// The choice itself.
    #[serde(skip)]
    pub choice: Choice,
    /// Steps.
    pub steps: u64,
    /// Cost of a step, s of one core of the reference machine.
    pub seconds_per_step: f64,
    /// Cost of the run, s of one core of the reference machine.
    pub predicted_seconds: f64,
    /// Relative error expected at the end; NaN (`null` in report.json) where no trial could tell.
    pub predicted_error: f64,
    /// Was the error measured at the end of a whole run with these steps, rather than extrapolated?
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

    /// By which candidates are ordered.
    pub(super) fn price(&self) -> f64 {
        self.predicted_seconds * if self.measured { 1.0 } else { DOUBT }
    }
}
