//! Runs the program on a scene in a temporary directory and reads the files that it writes.
#![allow(dead_code, reason = "each test binary uses a part of this module")]

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use tempfile::TempDir;

/// A run of the program that has ended.
pub(crate) struct Program {
    directory: TempDir,
    pub(crate) output: Output,
}

impl Program {
    /// Runs a scene that must succeed; `DATA` in it stands for tests/data, `MESHES` for meshes.
    pub(crate) fn run(scene: &str) -> Self {
        Self::run_with(scene, &[])
    }

    /// Runs a scene that must succeed, with further arguments.
    pub(crate) fn run_with(scene: &str, arguments: &[&str]) -> Self {
        let program = Self::try_run(scene, arguments);
        assert!(program.output.status.success(), "{}", program.errors());
        program
    }

    /// Runs a scene on 1, 2 and 8 threads and asserts that all files besides report.json have the same bytes.
    pub(crate) fn assert_same_on_threads(scene: &str) {
        let runs = ["1", "2", "8"].map(|threads| Self::run_with(scene, &["--threads", threads]));
        let mut files: Vec<_> =
            std::fs::read_dir(runs[0].out()).unwrap().map(|entry| entry.unwrap().file_name()).collect();
        files.retain(|file| file != "report.json");
        assert!(files.len() > 3, "{files:?}");
        for file in files {
            let bytes = runs.each_ref().map(|run| std::fs::read(run.out().join(&file)).unwrap());
            assert!(bytes[0] == bytes[1] && bytes[0] == bytes[2], "{file:?} differs");
        }
    }

    /// Runs a scene that may fail.
    pub(crate) fn try_run(scene: &str, arguments: &[&str]) -> Self {
        let directory = TempDir::new().unwrap();
        let path = directory.path().join("scene.toml");
        std::fs::write(&path, with_paths(scene)).unwrap();
        let output = command()
            .current_dir(directory.path())
            .args(["run", "scene.toml"])
            .args(if arguments.contains(&"--out") { &[][..] } else { &["--out", "out"] })
            .args(arguments)
            .output()
            .unwrap();
        Self { directory, output }
    }

    /// Runs `variational check` on a scene.
    pub(crate) fn check(scene: &str) -> Self {
        let directory = TempDir::new().unwrap();
        std::fs::write(directory.path().join("scene.toml"), with_paths(scene)).unwrap();
        let output = command().current_dir(directory.path()).args(["check", "scene.toml"]).output().unwrap();
        Self { directory, output }
    }

    /// Returns the directory in which the program was started.
    pub(crate) fn directory(&self) -> &Path {
        self.directory.path()
    }

    /// Returns the output directory of the program.
    pub(crate) fn out(&self) -> PathBuf {
        self.directory.path().join("out")
    }

    pub(crate) fn errors(&self) -> String {
        String::from_utf8_lossy(&self.output.stderr).into_owned()
    }

    pub(crate) fn code(&self) -> Option<i32> {
        self.output.status.code()
    }

    pub(crate) fn history(&self) -> History {
        History::read(&self.out().join("history.csv"))
    }

    pub(crate) fn report(&self) -> serde_json::Value {
        report_of(&self.out())
    }
}

/// Reads the report.json of a directory.
pub(crate) fn report_of(directory: &Path) -> serde_json::Value {
    serde_json::from_str(&std::fs::read_to_string(directory.join("report.json")).unwrap()).unwrap()
}

fn with_paths(scene: &str) -> String {
    let root = env!("CARGO_MANIFEST_DIR");
    scene.replace("DATA", &format!("{root}/tests/data")).replace("MESHES", &format!("{root}/meshes"))
}

/// Returns a command that starts the program as built for the tests.
pub(crate) fn command() -> Command {
    Command::new(env!("CARGO_BIN_EXE_variational"))
}

/// The contents of history.csv.
pub(crate) struct History {
    names: Vec<String>,
    rows: Vec<Vec<f64>>,
}

impl History {
    pub(crate) fn read(path: &Path) -> Self {
        let text = std::fs::read_to_string(path).unwrap();
        let mut lines = text.lines();
        let names = lines.next().unwrap().split(',').map(str::to_owned).collect();
        let rows = lines.map(|line| line.split(',').map(|value| value.parse().unwrap()).collect()).collect();
        Self { names, rows }
    }

    pub(crate) fn column(&self, name: &str) -> Vec<f64> {
        let i = self.names.iter().position(|n| n == name).unwrap_or_else(|| panic!("no column {name}"));
        self.rows.iter().map(|row| row[i]).collect()
    }

    pub(crate) fn first(&self, name: &str) -> f64 {
        self.column(name)[0]
    }

    pub(crate) fn last(&self, name: &str) -> f64 {
        *self.column(name).last().unwrap()
    }

    /// Returns the largest |H − H₀ − dissipated energy| relative to the largest kinetic energy, of a scene with contact.
    pub(crate) fn imbalance(&self) -> f64 {
        let [total, friction, damping] =
            ["total", "friction", "contact_damping"].map(|name| self.column(name));
        let kinetic = self.column("kinetic").into_iter().fold(0.0, f64::max);
        let kept = |row: usize| total[row] - friction[row] - damping[row];
        (0..total.len()).map(|row| (kept(row) - kept(0)).abs()).fold(0.0, f64::max) / kinetic
    }

    /// Returns the value in the row at time t.
    pub(crate) fn at(&self, name: &str, t: f64) -> f64 {
        let times = self.column("t");
        let nearest =
            (0..times.len()).min_by(|&a, &b| (times[a] - t).abs().total_cmp(&(times[b] - t).abs())).unwrap();
        assert!((times[nearest] - t).abs() < 1e-9, "no row at t = {t}");
        self.column(name)[nearest]
    }
}
