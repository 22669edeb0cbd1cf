//! The loop of a run: steps, rows and frames when they are due, and the end. `safety.rs` goes back, saves and resumes.

use std::path::Path;
use std::time::Instant;

use serde_json::Value;
use vi_core::State;
use vi_io::IoError;
use vi_solvers::{SolverError, StepError};

use super::checkpoint::{Checkpoint, CheckpointError, Origin, Snapshots, Store};
use super::claim::Claim;
use super::directory;
use super::error::RunError;
use super::estimate::Estimator;
use super::extremes::Extremes;
use super::frames::FrameWriter;
use super::guard::{EnergyGuard, STRIDE, Watching};
use super::history::{Columns, HistoryWriter};
use super::ledger::LedgerKeeper;
use super::momentum::MomentumLedger;
use super::observer::Purpose;
use super::observers::Observers;
use super::pitch::PitchFinder;
use super::report::{Outcome, Report};
use super::state::Run;
use super::watch::Watch;
use crate::auto::AutoReport;
use crate::scene::{Guard, GuardAction, history_columns};
use crate::simulation::stability::{StabilityNote, stability};
use crate::simulation::{Observation, Simulation, Snapshot, TOGETHER};

/// Number of steps after which the guard of a scene without `[guard]` examines the kinetic energy of explicit steps,
/// and observes implicit ones. An observation costs about as much as an explicit step, and a tenth of an implicit one;
/// the kinetic energy costs less than a tenth of an explicit step. P1 n8 takes 2.4 % longer with an observation every
/// 64 steps, and .5 % with the kinetic energy every 16.
const EXPLICIT_STRIDE: u64 = 64;
const IMPLICIT_STRIDE: u64 = 4;
/// With contact, the guard examines the kinetic energy after each explicit step. The energy of an unstable run grows
/// tenfold and more in each step, and the first step with contact at such velocities takes minutes and a gigabyte: all
/// pairs are then candidates.
const CONTACT_STRIDE: u64 = 1;
/// Growth of which the guard of a scene without `[guard]` warns.
const WARNS_ABOVE: f64 = 0.1;

impl Run {
    /// Starts a run and writes its first row and frame.
    pub(super) fn start(
        simulation: Simulation,
        auto: Option<AutoReport>,
        name: &str,
        directory: &Path,
        origin: Option<Origin>,
        begin: Instant,
    ) -> Result<Self, RunError> {
        let claim = Claim::new(directory)?;
        directory::prepare(directory, name, simulation.scene())?;
        let path = directory.join("history.csv");
        let history = |names: &[String], columns| HistoryWriter::create(&path, names, columns);
        let auto = serde_json::json!(auto);
        let (mut run, first) = Self::build(simulation, auto, name, claim, directory, origin, history)?;
        if !first.is_finite() {
            // A row or a frame cannot hold such a state.
            return Err(run.refuse_start());
        }
        run.write_row(first)?;
        if run.observers.frames.is_some() {
            run.observers.see_frame(&run.simulation)?;
        }
        run.report.setup_seconds = begin.elapsed().as_secs_f64();
        run.save()?;
        Ok(run)
    }

    /// Continues a run from a checkpoint.
    pub(super) fn resume(
        simulation: Simulation,
        checkpoint: &Checkpoint,
        directory: &Path,
        begin: Instant,
    ) -> Result<Self, RunError> {
        let name = &checkpoint.origin.name;
        let claim = Claim::new(directory)?;
        directory::refuse_inputs(directory, name, simulation.scene())?;
        let path = directory.join("history.csv");
        let bytes = checkpoint.history_bytes;
        let history = |_: &[String], columns| HistoryWriter::resume(&path, columns, bytes);
        let origin = checkpoint.origin.clone();
        let auto = origin.account_of_auto()?;
        let (mut run, _) = Self::build(simulation, auto, name, claim, directory, Some(origin), history)?;
        run.reinstate(checkpoint)?;
        // The report of the interrupted run is no longer valid.
        let report = directory.join("report.json");
        if report.exists() {
            std::fs::remove_file(&report).map_err(RunError::output(&report))?;
        }
        run.report.setup_seconds += begin.elapsed().as_secs_f64();
        Ok(run)
    }

