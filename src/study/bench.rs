//! Measures the program on the user's own scene: schemes × steps against a self-converged reference, by run time and
//! error at the end.
//!
//! The error is ‖u − u_ref‖_M / ‖u_ref‖_M at the end of the scene, where u is the displacement from rest. The time is
//! that of stepping alone, without output. Combinations run in turn until their two smallest times agree, and the
//! smallest counts: processor time on one thread, run time on several. A combination that fails is a row; it does not
//! end the bench.

mod chart;
mod reference;
mod sweep;
mod tables;
mod tenth;

use std::time::Duration;

use serde::Serialize;

use crate::auto::SettleError;
use crate::auto::trial::{Choice, Trial, TrialWatch};
use crate::run::provenance::Provenance;
use crate::scene::{Problem, Scene};

pub use sweep::bench;
pub use tenth::Tenth;

/// Options of a bench.
#[derive(Debug, Clone, PartialEq)]
pub struct BenchOptions {
    /// Name of the scene, for the report.
    pub name: String,
    /// Wall time for the whole bench (default 60 s).
    pub budget: Duration,
    /// Required relative error at the end (default: `[time] tolerance`, else 1e-2).
    pub accuracy: Option<f64>,
    /// Schemes to compare, e.g. `gauss 3`; if empty, the variational ones and `energy-momentum`.
    pub schemes: Vec<String>,
}

impl Default for BenchOptions {
    fn default() -> Self {
        Self { name: String::new(), budget: Duration::from_secs(60), accuracy: None, schemes: Vec::new() }
    }
}

/// Follows a bench. All methods are optional.
pub trait BenchWatch {
    /// Called with the next run, the fraction of the budget used, and the time left.
    fn next(&mut self, _what: &str, _spent: f64, _left: Duration) {}
    /// Called often: false ends the bench with the results so far.
    fn go_on(&mut self) -> bool {
        true
    }
}

impl BenchWatch for () {}

/// Passes the progress of the preceding trials of `auto` to the watch of a bench.
struct Trials<'a>(&'a mut dyn BenchWatch);

impl TrialWatch for Trials<'_> {
    fn next(&mut self, what: &str) {
        self.0.next(what, 0.0, Duration::ZERO);
    }

    fn go_on(&mut self) -> bool {
        self.0.go_on()
    }
}

/// The solution against which errors are measured, with its own error estimate.
#[derive(Debug, Clone, Serialize)]
pub struct ReferenceFacts {
    /// Method of the reference.
    pub scheme: String,
    /// Steps.
    pub steps: u64,
    /// Relative difference from a solution with `coarser_steps` by the same scheme.
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
    /// Run time of stepping, s, the smallest of `repeats`.
    pub seconds: Option<f64>,
    /// Processor time of stepping, s, of all threads, the smallest of `repeats`.
    pub processor_seconds: Option<f64>,
    /// Run time and processor time of each repeat, s.
    #[serde(skip)]
    times: Vec<[f64; 2]>,
    /// Number of repeats.
    pub repeats: u32,
    /// Relative error at the end; `None` if the run failed.
    pub error: Option<f64>,
    /// Order observed relative to the row with twice the step, if there is one.
    pub observed_order: Option<f64>,
    /// max |H − H₀| over the largest kinetic energy.
    pub energy_drift: Option<f64>,
    /// Counted work.
    pub work: serde_json::Map<String, serde_json::Value>,
    /// Whether no other row is both faster and more accurate.
    pub on_front: bool,
    /// Whether it is the current choice of the scene.
    pub is_present: bool,
    /// Whether its error is so near that of the reference that it is only an upper estimate.
    pub at_reference: bool,
    /// Error message, if the run failed.
    pub failure: Option<String>,
}

impl Row {
    /// Returns the row of a choice over the time `end`, s, before its first run.
    fn new(choice: Choice, end: f64) -> Self {
        Self {
            scheme: choice.label(),
            choice,
            steps: choice.steps,
            step: end / choice.steps as f64,
            seconds: None,
            processor_seconds: None,
            repeats: 1,
            times: Vec::new(),
            error: None,
            observed_order: None,
            energy_drift: None,
            work: serde_json::Map::new(),
            on_front: false,
            is_present: false,
            at_reference: false,
            failure: None,
        }
    }

    /// Adds the times of a run.
    fn time(&mut self, trial: &Trial) {
        self.times.push([trial.seconds, trial.processor_seconds]);
        let least = |k: usize| self.times.iter().map(|times| times[k]).reduce(f64::min);
        (self.seconds, self.processor_seconds) = (least(0), least(1));
    }

