//! `variational stress`: violent scenes from a seed, run and judged, to test the robustness of the engine. A run must
//! end in one of two ways: completed with its invariants within their bounds, or with a named error and an intact
//! state.

mod entries;
mod equilibria;
mod judge;
mod kinds;
mod meetings;
mod random;
mod transform;
mod violence;

use std::collections::BTreeMap;
use std::fmt::Write;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::mpsc::{self, RecvTimeoutError};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use serde_json::{Value, json};

pub use equilibria::resting;
use judge::Clock;
pub use judge::Outcome;
pub use kinds::Violence;
pub use meetings::meeting;
pub use transform::Transform;
pub use violence::{Case, CaseError, case};

use crate::run::provenance::Provenance;
use crate::scene::Scene;

/// Interval at which a running scene is checked for an interruption.
const LOOK: Duration = Duration::from_millis(50);

/// What happens in the scenes of a stress test.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Scenes {
    /// Each acts violently on one body.
    OneBody,
    /// Bodies meet in motion.
    Contact,
    /// Bodies meet and come to rest.
    Equilibria,
}

/// Options of a stress test.
#[derive(Debug, Clone)]
pub struct StressOptions {
    /// Number of the first scene.
    pub first: u64,
    /// Number of scenes.
    pub count: u64,
    /// Seed of the scenes.
    pub seed: u64,
    /// What happens in the scenes.
    pub scenes: Scenes,
    /// Number of scenes that run at the same time.
    pub jobs: usize,
    /// Time limit of a scene, after which it ends with its current step, or within it if that is a search for an equilibrium. At ten times
    /// this limit it counts as hung.
    pub limit: Duration,
    /// Directory for the scenes with forbidden outcomes.
    pub keep: PathBuf,
}

impl StressOptions {
    /// Returns the number after that of the last scene.
    fn end(&self) -> u64 {
        self.first.saturating_add(self.count)
    }
}

/// Follows a stress test, from several threads.
pub trait StressWatch: Sync {
    /// Called when a scene has ended.
    fn ended(&self, _case: &Case, _outcome: &Outcome) {}
    /// Called many times per second: false ends the test. A running scene then abandons its current step and is not
    /// counted, unless its outcome is forbidden.
    fn go_on(&self) -> bool {
        true
    }
}

impl StressWatch for () {}

/// Counts of outcomes.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Tally {
    /// Scenes run.
    pub tried: u64,
    /// Completed without cut steps or actions of the guard.
    pub done: u64,
    /// Completed with cut steps.
    pub cut: u64,
    /// Completed with a warning or an action of the energy guard.
    pub guarded: u64,
    /// Ended with a named error.
    pub failed: u64,
    /// Ended by the time limit.
    pub out_of_time: u64,
    /// Refused before the run.
    pub refused: u64,
    /// Forbidden outcomes.
    pub forbidden: u64,
}

impl Tally {
    fn enter(&mut self, outcome: &Outcome) {
        self.tried += 1;
        let count = match outcome {
            Outcome::Done { was_guarded: true, .. } => &mut self.guarded,
            Outcome::Done { was_cut: true, .. } => &mut self.cut,
            Outcome::Done { .. } => &mut self.done,
            Outcome::Failed(_) => &mut self.failed,
            Outcome::OutOfTime => &mut self.out_of_time,
            Outcome::Refused(_) => &mut self.refused,
            Outcome::Forbidden(_) => &mut self.forbidden,
        };
        *count += 1;
    }

    fn cells(&self) -> [u64; 8] {
        [
            self.tried,
            self.done,
            self.cut,
            self.guarded,
            self.failed,
            self.out_of_time,
            self.refused,
            self.forbidden,
        ]
    }
}

/// Outcome of all scenes.
#[derive(Debug, Clone, Default)]
pub struct StressReport {
    /// Counts by kind of violence.
    pub tallies: BTreeMap<Violence, Tally>,
    /// Number and reason of each forbidden outcome.
    pub forbidden: Vec<(u64, String)>,
    /// Number and reason of each scene that was refused.
    pub refused: Vec<(u64, String)>,
    /// Whether the test was ended from outside before all scenes were run.
    pub interrupted: bool,
}

impl StressReport {
    /// Returns the sum of all counts.
    pub fn total(&self) -> Tally {
        let mut sums = [0; 8];
        for tally in self.tallies.values() {
            sums.iter_mut().zip(tally.cells()).for_each(|(sum, cell)| *sum += cell);
        }
        let [tried, done, cut, guarded, failed, out_of_time, refused, forbidden] = sums;
        Tally { tried, done, cut, guarded, failed, out_of_time, refused, forbidden }
    }

