//! A command that is terminated, or whose output nobody reads, loses nothing. A run ended by a signal is written
//! completely and can be resumed. Closed or full standard streams stop no run and make no command panic.
#![cfg(unix)]

use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, Instant};

use crate::program::{command, report_of};

/// This run takes a moment: a hundred thousand steps of one small block.
const SCENE: &str = r#"
gravity = [0.0, 0.0, -9.81]
[time]
end = 10.0
step = 1e-4
scheme = "stormer-verlet"
[[body]]
name = "block"
box = { size = [0.4, 0.2, 0.2], cells = [3, 1, 1], element = "tet4", origin = [0, 0, 0] }
material = { law = "neo-hookean", young = 1e6, poisson = 0.3, density = 1000.0 }
[[fix]]
body = "block"
region = "x-min"
[output]
history = 100
[checkpoint]
interval = 0.01
"#;

/// Returns the scene, shortened to a tenth of a second of simulated time.
fn short() -> String {
    SCENE.replace("end = 10.0", "end = 0.1")
}

fn directory(scene: &str) -> tempfile::TempDir {
    let directory = tempfile::tempdir().unwrap();
    std::fs::write(directory.path().join("scene.toml"), scene).unwrap();
    directory
}

/// Waits until a condition becomes true, and fails after 60 s.
fn wait_for(what: &str, mut condition: impl FnMut() -> bool) {
    let deadline = Instant::now() + Duration::from_secs(60);
    while !condition() {
        assert!(Instant::now() < deadline, "no {what}");
        std::thread::sleep(Duration::from_millis(2));
    }
}

/// Sends a signal twice, as `timeout` does.
fn send(signal: &str, child: &Child) {
    let number = child.id().to_string();
    let sent = Command::new("kill").args(["-s", signal, &number, &number]).status().unwrap();
    assert!(sent.success());
}

fn checkpoints(directory: &Path) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(directory).into_iter().flatten();
    let paths = entries.map(|entry| entry.unwrap().path());
    paths.filter(|path| path.extension().is_some_and(|ending| ending == "vck")).collect()
}

/// Runs the program in a shell that redirects its streams.
fn under_shell(directory: &Path, script: &str) -> Output {
    let script = script.replace("variational", env!("CARGO_BIN_EXE_variational"));
    Command::new("bash").args(["-c", &script]).current_dir(directory).output().unwrap()
}

/// Returns whether this process ignores SIGHUP, as under `nohup`; the program then keeps ignoring it.
fn is_hangup_ignored() -> bool {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let mask = status.lines().find_map(|line| line.strip_prefix("SigIgn:")).unwrap_or("0");
    u64::from_str_radix(mask.trim(), 16).unwrap() & 1 == 1
}

#[test]
fn a_signal_ends_a_run_with_everything_written() {
    for (signal, code) in [("INT", 130), ("TERM", 143), ("HUP", 129)] {
        if signal == "HUP" && is_hangup_ignored() {
            continue;
        }
        let place = directory(SCENE);
        let out = place.path().join("out");
        let mut child = command()
            .current_dir(place.path())
            .args(["run", "scene.toml", "--out", "out"])
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .spawn()
            .unwrap();
        wait_for("checkpoint", || checkpoints(&out).len() > 1);
        send(signal, &child);
        assert_eq!(child.wait().unwrap().code(), Some(code), "SIG{signal}");
        let report = report_of(&out);
        assert_eq!(report["outcome"], "interrupted", "SIG{signal}");
        let steps = report["steps"].as_u64().unwrap();
        assert!(0 < steps && steps < 100_000);
        let newest = out.join(format!("checkpoint_{steps:012}.vck"));
        assert!(newest.exists(), "no checkpoint of step {steps}");
        let history = std::fs::read_to_string(out.join("history.csv")).unwrap();
        let last: f64 = history.lines().last().unwrap().split(',').next().unwrap().parse().unwrap();
        assert!((last - 1e-4 * steps as f64).abs() < 1e-9, "the last row is at {last} s");
    }
}

