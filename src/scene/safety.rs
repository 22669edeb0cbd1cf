//! Scene keys for the safety of a run: checkpoints and the energy guard.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// `[checkpoint]`: files from which `variational resume` continues the run, bit for bit.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Checkpoints {
    /// Simulated time between checkpoints, s (> 0); each is written at the nearest step. Further ones are written at
    /// the start, and at the state at which Ctrl-C or a failed step ends the run.
    pub interval: f64,
    /// Number of checkpoints kept, the newest ones (≥ 1; default 2, so that one is left if the newest is damaged).
    #[serde(default = "Checkpoints::default_keep")]
    pub keep: u64,
}

impl Checkpoints {
    fn default_keep() -> u64 {
        2
    }

    /// Makes checkpoints every `interval` (s).
    pub fn every(interval: f64) -> Self {
        Self { interval, keep: Self::default_keep() }
    }
}

/// Response of the energy guard to energy that no work accounts for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum GuardAction {
    /// None: energy is not watched.
    Off,
    /// A warning at the end, on the console and in the report.
    #[default]
    Warn,
    /// Goes back to the last good step and continues with half the step; ends the run at h/1024.
    Halve,
    /// Goes back to the last good step and continues with `energy-momentum`. If forces of the scene rule that out, or
    /// it does not help, halves the step.
    Switch,
    /// Ends the run (exit code 4).
    Stop,
}

/// `[guard]`: watches the growth of total energy minus the work of loads, prescribed motion and damping. Without this
/// table the guard warns of a growth of 0.1 and halves the step at a growth of 1 (explicit schemes with contact: ends
/// the run); with `scheme = "auto"` it does so at a growth of 1e-2.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Guard {
    /// Response of the guard.
    #[serde(default)]
    pub action: GuardAction,
    /// Largest growth allowed (> 0, default 1e-2), relative to the exchange: the largest energy given to motion and
    /// deformation by the initial state, by weight and by work.
    #[serde(default = "Guard::default_bound")]
    pub bound: f64,
}

impl Guard {
    fn default_bound() -> f64 {
        1e-2
    }

    /// Returns the guard of a scene without the table `[guard]`: beyond this growth the state means nothing.
    pub(crate) fn without_table() -> Self {
        Self { action: GuardAction::Halve, bound: 1.0 }
    }

    /// Makes a guard with the default bound.
    pub fn new(action: GuardAction) -> Self {
        Self { action, bound: Self::default_bound() }
    }

    /// Returns whether it checks during the run, in order to act.
    pub(crate) fn acts(&self) -> bool {
        matches!(self.action, GuardAction::Halve | GuardAction::Switch | GuardAction::Stop)
    }
}
