//! A whole run: steps a simulation to its end and writes what the scene asks for, from the start or from a
//! checkpoint.

mod chart;
pub mod checkpoint;
pub mod claim;
mod directory;
mod error;
pub mod estimate;
pub mod explain;
mod extremes;
pub(crate) mod frames;
pub mod guard;
mod history;
mod ledger;
pub mod momentum;
mod observer;
mod observers;
pub mod pitch;
mod probe_estimate;
pub mod provenance;
pub mod report;
pub mod results;
mod safety;
mod state;
mod stepping;
mod surfaces;
mod watch;

use std::path::Path;
use std::time::Instant;

use crate::auto;
use crate::auto::trial::TrialWatch;
use crate::run::checkpoint::Checkpoint;
use crate::run::report::Report;
use crate::scene::{Problem, Scene};
use crate::simulation::Simulation;
pub(crate) use directory::inputs_among;
pub use error::RunError;
pub use probe_estimate::ProbeEstimate;
use state::Run;
pub use watch::Watch;

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
