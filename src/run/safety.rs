//! What a run does for safety: it keeps good points to go back to, answers the energy guard, and saves
//! and reinstates checkpoints. It must not know what a step is.

use super::RunError;
use super::stepping::{Course, Run};
use crate::run::checkpoint::{Checkpoint, CheckpointError};
use crate::run::estimate::{Companions, Estimator};
use crate::run::frames::FrameWriter;
use crate::run::guard::Growth;
use crate::scene::GuardAction;
use crate::simulation::Snapshot;

/// Steps between points that the guard can go back to.
pub(super) const STRIDE: u64 = 16;

/// A point that the guard can go back to.
pub(super) struct Good {
    simulation: Snapshot,
    companions: Companions,
    course: Course,
}

impl Run {
    fn course(&self) -> Course {
        Course {
            ledger: self.ledger,
            momentum: self.momentum.clone(),
            work: self.work,
            growth: self.guard.growth,
            row: self.row,
            extremes: self.extremes.clone(),
            history_bytes: self.history.bytes(),
            frames: self.frames.as_ref().map_or(0, FrameWriter::count) as u64,
            samples: self.pitch.len() as u64,
        }
    }

    fn companions(&self) -> Companions {
        self.estimator.as_ref().map(Estimator::snapshot).unwrap_or_default()
    }

    /// Keeps this point to go back to, where the guard may ask for one.
    pub(super) fn keep_good(&mut self) {
        let can_go_back = matches!(self.guard.rule.action, GuardAction::Halve | GuardAction::Switch);
        if can_go_back && (self.good.is_none() || self.simulation.steps().is_multiple_of(STRIDE)) {
            self.good = Some(Good {
                simulation: self.simulation.snapshot(),
                companions: self.companions(),
                course: self.course(),
            });
        }
    }

    /// Is there a good point, and a smaller step to go on with?
    pub(super) fn can_go_back(&self) -> bool {
        self.good.is_some() && self.simulation.part() > self.simulation.step_size() / 1024.0
    }

    /// Answers growth beyond the bound: back to the last good point with a smaller step or another scheme,
    /// or the end.
    pub(super) fn answer(&mut self) -> Result<(), RunError> {
        let (step, t) = (self.simulation.steps(), self.simulation.time());
        let end = |run: &Self, after| {
            let Growth { now, exchange, .. } = run.guard.growth;
            let (relative, bound) = (now / exchange, run.guard.rule.bound);
            Err(RunError::Guard { step, t, joules: now, relative, bound, after })
        };
        let Some(good) = self.good.take() else { return end(self, "") };
        let from = good.simulation.steps() as f64 * self.simulation.step_size();
        let (part, was_switched) = (self.simulation.part(), self.simulation.is_switched());
        if part <= self.simulation.step_size() / 1024.0 {
            return end(self, ", though the step was halved to h/1024");
        }
        self.simulation
            .go_back(&good.simulation)
            .map_err(|error| CheckpointError::Unfit(error.to_string()))?;
        if let Some(estimator) = &mut self.estimator {
            let restored = estimator.restore(&good.companions);
            restored.map_err(|error| CheckpointError::Unfit(error.to_string()))?;
        }
        let wants_switch = self.guard.rule.action == GuardAction::Switch && !was_switched;
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
        let seen = self.guard.growth;
        self.go_back(&good.course)?;
        self.guard.act(step, t, action, seen);
        Ok(())
    }

    /// Makes the accounts and files what they were.
    fn go_back(&mut self, course: &Course) -> Result<(), RunError> {
        self.ledger = course.ledger;
        self.momentum = course.momentum.clone();
        self.work = course.work;
        self.guard.growth = course.growth;
        self.row = course.row;
        self.extremes = course.extremes.clone();
        self.pitch.truncate(course.samples as usize);
        let path = self.directory.join("history.csv");
        self.history.truncate(course.history_bytes).map_err(RunError::output(&path))?;
        if let Some(frames) = &mut self.frames {
            frames.truncate(course.frames as usize)?;
        }
        Ok(())
    }

