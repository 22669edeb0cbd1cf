//! A whole run: steps a simulation to its end and writes what the scene asks for, from the start or
//! from a checkpoint. It must not know the command line; a caller watches through [`Watch`].

mod chart;
pub mod checkpoint;
pub mod claim;
mod directory;
pub mod estimate;
pub mod explain;
pub(crate) mod frames;
pub mod guard;
mod history;
pub mod momentum;
pub mod pitch;
pub mod provenance;
pub mod report;
pub mod results;
mod safety;
mod stepping;
mod surfaces;

use std::io;
use std::path::{Path, PathBuf};
use std::time::Instant;

use vi_solvers::StepError;

use crate::auto::trial::TrialWatch;
use crate::auto::{self, AutoReport, SettleError};
use crate::run::checkpoint::{Checkpoint, CheckpointError};
use crate::run::claim::ClaimError;
use crate::run::report::Report;
use crate::scene::{Problem, Scene};
use crate::simulation::Simulation;
pub(crate) use directory::inputs_among;
pub(crate) use stepping::Course;
use stepping::Run;

/// Why a run ended before its end.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum RunError {
    /// The scene or its meshes are wrong.
    #[error("{}", list(.0))]
    Scene(Vec<Problem>),
    /// A step failed; what was reached is written.
    #[error("step {step}: {source}")]
    Step {
        /// The step that failed, from 1.
        step: u64,
        /// Why.
        source: StepError,
    },
    /// The energy guard ended the run; what was reached is written.
    #[error(
        "step {step}: the energy guard ends the run at t = {t} s: {joules:.3e} J were gained that nothing put in, \
         {relative:.2e} of the energy given, {bound:e} allowed{after}"
    )]
    Guard {
        /// The last step made.
        step: u64,
        /// Its time, s.
        t: f64,
        /// Growth, J.
        joules: f64,
        /// Growth relative to the exchange.
        relative: f64,
        /// What is allowed.
        bound: f64,
        /// What was tried, in words; may be empty.
        after: &'static str,
    },
    /// The state has left the range of what frames can hold: it has blown up. What was reached is written.
    #[error("step {step}: the state is beyond all bounds: {source}")]
    Beyond {
        /// The last step made.
        step: u64,
        /// The value.
        source: vi_io::IoError,
    },
    /// A file could not be written.
    #[error("{}: {source}", .path.display())]
    Output {
        /// The file or directory.
        path: PathBuf,
        /// What the operating system says.
        source: io::Error,
    },
    /// Another process writes into the directory, or it cannot be written into.
    #[error(transparent)]
    Claim(#[from] ClaimError),
    /// The directory holds a run of another scene that can be continued.
    #[error(
        "{}: the run of '{name}' in this directory has not ended: continue it with `variational resume {}`, or delete \
         its checkpoints, or choose another directory with --out",
        .directory.display(), .directory.display()
    )]
    Unfinished {
        /// The directory.
        directory: PathBuf,
        /// The other scene.
        name: String,
    },
    /// A mesh file could not be written.
    #[error(transparent)]
    Frame(#[from] vi_io::IoError),
    /// The caller ended the trials of scheme `auto`; nothing was written.
    #[error("stopped during the trials of scheme \"auto\"; nothing was written")]
    Stopped,
    /// There is nothing to continue from, or it does not fit.
    #[error(transparent)]
    Checkpoint(#[from] CheckpointError),
}

impl RunError {
    /// Is it the motion that failed, rather than its files?
    pub fn is_failure(&self) -> bool {
        matches!(self, Self::Step { .. } | Self::Guard { .. } | Self::Beyond { .. })
    }

    /// An error of writing `path`.
    fn output(path: &Path) -> impl FnOnce(io::Error) -> Self {
        let path = path.to_owned();
        move |source| Self::Output { path, source }
    }
}

impl From<SettleError> for RunError {
    fn from(error: SettleError) -> Self {
        match error {
            SettleError::Scene(problems) => Self::Scene(problems),
            SettleError::Stopped => Self::Stopped,
        }
    }
}

fn list(problems: &[Problem]) -> String {
    problems.iter().map(ToString::to_string).collect::<Vec<_>>().join("\n")
}

/// Follows a run. All methods are optional.
pub trait Watch {
    /// A trial of scheme `auto` is about to run.
    fn trial(&mut self, _what: &str) {}
    /// Asked every few steps of a trial: return false to end the run before it begins.
    fn go_on(&mut self) -> bool {
        true
    }
    /// Scheme `auto` has been settled.
    fn settled(&mut self, _auto: &AutoReport) {}
    /// The systems are built; what is to be said before the first step.
    fn start(&mut self, _simulation: &Simulation, _notes: &[String]) {}
    /// Something that a reader should hear was found on the way, e.g. a limit point.
    fn finding(&mut self, _finding: &str) {}
    /// A step was made, or some 16 with nothing due between them. Return false to end the run there, with
    /// everything written.
    fn step(&mut self, _simulation: &Simulation) -> bool {
        true
    }
    /// The last step was made, or one failed: the state that is left.
    fn end(&mut self, _simulation: &Simulation) {}
}

/// Watches nothing.
impl Watch for () {}

/// A watch of a run that follows the trials before it.
struct Trials<'a>(&'a mut dyn Watch);

