//! Tests the interfaces of the command line to other programs: editors, shells, programs that start it, viewers.

use std::path::Path;
use std::process::Output;

use serde_json::Value;

use crate::program::{History, command};

/// Runs a command that must end with this exit code.
fn said(directory: &Path, words: &str, code: i32) -> Output {
    let output = command().current_dir(directory).args(words.split(' ')).output().unwrap();
    let errors = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(code), "{words}: {errors}");
    output
}

fn text(bytes: &[u8]) -> &str {
    std::str::from_utf8(bytes).unwrap()
}

#[test]
fn every_starter_scene_runs_and_editors_find_its_schema() {
    let place = tempfile::tempdir().unwrap();
    let place = place.path();
    let schema: Value = serde_json::from_slice(&said(place, "schema", 0).stdout).unwrap();
    for starter in ["beam", "flag", "static", "drop"] {
        said(place, &format!("new work/{starter} --from {starter} --quiet"), 0);
        let scene = std::fs::read_to_string(place.join(format!("work/{starter}.toml"))).unwrap();
        let first = scene.lines().next().unwrap();
        let file = first.strip_prefix("#:schema ").unwrap();
        let found = std::fs::read_to_string(place.join("work").join(file)).unwrap();
        assert_eq!(serde_json::from_str::<Value>(&found).unwrap(), schema);
        said(place, &format!("check work/{starter}.toml"), 0);
        said(place, &format!("run work/{starter}.toml --set time.end=0.25 --quiet"), 0);
    }
}

#[test]
fn new_replaces_no_file_but_an_older_schema() {
    let place = tempfile::tempdir().unwrap();
    let place = place.path();
    std::fs::write(place.join("variational.json"), r#"{"title": "Scene", "old": true}"#).unwrap();
    let report: Value = serde_json::from_slice(&said(place, "new a.toml --json", 0).stdout).unwrap();
    assert_eq!((&report["scene"], &report["schema"]), (&"a.toml".into(), &"variational.json".into()));
    assert!(!std::fs::read_to_string(place.join("variational.json")).unwrap().contains("\"old\""));
    std::fs::write(place.join("a.toml"), "mine").unwrap();
    assert!(text(&said(place, "new a", 2).stderr).contains("exists"));
    assert_eq!(std::fs::read_to_string(place.join("a.toml")).unwrap(), "mine");
    std::fs::write(place.join("variational.json"), "{}").unwrap();
    assert!(text(&said(place, "new b", 2).stderr).contains("not a schema"));
    assert!(!place.join("b.toml").exists());
}

#[test]
fn progress_as_json_is_what_the_files_say() {
    let place = tempfile::tempdir().unwrap();
    let place = place.path();
    said(place, "new beam", 0);
    let words = "run beam.toml --out out --progress json --set time.end=0.2";
    let output = said(place, words, 0);
    assert_eq!(text(&output.stderr), "");
    let events: Vec<Value> =
        text(&output.stdout).lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    let of = |kind: &str| events.iter().filter(|event| event["event"] == kind).collect::<Vec<_>>();
    let start = of("start")[0];
    assert_eq!(
        (&start["directory"], &start["bodies"], &start["end"]),
        (&"out".into(), &1.into(), &0.2.into())
    );
    assert!(!of("trial").is_empty() && !of("note").is_empty());
    let history = History::read(&place.join("out/history.csv"));
    let last = of("energy").pop().unwrap();
    for column in ["kinetic", "elastic", "gravity", "total"] {
        assert_eq!(last[column].as_f64().unwrap(), history.last(column), "{column}");
    }
    assert_eq!(of("step").pop().unwrap()["step"], start["steps"]);
    let frames = of("frame");
    assert_eq!(frames.len(), 6);
    for frame in frames {
        assert!(place.join(frame["file"].as_str().unwrap()).exists(), "{frame}");
    }
    assert_eq!(events.last().unwrap(), &serde_json::json!({"event": "end", "exit_code": 0}));
    // The last line also reports a run that could not begin.
    let output = said(place, "run no-such.toml --progress json", 2);
    assert_eq!(text(&output.stdout), "{\"event\":\"end\",\"exit_code\":2}\n");
    assert!(text(&output.stderr).contains("no-such.toml"));
    // The files do not depend on the form of the progress.
    said(place, "run beam.toml --out other --quiet --set time.end=0.2", 0);
    for file in ["history.csv", "beam_000003.vtu"] {
        let read = |out: &str| std::fs::read(place.join(out).join(file)).unwrap();
        assert!(read("out") == read("other"), "{file}");
    }
}

#[test]
fn shells_and_man_know_every_command() {
    let place = tempfile::tempdir().unwrap();
    let place = place.path();
    let help = said(place, "--help", 0);
    let list = text(&help.stdout).split("Commands:\n").nth(1).unwrap().split("\n\n").next().unwrap();
    let commands = list.lines().filter_map(|line| line.split_whitespace().next());
    let commands: Vec<&str> = commands.filter(|command| *command != "help").collect();
    assert!(commands.contains(&"run") && commands.contains(&"picture"), "{commands:?}");
    for shell in ["bash", "zsh", "fish", "powershell", "elvish"] {
        let script = said(place, &format!("completions {shell}"), 0).stdout;
        for command in &commands {
            assert!(text(&script).contains(command), "{shell}: {command}");
        }
    }
    said(place, "man pages", 0);
    for command in &commands {
        let page = std::fs::read_to_string(place.join(format!("pages/variational-{command}.1"))).unwrap();
        assert!(page.contains(".TH"), "{command}");
    }
    assert!(std::fs::read_to_string(place.join("pages/variational.1")).unwrap().contains("variational"));
}

#[test]
fn pictures_without_python_say_what_is_missing() {
    let place = tempfile::tempdir().unwrap();
    for words in ["view out", "picture out", "movie out"] {
        let output = command()
            .current_dir(place.path())
            .args(words.split(' '))
            .env("VARIATIONAL_PYTHON", "no-such-python")
            .output()
            .unwrap();
        assert_eq!(output.status.code(), Some(5));
        let errors = text(&output.stderr);
        assert!(errors.contains("no-such-python") && errors.contains("VARIATIONAL_PYTHON"), "{errors}");
    }
}