    /// Builds a run; `auto` is the account of the choice that scheme `auto` made, or null.
    fn build(
        mut simulation: Simulation,
        auto: Value,
        name: &str,
        claim: Claim,
        directory: &Path,
        origin: Option<Origin>,
        history: impl FnOnce(&[String], Columns) -> std::io::Result<HistoryWriter>,
    ) -> Result<(Self, Observation), RunError> {
        let stability = stability(&simulation);
        let first = simulation.observe();
        let scene = simulation.scene();
        let has_loads = simulation.components().iter().any(|component| {
            component.system().potentials().iter().any(|term| term.account() == vi_core::Account::Load)
        });
        let estimator = scene.time.estimate.then(|| Estimator::new(&simulation));
        let has_load_factor = first.load_factor.is_some();
        let columns = Columns { has_loads, has_estimates: estimator.is_some(), has_load_factor };
        let path = directory.join("history.csv");
        let history =
            history(&history_columns(scene, has_loads), columns).map_err(RunError::output(&path))?;
        let schedule = scene.output.schedule();
        let frames = schedule
            .map(|schedule| FrameWriter::create(directory, name, &simulation, schedule))
            .transpose()?;
        // The program may halve a step that it chose itself.
        let is_auto = !auto.is_null();
        let mut report = Report::new(&simulation, auto, name, &stability);
        report.notes.extend(frames.iter().flat_map(|frames| frames.notes(&simulation)));
        let default_guard = if is_auto { Guard::new(GuardAction::Halve) } else { Guard::without_table() };
        let mut rule = scene.guard.unwrap_or(default_guard);
        let method = simulation.method().facts();
        let has_explicit_contact = simulation.has_explicit_contact();
        let stride = match (scene.guard.is_some(), is_auto, method.is_explicit) {
            (true, ..) => 1,
            (_, true, _) => STRIDE,
            (.., true) if has_explicit_contact => CONTACT_STRIDE,
            (.., true) => EXPLICIT_STRIDE,
            (.., false) => IMPLICIT_STRIDE,
        };
        let mut warns_above = rule.bound;
        let is_unasked = scene.guard.is_none() && !is_auto;
        let watches_motion = is_unasked && method.is_explicit;
        let longest_advised = stability
            .as_ref()
            .ok()
            .and_then(Option::as_ref)
            .map_or(f64::INFINITY, StabilityNote::advised_step);
        if is_unasked {
            warns_above = WARNS_ABOVE;
        }
        if scene.guard.is_none() && has_explicit_contact {
            // Each change of a step near the stability limit adds energy.
            rule.action = GuardAction::Stop;
        }
        if scene.statics.is_some() || !simulation.is_accounted() {
            // Growth cannot be determined without the external work.
            rule.action = GuardAction::Off;
        }
        let store = scene.checkpoint.as_ref().map(|rule| Store::new(directory, rule)).zip(origin);
        let resolution = simulation.resolution();
        let observers = Observers {
            ledger: LedgerKeeper::new(&first, resolution),
            guard: EnergyGuard::new(
                Watching {
                    rule,
                    is_stated: scene.guard.is_some(),
                    stride,
                    warns_above,
                    watches_motion,
                    longest_advised,
                },
                method.order,
                &first,
                resolution,
            ),
            momentum: MomentumLedger::new(&simulation, &first),
            pitch: PitchFinder::new(scene.node_probes()),
            estimator,
            extremes: Extremes::default(),
            history,
            frames,
        };
        let run = Self {
            observers,
            report,
            directory: directory.to_owned(),
            findings: Vec::new(),
            row: None,
            good: None,
            simulation,
            store,
            stability,
            claim,
        };
        Ok((run, first))
    }

    /// Steps to the end, or until the run fails or is stopped, and writes everything. `note` is shown before the first
    /// step.
    pub(super) fn complete(
        mut self,
        note: Option<String>,
        watch: &mut dyn Watch,
    ) -> Result<Report, RunError> {
        let mut notes = self.report.notes.clone();
        notes.extend(self.claim.note());
        notes.extend(note);
        watch.start(&self.simulation, &notes);
        let mut failure = None;
        let mut interrupted = false;
        let mut said = self.findings.len();
        let mut frames = self.show_progress(0, watch);
        while !self.simulation.is_done() && !interrupted {
            match self.advance() {
                Ok(()) => {}
                Err(RunError::Step { source, .. }) if source.is_interruption() => {
                    interrupted = true;
                    break;
                }
                Err(error) if error.is_failure() => {
                    failure = Some(error);
                    break;
                }
                Err(error) => return Err(error),
            }
            self.findings[said..].iter().for_each(|finding| watch.finding(finding));
            said = self.findings.len();
            frames = self.show_progress(frames, watch);
            let go_on = watch.step(&self.simulation);
            interrupted = !go_on && !self.simulation.is_done();
        }
        if failure.is_some()
            && let Ok(Some(note)) = &self.stability
            && let Some(diagnosis) = note.diagnosis()
        {
            watch.finding(&diagnosis);
            self.findings.push(diagnosis);
        }
        watch.end(&self.simulation);
        if failure.is_some() || interrupted {
            self.leave()?;
            self.show_progress(frames, watch);
        }
        let outcome = match &failure {
            Some(error) => Outcome::Failed(error.to_string()),
            None if interrupted => Outcome::Interrupted,
            None => Outcome::Done,
        };
        self.finish(outcome)?;
        match failure {
            Some(error) => Err(error),
            None => Ok(self.report),
        }
    }