impl TrialWatch for Trials<'_> {
    fn next(&mut self, what: &str) {
        self.0.trial(what);
    }

    fn go_on(&mut self) -> bool {
        self.0.go_on()
    }
}

/// Runs a scene and writes history.csv, frames, checkpoints and report.json into `directory`.
///
/// The directory is made only once the whole scene has been accepted; what an earlier run of the scene wrote
/// there is replaced, nothing else is touched. The history and the report of another scene are kept under its name.
/// Until the run has ended, nobody else can run into the directory.
///
/// # Errors
/// [`RunError`]; what was reached before the error is written, but for errors of output itself.
pub fn run(scene: Scene, name: &str, directory: &Path, watch: &mut dyn Watch) -> Result<Report, RunError> {
    run_from(None, scene, name, directory, watch)
}

/// [`run`] of a scene that was read from `file`: its path and the keys that were set in it, by which
/// [`resume`] finds it again.
///
/// # Errors
/// As [`run`].
pub fn run_from(
    file: Option<(&Path, &[String])>,
    scene: Scene,
    name: &str,
    directory: &Path,
    watch: &mut dyn Watch,
) -> Result<Report, RunError> {
    let begin = Instant::now();
    if Path::new(name).file_name() != Some(name.as_ref()) || name.contains(char::is_control) {
        let message = format!("{name:?} cannot be part of the names of files; give the scene another name");
        return Err(RunError::Scene(vec![Problem::new("", message)]));
    }
    let origin = scene.checkpoint.as_ref().map(|_| checkpoint::Origin::new(&scene, name));
    let (scene, auto) = auto::settle(scene, &mut Trials(watch))?;
    if let Some(auto) = &auto {
        watch.settled(auto);
    }
    let simulation = Simulation::new(scene).map_err(RunError::Scene)?;
    // A mesh that cannot be read is a problem of the scene, and has been reported as one.
    let mut origin = origin.transpose()?;
    if let (Some(origin), Some((path, overrides))) = (&mut origin, file) {
        let path = std::path::absolute(path).unwrap_or_else(|_| path.to_owned());
        origin.file = Some((path, overrides.to_vec()));
    }
    Run::start(simulation, auto, name, directory, origin, begin)?.complete(watch)
}

/// Continues the run of `scene` in `directory` from a checkpoint of it, to the same bits as if it had
/// never been interrupted.
///
/// # Errors
/// [`RunError::Checkpoint`] where scene or meshes have changed; else as [`run`].
pub fn resume(
    scene: Scene,
    checkpoint: &Checkpoint,
    directory: &Path,
    watch: &mut dyn Watch,
) -> Result<Report, RunError> {
    let begin = Instant::now();
    checkpoint.origin.check(&scene)?;
    let scene = checkpoint.origin.settle(scene)?;
    let simulation = Simulation::new(scene).map_err(RunError::Scene)?;
    Run::resume(simulation, checkpoint, directory, begin)?.complete(watch)
}
