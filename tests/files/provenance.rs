//! Every JSON file states its origin in one object, and equal runs differ only there and in clock times. Commands draw
//! charts of their results; `run` does so only on request.

use std::path::Path;

use crate::program::command;
use serde_json::Value;

const SCENE: &str = r#"
title = "A <soft> beam"
gravity = [0.0, -9.81, 0.0]
[time]
end = 0.02
step = 1e-3
scheme = "stormer-verlet"
[[body]]
name = "beam"
box = { size = [1.0, 0.2, 0.2], cells = [4, 1, 1], element = "tet4" }
material = { law = "neo-hookean", young = 1e5, poisson = 0.3, density = 1000.0 }
[[fix]]
body = "beam"
region = "x-min"
[[probe]]
name = "tip"
body = "beam"
point = [1.0, 0.1, 0.1]
"#;

/// Runs a command that must succeed, and parses its standard output as JSON.
fn json(directory: &Path, arguments: &[&str]) -> Value {
    let output = command().current_dir(directory).args(arguments).output().unwrap();
    assert!(output.status.success(), "{arguments:?}: {}", String::from_utf8_lossy(&output.stderr));
    serde_json::from_slice(&output.stdout).unwrap()
}

#[test]
fn every_json_file_has_its_provenance_in_one_object() {
    let directory = tempfile::TempDir::new().unwrap();
    let directory = directory.path();
    std::fs::write(directory.join("beam.toml"), SCENE).unwrap();
    for (command, arguments, file) in [
        ("run", &["--out", "run"][..], Some("run/report.json")),
        ("convergence", &["--levels", "2", "--out", "convergence"], Some("convergence/convergence.json")),
        ("modes", &["--count", "3", "--out", "modes"], Some("modes/modes.json")),
        ("bench", &["--budget", "2", "--out", "bench"], Some("bench/bench.json")),
        ("info", &[], None),
    ] {
        let threads = if command == "info" { &[][..] } else { &["--threads", "1"] };
        let words = [&[command, "beam.toml", "--json"], arguments, threads].concat();
        let printed = json(directory, &words);
        let provenance = &printed["provenance"];
        assert_eq!(provenance["scene"], "beam", "{command}");
        assert_eq!(provenance["free_coordinates"], 48, "{command}");
        assert_eq!(provenance["version"], env!("CARGO_PKG_VERSION"), "{command}");
        assert!(provenance["compiler"].as_str().unwrap().starts_with("rustc 1."), "{provenance}");
        assert!(!provenance["processor"].as_str().unwrap().is_empty(), "{provenance}");
        assert!(provenance["date"].as_str().unwrap().ends_with('Z'), "{provenance}");
        let said: Vec<&str> = provenance["command"]
            .as_array()
            .unwrap()
            .iter()
            .skip(1)
            .map(|word| word.as_str().unwrap())
            .collect();
        assert_eq!(said, words, "{command}");
        if let Some(file) = file {
            let text = std::fs::read_to_string(directory.join(file)).unwrap();
            let written: Value = serde_json::from_str(&text).unwrap();
            assert_eq!(written["provenance"], *provenance, "{command}");
        }
    }
    for chart in ["convergence/convergence.svg", "modes/modes.svg", "bench/bench.svg"] {
        let text = std::fs::read_to_string(directory.join(chart)).unwrap();
        assert!(text.starts_with("<svg") && text.ends_with("</svg>\n"), "{chart}");
        let drawn = if chart.starts_with("modes") { "stroke=\"#0072b2\"" } else { "<polyline" };
        assert!(text.contains(drawn), "{chart}");
    }
    let bench = std::fs::read_to_string(directory.join("bench/bench.json")).unwrap();
    let bench: Value = serde_json::from_str(&bench).unwrap();
    assert_eq!(bench["ranked_by"], "processor-time");
    for row in bench["rows"].as_array().unwrap().iter().filter(|row| row["failure"].is_null()) {
        let [wall, processor] = ["seconds", "processor_seconds"].map(|key| row[key].as_f64().unwrap());
        // One thread uses at most one processor; the tolerance covers the resolution of both clocks.
        assert!(processor > 0.0 && processor < 1.5 * wall + 0.05, "{row}");
    }
}

#[test]
fn equal_runs_have_equal_reports_but_for_provenance_and_clock() {
    let directory = tempfile::TempDir::new().unwrap();
    let directory = directory.path();
    std::fs::write(directory.join("beam.toml"), SCENE).unwrap();
    let report = |out: &str, threads: &str| {
        let mut report = json(directory, &["run", "beam.toml", "--json", "--out", out, "--threads", threads]);
        let object = report.as_object_mut().unwrap();
        object.retain(|key, _| key != "provenance" && !key.ends_with("seconds"));
        report
    };
    assert_eq!(report("one", "1"), report("two", "2"));
}

#[test]
fn a_run_draws_its_energies_where_it_is_asked_to() {
    let directory = tempfile::TempDir::new().unwrap();
    let directory = directory.path();
    std::fs::write(directory.join("beam.toml"), SCENE).unwrap();
    json(directory, &["run", "beam.toml", "--json", "--out", "out", "--chart"]);
    let chart = std::fs::read_to_string(directory.join("out/energy.svg")).unwrap();
    for name in ["total", "kinetic", "elastic", "gravity", "A &lt;soft&gt; beam"] {
        assert!(chart.contains(name), "{name}");
    }
    // Without the option the run draws nothing, and removes the chart of an earlier run.
    json(directory, &["run", "beam.toml", "--json", "--out", "out"]);
    assert!(!directory.join("out/energy.svg").exists());
}
