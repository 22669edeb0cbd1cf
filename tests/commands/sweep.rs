//! A sweep writes the same bytes whether it runs on one or two threads, in separate tasks, or is ended by a signal
//! or killed and continued.

use std::path::Path;
use std::process::{Output, Stdio};
use std::time::{Duration, Instant};

use crate::program::command;
use tempfile::TempDir;

const SCENE: &str = r#"
gravity = [0.0, -9.81, 0.0]
[time]
end = 0.2
step = 1e-4
scheme = "stormer-verlet"
[[body]]
name = "beam"
box = { size = [1.0, 0.2, 0.2], cells = [8, 2, 2], element = "tet4" }
material = { law = "neo-hookean", young = 1e6, poisson = 0.3, density = 1000.0 }
[[fix]]
body = "beam"
region = "x-min"
[[probe]]
name = "tip"
body = "beam"
point = [1.0, 0.1, 0.1]
[guard]
action = "warn"
[checkpoint]
interval = 0.02
"#;

/// With the stiffest beam a step of 5 ms is unstable, and a negative step is refused.
const OVER: [&str; 4] =
    ["--over", "body.0.material.young=1e5:1e7:log3", "--over", "time.step=1e-4,5e-5,5e-3,-1.0"];

fn directory() -> TempDir {
    let directory = TempDir::new().unwrap();
    std::fs::write(directory.path().join("scene.toml"), SCENE).unwrap();
    directory
}

fn sweep(directory: &Path, out: &str, arguments: &[&str]) -> std::process::Command {
    let mut command = command();
    command.current_dir(directory).args(["sweep", "scene.toml", "--out", out]).args(OVER).args(arguments);
    command
}

fn whole(directory: &Path, out: &str, arguments: &[&str]) -> Output {
    let output = sweep(directory, out, arguments).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    output
}

fn table(directory: &Path, out: &str) -> String {
    std::fs::read_to_string(directory.join(out).join("sweep.csv")).unwrap()
}

/// Starts a sweep with one job and waits until its second point has begun.
fn begun(directory: &Path, out: &str) -> std::process::Child {
    let mut child = sweep(directory, out, &["--jobs", "1"]).stderr(Stdio::null()).spawn().unwrap();
    let point = directory.join(out).join("point-0001/history.csv");
    let begin = Instant::now();
    while !point.exists() {
        assert!(child.try_wait().unwrap().is_none() && begin.elapsed() < Duration::from_secs(60));
        std::thread::sleep(Duration::from_millis(5));
    }
    child
}

#[test]
fn the_table_is_the_same_however_the_sweep_was_run() {
    let directory = directory();
    let directory = directory.path();
    whole(directory, "one", &["--jobs", "1"]);
    let one = table(directory, "one");

    whole(directory, "two", &["--jobs", "2", "--threads", "2"]);
    assert_eq!(one, table(directory, "two"));

    let first = whole(directory, "tasks", &["--task", "0/2"]);
    assert!(String::from_utf8_lossy(&first.stdout).contains("9 of 12 points are done"), "{first:?}");
    assert!(table(directory, "tasks").contains("not run yet"));
    whole(directory, "tasks", &["--task", "1/2"]);
    assert_eq!(one, table(directory, "tasks"));

    let mut child = begun(directory, "killed");
    child.kill().unwrap();
    child.wait().unwrap();
    whole(directory, "killed", &["--jobs", "2"]);
    assert_eq!(one, table(directory, "killed"));
}

#[cfg(unix)]
#[test]
fn a_signal_ends_a_sweep_cleanly_and_a_second_call_goes_on() {
    let directory = directory();
    let directory = directory.path();
    let mut child = begun(directory, "out");
    let kill = std::process::Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap();
    assert!(kill.success());
    assert_eq!(child.wait().unwrap().code(), Some(130));
    assert!(table(directory, "out").contains("not run yet"));
    // Finished points are not run again.
    let first = directory.join("out/point-0000/history.csv");
    let written = || std::fs::metadata(&first).unwrap().modified().unwrap();
    let before = written();
    whole(directory, "out", &[]);
    assert_eq!(before, written());
    whole(directory, "again", &[]);
    assert_eq!(table(directory, "out"), table(directory, "again"));
}

