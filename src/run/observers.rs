//! The observers of a run, in the order in which they see events and report.

use std::path::Path;

use vi_io::IoError;

use super::checkpoint::{CheckpointError, Snapshots};
use super::error::RunError;
use super::estimate::Estimator;
use super::extremes::Extremes;
use super::frames::FrameWriter;
use super::guard::EnergyGuard;
use super::history::HistoryWriter;
use super::ledger::LedgerKeeper;
use super::momentum::MomentumLedger;
use super::observer::{Observer, Purpose, Row, Sight};
use super::pitch::PitchFinder;
use super::report::Report;
use crate::simulation::{Observation, Simulation, Stepped};

/// All observers of a run.
pub(super) struct Observers {
    pub(super) ledger: LedgerKeeper,
    pub(super) guard: EnergyGuard,
    pub(super) momentum: MomentumLedger,
    pub(super) pitch: PitchFinder,
    pub(super) estimator: Option<Estimator>,
    pub(super) extremes: Extremes,
    pub(super) history: HistoryWriter,
    pub(super) frames: Option<FrameWriter>,
}

impl Observers {
    fn all(&self) -> impl Iterator<Item = &dyn Observer> {
        let all: [Option<&dyn Observer>; 8] = [
            Some(&self.ledger),
            Some(&self.guard),
            Some(&self.momentum),
            Some(&self.pitch),
            self.estimator.as_ref().map(|estimator| estimator as _),
            Some(&self.extremes),
            self.frames.as_ref().map(|frames| frames as _),
            Some(&self.history),
        ];
        all.into_iter().flatten()
    }

    fn all_mut(&mut self) -> impl Iterator<Item = &mut dyn Observer> {
        let all: [Option<&mut dyn Observer>; 8] = [
            Some(&mut self.ledger),
            Some(&mut self.guard),
            Some(&mut self.momentum),
            Some(&mut self.pitch),
            self.estimator.as_mut().map(|estimator| estimator as _),
            Some(&mut self.extremes),
            self.frames.as_mut().map(|frames| frames as _),
            Some(&mut self.history),
        ];
        all.into_iter().flatten()
    }

    fn see(&mut self, sight: &Sight<'_>) -> Result<(), RunError> {
        self.all_mut().try_for_each(|observer| observer.see(sight))
    }

    /// Passes the outcome of steps to the observers.
    pub(super) fn see_steps(&mut self, stepped: &Stepped) -> Result<(), RunError> {
        self.see(&Sight::Steps(stepped))
    }

    /// Passes the energies after a step to the observers.
    pub(super) fn see_energies(&mut self, seen: &Observation) -> Result<(), RunError> {
        let account = self.ledger.account;
        self.see(&Sight::Energies(seen, &account))
    }

    /// Passes a row of history.csv to the observers.
    pub(super) fn see_row(&mut self, simulation: &Simulation, seen: &Observation) -> Result<(), RunError> {
        let step = simulation.steps();
        let estimates = self.estimator.as_mut().and_then(|estimator| estimator.compare(step, &seen.probes));
        let measures = simulation.measures();
        self.see(&Sight::Row(&Row { step, seen, measures: &measures, estimates: estimates.as_deref() }))
    }

    /// Passes a state to the observers for which a frame is due.
    pub(super) fn see_frame(&mut self, simulation: &Simulation) -> Result<(), RunError> {
        self.see(&Sight::Frame(simulation))
    }

    /// Returns the snapshots of all observers.
    pub(super) fn snapshots(&self, purpose: Purpose) -> Snapshots {
        self.all().map(|observer| (observer.name().to_owned(), observer.snapshot(purpose))).collect()
    }

    /// Restores all observers. The history is cut last, after everything that can fail.
    pub(super) fn restore(&mut self, snapshots: &Snapshots) -> Result<(), RunError> {
        for observer in self.all_mut() {
            let name = observer.name();
            let found = snapshots.iter().find(|(other, _)| other == name);
            let missing = || CheckpointError::Unfit(format!("it holds no snapshot of the {name}"));
            observer.restore(&found.ok_or_else(missing)?.1)?;
        }
        Ok(())
    }

    pub(super) fn report(&self, simulation: &Simulation, report: &mut Report) {
        self.all().for_each(|observer| observer.report(simulation, report));
    }

    /// Waits until history and frames are on disk, before files that refer to them are written.
    pub(super) fn sync(&mut self, directory: &Path) -> Result<(), RunError> {
        self.history.sync().map_err(RunError::output(&directory.join("history.csv")))?;
        self.frames.as_mut().map_or(Ok(()), FrameWriter::sync)?;
        Ok(())
    }

    /// Writes the files that need all frames, at the end of the run.
    pub(super) fn finish(&self) -> Result<(), RunError> {
        self.frames.as_ref().map_or(Ok(()), FrameWriter::finish)?;
        Ok(())
    }

    /// Writes the state at which a run ends early as a last frame, unless it has one.
    pub(super) fn write_last_frame(&mut self, simulation: &Simulation) -> Result<(), RunError> {
        let Some(frames) = &mut self.frames else { return Ok(()) };
        if frames.frames().last().is_some_and(|last| last.0 >= simulation.time()) {
            return Ok(());
        }
        match frames.write_last(simulation) {
            // Ignore a value that a frame cannot hold: it is the reason why the run ends.
            Ok(()) | Err(IoError::BadOutput { .. }) => Ok(()),
            Err(error) => Err(error.into()),
        }
    }
}
