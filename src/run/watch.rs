//! How a caller follows a run.

use crate::auto::AutoReport;
use crate::simulation::Simulation;

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
