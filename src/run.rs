//! A whole run: steps a simulation to its end and writes what the scene asks for.
//! It must not know the command line; a caller watches through [`Watch`].

use std::io;
use std::path::{Path, PathBuf};
use std::time::Instant;

use vi_core::EnergyLedger;
use vi_solvers::StepError;

use crate::estimate::{Estimator, ProbeEstimate};
use crate::frames::FrameWriter;
use crate::history::{Columns, HistoryWriter};
use crate::momentum::MomentumLedger;
use crate::pitch::PitchFinder;
use crate::report::{Outcome, Report};
use crate::scene::{Problem, Scene};
use crate::simulation::{Observation, Simulation};
use crate::stability::{StabilityNote, stability};

/// Why a run ended before its end.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum RunError {
    /// The scene or its meshes are wrong.
    #[error("{}", list(.0))]
    Scene(Vec<Problem>),
    /// A step failed; what was reached is written.
    #[error("step {step}: {source}")]
    Step {
        /// The step that failed, from 1.
        step: u64,
        /// Why.
        source: StepError,
    },
    /// A file could not be written.
    #[error("{}: {source}", .path.display())]
    Output {
        /// The file or directory.
        path: PathBuf,
        /// What the operating system says.
        source: io::Error,
    },
    /// A mesh file could not be written.
    #[error(transparent)]
    Frame(#[from] vi_io::IoError),
}

fn list(problems: &[Problem]) -> String {
    problems.iter().map(ToString::to_string).collect::<Vec<_>>().join("\n")
}

/// Follows a run. All methods are optional.
pub trait Watch {
    /// The systems are built; what is to be said before the first step.
    fn start(&mut self, _simulation: &Simulation, _notes: &[String]) {}
    /// A step was made. Return false to end the run after it, with everything written.
    fn step(&mut self, _simulation: &Simulation) -> bool {
        true
    }
}

/// Watches nothing.
impl Watch for () {}

/// Runs a scene and writes history.csv, frames and report.json into `directory`.
///
/// The directory is made only once the whole scene has been accepted; what an earlier run wrote
/// there is replaced, nothing else is touched.
///
/// # Errors
/// [`RunError`]; what was reached before the error is written, but for errors of output itself.
pub fn run(scene: Scene, name: &str, directory: &Path, watch: &mut dyn Watch) -> Result<Report, RunError> {
    let begin = Instant::now();
    let simulation = Simulation::new(scene).map_err(RunError::Scene)?;
    Run::start(simulation, name, directory, begin)?.complete(watch)
}

/// A run under way.
struct Run {
    simulation: Simulation,
    directory: PathBuf,
    history: HistoryWriter,
    frames: Option<FrameWriter>,
    ledger: EnergyLedger,
    momentum: MomentumLedger,
    pitch: PitchFinder,
    stability: Option<StabilityNote>,
    iterations: u64,
    estimator: Option<Estimator>,
    estimates: Vec<ProbeEstimate>,
    report: Report,
}

impl Run {
    fn start(
        mut simulation: Simulation,
        name: &str,
        directory: &Path,
        begin: Instant,
    ) -> Result<Self, RunError> {
        let output = |path: &Path| {
            let path = path.to_owned();
            move |source| RunError::Output { path, source }
        };
        let stability = stability(&simulation);
        std::fs::create_dir_all(directory).map_err(output(directory))?;
        clear(directory, name).map_err(output(directory))?;
        let first = simulation.observe();
        let probes: Vec<_> = simulation.scene().probes.iter().map(|probe| probe.name.clone()).collect();
        let has_loads = simulation.components().iter().any(|component| {
            component.system().potentials().iter().any(|term| term.account() == vi_core::Account::Load)
        });
        let path = directory.join("history.csv");
        let mut estimator = simulation.scene().time.estimate.then(|| Estimator::new(&simulation));
        let estimates = estimator.as_mut().and_then(|estimator| estimator.compare(0, &first.probes));
        let columns = Columns { has_loads, has_estimates: estimator.is_some() };
        let mut history = HistoryWriter::create(&path, &probes, columns).map_err(output(&path))?;
        history.write(&first, 0, estimates.as_deref()).map_err(output(&path))?;
        let frames = match simulation.scene().output.interval {
            Some(interval) => {
                let mut frames = FrameWriter::create(directory, name, &simulation, interval)?;
                frames.write(&simulation)?;
                Some(frames)
            }
            None => None,
        };
        let mut report = Report::new(&simulation, name, stability.as_ref());
        report.setup_seconds = begin.elapsed().as_secs_f64();
        Ok(Self {
            ledger: EnergyLedger::new(first.total(), first.kinetic),
            momentum: MomentumLedger::new(&simulation, &first),
            pitch: PitchFinder::new(&simulation.scene().probes, &first),
            directory: directory.to_owned(),
            iterations: 0,
            simulation,
            history,
            frames,
            stability,
            estimator,
            estimates: estimates.unwrap_or_default(),
            report,
        })
    }