    /// Writes the observation of the current step as a row of history.csv.
    fn write_row(&mut self, seen: Observation) -> Result<(), RunError> {
        self.observers.see_row(&self.simulation, &seen)?;
        self.row = Some((self.simulation.steps(), seen));
        Ok(())
    }

    /// Passes the newest row, and the frames after the first `shown`, to the watch. Returns the number of frames so
    /// far.
    fn show_progress(&mut self, shown: usize, watch: &mut dyn Watch) -> usize {
        if let Some((step, seen)) = self.row.take() {
            watch.row(step, &seen);
        }
        let frames = self.observers.frames.as_ref().map_or(&[][..], FrameWriter::frames);
        for (t, file) in frames.iter().skip(shown) {
            watch.frame(*t, &self.directory.join(file));
        }
        frames.len()
    }

    /// Returns the number of steps to make together before something is due, at least one. A step with a frame inside
    /// it is made alone.
    fn quiet_steps(&self) -> u64 {
        let (now, h) = (self.simulation.steps(), self.simulation.step_size());
        let holds_frame =
            |step: &u64| self.observers.frames.as_ref().is_some_and(|frames| frames.is_within(*step, h));
        if holds_frame(&(now + 1)) {
            return 1;
        }
        let every = self.simulation.scene().output.history;
        let is_due = |step: &u64| {
            (every > 0 && step.is_multiple_of(every))
                || self.observers.guard.is_due(*step)
                || self.observers.frames.as_ref().is_some_and(|frames| frames.is_due(*step, h))
                || holds_frame(&(step + 1))
                || self.store.as_ref().is_some_and(|(store, _)| store.is_due(*step, h))
        };
        (now + 1..now + TOGETHER).find(is_due).unwrap_or(now + TOGETHER) - now
    }

    /// Makes one step, or several if nothing is due between them, and writes row, frame and checkpoint if they are due.
    /// The energy guard may go back instead. A step that is abandoned on request leaves the run as it was before.
    fn advance(&mut self) -> Result<(), RunError> {
        self.keep_good()?;
        let quiet = self.quiet_steps();
        let (next, h) = (self.simulation.steps() + 1, self.simulation.step_size());
        let is_within = self.observers.frames.as_ref().is_some_and(|frames| frames.is_within(next, h));
        let before = is_within.then(|| self.simulation.states());
        // Frames within the step may be many, so that it can also be abandoned while they are written.
        let is_long = is_within && self.simulation.scene().solver.interrupt.is_possible();
        let kept = (is_long || self.simulation.needs_return()).then(|| self.simulation.snapshot());
        let observed = is_long.then(|| (self.observers.snapshots(Purpose::GoBack), self.findings.len()));
        let begin = Instant::now();
        let stepped = self.simulation.advance(quiet);
        self.report.stepping_seconds += begin.elapsed().as_secs_f64();
        let step = self.simulation.steps();
        let stepped = match stepped {
            Ok(stepped) => stepped,
            Err(source) if source.is_interruption() => {
                self.undo(kept.as_ref(), None)?;
                return Err(RunError::Step { step: step + 1, source });
            }
            // An explicit scheme fails if its energy has grown beyond all bounds since the last observation of the
            // guard, or if a step leaves the domain of a term.
            Err(error)
                if self.simulation.method().facts().is_explicit
                    && self.can_go_back()
                    && !error.cause.is_at_any_state() =>
            {
                return self.answer(Some(&error.cause));
            }
            Err(source) => return Err(RunError::Step { step: step + 1, source }),
        };
        self.findings.extend(self.simulation.take_findings());
        self.observers.see_steps(&stepped)?;
        let begin = Instant::now();
        let every = self.simulation.scene().output.history;
        let row_is_due = self.simulation.is_done() || (every > 0 && step.is_multiple_of(every));
        let guard = &self.observers.guard;
        if row_is_due
            || guard.doubts(&stepped)
            || (guard.is_due(step) && guard.suspects(|| self.simulation.kinetic_energy()))
        {
            let seen = self.simulation.observe();
            if !seen.is_finite() {
                if !self.can_go_back() {
                    return Err(self.overflow());
                }
                let fault = self.simulation.fault();
                return self.answer(Some(&fault));
            }
            self.observers.see_energies(&seen)?;
            if self.observers.guard.rule().acts() && self.observers.guard.is_exceeded(step) {
                return self.answer(None);
            }
            if row_is_due {
                self.write_row(seen)?;
            }
        }
        match self.show_frames(before.as_deref()) {
            Err(RunError::Frame(source @ IoError::BadOutput { .. })) => {
                return Err(RunError::Beyond { step, source });
            }
            Err(RunError::Step { step, source }) if source.is_interruption() => {
                self.undo(kept.as_ref(), observed.as_ref())?;
                return Err(RunError::Step { step, source });
            }
            shown => shown?,
        }
        self.save_if_due()?;
        self.report.output_seconds += begin.elapsed().as_secs_f64();
        Ok(())
    }