/// A bench that is terminated releases its directory and reports the interruption, not a budget that was too small.
#[test]
fn a_signal_ends_a_bench() {
    let place = directory(&short());
    let child = command()
        .current_dir(place.path())
        .args(["bench", "scene.toml", "--budget", "1000", "--out", "bench"])
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    wait_for("claim", || place.path().join("bench/variational.lock").exists());
    std::thread::sleep(Duration::from_millis(500));
    send("TERM", &child);
    let output = child.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(143));
    assert!(!place.path().join("bench/variational.lock").exists());
    let said = String::from_utf8([output.stdout, output.stderr].concat()).unwrap();
    assert!(said.contains("interrupt") && !said.contains("budget"), "{said}");
}

/// A stress test that is terminated prints the table of the scenes that it has run.
#[test]
fn a_signal_ends_a_stress_test_with_its_table() {
    let place = tempfile::tempdir().unwrap();
    let said = std::fs::File::create(place.path().join("said")).unwrap();
    let child = command()
        .current_dir(place.path())
        .args(["stress", "--count", "1000000", "--jobs", "1", "--verbose", "--json"])
        .stdout(Stdio::piped())
        .stderr(said)
        .spawn()
        .unwrap();
    let text = || std::fs::read_to_string(place.path().join("said")).unwrap();
    wait_for("scene", || text().lines().count() > 2);
    send("TERM", &child);
    let output = child.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(143));
    let report: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(report["interrupted"], true);
    assert_eq!(report["total"]["scenes"], text().lines().count());
    assert_eq!(report["total"]["forbidden"], 0);
}

#[test]
fn a_run_that_is_not_heard_goes_on() {
    for redirection in
        ["2>&1 | head -1", "2>/dev/full", ">/dev/full 2>&1", ">&- 2>&-", "2> >(exec head -c 1 >/dev/null)"]
    {
        let place = directory(&short());
        let said = under_shell(place.path(), &format!("variational run scene.toml --out out {redirection}"));
        let report = report_of(&place.path().join("out"));
        assert_eq!(report["outcome"], "done", "{redirection}: {said:?}");
        assert_eq!(report["steps"], 1000);
        assert!(!String::from_utf8_lossy(&said.stderr).contains("panicked"), "{redirection}: {said:?}");
    }
}

#[test]
fn output_that_cannot_be_written_is_exit_code_5() {
    let place = directory(&short());
    let status = |script: &str| {
        let output = under_shell(place.path(), script);
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(!said.contains("panicked"), "{script}: {said}");
        output.status.code()
    };
    let mesh = concat!(env!("CARGO_MANIFEST_DIR"), "/meshes/beam.msh");
    for words in [
        "schema",
        "--help",
        "--version",
        "info scene.toml",
        &format!("info {mesh}"),
        "check scene.toml",
        "run scene.toml --out out",
        "run scene.toml --out out --json",
        "resume out",
        "modes scene.toml --out modes",
        "convergence scene.toml --time --levels 2 --out convergence",
        "bench scene.toml --budget 1 --schemes stormer-verlet --out bench",
    ] {
        assert_eq!(status(&format!("variational {words} > /dev/full")), Some(5), "{words}");
        assert_eq!(status(&format!("variational {words} 2> /dev/full > /dev/null")), Some(0), "{words}");
    }
    assert_eq!(status("variational schema | head -1; exit ${PIPESTATUS[0]}"), Some(5));
    // A failed command keeps its own exit code.
    assert_eq!(status("variational check no-such.toml > /dev/full 2>&1"), Some(2));
    assert_eq!(status("variational frobnicate > /dev/full 2>&1"), Some(2));
}

/// The trials of scheme "auto" report their progress, and a signal ends them before anything is written.
#[test]
fn a_signal_ends_the_trials_of_auto() {
    let scene = SCENE.replace("step = 1e-4\nscheme = \"stormer-verlet\"", "scheme = \"auto\"");
    let place = directory(&scene.replace("cells = [3, 1, 1]", "cells = [24, 8, 8]"));
    let said = std::fs::File::create(place.path().join("said")).unwrap();
    let mut child = command()
        .current_dir(place.path())
        .args(["run", "scene.toml", "--out", "out"])
        .stdout(Stdio::null())
        .stderr(said)
        .spawn()
        .unwrap();
    let text = || std::fs::read_to_string(place.path().join("said")).unwrap();
    wait_for("second trial", || text().contains("auto: trial 2"));
    let asked = Instant::now();
    send("TERM", &child);
    assert_eq!(child.wait().unwrap().code(), Some(143));
    assert!(asked.elapsed() < Duration::from_secs(20), "heard after {:?}", asked.elapsed());
    assert!(text().contains("nothing was written"), "{}", text());
    assert!(!place.path().join("out").exists());
}