    fn complete(mut self, watch: &mut dyn Watch) -> Result<Report, RunError> {
        let mut notes = self.simulation.notes().to_vec();
        notes.extend(self.stability.as_ref().and_then(StabilityNote::warning));
        watch.start(&self.simulation, &notes);
        let every = self.simulation.scene().output.history;
        let mut failure = None;
        let mut interrupted = false;
        while !self.simulation.is_done() {
            let begin = Instant::now();
            let stepped = self.simulation.step();
            self.report.stepping_seconds += begin.elapsed().as_secs_f64();
            match stepped {
                Ok(stepped) => {
                    self.iterations += stepped.iterations;
                    self.ledger.parts += stepped.energy;
                }
                Err(source) => {
                    failure = Some(RunError::Step { step: self.simulation.steps() + 1, source });
                    break;
                }
            }
            let is_last = self.simulation.is_done();
            let begin = Instant::now();
            let step = self.simulation.steps();
            let go_on = watch.step(&self.simulation);
            interrupted = !go_on && !is_last;
            if is_last || interrupted || (every > 0 && step.is_multiple_of(every)) {
                self.observe()?;
            }
            if let Some(frames) = &mut self.frames
                && (frames.is_due(&self.simulation) || is_last || interrupted)
            {
                frames.write(&self.simulation)?;
            }
            self.report.output_seconds += begin.elapsed().as_secs_f64();
            if interrupted {
                break;
            }
        }
        let outcome = match &failure {
            Some(error) => Outcome::Failed(error.to_string()),
            None if interrupted => Outcome::Interrupted,
            None => Outcome::Done,
        };
        if failure.is_some() && every != 1 {
            self.observe()?;
        }
        self.finish(outcome)?;
        match failure {
            Some(error) => Err(error),
            None => Ok(self.report),
        }
    }

    fn observe(&mut self) -> Result<(), RunError> {
        let seen: Observation = self.simulation.observe();
        self.ledger.enter(vi_core::StepEnergy::default(), seen.total(), seen.kinetic);
        self.momentum.enter(&seen);
        self.pitch.enter(&seen);
        let begin = Instant::now();
        let steps = self.simulation.steps();
        let estimates = self.estimator.as_mut().and_then(|estimator| estimator.compare(steps, &seen.probes));
        self.report.estimating_seconds += begin.elapsed().as_secs_f64();
        let result = self.history.write(&seen, std::mem::take(&mut self.iterations), estimates.as_deref());
        if let Some(estimates) = estimates {
            self.estimates = estimates;
        }
        result.map_err(|source| RunError::Output { path: self.directory.join("history.csv"), source })
    }

    fn finish(&mut self, outcome: Outcome) -> Result<(), RunError> {
        let path = self.directory.join("history.csv");
        self.history.flush().map_err(|source| RunError::Output { path, source })?;
        let frame_count = self.frames.as_ref().map_or(0, FrameWriter::count);
        self.report.close(&self.simulation, outcome, frame_count, &self.ledger, &self.momentum, &self.pitch);
        if let Some(estimator) = &self.estimator {
            self.report.estimate(&self.simulation, &self.estimates, estimator.notes());
        }
        let path = self.directory.join("report.json");
        self.report.write(&path).map_err(|source| RunError::Output { path, source })
    }
}

/// Removes what an earlier run wrote into a directory: its history, report, frames and series.
fn clear(directory: &Path, name: &str) -> io::Result<()> {
    for entry in std::fs::read_dir(directory)? {
        let entry = entry?;
        let file = entry.file_name();
        let Some(file) = file.to_str() else { continue };
        let digits = file.strip_prefix("frame_").and_then(|rest| rest.strip_suffix(".vtu"));
        let is_frame = digits.is_some_and(|d| d.len() >= 6 && d.bytes().all(|b| b.is_ascii_digit()));
        let is_ours =
            is_frame || file == "history.csv" || file == "report.json" || file == format!("{name}.pvd");
        if is_ours && entry.file_type()?.is_file() {
            std::fs::remove_file(entry.path())?;
        }
    }
    Ok(())
}
