//! Starts the program on ranks.
//!
//! `MPIEXEC` names the launcher (default `mpiexec`) and its options; `VARIATIONAL_PROGRAM` the program of one process
//! (default: this program without a launcher).

// Each test uses some of these.
#![allow(dead_code)]

pub(crate) mod files;
#[cfg(target_os = "linux")]
pub(crate) mod memory;
pub(crate) mod scenes;

use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};

pub(crate) const PROGRAM: &str = env!("CARGO_BIN_EXE_variational-mpi");

/// The directory of one test.
pub(crate) fn place_of(name: &str) -> PathBuf {
    Path::new(env!("CARGO_TARGET_TMPDIR")).join(name)
}

/// Empties the directory of one test; returns it.
pub(crate) fn room(name: &str) -> PathBuf {
    let room = place_of(name);
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

/// Writes a scene in a directory of its own; returns its path.
pub(crate) fn scene_in(directory: &Path, text: &str) -> PathBuf {
    std::fs::create_dir_all(directory).unwrap();
    scene(directory, text)
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

/// Adds the arguments that run a scene by one thread.
pub(crate) fn to_run<'a>(command: &'a mut Command, scene: &Path, out: &Path) -> &'a mut Command {
    command.arg("run").arg(scene).arg("--out").arg(out).args(["--threads", "1", "--quiet"])
}

pub(crate) fn run(ranks: usize, scene: &Path, out: &Path) -> Output {
    to_run(&mut program(ranks), scene, out).output().unwrap()
}

/// Runs a scene that must come to its end.
pub(crate) fn run_well(ranks: usize, scene: &Path, out: &Path) {
    assert_success(&run(ranks, scene, out), &format!("{ranks} ranks"));
}

/// Starts to run a scene.
pub(crate) fn start(ranks: usize, scene: &Path, out: &Path) -> Child {
    let mut command = program(ranks);
    to_run(&mut command, scene, out).stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap()
}

/// Parts a mesh; returns the index.
pub(crate) fn part(mesh: &Path, pieces: usize, index: PathBuf) -> PathBuf {
    let mut command = Command::new(program_of_one_process());
    command.arg("part").arg(mesh).args(["--parts", &pieces.to_string(), "--quiet", "--out"]).arg(&index);
    assert_success(&command.output().unwrap(), "part");
    index
}

pub(crate) fn assert_success(output: &Output, what: &str) {
    assert!(output.status.success(), "{what}: {}", text(&output.stderr));
}

/// Asserts that a run ended with this exit code and one error, which says all this.
pub(crate) fn assert_one_error(output: &Output, code: Option<i32>, reasons: &[&str]) {
    let message = text(&output.stderr);
    assert_eq!(output.status.code(), code, "{message}");
    assert_eq!(errors(output).len(), 1, "{message}");
    assert!(reasons.iter().all(|reason| message.contains(reason)), "{reasons:?}: {message}");
}

/// Returns the errors that a run has reported.
pub(crate) fn errors(output: &Output) -> Vec<String> {
    text(&output.stderr).lines().filter(|line| line.starts_with("error")).map(str::to_owned).collect()
}

pub(crate) fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}
