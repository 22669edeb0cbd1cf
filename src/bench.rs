//! The program measures itself on the user's own scene: schemes × steps against a self-converged
//! reference, by run time and error at the end. It must not know the command line.
//!
//! Error is ‖u − u_ref‖_M / ‖u_ref‖_M at the end of the scene, u the displacement from rest. Time is that
//! of stepping alone, output off; combinations under a second run three times, in turn with the others,
//! and the least counts. A combination that fails is a row, not an end.

mod chart;
mod reference;
mod sweep;
mod tables;

use std::time::Duration;

use serde::Serialize;

use crate::auto::SettleError;
use crate::scene::{Problem, Scene};
use crate::trial::{Choice, TrialWatch};

pub use sweep::bench;

/// What a bench is asked for.
#[derive(Debug, Clone, PartialEq)]
pub struct BenchOptions {
    /// Wall time for everything (default 60 s).
    pub budget: Duration,
    /// The relative error wanted at the end (default: `[time] tolerance`, else 1e-2).
    pub accuracy: Option<f64>,
    /// Schemes to sweep, e.g. `gauss 3`; empty: the variational ones and `energy-momentum`.
    pub schemes: Vec<String>,
}

impl Default for BenchOptions {
    fn default() -> Self {
        Self { budget: Duration::from_secs(60), accuracy: None, schemes: Vec::new() }
    }
}

/// Follows a bench. All methods are optional.
pub trait BenchWatch {
    /// What is about to run, the share of the budget that is spent, and the time left.
    fn next(&mut self, _what: &str, _spent: f64, _left: Duration) {}
    /// Asked often: false ends the bench with what it has.
    fn go_on(&mut self) -> bool {
        true
    }
}

impl BenchWatch for () {}

/// A watch of a bench that follows the trials of `auto` before it.
struct Trials<'a>(&'a mut dyn BenchWatch);

impl TrialWatch for Trials<'_> {
    fn next(&mut self, what: &str) {
        self.0.next(what, 0.0, Duration::ZERO);
    }

    fn go_on(&mut self) -> bool {
        self.0.go_on()
    }
}

/// The solution that errors are measured against, and why it can be trusted.
#[derive(Debug, Clone, Serialize)]
pub struct ReferenceFacts {
    /// How it was made.
    pub scheme: String,
    /// Steps.
    pub steps: u64,
    /// Its relative difference from a solution with `coarser_steps` by the same scheme.
    pub difference: f64,
    /// Steps of that solution.
    pub coarser_steps: u64,
}

/// One combination of scheme and step.
#[derive(Debug, Clone, Serialize)]
pub struct Row {
    /// The scheme with its stages.
    pub scheme: String,
    /// Scheme and number of steps.
    #[serde(skip)]
    pub choice: Choice,
    /// Steps.
    pub steps: u64,
    /// Step, s.
    pub step: f64,
    /// Seconds of stepping, the least of `repeats`.
    pub seconds: Option<f64>,
    /// How often it ran.
    pub repeats: u32,
    /// Relative error at the end; none where it failed.
    pub error: Option<f64>,
    /// Order observed from the row with twice the step, where there is one.
    pub observed_order: Option<f64>,
    /// max |H − H₀| over the largest kinetic energy.
    pub energy_drift: Option<f64>,
    /// Counted work.
    pub work: serde_json::Map<String, serde_json::Value>,
    /// Is no other row both faster and more accurate?
    pub on_front: bool,
    /// Is it what the scene asks for now?
    pub is_present: bool,
    /// Is its error so near that of the reference that it says no more than "at most about this"?
    pub at_reference: bool,
    /// Why it failed.
    pub failure: Option<String>,
}

/// The outcome of a bench.
#[derive(Debug, Clone, Serialize)]
pub struct BenchReport {
    /// Version of this program.
    pub version: &'static str,
    /// Threads of the pool.
    pub threads: usize,
    /// The relative error wanted.
    pub accuracy: f64,
    /// The reference.
    pub reference: ReferenceFacts,
    /// All combinations.
    pub rows: Vec<Row>,
    /// What to use, in a sentence.
    pub recommendation: String,
    /// The row that is recommended.
    pub recommended: Option<usize>,
    /// Wall seconds of the whole bench.
    pub seconds: f64,
}

/// Why there is no bench at all.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum BenchError {
    /// The scene is wrong.
    #[error("the scene is wrong")]
    Scene(Vec<Problem>),
    /// The caller asked to stop before anything could be compared.
    #[error("stopped")]
    Stopped,
    /// A scheme is unknown.
    #[error("unknown scheme '{name}'; there are {known}")]
    Scheme {
        /// What was asked for.
        name: String,
        /// What there is.
        known: String,
    },
    /// Nothing moves.
    #[error("no coordinate of the scene is free: there is nothing to measure")]
    NothingMoves,
    /// The scene never leaves its rest shape.
    #[error("no reference within the budget: {why}; allow more with --budget")]
    Reference {
        /// What was tried.
        why: String,
    },
}

impl From<SettleError> for BenchError {
    fn from(error: SettleError) -> Self {
        match error {
            SettleError::Scene(problems) => Self::Scene(problems),
            SettleError::Stopped => Self::Stopped,
        }
    }
}

/// The scene that a bench recommends: its own, with the recommended scheme and step.
pub fn recommended_scene(report: &BenchReport, scene: &Scene) -> Option<Scene> {
    report.recommended.map(|row| {
        let mut found = report.rows[row].choice.apply(scene);
        found.output = scene.output.clone();
        found
    })
}
