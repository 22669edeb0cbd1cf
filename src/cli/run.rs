//! `variational run`; also how all commands read a scene and report the end of a run.

use std::path::{Path, PathBuf};

use clap::{Args, ValueEnum};

use super::events::{self, Events};
use super::exit;
use super::progress::Progress;
use super::say::{self, Say, message};
use super::signals::Stop;
use super::summary::summary;
use crate::model::all_problems;
use crate::run::checkpoint::{CheckpointError, newest};
use crate::run::claim::ClaimError;
use crate::run::report::{Outcome, Report};
use crate::run::{RunError, Team, Watch, run_by};
use crate::scene::{Parsed, Problem, Scene};

#[derive(Debug, Args)]
pub(super) struct RunArguments {
    /// The scene file
    scene: PathBuf,
    /// Output directory (default: the scene's, else out/<scene>)
    #[arg(long, value_name = "DIRECTORY")]
    out: Option<PathBuf>,
    /// Set a key of the scene, e.g. time.step=0.01
    #[arg(long = "set", value_name = "KEY=VALUE")]
    overrides: Vec<String>,
    /// Number of threads (default: one per core); the results do not depend on it
    #[arg(long)]
    threads: Option<usize>,
    /// Draw the energies over time as energy.svg, like `output.chart = true`
    #[arg(long)]
    chart: bool,
    #[command(flatten)]
    output: RunSay,
}

/// Amount of output of a run.
#[derive(Debug, Args)]
pub(super) struct RunSay {
    #[command(flatten)]
    pub(super) say: Say,
    /// Print what is built, evaluated once and skipped, with reasons; after the run, the work done
    #[arg(long)]
    explain: bool,
    /// Form of the progress: text on standard error, or one JSON object per line on standard output
    #[arg(long, value_enum, default_value_t = ProgressForm::Text, conflicts_with_all = ["json", "explain"])]
    progress: ProgressForm,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum ProgressForm {
    Text,
    Json,
}

impl RunSay {
    /// Returns whether progress and text for a reader are omitted.
    pub(super) fn is_brief(&self) -> bool {
        self.say.is_brief() || self.progress == ProgressForm::Json
    }

    /// Returns the watch of a run with this amount of output.
    pub(super) fn watch<'a>(&self, directory: &'a Path, stop: &Stop) -> Box<dyn Watch + Send + 'a> {
        match self.progress {
            ProgressForm::Text => Box::new(Progress::new(self.is_brief(), self.explain, stop.clone())),
            ProgressForm::Json => Box::new(Events::new(directory, stop.clone())),
        }
    }

    /// Reports that the command ends with this exit code, and returns the code.
    pub(super) fn end(&self, code: u8) -> u8 {
        if self.progress == ProgressForm::Json {
            events::end(code);
        }
        code
    }
}

pub(super) fn run(team: &Team, arguments: &RunArguments) -> u8 {
    arguments.output.end(run_scene(team, arguments))
}

fn run_scene(team: &Team, arguments: &RunArguments) -> u8 {
    let mut overrides = arguments.overrides.clone();
    if arguments.chart {
        overrides.push("output.chart=true".to_owned());
    }
    let scene = match accept(&arguments.scene, &overrides) {
        Ok((scene, _)) => scene,
        Err(code) => return code,
    };
    let stop = Stop::on_signals();
    let pool = match thread_pool(arguments.threads.or(team.threads())) {
        Ok(pool) => pool,
        Err(code) => return code,
    };
    let name = name_of(&arguments.scene);
    let directory = output_directory(&scene, &name, arguments.out.as_deref());
    if let Err(error) = writable(&directory) {
        message!(
            "error: {}: output directory not writable: {error}; choose another with --out",
            directory.display()
        );
        return exit::BAD_INPUT;
    }
    let scene = scene.interruptible(stop.interrupt());
    let mut watch = arguments.output.watch(&directory, &stop);
    let source = (arguments.scene.as_path(), overrides.as_slice());
    let result = pool.install(|| run_by(team, Some(source), scene, &name, &directory, &mut *watch));
    drop(watch);
    match result {
        Err(RunError::Scene(problems)) => refuse(problems, &arguments.scene, &overrides),
        other => conclude(other, &directory, &arguments.output, &stop),
    }
}

/// Largest number of threads accepted on a machine with fewer processors.
const MOST_THREADS: usize = 64;

/// Returns the threads of a command.
pub(super) fn thread_pool(threads: Option<usize>) -> Result<rayon::ThreadPool, u8> {
    let mut pool = rayon::ThreadPoolBuilder::new();
    if let Some(threads) = threads {
        // More threads than processors are useful only in tests, and each uses memory.
        let processors = std::thread::available_parallelism().map_or(1, usize::from);
        let most = MOST_THREADS.max(4 * processors);
        if !(1..=most).contains(&threads) {
            message!(
                "error: --threads must be 1 to {most} on this machine of {processors} processors, is {threads}"
            );
            return Err(exit::BAD_INPUT);
        }
        pool = pool.num_threads(threads);
    }
    pool.build().map_err(|error| {
        message!("error: cannot start threads: {error}");
        exit::INPUT_OUTPUT
    })
}

