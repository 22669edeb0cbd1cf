//! The interface by which a caller follows a run.

use std::path::Path;

use crate::auto::AutoReport;
use crate::simulation::{Observation, Simulation};

/// Follows a run. All methods are optional.
pub trait Watch {
    /// Called before a trial of scheme `auto`.
    fn trial(&mut self, _what: &str) {}
    /// Called every few steps of a trial; return false to end the run before it begins.
    fn go_on(&mut self) -> bool {
        true
    }
    /// Called when scheme `auto` has been settled.
    fn settled(&mut self, _auto: &AutoReport) {}
    /// Called when the systems are built, with the notes to report before the first step.
    fn start(&mut self, _simulation: &Simulation, _notes: &[String]) {}
    /// Called when a step finds something that a reader should know, e.g. a limit point.
    fn finding(&mut self, _finding: &str) {}
    /// Called when a row of history.csv has been written.
    fn row(&mut self, _step: u64, _seen: &Observation) {}
    /// Called when a frame of time t (s) has been written into this file.
    fn frame(&mut self, _t: f64, _file: &Path) {}
    /// Called after every step, or after up to 16 steps without output between them. Return false to end the run there,
    /// with everything written.
    fn step(&mut self, _simulation: &Simulation) -> bool {
        true
    }
    /// Called after the last step or after a failed one, with the remaining state.
    fn end(&mut self, _simulation: &Simulation) {}
}

/// Ignores everything.
impl Watch for () {}
