//! The contract of the observers of a run: the energy ledger, the momenta, pitches, the energy guard, the error
//! estimate, extremes of the probes, history.csv and frames.

use vi_core::EnergyLedger;

use super::error::RunError;
use super::probe_estimate::ProbeEstimate;
use super::report::Report;
use crate::record::Bytes;
use crate::simulation::{Observation, Simulation, Stepped};

/// An event that is shown to all observers. Each handles the events that concern it and ignores the others.
pub(crate) enum Sight<'a> {
    /// A step was made, or several without output between them.
    Steps(&'a Stepped),
    /// Energies and momenta after a step, with the energy ledger up to it.
    Energies(&'a Observation, &'a EnergyLedger),
    /// A row of history.csv is due.
    Row(&'a Row<'a>),
    /// A frame of this state is due.
    Frame(&'a Simulation),
}

/// A row of history.csv.
pub(crate) struct Row<'a> {
    /// Steps made.
    pub(crate) step: u64,
    pub(crate) seen: &'a Observation,
    /// The columns of probes over parts of bodies.
    pub(crate) measures: &'a [f64],
    /// The estimated errors of the probes, if requested and known at this step.
    pub(crate) estimates: Option<&'a [ProbeEstimate]>,
}

/// Purpose of a snapshot.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Purpose {
    /// To go back to this point later in the same run. Lists that only grow are stored by their length, and data about
    /// the run as a whole are not reset.
    GoBack,
    /// To continue the run in another process.
    Resume,
}

/// An observer of a run.
pub(crate) trait Observer {
    /// Returns the name of its snapshot in a checkpoint.
    fn name(&self) -> &'static str;

    /// Handles an event.
    ///
    /// # Errors
    /// Returns an error if a file cannot be written.
    fn see(&mut self, sight: &Sight<'_>) -> Result<(), RunError>;

    /// Returns everything beyond the scene that its further results depend on.
    fn snapshot(&self, purpose: Purpose) -> Bytes;

    /// Restores the snapshot, and cuts its files accordingly.
    ///
    /// # Errors
    /// Returns [`RunError::Checkpoint`] if the snapshot is not one of this observer; otherwise the errors of
    /// [`Observer::see`].
    fn restore(&mut self, snapshot: &Bytes) -> Result<(), RunError>;

    /// Adds its results to the report, at the end of the run.
    fn report(&self, simulation: &Simulation, report: &mut Report);
}
