//! Scene keys for the safety of a run: checkpoints and the energy guard.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// `[checkpoint]`: files from which `variational resume` continues the run, bit for bit.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Checkpoints {
    /// Simulated time between checkpoints, s (> 0); each is written at the nearest step. There is one
    /// at the start too, and one where the run is ended by Ctrl-C or by a failed step.
    pub interval: f64,
    /// Number of checkpoints kept, the newest ones (≥ 1; default 2, so that one is left if the newest is damaged).
    #[serde(default = "Checkpoints::default_keep")]
    pub keep: u64,
}

impl Checkpoints {
    fn default_keep() -> u64 {
        2
    }

    /// One every `interval` (s).
    pub fn every(interval: f64) -> Self {
        Self { interval, keep: Self::default_keep() }
    }
}

/// Reaction of the energy guard to energy that no work accounts for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum GuardAction {
    /// Nothing: energy is not watched.
    Off,
    /// Says so at the end, on the console and in the report.
    #[default]
    Warn,
    /// Goes back to the last good step and continues with half the step; ends the run at h/1024.
    Halve,
    /// Goes back to the last good step and continues by `energy-momentum`; halves the step where forces
    /// of the scene rule that out, or where it does not help.
    Switch,
    /// Ends the run (exit code 4).
    Stop,
}

/// `[guard]`: watches total energy − work of loads, prescribed motion and damping against its start.
/// Without this table the guard warns of 0.1; with `scheme = "auto"` it looks every 16 steps, and halves.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Guard {
    /// Reaction of the guard.
    #[serde(default)]
    pub action: GuardAction,
    /// Largest growth that is allowed (> 0, default 1e-2), relative to the exchange: the largest energy
    /// that motion and deformation were given, by the start, by weight and by work.
    #[serde(default = "Guard::default_bound")]
    pub bound: f64,
}

impl Guard {
    fn default_bound() -> f64 {
        1e-2
    }

    /// The guard of a scene that does not speak of it.
    pub(crate) fn silent() -> Self {
        Self { action: GuardAction::Warn, bound: 0.1 }
    }

    /// With the default bound.
    pub fn new(action: GuardAction) -> Self {
        Self { action, bound: Self::default_bound() }
    }

    /// Does it look while the run goes on, to act?
    pub(crate) fn acts(&self) -> bool {
        matches!(self.action, GuardAction::Halve | GuardAction::Switch | GuardAction::Stop)
    }
}