    /// Returns to what was kept before a step that is abandoned on request.
    fn undo(
        &mut self,
        kept: Option<&Snapshot>,
        observed: Option<&(Snapshots, usize)>,
    ) -> Result<(), RunError> {
        if let Some(kept) = kept {
            let returned = self.simulation.restore(kept);
            returned.map_err(|error| CheckpointError::Unfit(error.to_string()))?;
        }
        if let Some((observed, findings)) = observed {
            self.observers.restore(observed)?;
            self.findings.truncate(*findings);
            self.row = None;
        }
        Ok(())
    }

    /// Shows the states for which frames are due. Those within the last step are interpolated between `before` and now. A request
    /// to end ends it between two of these, with the error of a step that is abandoned.
    fn show_frames(&mut self, before: Option<&[State]>) -> Result<(), RunError> {
        let Self { simulation, observers, .. } = self;
        let (steps, h) = (simulation.steps(), simulation.step_size());
        let next_within = |observers: &Observers| {
            observers.frames.as_ref().filter(|frames| frames.is_within(steps, h)).map(FrameWriter::next_time)
        };
        if let Some(before) = before {
            while let Some(t) = next_within(observers) {
                let asked = simulation.scene().solver.interrupt.check();
                asked.map_err(|cause| RunError::Step {
                    step: steps,
                    source: StepError { t: (steps - 1) as f64 * h, h, cause },
                })?;
                simulation.between(before, t, |simulation| observers.see_frame(simulation))?;
            }
        }
        let is_due = observers.frames.as_ref().is_some_and(|frames| {
            frames.is_due(steps, h) || (simulation.is_done() && frames.ends_with_frame())
        });
        if is_due { observers.see_frame(simulation) } else { Ok(()) }
    }

    /// Writes the state at which a run ends early: a checkpoint, then the row and the frame that were not due.
    fn leave(&mut self) -> Result<(), RunError> {
        let begin = Instant::now();
        // Take the snapshot before the observation: an uninterrupted run, whose bits a continued one must have, does
        // not observe here.
        let now = self.simulation.snapshot();
        let seen = self.simulation.observe();
        if seen.is_finite() {
            self.save_as(now)?;
            if self.observers.history.last_step() < self.simulation.steps() {
                self.write_row(seen)?;
            }
            self.observers.write_last_frame(&self.simulation)?;
        }
        self.report.output_seconds += begin.elapsed().as_secs_f64();
        Ok(())
    }

    fn finish(&mut self, outcome: Outcome) -> Result<(), RunError> {
        self.settle()?;
        // The report takes memory; the run does not go back any more.
        self.good = None;
        let scene = self.simulation.scene();
        if scene.output.chart {
            let title = if scene.title.is_empty() { &self.report.name } else { &scene.title };
            let drawn = super::chart::write(&self.directory, title, self.report.scheme.unwrap_or("statics"));
            drawn.map_err(RunError::output(&self.directory.join("energy.svg")))?;
        }
        self.observers.finish()?;
        self.report.notes.append(&mut self.findings);
        self.observers.report(&self.simulation, &mut self.report);
        if let Some(fault) = self.simulation.mesh_fault() {
            return Err(RunError::Mesh(fault));
        }
        self.report.close(&self.simulation, outcome);
        let path = self.directory.join("report.json");
        self.report.write(&path).map_err(RunError::output(&path))
    }

    /// Reports why the initial state is not finite, with a report but without row and frame.
    fn refuse_start(&mut self) -> RunError {
        let error = self.overflow();
        self.finish(Outcome::Failed(error.to_string())).err().unwrap_or(error)
    }

    /// Returns the error for energies or momenta that are not finite.
    fn overflow(&mut self) -> RunError {
        let cause: SolverError = self.simulation.fault();
        let (t, h) = (self.simulation.time(), self.simulation.step_size());
        RunError::Step { step: self.simulation.steps(), source: StepError { t, h, cause } }
    }
}
