//! `variational sweep`: a scene at every combination of some values. Each point is a run in its own directory,
//! several run at the same time, and one table collects the results. This file does not depend on the command line.
//!
//! A sweep can end at any time and be called again. Points that are done are not run again, points with a checkpoint
//! continue from it, and the final table has the same bytes.

mod axis;
mod error;
mod options;
mod point;
mod table;

use std::sync::atomic::{AtomicUsize, Ordering};

use serde::Serialize;

use crate::scene::Scene;

use axis::MOST_POINTS;
pub use axis::{Axis, AxisError};
pub use error::SweepError;
pub use options::{SweepOptions, SweepWatch};
use point::{Identities, Point};

/// Outcome of a sweep.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct SweepReport {
    /// Points of the whole sweep.
    pub points: usize,
    /// Points that have ended, in this call or before, in this task or another.
    pub done: usize,
    /// Ended points with an error.
    pub failed: usize,
    /// Whether the sweep was ended from outside before all points of the task were done.
    pub interrupted: bool,
}

/// Runs the points of a task that are not done yet, and writes `sweep.csv` and `sweep-times.csv` for all points.
///
/// # Errors
/// Returns [`SweepError`]; results so far are written, and a second call continues from there. A point that fails is a
/// row of the table, not an error.
pub fn sweep(options: &SweepOptions, watch: &dyn SweepWatch) -> Result<SweepReport, SweepError> {
    let points = points(options)?;
    std::fs::create_dir_all(&options.directory).map_err(SweepError::files(&options.directory))?;
    let identities = Identities::of(&points)?;
    let (index, count) = options.task;
    let mine: Vec<&Point> = points.iter().filter(|point| point.number % count == index).collect();
    let next = AtomicUsize::new(0);
    let work = || -> Result<(), SweepError> {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(options.threads).build()?;
        while watch.go_on() {
            let turn = next.fetch_add(1, Ordering::Relaxed);
            let Some(point) = mine.get(turn) else { break };
            if let Some(end) = pool.install(|| point.bring_to_end(&identities, watch))? {
                watch.done(point.number, end.exit, &end.reason, mine.len() - turn - 1);
            }
        }
        Ok(())
    };
    let results: Vec<Result<(), SweepError>> = std::thread::scope(|scope| {
        let workers: Vec<_> = (0..options.jobs.min(mine.len())).map(|_| scope.spawn(work)).collect();
        workers
            .into_iter()
            .map(|worker| worker.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic)))
            .collect()
    });
    let (done, failed) = table::write(options, &points, &identities)?;
    results.into_iter().collect::<Result<(), _>>()?;
    let is_open = |point: &&&Point| point.end(&identities).is_none();
    let interrupted = mine.iter().filter(is_open).count() > 0;
    Ok(SweepReport { points: points.len(), done, failed, interrupted })
}

/// Returns all points; the last axis varies fastest.
fn points(options: &SweepOptions) -> Result<Vec<Point>, SweepError> {
    refuse_overridden(options)?;
    let count = options.axes.iter().try_fold(1_usize, |count, axis| count.checked_mul(axis.values.len()));
    let count = count.filter(|&count| count <= MOST_POINTS).ok_or(SweepError::TooMany)?;
    let mut points = Vec::with_capacity(count);
    for number in 0..count {
        let mut rest = number;
        let mut values: Vec<String> = Vec::new();
        for axis in options.axes.iter().rev() {
            values.push(axis.values[rest % axis.values.len()].clone());
            rest /= axis.values.len();
        }
        values.reverse();
        let set = options.axes.iter().zip(&values).map(|(axis, value)| format!("{}={value}", axis.key));
        let overrides: Vec<String> = options.overrides.iter().cloned().chain(set).collect();
        let parsed = Scene::read(&options.scene, &overrides).map_err(SweepError::files(&options.scene))?;
        let scene = match parsed.scene {
            Some(scene) if parsed.problems.is_empty() => Ok(scene),
            _ => Err(parsed.problems),
        };
        let directory = options.directory.join(format!("point-{number:04}"));
        points.push(Point { number, values, overrides, file: options.scene.clone(), scene, directory });
    }
    let refused = points.iter().all(|point| point.scene.is_err());
    match points.first().map(|first| &first.scene) {
        Some(Err(problems)) if refused => Err(SweepError::Scene(problems.clone())),
        _ => Ok(points),
    }
}

/// Refuses keys that a later axis sets again, itself or with the table that holds it.
fn refuse_overridden(options: &SweepOptions) -> Result<(), SweepError> {
    let key_of = |set: &String| set.split_once('=').map_or(set.as_str(), |(key, _)| key).trim().to_owned();
    let keys = options.overrides.iter().map(key_of).chain(options.axes.iter().map(|axis| axis.key.clone()));
    // `body[0].name` is the same as `body.0.name`.
    let keys: Vec<String> = keys.map(|key| key.replace('[', ".").replace(']', "")).collect();
    for (number, later) in keys.iter().enumerate().skip(options.overrides.len()) {
        let is_within = |key: &&String| {
            key.strip_prefix(later.as_str()).is_some_and(|rest| rest.is_empty() || rest.starts_with('.'))
        };
        if let Some(key) = keys[..number].iter().find(is_within) {
            return Err(SweepError::Overridden { key: key.clone(), later: later.clone() });
        }
    }
    Ok(())
}