    /// Saves a checkpoint where one is due.
    pub(super) fn save_if_due(&mut self) -> Result<(), RunError> {
        let (steps, h) = (self.simulation.steps(), self.simulation.step_size());
        if !self.simulation.is_done() && self.store.as_ref().is_some_and(|(store, _)| store.is_due(steps, h))
        {
            // A run that continues goes back no further than here, so neither does this one.
            self.good = None;
            self.save()?;
        }
        Ok(())
    }

    /// Saves a checkpoint of the state now, where the scene asks for checkpoints.
    pub(super) fn save(&mut self) -> Result<(), RunError> {
        let Some((_, origin)) = &self.store else { return Ok(()) };
        let mut origin = origin.clone();
        if let Some(auto) = &self.auto {
            let time = &self.simulation.scene().time;
            let scheme = serde_json::json!(time.scheme).as_str().unwrap_or_default().to_owned();
            let stages = time.stages.unwrap_or(0) as u64;
            origin.choice = Some((scheme, (stages, self.simulation.step_count())));
            origin.auto = serde_json::json!(auto).to_string();
        }
        self.sync()?;
        let report = &self.report;
        let checkpoint = Checkpoint {
            origin,
            simulation: self.simulation.snapshot(),
            companions: self.companions(),
            course: self.course(),
            pitch: self.pitch.samples(),
            estimates: self.estimates.clone(),
            events: self.guard.events.clone(),
            frames: self.frames.as_ref().map(|frames| frames.frames().to_vec()).unwrap_or_default(),
            findings: self.findings.clone(),
            seconds: [
                report.setup_seconds,
                report.stepping_seconds,
                report.output_seconds,
                report.estimating_seconds,
            ],
        };
        let Some((store, _)) = &self.store else { return Ok(()) };
        store.write(&checkpoint).map_err(RunError::output(&self.directory.join("checkpoint")))
    }

    /// Returns when history and frames are on the disk, so that what is written then may build on them.
    fn sync(&mut self) -> Result<(), RunError> {
        let path = self.directory.join("history.csv");
        self.history.sync().map_err(RunError::output(&path))?;
        self.frames.as_mut().map_or(Ok(()), FrameWriter::sync)?;
        Ok(())
    }

    /// What report.json will tell of is complete: on the disk, where the scene asks for checkpoints, and else with
    /// the operating system.
    pub(super) fn settle(&mut self) -> Result<(), RunError> {
        if self.store.is_some() {
            return self.sync();
        }
        let path = self.directory.join("history.csv");
        self.history.flush().map_err(RunError::output(&path))
    }

    /// Makes a run that has just been built what it was at a checkpoint.
    pub(super) fn reinstate(&mut self, was: &Checkpoint) -> Result<(), RunError> {
        let unfit = |error: vi_solvers::SolverError| CheckpointError::Unfit(error.to_string());
        self.simulation.restore(&was.simulation).map_err(unfit)?;
        if let Some(estimator) = &mut self.estimator {
            estimator.restore(&was.companions).map_err(unfit)?;
        }
        self.pitch.restore(&was.pitch);
        self.estimates.clone_from(&was.estimates);
        self.guard.events.clone_from(&was.events);
        self.findings.clone_from(&was.findings);
        if let Some(frames) = &mut self.frames {
            frames.resume(&was.frames)?;
        }
        self.go_back(&was.course)?;
        let [setup, stepping, output, estimating] = was.seconds;
        let report = &mut self.report;
        report.setup_seconds = setup;
        report.stepping_seconds = stepping;
        report.output_seconds = output;
        report.estimating_seconds = estimating;
        if !was.origin.auto.is_empty() {
            report.auto = serde_json::from_str(&was.origin.auto)
                .map_err(|error| CheckpointError::Unfit(format!("its account of `auto`: {error}")))?;
        }
        Ok(())
    }
}
