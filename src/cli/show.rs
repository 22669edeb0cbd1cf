//! `variational view`, `picture` and `movie`: show the frames of a run. The Python package `variational-sim` draws them
//! with pyvista; this file starts it.

use std::path::{Path, PathBuf};
use std::process::{Command, ExitStatus};

use clap::Args;
use serde::Serialize;

use super::exit;
use super::say::{Say, message, out};
use crate::run::provenance::Provenance;

/// Environment variable that names the Python; the command of the Python package sets it.
const PYTHON: &str = "VARIATIONAL_PYTHON";

/// Draws, or exits with [`NO_PACKAGE`]. The package itself reports all other errors.
const PROGRAM: &str = "\
import importlib.util, sys
if importlib.util.find_spec('variational_sim') is None:
    sys.exit(99)
from variational_sim.view import main
sys.exit(main(sys.argv[1:]))";

/// Exit code of [`PROGRAM`] where the package is not installed.
const NO_PACKAGE: i32 = 99;

#[derive(Debug, Args)]
pub(super) struct ViewArguments {
    /// The output directory of a run
    directory: PathBuf,
    #[command(flatten)]
    look: Look,
}

#[derive(Debug, Args)]
pub(super) struct PictureArguments {
    /// The output directory of a run
    directory: PathBuf,
    /// The file to write, .png or .jpg (default: picture.png in the directory)
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Number of the frame, from 0; from the last one back with -1, -2 …
    #[arg(long, default_value_t = -1, allow_negative_numbers = true)]
    frame: i64,
    #[command(flatten)]
    look: Look,
}

#[derive(Debug, Args)]
pub(super) struct MovieArguments {
    /// The output directory of a run
    directory: PathBuf,
    /// The file to write, .mp4, .gif or, with its geometry, .usdc or .usda (default: movie.mp4 in the directory)
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Frames per second of the film
    #[arg(long, default_value_t = 25.0)]
    fps: f64,
    #[command(flatten)]
    look: Look,
}

/// How bodies are drawn.
#[derive(Debug, Args)]
struct Look {
    /// Field of the frames that colours the bodies; "none" for one colour
    #[arg(long, default_value = "displacement")]
    scalars: String,
    /// Width and height in pixels
    #[arg(long, default_value = "1024x768", value_name = "WIDTHxHEIGHT")]
    size: String,
    #[command(flatten)]
    say: Say,
}

#[derive(Serialize)]
struct Shown<'a> {
    provenance: Provenance,
    directory: &'a Path,
    /// The file that was written.
    file: Option<&'a Path>,
}

pub(super) fn view(arguments: &ViewArguments) -> u8 {
    draw("view", &arguments.directory, None, &[], &arguments.look)
}

pub(super) fn picture(arguments: &PictureArguments) -> u8 {
    let out = arguments.out.clone().unwrap_or_else(|| arguments.directory.join("picture.png"));
    let options = [format!("--frame={}", arguments.frame)];
    draw("picture", &arguments.directory, Some(&out), &options, &arguments.look)
}

pub(super) fn movie(arguments: &MovieArguments) -> u8 {
    let out = arguments.out.clone().unwrap_or_else(|| arguments.directory.join("movie.mp4"));
    let options = [format!("--fps={}", arguments.fps)];
    draw("movie", &arguments.directory, Some(&out), &options, &arguments.look)
}

fn draw(command: &str, directory: &Path, out: Option<&Path>, options: &[String], look: &Look) -> u8 {
    let python = std::env::var_os(PYTHON).unwrap_or_else(|| "python3".into());
    let look_options = [format!("--scalars={}", look.scalars), format!("--size={}", look.size)];
    let ended = Command::new(&python)
        .args(["-c", PROGRAM, command])
        .arg(directory)
        .args(out)
        .args(options)
        .args(look_options)
        .status();
    let python = Path::new(&python).display();
    match ended.as_ref().map(ExitStatus::code) {
        Ok(Some(0)) => {
            let provenance = Provenance::new(&super::run::name_of(directory), 0);
            look.say.result(&Shown { provenance, directory, file: out }, || {
                if let Some(file) = out {
                    out!("written to {}", file.display());
                }
            });
            exit::DONE
        }
        Ok(Some(NO_PACKAGE)) => {
            message!(
                "error: `variational {command}` draws with the Python package variational-sim, which {python} does not \
                 have: `pip install 'variational-sim[view]'`, or name another Python in {PYTHON}"
            );
            exit::INPUT_OUTPUT
        }
        // The package has reported the error.
        Ok(Some(2)) => exit::BAD_INPUT,
        Ok(_) => exit::INPUT_OUTPUT,
        Err(error) => {
            message!(
                "error: `variational {command}` draws with Python, and {python} cannot be started: {error}; name a \
                 Python in {PYTHON}"
            );
            exit::INPUT_OUTPUT
        }
    }
}
