//! Keeps states of a run to go back to, responds to the energy guard, saves checkpoints and resumes from them.

use vi_solvers::SolverError;

use super::checkpoint::{Checkpoint, CheckpointError};
use super::error::RunError;
use super::guard::Growth;
use super::observer::Purpose;
use super::state::{Good, Run};
use crate::scene::GuardAction;
use crate::simulation::Snapshot;

impl Run {
    /// Keeps the current state, if the guard may go back to one.
    pub(super) fn keep_good(&mut self) -> Result<(), RunError> {
        let can_go_back =
            matches!(self.observers.guard.rule().action, GuardAction::Halve | GuardAction::Switch);
        if can_go_back && (self.good.is_none() || self.observers.guard.keeps(self.simulation.steps())) {
            // Two states of a large mesh take much memory.
            self.good = None;
            let kept = self.simulation.keep();
            self.good = Some(Good {
                simulation: kept.map_err(|error| CheckpointError::Unfit(error.to_string()))?,
                observers: self.observers.snapshots(Purpose::GoBack),
            });
        }
        Ok(())
    }

    /// Returns whether the run can go back to a good state with a smaller step.
    pub(super) fn can_go_back(&self) -> bool {
        self.good.is_some() && self.simulation.part() > self.simulation.step_size() / 1024.0
    }

    /// Responds to growth beyond the bound, or to the `failure` of a step: goes back to the last good state with a smaller step or
    /// another scheme, or ends the run.
    pub(super) fn answer(&mut self, failure: Option<&SolverError>) -> Result<(), RunError> {
        let (step, t) = (self.simulation.steps(), self.simulation.time());
        let end = |run: &Self, after| {
            let Growth { now, exchange, .. } = run.observers.guard.growth;
            let (relative, bound) = (now / exchange, run.observers.guard.rule().bound);
            Err(RunError::Guard { step, t, joules: now, relative, bound, after })
        };
        let Some(good) = self.good.take() else {
            return match self.simulation.method().facts().conserves.energy {
                true => end(self, ": shorten `time.step`"),
                false => end(self, ": shorten `time.step`, or use scheme = \"energy-momentum\""),
            };
        };
        let from = good.simulation.steps() as f64 * self.simulation.step_size();
        let (part, was_switched) = (self.simulation.part(), self.simulation.is_switched());
        if part <= self.simulation.step_size() / 1024.0 {
            return end(self, ", though the step was halved to h/1024");
        }
        self.simulation
            .go_back(&good.simulation)
            .map_err(|error| CheckpointError::Unfit(error.to_string()))?;
        let wants_switch = self.observers.guard.rule().action == GuardAction::Switch && !was_switched;
        let action = match wants_switch.then(|| self.simulation.switch()) {
            Some(Ok(())) => format!("from t = {from:e} s on by energy-momentum"),
            refused => {
                self.simulation.halve();
                let why = match refused {
                    Some(Err(error)) => format!(" ({error})"),
                    _ => String::new(),
                };
                format!("from t = {from:e} s on with steps of {:e} s{why}", self.simulation.part())
            }
        };
        let seen = self.observers.guard.growth;
        self.observers.restore(&good.observers)?;
        let failure = failure.map(ToString::to_string);
        self.observers.guard.act((step, t), action, failure, seen);
        Ok(())
    }

    /// Saves a checkpoint if one is due.
    pub(super) fn save_if_due(&mut self) -> Result<(), RunError> {
        let (steps, h) = (self.simulation.steps(), self.simulation.step_size());
        if !self.simulation.is_done() && self.store.as_ref().is_some_and(|(store, _)| store.is_due(steps, h))
        {
            // A continued run cannot go back beyond its checkpoint, so neither does this run.
            self.good = None;
            self.save()?;
        }
        Ok(())
    }

    /// Saves a checkpoint of the current state, if the scene has checkpoints.
    pub(super) fn save(&mut self) -> Result<(), RunError> {
        let now = self.simulation.snapshot();
        self.save_as(now)
    }

    /// Saves a checkpoint of the state `now`, if the scene has checkpoints, with what the guard can go back to.
    pub(super) fn save_as(&mut self, now: Snapshot) -> Result<(), RunError> {
        let Some((_, origin)) = &self.store else { return Ok(()) };
        let mut origin = origin.clone();
        let auto = &self.report.auto;
        if !auto.is_null() {
            let time = &self.simulation.scene().time;
            let scheme = serde_json::json!(time.scheme).as_str().unwrap_or_default().to_owned();
            let stages = time.stages.unwrap_or(0) as u64;
            origin.choice = Some((scheme, (stages, self.simulation.step_count())));
            origin.auto = auto.to_string();
        }
        self.observers.sync(&self.directory)?;
        let good = match self.good.take() {
            Some(Good { simulation, observers }) => {
                let whole = self.simulation.completed(simulation);
                Some((whole.map_err(|error| CheckpointError::Unfit(error.to_string()))?, observers))
            }
            None => None,
        };
        let report = &self.report;
        let checkpoint = Checkpoint {
            origin,
            simulation: now,
            history_bytes: self.observers.history.bytes(),
            observers: self.observers.snapshots(Purpose::Resume),
            good,
            findings: self.findings.clone(),
            seconds: [report.setup_seconds, report.stepping_seconds, report.output_seconds],
        };
        let Some((store, _)) = &self.store else { return Ok(()) };
        store.write(&checkpoint).map_err(RunError::output(&self.directory.join("checkpoint")))
    }

    /// Completes the files that report.json describes: they are on disk if the scene has checkpoints, otherwise handed
    /// to the operating system.
    pub(super) fn settle(&mut self) -> Result<(), RunError> {
        if self.store.is_some() {
            return self.observers.sync(&self.directory);
        }
        let path = self.directory.join("history.csv");
        self.observers.history.flush().map_err(RunError::output(&path))
    }

    /// Restores a run that has just been built to the state of a checkpoint.
    pub(super) fn reinstate(&mut self, was: &Checkpoint) -> Result<(), RunError> {
        let unfit = |error: vi_solvers::SolverError| CheckpointError::Unfit(error.to_string());
        self.simulation.restore(&was.simulation).map_err(unfit)?;
        self.observers.restore(&was.observers)?;
        self.good = was.good.clone().map(|(simulation, observers)| Good { simulation, observers });
        self.findings.clone_from(&was.findings);
        let [setup, stepping, output] = was.seconds;
        let report = &mut self.report;
        report.setup_seconds = setup;
        report.stepping_seconds = stepping;
        report.output_seconds = output;
        Ok(())
    }
}
