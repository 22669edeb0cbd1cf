//! Runs a simulation to its end and writes the files that the scene requests, from the start or from a checkpoint.

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
mod team;
mod watch;

use std::path::Path;
use std::time::Instant;

use crate::auto;
use crate::auto::trial::TrialWatch;
use crate::run::checkpoint::Checkpoint;
use crate::run::report::Report;
use crate::scene::{Problem, Scene};
pub(crate) use directory::inputs_among;
pub use error::RunError;
pub use probe_estimate::ProbeEstimate;
use state::Run;
pub use team::Team;
pub use watch::Watch;

/// Forwards the progress of the trials before a run to the run's watch.
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
/// The directory is created only after the whole scene has been accepted. Files that an earlier run of the scene wrote
/// there are replaced, and nothing else is changed. The history and the report of another scene are kept under its
/// name. Until the run has ended, no other process of the program can write into the directory.
///
/// The interrupt of the scene ([`Scene::interruptible`]) abandons the step in progress and ends the run as
/// [`Watch::step`] does, at the last complete step.
///
/// # Errors
/// Returns [`RunError`]. The results up to the error are written, unless writing itself failed.
pub fn run(scene: Scene, name: &str, directory: &Path, watch: &mut dyn Watch) -> Result<Report, RunError> {
    run_from(None, scene, name, directory, watch)
}

/// Runs a scene as [`run`] does. `file` is the path of the scene file with the keys that were set in it; [`resume`]
/// finds the scene again by them.
///
/// # Errors
/// Returns the errors of [`run`].
pub fn run_from(
    file: Option<(&Path, &[String])>,
    scene: Scene,
    name: &str,
    directory: &Path,
    watch: &mut dyn Watch,
) -> Result<Report, RunError> {
    run_by(&Team::default(), file, scene, name, directory, watch)
}

/// Runs a scene as [`run_from`] does, by all ranks of a team; this is the first one, which writes all files. The results
/// have the same bits for any number of ranks.
///
/// # Errors
/// Returns the errors of [`run`], and [`RunError::Scene`] for what does not run on several ranks.
pub fn run_by(
    team: &Team,
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
    let (simulation, note) = team.build(scene, name)?;
    // If a mesh cannot be read, the problems of the scene already report it.
    let mut origin = origin.transpose()?;
    if let (Some(origin), Some((path, overrides))) = (&mut origin, file) {
        let path = std::path::absolute(path).unwrap_or_else(|_| path.to_owned());
        origin.file = Some((path, overrides.to_vec()));
    }
    Run::start(simulation, auto, name, directory, origin, begin)?.complete(note, watch)
}

/// Continues the run of `scene` in `directory` from one of its checkpoints, to the same bits as an uninterrupted run.
///
/// # Errors
/// Returns [`RunError::Checkpoint`] if the scene or meshes have changed; otherwise the errors of [`run`].
pub fn resume(
    scene: Scene,
    checkpoint: &Checkpoint,
    directory: &Path,
    watch: &mut dyn Watch,
) -> Result<Report, RunError> {
    resume_by(&Team::default(), scene, checkpoint, directory, watch)
}

/// Continues a run as [`resume`] does, by all ranks of a team. The checkpoint may be of any number of ranks.
///
/// # Errors
/// Returns the errors of [`resume`], and [`RunError::Scene`] for what does not run on several ranks.
pub fn resume_by(
    team: &Team,
    scene: Scene,
    checkpoint: &Checkpoint,
    directory: &Path,
    watch: &mut dyn Watch,
) -> Result<Report, RunError> {
    let begin = Instant::now();
    checkpoint.origin.check(&scene)?;
    let scene = checkpoint.origin.settle(scene)?;
    let (simulation, note) = team.build(scene, &checkpoint.origin.name)?;
    Run::resume(simulation, checkpoint, directory, begin)?.complete(note, watch)
}