#[test]
fn rows_are_those_of_the_runs_and_failures_have_their_reasons() {
    let directory = directory();
    let directory = directory.path();
    whole(directory, "out", &[]);
    let text = table(directory, "out");
    let mut lines = text.lines();
    let names: Vec<&str> = lines.next().unwrap().split(',').collect();
    let rows: Vec<Vec<&str>> = lines.map(|line| line.split(',').collect()).collect();
    let at = |name: &str| names.iter().position(|other| *other == name).unwrap();
    assert_eq!(rows.len(), 12);
    let young: Vec<f64> = rows.iter().map(|row| row[at("body.0.material.young")].parse().unwrap()).collect();
    assert_eq!((young[0], young[4], young[8]), (1e5, 1e6, 1e7));
    let exits: Vec<&str> = rows.iter().map(|row| row[at("exit")]).collect();
    assert_eq!(exits[..4], ["0", "0", exits[2], "2"]);
    assert_eq!(exits[8..], ["0", "0", "4", "2"]);
    assert!(rows[3][at("reason")].contains("time.step"), "{:?}", rows[3]);
    assert!(rows[10][at("reason")].contains("step "), "{:?}", rows[10]);
    // The stiffest beam bends least, and a separate run of the same point gives the same row.
    let low = |row: usize| rows[row][at("tip.uy.min")].parse::<f64>().unwrap();
    assert!(low(0).max(low(4)) < low(8) && low(8) < 0.0);
    // Each point records what ran, as every JSON file does, even if it failed.
    for point in ["point-0000", "point-0010"] {
        let text = std::fs::read_to_string(directory.join("out").join(point).join("point.json")).unwrap();
        let record: serde_json::Value = serde_json::from_str(&text).unwrap();
        assert!(
            record["provenance"]["commit"].is_string() && record["provenance"]["free_coordinates"].is_u64()
        );
    }
    let by_hand = command()
        .current_dir(directory)
        .args(["run", "scene.toml", "--out", "hand", "--set", "body.0.material.young=1e6"])
        .output()
        .unwrap();
    assert!(by_hand.status.success());
    let history = std::fs::read_to_string(directory.join("hand/history.csv")).unwrap();
    let last: Vec<&str> = history.lines().last().unwrap().split(',').collect();
    for (name, value) in history.lines().next().unwrap().split(',').zip(last) {
        assert_eq!(rows[4][at(name)], value, "{name}");
    }
    // A key that no scene has is refused before anything is written.
    let wrong = command()
        .current_dir(directory)
        .args(["sweep", "scene.toml", "--out", "wrong", "--over", "time.stepp=1,2"])
        .output()
        .unwrap();
    assert_eq!(wrong.status.code(), Some(2));
    assert!(String::from_utf8_lossy(&wrong.stderr).contains("stepp") && !directory.join("wrong").exists());
}

/// A finished point is run again if a file that its scene reads has changed, including a list of nodes.
#[test]
fn a_changed_list_of_nodes_is_seen() {
    let directory = directory();
    let directory = directory.path();
    let scene =
        SCENE.replace("region = \"x-min\"", "node_file = \"clamp.txt\"").replace("end = 0.2", "end = 0.01");
    std::fs::write(directory.join("scene.toml"), scene).unwrap();
    let after = |nodes: &str, out: &str| {
        std::fs::write(directory.join("clamp.txt"), nodes).unwrap();
        whole(directory, out, &[]);
        table(directory, out)
    };
    let first = after("0 9 18 27 36 45 54 63 72", "out");
    let second = after("0 9", "out");
    assert_eq!(second, after("0 9", "fresh"));
    assert!(first != second);
}

/// A sweep with too many points is refused at once, and so is one whose point is being run by another process.
#[test]
fn sweeps_that_cannot_be_made() {
    let directory = directory();
    let directory = directory.path();
    let said = |arguments: &[&str]| {
        let mut command = command();
        command.current_dir(directory).args(["sweep", "scene.toml", "--out", "out"]).args(arguments);
        let output = command.output().unwrap();
        (output.status.code(), String::from_utf8_lossy(&output.stderr).into_owned())
    };
    let (code, words) = said(&["--over", "time.step=1:2:lin1000000000"]);
    assert!(code == Some(2) && words.contains("2 to 100000 values"), "{words}");
    let keys = ["time.step", "time.end", "body.0.material.young", "body.0.material.density", "gravity"];
    let axes = keys.map(|key| format!("{key}=1:2:lin60000"));
    let (code, words) = said(&axes.each_ref().map(|axis| ["--over", axis.as_str()]).concat());
    assert!(code == Some(2) && words.contains("more than 100000 points"), "{words}");
    // What a later axis sets again has no effect.
    let axis = ["--over", "time.step=1e-4,5e-5"];
    for earlier in [axis, ["--set", "time.step=1e-3"], ["--over", "time.step=1e-3"]] {
        let (code, words) = said(&[earlier, axis].concat());
        assert!(code == Some(2) && words.contains("'time.step' has no effect"), "{words}");
    }
    let part = ["--over", "body[0].material.young=1e5,1e6"];
    let (code, words) = said(&[part, ["--over", "body.0.material={law='linear'}"]].concat());
    assert!(code == Some(2) && words.contains("'body.0.material.young' has no effect"), "{words}");
    let mut child = begun(directory, "out");
    let (code, words) = said(&OVER);
    assert!(code == Some(2) && words.contains(&format!("process {}", child.id())), "{words}");
    child.kill().unwrap();
    child.wait().unwrap();
}