/// Prints how a run ended; returns the exit code.
pub(super) fn conclude(
    result: Result<Report, RunError>,
    directory: &Path,
    output: &RunSay,
    stop: &Stop,
) -> u8 {
    let report = match result {
        Ok(report) => report,
        Err(RunError::Stopped) => {
            message!("{}", RunError::Stopped);
            return stop.code();
        }
        Err(error) => return fail(&error, directory),
    };
    let report = &report;
    if output.progress == ProgressForm::Text {
        output.say.result(report, || summary(report, directory));
    }
    if let Some(note) = report.lost_symmetry() {
        message!("note: {note}");
    }
    if let Some(note) = report.stopped_short() {
        message!("note: {note}");
    }
    if let Some(warning) = &report.warning {
        message!("warning: {warning}");
    }
    if output.explain {
        say::write_message(format_args!("{}", report.account()));
    }
    for broken in &report.broken {
        message!("assertion broken: {broken}");
    }
    match report.outcome {
        Some(Outcome::Interrupted) => {
            let way_out = match newest(directory) {
                Ok(_) => format!("`variational resume {}` continues from there", directory.display()),
                Err(_) => "without [checkpoint] it cannot be continued".to_owned(),
            };
            message!("note: a signal ended the run after step {}; {way_out}", report.steps);
            stop.code()
        }
        _ if !report.broken.is_empty() => exit::BROKEN,
        _ => exit::DONE,
    }
}

/// Returns the exit code of a command that ends with this error.
pub(super) fn code_of(error: &RunError) -> u8 {
    match error {
        error if error.is_failure() => exit::NO_CONVERGENCE,
        RunError::Scene(_)
        | RunError::Claim(ClaimError::Held { .. })
        | RunError::Unfinished { .. }
        | RunError::Checkpoint(
            CheckpointError::None { .. } | CheckpointError::Changed { .. } | CheckpointError::Newer { .. },
        ) => exit::BAD_INPUT,
        _ => exit::INPUT_OUTPUT,
    }
}

/// Prints why a run failed and where its results are; returns the exit code.
pub(super) fn fail(error: &RunError, directory: &Path) -> u8 {
    message!("error: {error}");
    let code = code_of(error);
    if code == exit::BAD_INPUT {
        return code;
    }
    if error.is_failure() {
        message!("the results so far are in {}", directory.display());
    }
    if let Ok(found) = newest(directory) {
        let path = found.path.display();
        message!(
            "the last good state is {path} (step {}): `variational resume {}` continues from there",
            found.checkpoint.steps(),
            directory.display()
        );
    }
    code
}

/// Reads a scene and the headers of its meshes; prints all problems of both.
pub(super) fn accept(path: &Path, overrides: &[String]) -> Result<(Scene, Parsed), u8> {
    read(path, overrides).map_err(|problems| {
        problems.iter().for_each(|problem| message!("error: {problem}"));
        exit::BAD_INPUT
    })
}

/// Reads a scene and the headers of its meshes; returns all problems, if there are any.
pub(super) fn read(path: &Path, overrides: &[String]) -> Result<(Scene, Parsed), Vec<Problem>> {
    let here = |problem: Problem| Problem { file: Some(path.to_owned()), ..problem };
    let parsed = Scene::read(path, overrides).map_err(|error| {
        let why = match error.kind() {
            std::io::ErrorKind::InvalidData => "it is not UTF-8 text; save it as UTF-8".to_owned(),
            _ => error.to_string(),
        };
        vec![here(Problem::new("", format!("cannot read the scene: {why}")))]
    })?;
    match parsed.scene.clone().filter(|_| parsed.problems.is_empty()) {
        Some(scene) => Ok((scene, parsed)),
        None => Err(all_problems(&parsed).into_iter().map(here).collect()),
    }
}

fn refuse(problems: Vec<Problem>, path: &Path, overrides: &[String]) -> u8 {
    if let Ok(parsed) = Scene::read(path, overrides) {
        print_problems(problems, &parsed, path);
    }
    exit::BAD_INPUT
}

pub(super) fn print_problems(problems: Vec<Problem>, parsed: &Parsed, path: &Path) {
    located(problems, parsed, path).iter().for_each(|problem| message!("error: {problem}"));
}

/// Returns the problems with their lines in the file.
pub(super) fn located(problems: Vec<Problem>, parsed: &Parsed, path: &Path) -> Vec<Problem> {
    let located = |problem| Problem { file: Some(path.to_owned()), ..parsed.locate(problem) };
    problems.into_iter().map(located).collect()
}

/// Returns the name of the scene file without its extension.
pub(super) fn name_of(path: &Path) -> String {
    path.file_stem().map_or_else(|| "scene".to_owned(), |stem| stem.to_string_lossy().into_owned())
}

pub(super) fn output_directory(scene: &Scene, name: &str, out: Option<&Path>) -> PathBuf {
    out.map(Path::to_owned)
        .or_else(|| scene.output.directory.clone())
        .unwrap_or_else(|| Path::new("out").join(name))
}

/// Checks that files can be written into this directory, or into the nearest existing one above it. Leaves no files.
pub(super) fn writable(directory: &Path) -> std::io::Result<()> {
    let existing =
        directory.ancestors().find(|path| path.exists()).filter(|path| !path.as_os_str().is_empty());
    tempfile::tempfile_in(existing.unwrap_or(Path::new("."))).map(|_| ())
}