    /// Returns a Markdown table.
    pub fn markdown(&self, options: &StressOptions) -> String {
        let total = self.total();
        let scenes = match self.interrupted {
            true => format!("interrupted after {} of {}", total.tried, options.count),
            false => options.count.to_string(),
        };
        let mut text = format!(
            "Version {}, {scenes} scenes of seed {}, from number {}.\n\n| what was done | scenes | done | with cut steps | warned or guarded \
             | failed, named | out of time | refused | forbidden |\n|---|--:|--:|--:|--:|--:|--:|--:|--:|\n",
            env!("CARGO_PKG_VERSION"),
            options.seed,
            options.first
        );
        let rows = self.tallies.iter().map(|(violence, tally)| (violence.words(), tally));
        for (words, tally) in rows.chain([("**all**", &total)]) {
            let cells: Vec<String> = tally.cells().iter().map(u64::to_string).collect();
            // Writing into a string cannot fail.
            let _ = writeln!(text, "| {words} | {} |", cells.join(" | "));
        }
        text
    }

    /// Returns the outcome as JSON.
    pub fn json(&self, options: &StressOptions) -> Value {
        let names = ["scenes", "done", "cut", "guarded", "failed", "out_of_time", "refused", "forbidden"];
        let object = |tally: &Tally| -> Value {
            names.iter().zip(tally.cells()).map(|(name, count)| ((*name).to_owned(), json!(count))).collect()
        };
        let kinds: serde_json::Map<String, Value> =
            self.tallies.iter().map(|(kind, tally)| (format!("{kind:?}"), object(tally))).collect();
        json!({ "provenance": Provenance::new("stress", 0), "seed": options.seed, "first": options.first, "interrupted": self.interrupted,
                "total": object(&self.total()), "kinds": kinds, "forbidden": self.forbidden,
                "refused": self.refused })
    }
}

/// Runs all scenes, or until `watch` ends the test.
pub fn stress(options: &StressOptions, watch: &dyn StressWatch) -> StressReport {
    let report = Mutex::new(StressReport::default());
    let next = AtomicU64::new(options.first);
    let is_broken = AtomicBool::new(false);
    std::thread::scope(|scope| {
        for _ in 0..options.jobs.max(1) {
            scope.spawn(|| {
                while !is_broken.load(Ordering::Relaxed) && watch.go_on() {
                    let index = next.fetch_add(1, Ordering::Relaxed);
                    if index >= options.end() {
                        break;
                    }
                    let (case, outcome) = match trial(options, index, watch) {
                        Ok(trial) => trial,
                        Err(why) => {
                            is_broken.store(true, Ordering::Relaxed);
                            if let Ok(mut report) = report.lock() {
                                report.forbidden.push((index, format!("the scene cannot be made: {why}")));
                            }
                            break;
                        }
                    };
                    if outcome == Outcome::OutOfTime && !watch.go_on() {
                        break;
                    }
                    watch.ended(&case, &outcome);
                    let Ok(mut report) = report.lock() else { break };
                    report.tallies.entry(case.violence).or_default().enter(&outcome);
                    match outcome {
                        Outcome::Forbidden(why) => report.forbidden.push((index, why)),
                        Outcome::Refused(why) => report.refused.push((index, why)),
                        _ => {}
                    }
                }
            });
        }
    });
    let mut report = report.into_inner().unwrap_or_default();
    report.forbidden.sort();
    report.refused.sort();
    report.interrupted = !watch.go_on() && report.total().tried < options.count;
    report
}

/// Returns case `index` of the kind that the options request.
fn of_kind(options: &StressOptions, index: u64, directory: &Path) -> Result<Case, CaseError> {
    match options.scenes {
        Scenes::OneBody => case(options.seed, index, directory),
        Scenes::Contact => meeting(options.seed, index),
        Scenes::Equilibria => resting(options.seed, index),
    }
}

/// Runs one scene in its own directory; returns an error if the directory cannot be written or the scene cannot be
/// built.
fn trial(options: &StressOptions, index: u64, watch: &dyn StressWatch) -> Result<(Case, Outcome), String> {
    let directory = tempfile::tempdir().map_err(|error| error.to_string())?;
    let case = of_kind(options, index, directory.path()).map_err(|error| error.to_string())?;
    let outcome = timed(&case, &directory.path().join("out"), options.limit, watch);
    if let Outcome::Forbidden(why) = &outcome {
        let smaller = simplify(&case, directory.path(), options.limit, watch);
        // The number of a forbidden scene is reported even if the scene cannot be written.
        let _ = keep(&smaller, why, options);
    }
    Ok((case, outcome))
}

