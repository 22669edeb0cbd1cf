//! One point of a sweep: a run in its own directory, with `point.json`, which records its end and identifies its
//! scene. Points do not depend on each other.

use std::collections::HashMap;
use std::io;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use super::error::SweepError;
use super::options::SweepWatch;
use crate::run::checkpoint::{newest, scene_text};
use crate::run::report::{Outcome, Report};
use crate::run::{RunError, Watch, resume, run_from};
use crate::scene::{Problem, Scene};
use crate::simulation::Simulation;

/// A point of a sweep.
pub(super) struct Point {
    /// Number of the point, from 0.
    pub(super) number: usize,
    /// Values of the axes.
    pub(super) values: Vec<String>,
    /// All keys that are set in the scene, with values.
    pub(super) overrides: Vec<String>,
    /// The scene file.
    pub(super) file: PathBuf,
    /// The scene, or the problems found in it.
    pub(super) scene: Result<Scene, Vec<Problem>>,
    /// Directory of the run.
    pub(super) directory: PathBuf,
}

/// Identity of a run: sufficient to decide whether a new run would be equal.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
struct Identity {
    /// Version of the program.
    version: String,
    /// The scene, from [`scene_text`].
    scene: String,
    /// The files that the scene reads, with the CRC-32 of their bytes.
    files: Vec<(PathBuf, u32)>,
}

/// End of a point.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct End {
    /// The exit code that `variational run` would have.
    pub(super) exit: u8,
    /// Reason for an error; empty if the run ended without one.
    pub(super) reason: String,
}

#[derive(Serialize, Deserialize)]
struct Record {
    /// Provenance from report.json; null if the run wrote none.
    #[serde(default)]
    provenance: serde_json::Value,
    end: End,
    identity: Identity,
}

/// Checksums of the files that the points read, each computed once.
pub(super) struct Identities {
    sums: HashMap<PathBuf, u32>,
}

impl Identities {
    pub(super) fn of(points: &[Point]) -> Result<Self, SweepError> {
        let mut sums = HashMap::new();
        let scenes = points.iter().filter_map(|point| point.scene.as_ref().ok());
        for (_, path) in scenes.flat_map(Scene::files) {
            // An unreadable file is reported as a problem of its scene.
            if !sums.contains_key(path)
                && let Ok(bytes) = std::fs::read(path)
            {
                sums.insert(path.to_owned(), crc32fast::hash(&bytes));
            }
        }
        Ok(Self { sums })
    }

    fn identity(&self, scene: &Scene) -> Identity {
        let sum = |(_, path): (String, &Path)| {
            let sum = self.sums.get(path).copied().unwrap_or(0);
            (path.to_owned(), sum)
        };
        Identity {
            version: env!("CARGO_PKG_VERSION").to_owned(),
            scene: scene_text(scene),
            files: scene.files().into_iter().map(sum).collect(),
        }
    }
}

/// Ends the run when the sweep ends.
struct Stop<'a>(&'a dyn SweepWatch);

impl Watch for Stop<'_> {
    fn step(&mut self, _simulation: &Simulation) -> bool {
        self.0.go_on()
    }
}

impl Point {
    /// Returns the end of the point, if it has ended in this call of the program or an earlier one.
    pub(super) fn end(&self, identities: &Identities) -> Option<End> {
        let scene = match &self.scene {
            Ok(scene) => scene,
            Err(problems) => return Some(refusal(problems)),
        };
        let text = std::fs::read_to_string(self.record()).ok()?;
        let record: Record = serde_json::from_str(&text).ok()?;
        (record.identity == identities.identity(scene)).then_some(record.end)
    }

    /// Runs the point from its newest checkpoint, if any, unless it is done. Returns `None` if the sweep was
    /// interrupted.
    ///
    /// # Errors
    /// Returns an error if its output cannot be written.
    pub(super) fn bring_to_end(
        &self,
        identities: &Identities,
        watch: &dyn SweepWatch,
    ) -> Result<Option<End>, SweepError> {
        if let Some(end) = self.end(identities) {
            return Ok(Some(end));
        }
        let Ok(scene) = &self.scene else { return Ok(None) };
        let record = self.record();
        match std::fs::remove_file(&record) {
            Err(error) if error.kind() != io::ErrorKind::NotFound => {
                return Err(SweepError::files(&record)(error));
            }
            _ => {}
        }
        let end = match self.run(scene, watch) {
            Ok(report) if report.outcome == Some(Outcome::Interrupted) => return Ok(None),
            Ok(report) if report.broken.is_empty() => End { exit: 0, reason: String::new() },
            Ok(report) => End { exit: 3, reason: report.broken.join("; ") },
            Err(RunError::Scene(problems)) => refusal(&problems),
            Err(error) if error.is_failure() => End { exit: 4, reason: error.to_string() },
            Err(source) => return Err(SweepError::Output { point: self.number, source }),
        };
        std::fs::create_dir_all(&self.directory).map_err(SweepError::files(&self.directory))?;
        let record_of_end =
            Record { provenance: self.provenance(), end: end.clone(), identity: identities.identity(scene) };
        write_whole(&record, &serde_json::json!(record_of_end).to_string())
            .map_err(SweepError::files(&record))?;
        Ok(Some(end))
    }

    fn run(&self, scene: &Scene, watch: &dyn SweepWatch) -> Result<Report, RunError> {
        let mut stop = Stop(watch);
        let scene = &scene.clone().interruptible(watch.interrupt());
        if scene.checkpoint.is_some()
            && let Ok(found) = newest(&self.directory)
            && found.checkpoint.origin.check(scene).is_ok()
        {
            match resume(scene.clone(), &found.checkpoint, &self.directory, &mut stop) {
                // A run that cannot be continued starts again.
                Err(RunError::Checkpoint(_)) => {}
                other => return other,
            }
        }
        let name = self.file.file_stem().map_or_else(|| "scene".into(), |stem| stem.to_string_lossy());
        let source = (self.file.as_path(), self.overrides.as_slice());
        run_from(Some(source), scene.clone(), &name, &self.directory, &mut stop)
    }

    /// Returns the provenance from the report of the run.
    fn provenance(&self) -> serde_json::Value {
        let report = std::fs::read(self.directory.join("report.json")).ok();
        let report = report.and_then(|bytes| serde_json::from_slice::<serde_json::Value>(&bytes).ok());
        report.and_then(|report| report.get("provenance").cloned()).unwrap_or_default()
    }

    fn record(&self) -> PathBuf {
        self.directory.join("point.json")
    }
}

/// Returns the end of a point with an invalid scene. The table must not depend on the location or lines of the file.
fn refusal(problems: &[Problem]) -> End {
    let plain = |problem: &Problem| Problem::new(&problem.key, &problem.message).to_string();
    End { exit: 2, reason: problems.iter().map(plain).collect::<Vec<_>>().join("; ") }
}

/// Writes a file completely or not at all, even if the process is interrupted.
pub(super) fn write_whole(path: &Path, text: &str) -> io::Result<()> {
    let temporary = path.with_extension(format!("tmp-{}", std::process::id()));
    let written = std::fs::write(&temporary, text).and_then(|()| std::fs::rename(&temporary, path));
    if written.is_err() {
        // The first error is reported; the temporary file may not exist.
        let _ = std::fs::remove_file(&temporary);
    }
    written
}