/// A static scene with a load step that takes so long that a signal arrives during it.
const PRESSED: &str = r#"
[time]
end = 2.0
step = 1.0
[static]
[[body]]
name = "block"
box = { size = [1.0, 1.0, 1.0], cells = [8, 8, 8], element = "hex8" }
material = { law = "neo-hookean", young = 1e6, poisson = 0.3, density = 1000.0 }
[[fix]]
body = "block"
region = "z-min"
[[load]]
kind = "pressure"
body = "block"
region = "z-max"
pressure = 5e4
[output]
interval = 1.0
[checkpoint]
interval = 1.0
"#;

/// A signal within a step does not wait for its end. The step is abandoned, and made again by `resume`.
#[test]
fn a_signal_within_a_step_abandons_it() {
    let place = directory(PRESSED);
    let run = |arguments: &[&str]| {
        let mut command = command();
        command.current_dir(place.path()).args(arguments).stdout(Stdio::null()).stderr(Stdio::null());
        command
    };
    let mut child = run(&["run", "scene.toml", "--out", "out"]).spawn().unwrap();
    let out = place.path().join("out");
    wait_for("checkpoint", || !checkpoints(&out).is_empty());
    send("TERM", &child);
    assert_eq!(child.wait().unwrap().code(), Some(143));
    let report = report_of(&out);
    assert_eq!((&report["outcome"], &report["steps"]), (&"interrupted".into(), &0.into()));
    assert_eq!(checkpoints(&out), [out.join("checkpoint_000000000000.vck")]);
    assert!(run(&["resume", "out"]).status().unwrap().success());
    assert!(run(&["run", "scene.toml", "--out", "whole"]).status().unwrap().success());
    let whole = place.path().join("whole");
    for file in ["history.csv", "scene_000001.vtu", "scene_000002.vtu"] {
        let [parts, whole] = [&out, &whole].map(|directory| std::fs::read(directory.join(file)).unwrap());
        assert!(parts == whole, "{file} differs");
    }
}

/// A signal while the frames within a step are written abandons the step and these frames. Both are made again by `resume`.
#[test]
fn a_signal_between_the_frames_of_a_step_abandons_it() {
    let scene = SCENE
        .replace("end = 10.0", "end = 0.2")
        .replace("step = 1e-4", "step = 0.1")
        .replace("stormer-verlet", "implicit-midpoint")
        .replace("history = 100", "fps = 20000")
        .replace("interval = 0.01", "interval = 0.1");
    let place = directory(&scene);
    let run = |arguments: &[&str]| {
        let mut command = command();
        command.current_dir(place.path()).args(arguments).stdout(Stdio::null()).stderr(Stdio::null());
        command
    };
    let mut child = run(&["run", "scene.toml", "--out", "out"]).spawn().unwrap();
    let out = place.path().join("out");
    wait_for("frame within the first step", || out.join("scene_000010.vtu").exists());
    send("TERM", &child);
    assert_eq!(child.wait().unwrap().code(), Some(143));
    let report = report_of(&out);
    assert_eq!((&report["outcome"], &report["steps"]), (&"interrupted".into(), &0.into()));
    assert!(!out.join("scene_000001.vtu").exists());
    assert!(run(&["resume", "out"]).status().unwrap().success());
    assert!(run(&["run", "scene.toml", "--out", "whole"]).status().unwrap().success());
    let whole = place.path().join("whole");
    for file in ["history.csv", "scene.pvd", "scene_000010.vtu", "scene_004000.vtu"] {
        let [parts, whole] = [&out, &whole].map(|directory| std::fs::read(directory.join(file)).unwrap());
        assert!(parts == whole, "{file} differs");
    }
}

/// A search for modes that is terminated says so, and writes nothing.
#[test]
fn a_signal_ends_a_search_for_modes() {
    let scene = PRESSED.replace("cells = [8, 8, 8]", "cells = [20, 20, 20]");
    let place = directory(&scene);
    let child = command()
        .current_dir(place.path())
        .args(["modes", "scene.toml", "--count", "60", "--out", "modes"])
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    std::thread::sleep(Duration::from_secs(1));
    send("TERM", &child);
    let output = child.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(143));
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(said.contains("nothing was written"), "{said}");
    assert!(!place.path().join("modes/modes.csv").exists());
}
