//! What a run under way holds.

use std::path::PathBuf;

use vi_solvers::SolverError;

use super::checkpoint::{Origin, Snapshots, Store};
use super::claim::Claim;
use super::observers::Observers;
use super::report::Report;
use crate::auto::AutoReport;
use crate::simulation::stability::StabilityNote;
use crate::simulation::{Simulation, Snapshot};

/// A run under way.
pub(super) struct Run {
    pub(super) simulation: Simulation,
    pub(super) directory: PathBuf,
    pub(super) observers: Observers,
    pub(super) good: Option<Good>,
    pub(super) store: Option<(Store, Origin)>,
    /// What the steps so far have found, e.g. limit points.
    pub(super) findings: Vec<String>,
    pub(super) report: Report,
    pub(super) auto: Option<AutoReport>,
    pub(super) stability: Result<Option<StabilityNote>, SolverError>,
    pub(super) claim: Claim,
}

/// Steps between points that the guard can go back to.
pub(super) const STRIDE: u64 = 16;

/// A point that the guard can go back to.
pub(super) struct Good {
    pub(super) simulation: Snapshot,
    pub(super) observers: Snapshots,
}