/// Judges a case in a separate thread, so that a hang is detected.
fn timed(case: &Case, out: &Path, limit: Duration, watch: &dyn StressWatch) -> Outcome {
    let (sender, receiver) = mpsc::channel();
    // A search for an equilibrium is one step, and its last increments take the longest.
    let is_static = case.scene.statics.is_some();
    let (case, out) = (case.clone(), out.to_owned());
    let is_ended = Arc::new(AtomicBool::new(false));
    let clock = Clock { limit, is_ended: Arc::clone(&is_ended) };
    std::thread::spawn(move || {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build();
        let outcome = match pool {
            Ok(pool) => pool.install(|| judge::judge(&case, &out, &clock)),
            Err(error) => Outcome::Forbidden(format!("no thread: {error}")),
        };
        // The receiver may have stopped waiting.
        let _ = sender.send(outcome);
    });
    let begin = Instant::now();
    while begin.elapsed() < 10 * limit {
        let is_late = is_static && begin.elapsed() > limit;
        is_ended.store(is_late || !watch.go_on(), Ordering::Relaxed);
        match receiver.recv_timeout(LOOK) {
            Ok(outcome) => return outcome,
            Err(RecvTimeoutError::Timeout) => {}
            Err(RecvTimeoutError::Disconnected) => break,
        }
    }
    Outcome::Forbidden(format!("hangs: more than {:?}", 10 * limit))
}

/// Removes everything from a scene that is not needed for its forbidden outcome.
fn simplify(case: &Case, directory: &Path, limit: Duration, watch: &dyn StressWatch) -> Case {
    let simpler: [fn(&mut Scene); 9] = [
        |scene| scene.wind = None,
        |scene| scene.damping = None,
        |scene| scene.guard = None,
        |scene| scene.checkpoint = None,
        |scene| scene.gravity = [0.0; 3],
        |scene| scene.strikes.clear(),
        |scene| scene.fixes.clear(),
        |scene| scene.output.interval = None,
        |scene| scene.bodies.iter_mut().for_each(|body| body.velocity = None),
    ];
    let mut best = case.clone();
    for (number, change) in simpler.iter().enumerate() {
        let mut trial = best.clone();
        change(&mut trial.scene);
        let out = directory.join(format!("simpler-{number}"));
        if trial.scene != best.scene && matches!(timed(&trial, &out, limit, watch), Outcome::Forbidden(_)) {
            best = trial;
        }
    }
    best
}

/// Writes the scene with a forbidden outcome, and its mesh, into `options.keep`.
fn keep(case: &Case, why: &str, options: &StressOptions) -> std::io::Result<()> {
    write(case, &format!("seed {}, scene {}: {why}", options.seed, case.index), &options.keep)
}

/// Writes the scenes of `options.seed`, with their meshes, into `directory` without running them.
///
/// # Errors
/// Returns an error if a file cannot be written.
pub fn write_scenes(options: &StressOptions, directory: &Path) -> std::io::Result<()> {
    for index in options.first..options.end() {
        let scratch = tempfile::tempdir()?;
        let case = of_kind(options, index, scratch.path()).map_err(std::io::Error::other)?;
        write(&case, &format!("seed {}, scene {index}: {}", options.seed, case.violence.words()), directory)?;
    }
    Ok(())
}

/// Writes a scene and its mesh into `directory`.
fn write(case: &Case, title: &str, directory: &Path) -> std::io::Result<()> {
    std::fs::create_dir_all(directory)?;
    let mut scene = case.scene.clone();
    for body in &mut scene.bodies {
        if let Some(mesh) = &mut body.mesh {
            let name = PathBuf::from(mesh.file_name().unwrap_or_default());
            std::fs::copy(&*mesh, directory.join(&name))?;
            *mesh = name;
        }
    }
    scene.title = title.replace('\n', " ");
    let text = scene.to_toml().map_err(std::io::Error::other)?;
    std::fs::write(directory.join(format!("scene-{}.toml", case.index)), text)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_scene_in_which_bodies_meet_is_sound() {
        for generate in [meeting, resting] {
            for index in 0..200 {
                let case = generate(3, index).unwrap();
                let problems = case.scene.problems();
                assert!(problems.is_empty(), "scene {index}, {:?}: {problems:?}", case.violence);
            }
        }
    }
}