    /// Returns whether the two smallest times differ by at most `share`, for run time and for processor time.
    fn times_agree(&self, share: f64) -> bool {
        (0..2).all(|k| {
            let mut times: Vec<f64> = self.times.iter().map(|times| times[k]).collect();
            times.sort_by(f64::total_cmp);
            matches!(times[..], [first, second, ..] if second - first <= share * second)
        })
    }

    /// Returns the time by which it is ranked, s.
    pub fn cost(&self, measure: Measure) -> Option<f64> {
        match measure {
            Measure::ProcessorTime => self.processor_seconds,
            Measure::RunTime => self.seconds,
        }
    }
}

/// Time by which combinations are ranked.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Measure {
    /// Processor time: used on one thread, because it does not depend on the load of the machine.
    ProcessorTime,
    /// Run time: used on several threads, because their purpose is to reduce it.
    RunTime,
}

impl Measure {
    fn of_threads(threads: usize) -> Self {
        if threads == 1 { Self::ProcessorTime } else { Self::RunTime }
    }
}

impl std::fmt::Display for Measure {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::ProcessorTime => "processor time",
            Self::RunTime => "run time",
        })
    }
}

/// A machine counts as busy if runs wait for a processor during more than this fraction of their time.
const BUSY: f64 = 0.05;

/// The outcome of a bench.
#[derive(Debug, Clone, Serialize)]
pub struct BenchReport {
    /// Origin of the result.
    pub provenance: Provenance,
    /// Time by which combinations are ranked.
    pub ranked_by: Measure,
    /// Fraction of their time for which runs waited for a busy processor; `None` if the system does not provide it.
    pub waited_share: Option<f64>,
    /// Required relative error.
    pub accuracy: f64,
    /// The reference.
    pub reference: ReferenceFacts,
    /// All combinations.
    pub rows: Vec<Row>,
    /// Recommendation, one sentence.
    pub recommendation: String,
    /// Index of the recommended row.
    pub recommended: Option<usize>,
    /// What a tenth of the required error would cost; `None` if the rows do not show it.
    pub tenth: Option<Tenth>,
    /// Whether the bench was ended from outside. The rows are then those measured before.
    pub interrupted: bool,
    /// Wall time of the whole bench, s.
    pub seconds: f64,
}

impl BenchReport {
    /// Returns the time by which a row is ranked, s.
    pub(crate) fn cost(&self, row: &Row) -> Option<f64> {
        row.cost(self.ranked_by)
    }

    /// Returns a warning if the machine was busy with other work.
    pub fn busy(&self) -> Option<String> {
        let share = self.waited_share.filter(|share| *share > BUSY)?;
        let trust = match self.ranked_by {
            Measure::ProcessorTime => "processor times hold, run times are too long",
            Measure::RunTime => {
                "run times are too long: measure again on a quiet machine, or with --threads 1"
            }
        };
        Some(format!(
            "the machine is busy: runs waited {:.0} % of the time for a processor; {trust}",
            100.0 * share
        ))
    }
}

/// Error that prevents a bench.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum BenchError {
    /// The scene is invalid.
    #[error("the scene is invalid")]
    Scene(Vec<Problem>),
    /// The caller asked to stop before anything could be compared.
    #[error("interrupted before anything could be compared; nothing was written")]
    Stopped,
    /// A scheme is unknown.
    #[error("unknown scheme '{name}'; there are {known}")]
    Scheme {
        /// The unknown name.
        name: String,
        /// The known names.
        known: String,
    },
    /// The scene requests equilibria instead of a motion.
    #[error(
        "a scene with [static] has no scheme and no time step to compare; remove [static] to compare those of its motion"
    )]
    Static,
    /// Nothing moves.
    #[error(
        "no free coordinate of the scene feels a force that changes with position: there is nothing to measure"
    )]
    NothingMoves,
    /// The highest frequency could not be estimated.
    #[error("the highest frequency of the scene is not known: {0}")]
    Frequency(vi_solvers::SolverError),
    /// No two solutions with a known accuracy could be computed.
    #[error("no reference within the budget: {why}; allow more with --budget")]
    Reference {
        /// Attempts made.
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

/// Returns the scene with the scheme and step that the bench recommends.
pub fn recommended_scene(report: &BenchReport, scene: &Scene) -> Option<Scene> {
    report.recommended.map(|row| {
        let mut found = report.rows[row].choice.apply(scene);
        found.output = scene.output.clone();
        found
    })
}
