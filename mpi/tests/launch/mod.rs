//! Starts the program on ranks.
//!
//! `MPIEXEC` names the launcher (default `mpiexec`) and its options; `VARIATIONAL_PROGRAM` the program of one process
//! (default: this program without a launcher).

// Each test uses some of these.
#![allow(dead_code)]

pub(crate) mod files;
#[cfg(target_os = "linux")]
pub(crate) mod memory;

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

pub(crate) const PROGRAM: &str = env!("CARGO_BIN_EXE_variational-mpi");

/// A directory for one test.
pub(crate) fn room(name: &str) -> PathBuf {
    let room = Path::new(env!("CARGO_TARGET_TMPDIR")).join(name);
    let _ = std::fs::remove_dir_all(&room);
    std::fs::create_dir_all(&room).unwrap();
    room
}

/// Writes a scene; returns its path.
pub(crate) fn scene(room: &Path, text: &str) -> PathBuf {
    let path = room.join("scene.toml");
    std::fs::write(&path, text).unwrap();
    path
}

/// Returns the command of the program on `ranks` ranks; 0 for one process without MPI.
pub(crate) fn program(ranks: usize) -> Command {
    if ranks == 0 {
        return Command::new(program_of_one_process());
    }
    let mut command = launcher();
    command.args(["-n", &ranks.to_string(), PROGRAM]);
    command
}

pub(crate) fn program_of_one_process() -> String {
    std::env::var("VARIATIONAL_PROGRAM").unwrap_or_else(|_| PROGRAM.to_owned())
}

pub(crate) fn launcher() -> Command {
    let words = std::env::var("MPIEXEC").unwrap_or_else(|_| "mpiexec".to_owned());
    let mut words = words.split_whitespace();
    let mut command = Command::new(words.next().expect("a launcher"));
    command.args(words);
    command
}

pub(crate) fn run(ranks: usize, scene: &Path, out: &Path) -> Output {
    let mut command = program(ranks);
    command.arg("run").arg(scene).arg("--out").arg(out).args(["--threads", "1", "--quiet"]);
    command.output().unwrap()
}

pub(crate) fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}
