//! Options of a sweep, and a trait to follow it.

use std::path::PathBuf;

use vi_solvers::Interrupt;

use super::axis::Axis;

/// Options of a sweep.
#[derive(Debug, Clone, PartialEq)]
pub struct SweepOptions {
    /// The scene file.
    pub scene: PathBuf,
    /// Keys that are set in every point, in the form of `run --set`.
    pub overrides: Vec<String>,
    /// The keys that vary; the last one varies fastest.
    pub axes: Vec<Axis>,
    /// Directory of the tables and of the points.
    pub directory: PathBuf,
    /// Number of points that run at the same time.
    pub jobs: usize,
    /// Number of threads of each point.
    pub threads: usize,
    /// Runs only the points whose number has the remainder `.0` when divided by `.1`.
    pub task: (usize, usize),
}

/// Follows a sweep, from several threads.
pub trait SweepWatch: Sync {
    /// Called when a point has ended: with its number, its exit code, the reason if it failed, and the number of
    /// points left.
    fn done(&self, _point: usize, _exit: u8, _reason: &str, _left: usize) {}
    /// Called after every step: false ends the sweep, after all output is written.
    fn go_on(&self) -> bool {
        true
    }
    /// Returns the request that abandons the steps in progress. It should stand when [`SweepWatch::go_on`] returns false.
    fn interrupt(&self) -> Interrupt {
        Interrupt::NEVER
    }
}

impl SweepWatch for () {}
