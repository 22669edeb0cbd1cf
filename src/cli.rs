//! The command line: parses arguments, prints results, returns exit codes.
//!
//! Exit codes: 0 success, 2 bad input, 3 an assertion of the scene failed, 4 no convergence, 5 input/output error,
//! 128 + n ended by signal n (130 Ctrl-C, 143 SIGTERM, 129 SIGHUP) after all output was written.

mod bench;
mod check;
mod check_frames;
mod convergence;
mod events;
pub(crate) mod exit;
mod frame_planes;
mod info;
mod modes;
mod new;
mod part;
mod progress;
mod resume;
mod run;
mod say;
mod shell;
mod show;
mod signals;
mod stress;
mod study;
mod summary;
mod sweep;

use std::ffi::OsString;
use std::process::ExitCode;

use clap::{CommandFactory, Parser, Subcommand};

use crate::run::Team;
use crate::scene::Scene;

/// Simulates deformable bodies by finite elements and variational time integrators.
#[derive(Debug, Parser)]
#[command(name = "variational", version, about)]
struct Arguments {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Write a starter scene, with the schema by which editors complete its keys
    New(new::NewArguments),
    /// Run a scene and write history.csv, frames and report.json
    Run(run::RunArguments),
    /// Continue a run from its newest checkpoint, with bitwise the same results
    Resume(resume::ResumeArguments),
    /// Show the frames of a run in a window (needs the Python package)
    View(show::ViewArguments),
    /// Draw a frame of a run, also without a display (needs the Python package)
    Picture(show::PictureArguments),
    /// Draw all frames of a run as a film, also without a display (needs the Python package)
    Movie(show::MovieArguments),
    /// Measure schemes and steps on a scene: run time against error, with a recommendation
    Bench(bench::BenchArguments),
    /// Refine the mesh and the step of a scene: observed orders, and estimates of the exact values
    Convergence(convergence::ConvergenceArguments),
    /// Run a scene at every combination of some values, several at the same time; write one table
    Sweep(sweep::SweepArguments),
    /// Run random violent scenes from a seed: each must finish, or fail with a named error
    Stress(stress::StressArguments),
    /// Check scenes and their meshes without running them: report all errors at once
    Check(check::CheckArguments),
    /// Test the frames of a run exactly: does any edge intersect a triangle?
    CheckFrames(check_frames::CheckFramesArguments),
    /// Part a mesh beforehand, so that each rank of a run reads only what it needs
    Part(part::PartArguments),
    /// Compute the lowest vibration modes of a scene; write modes.csv and mode shapes
    Modes(modes::ModesArguments),
    /// Print the JSON schema of a scene
    Schema,
    /// Print the contents of a scene or a mesh
    Info(info::InfoArguments),
    /// Print the script by which a shell completes the command line
    Completions(shell::CompletionsArguments),
    /// Write the manual pages
    Man(shell::ManArguments),
}

/// Runs the program with these arguments (the first is the program's name).
pub fn main(arguments: impl IntoIterator<Item = OsString>) -> ExitCode {
    signals::own_process();
    ExitCode::from(execute(arguments))
}

/// Runs the program as [`main`] does, and returns the exit code as a number, for a process that goes on.
pub fn execute(arguments: impl IntoIterator<Item = OsString>) -> u8 {
    execute_by(&Team::default(), arguments)
}

/// Runs the program as [`execute`] does, on the first rank of a team, and ends the others. They call [`execute_on_other_rank`].
pub fn execute_on_first_rank(team: &Team, arguments: impl IntoIterator<Item = OsString>) -> u8 {
    let code = execute_by(team, arguments);
    team.dismiss(code);
    code
}

/// Obeys the first rank of a team until it ends the program; returns its exit code.
pub fn execute_on_other_rank(team: &Team) -> u8 {
    // The first rank receives the same signals, and ends the run.
    let _stop = signals::Stop::on_signals();
    team.obey()
}

fn execute_by(team: &Team, arguments: impl IntoIterator<Item = OsString>) -> u8 {
    let arguments = match Arguments::try_parse_from(arguments) {
        Ok(arguments) => arguments,
        Err(error) => {
            let is_written = error.print().is_ok() && say::all_is_written();
            return match (error.use_stderr(), is_written) {
                (true, _) => exit::BAD_INPUT,
                (false, true) => exit::DONE,
                (false, false) => exit::INPUT_OUTPUT,
            };
        }
    };
    let takes_ranks = matches!(arguments.command, Command::Run(_) | Command::Resume(_));
    if team.size() > 1 && !takes_ranks {
        say::message!("error: only `run` and `resume` use several ranks: start this command on one");
        return exit::BAD_INPUT;
    }
    let code = match arguments.command {
        Command::New(arguments) => new::run(&arguments),
        Command::Part(arguments) => part::run(&arguments),
        Command::View(arguments) => show::view(&arguments),
        Command::Picture(arguments) => show::picture(&arguments),
        Command::Movie(arguments) => show::movie(&arguments),
        Command::Completions(arguments) => shell::completions(Arguments::command(), &arguments),
        Command::Man(arguments) => shell::man(Arguments::command(), &arguments),
        Command::Run(arguments) => run::run(team, &arguments),
        Command::Resume(arguments) => resume::resume(team, &arguments),
        Command::Stress(arguments) => stress::run(&arguments),
        Command::Sweep(arguments) => sweep::run(&arguments),
        Command::Bench(arguments) => bench::bench_scene(&arguments),
        Command::Convergence(arguments) => convergence::study(&arguments),
        Command::Check(arguments) => check::run(team, &arguments),
        Command::CheckFrames(arguments) => check_frames::run(&arguments),
        Command::Modes(arguments) => modes::modes(&arguments),
        Command::Schema => {
            say::out!("{:#}", Scene::schema());
            exit::DONE
        }
        Command::Info(arguments) => info::info(&arguments),
    };
    let is_lost = !say::all_is_written() && code == exit::DONE;
    if is_lost { exit::INPUT_OUTPUT } else { code }
}
