//! The program measures itself on the user's own scene: schemes × steps against a self-converged reference, by run
//! time and error at the end.
//!
//! Error is ‖u − u_ref‖_M / ‖u_ref‖_M at the end of the scene, u the displacement from rest. Time is that
//! of stepping alone, output off; combinations run in turn until their two least times agree, and the least counts:
//! processor time on one thread, run time on several. A combination that fails is a row, not an end.

mod chart;
mod reference;
mod sweep;
mod tables;

use std::time::Duration;

use serde::Serialize;

use crate::auto::SettleError;
use crate::auto::trial::{Choice, Trial, TrialWatch};
use crate::run::provenance::Provenance;
use crate::scene::{Problem, Scene};

pub use sweep::bench;

/// Options of a bench.
#[derive(Debug, Clone, PartialEq)]
pub struct BenchOptions {
    /// Name of the scene, for the report.
    pub name: String,
    /// Wall time for everything (default 60 s).
    pub budget: Duration,
    /// The relative error wanted at the end (default: `[time] tolerance`, else 1e-2).
    pub accuracy: Option<f64>,
    /// Schemes to sweep, e.g. `gauss 3`; empty: the variational ones and `energy-momentum`.
    pub schemes: Vec<String>,
}

impl Default for BenchOptions {
    fn default() -> Self {
        Self { name: String::new(), budget: Duration::from_secs(60), accuracy: None, schemes: Vec::new() }
    }
}

/// Follows a bench. All methods are optional.
pub trait BenchWatch {
    /// The run about to start, the share of the budget spent, and the time left.
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
    /// Seconds of stepping by the clock, the least of `repeats`.
    pub seconds: Option<f64>,
    /// Seconds of processors in stepping, of all threads, the least of `repeats`.
    pub processor_seconds: Option<f64>,
    /// Time of each repeat: by the clock, and of processors, s.
    #[serde(skip)]
    times: Vec<[f64; 2]>,
    /// Number of repeats.
    pub repeats: u32,
    /// Relative error at the end; `None` if the run failed.
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

impl Row {
    /// Enters what a run took.
    fn time(&mut self, trial: &Trial) {
        self.times.push([trial.seconds, trial.processor_seconds]);
        let least = |k: usize| self.times.iter().map(|times| times[k]).reduce(f64::min);
        (self.seconds, self.processor_seconds) = (least(0), least(1));
    }

    /// Do the two least times differ by this share at most, by the clock and of processors?
    fn times_agree(&self, share: f64) -> bool {
        (0..2).all(|k| {
            let mut times: Vec<f64> = self.times.iter().map(|times| times[k]).collect();
            times.sort_by(f64::total_cmp);
            matches!(times[..], [first, second, ..] if second - first <= share * second)
        })
    }

    /// Time by which it is ranked, s.
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
    /// Seconds of the processor: on one thread, where it does not matter what else the machine does.
    ProcessorTime,
    /// Seconds by the clock: on several threads, for they are there to save it.
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

/// A machine on which runs wait longer than this share of their time for a processor is busy.
const BUSY: f64 = 0.05;

/// The outcome of a bench.
#[derive(Debug, Clone, Serialize)]
pub struct BenchReport {
    /// Origin of the result.
    pub provenance: Provenance,
    /// Time by which combinations are ranked.
    pub ranked_by: Measure,
    /// Share of their time for which runs waited for a processor that something else had; `None` if the system does
    /// not tell.
    pub waited_share: Option<f64>,
    /// The relative error wanted.
    pub accuracy: f64,
    /// The reference.
    pub reference: ReferenceFacts,
    /// All combinations.
    pub rows: Vec<Row>,
    /// Recommendation, in a sentence.
    pub recommendation: String,
    /// The row that is recommended.
    pub recommended: Option<usize>,
    /// Was the bench ended from outside? The rows are then those that were measured before.
    pub interrupted: bool,
    /// Wall seconds of the whole bench.
    pub seconds: f64,
}

impl BenchReport {
    /// Time by which a row is ranked, s.
    pub(crate) fn cost(&self, row: &Row) -> Option<f64> {
        row.cost(self.ranked_by)
    }

    /// A warning where the machine had other things to do.
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

/// Why there is no bench at all.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum BenchError {
    /// The scene is wrong.
    #[error("the scene is wrong")]
    Scene(Vec<Problem>),
    /// The caller asked to stop before anything could be compared.
    #[error("interrupted before anything could be compared; nothing was written")]
    Stopped,
    /// A scheme is unknown.
    #[error("unknown scheme '{name}'; there are {known}")]
    Scheme {
        /// Name asked for.
        name: String,
        /// Names that exist.
        known: String,
    },
    /// Nothing moves.
    #[error(
        "no free coordinate of the scene feels a force that changes with position: there is nothing to measure"
    )]
    NothingMoves,
    /// The highest frequency could not be estimated.
    #[error("the highest frequency of the scene is not known: {0}")]
    Frequency(vi_solvers::SolverError),
    /// No two solutions could be made that show how exact they are.
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

/// The scene that a bench recommends: its own, with the recommended scheme and step.
pub fn recommended_scene(report: &BenchReport, scene: &Scene) -> Option<Scene> {
    report.recommended.map(|row| {
        let mut found = report.rows[row].choice.apply(scene);
        found.output = scene.output.clone();
        found
    })
}
