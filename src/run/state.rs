//! The state of a run.

use std::path::PathBuf;

use vi_solvers::SolverError;

use super::checkpoint::{Origin, Snapshots, Store};
use super::claim::Claim;
use super::observers::Observers;
use super::report::Report;
use crate::simulation::stability::StabilityNote;
use crate::simulation::{Observation, Simulation, Snapshot};

/// A run in progress.
pub(super) struct Run {
    pub(super) simulation: Simulation,
    pub(super) directory: PathBuf,
    pub(super) observers: Observers,
    pub(super) good: Option<Good>,
    pub(super) store: Option<(Store, Origin)>,
    /// Findings of the steps so far, e.g. limit points.
    pub(super) findings: Vec<String>,
    /// The newest row of history.csv with its step, until it is passed to the watch.
    pub(super) row: Option<(u64, Observation)>,
    pub(super) report: Report,
    pub(super) stability: Result<Option<StabilityNote>, SolverError>,
    pub(super) claim: Claim,
}

/// A state that the guard can go back to.
pub(super) struct Good {
    pub(super) simulation: Snapshot,
    pub(super) observers: Snapshots,
}
