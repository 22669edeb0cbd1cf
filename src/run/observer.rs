//! The contract of all that a run observes: the energy ledger, the momenta, pitches, the energy guard, the error
//! estimate, extremes of the probes, history.csv and frames.

use vi_core::EnergyLedger;

use super::error::RunError;
use super::probe_estimate::ProbeEstimate;
use super::report::Report;
use crate::record::Bytes;
use crate::simulation::{Observation, Simulation, Stepped};

/// An event that observers are shown. Each handles the events that concern it and ignores the others.
pub(crate) enum Sight<'a> {
    /// A step was made, or several with nothing due between them.
    Steps(&'a Stepped),
    /// Energies and momenta after a step, with the account of energy until then.
    Energies(&'a Observation, &'a EnergyLedger),
    /// A row of history.csv is due.
    Row(&'a Row<'a>),
    /// A frame is due, of this state.
    Frame(&'a Simulation),
}

/// A row of history.csv.
pub(crate) struct Row<'a> {
    /// Steps made.
    pub(crate) step: u64,
    pub(crate) seen: &'a Observation,
    /// The columns of probes over parts of bodies.
    pub(crate) measures: &'a [f64],
    /// The estimated errors of the probes, where they are asked for and known at this step.
    pub(crate) estimates: Option<&'a [ProbeEstimate]>,
}

/// Purpose of a snapshot.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Purpose {
    /// To go back to this point later in the same run. What only grows is stored by its length, and what tells of the
    /// run as a whole stays as it is.
    GoBack,
    /// To continue the run in another process.
    Resume,
}

/// One thing that a run observes.
pub(crate) trait Observer {
    /// The name of its snapshot in a checkpoint.
    fn name(&self) -> &'static str;

    /// Looks.
    ///
    /// # Errors
    /// Where a file cannot be written.
    fn see(&mut self, sight: &Sight<'_>) -> Result<(), RunError>;

    /// All that it depends on beyond the scene.
    fn snapshot(&self, purpose: Purpose) -> Bytes;

    /// Becomes what it was when the snapshot was taken, and makes its files what they were.
    ///
    /// # Errors
    /// [`RunError::Checkpoint`] where the snapshot is not one of this observer; else as [`Observer::see`].
    fn restore(&mut self, snapshot: &Bytes) -> Result<(), RunError>;

    /// Writes what it found into the report, where the run has ended.
    fn report(&self, simulation: &Simulation, report: &mut Report);
}
