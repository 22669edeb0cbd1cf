//! What a sweep is asked for, and how it is followed.

use std::path::PathBuf;

use super::axis::Axis;

/// What a sweep is asked for.
#[derive(Debug, Clone, PartialEq)]
pub struct SweepOptions {
    /// The scene file.
    pub scene: PathBuf,
    /// Keys that are set in every point, as `run --set` takes them.
    pub overrides: Vec<String>,
    /// The keys that vary; the last one varies first.
    pub axes: Vec<Axis>,
    /// Directory of the tables and of the points.
    pub directory: PathBuf,
    /// Points that run at once.
    pub jobs: usize,
    /// Threads of each point.
    pub threads: usize,
    /// Run the points whose number leaves the remainder `.0` when it is divided by `.1` only.
    pub task: (usize, usize),
}

/// Follows a sweep, from several threads.
pub trait SweepWatch: Sync {
    /// A point has come to its end: its number, its exit code, why it failed, and how many of all are left.
    fn done(&self, _point: usize, _exit: u8, _reason: &str, _left: usize) {}
    /// Asked after every step: false ends the sweep, with everything written.
    fn go_on(&self) -> bool {
        true
    }
}

impl SweepWatch for () {}
