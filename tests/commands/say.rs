//! `--json` and `--quiet` mean the same for every command: standard output holds one JSON document or nothing. Errors
//! and warnings go to standard error under both, and exit codes do not change.

use std::path::Path;

use serde_json::Value;

use crate::program::command;

const SCENE: &str = r#"
gravity = [0.0, 0.0, -9.81]
[time]
end = 0.02
step = 1e-3
scheme = "stormer-verlet"
[[body]]
name = "block"
box = { size = [0.4, 0.2, 0.2], cells = [2, 1, 1], element = "tet4" }
material = { law = "neo-hookean", young = 1e6, poisson = 0.3, density = 1000.0 }
[[fix]]
body = "block"
region = "x-min"
[output]
interval = 0.01
[checkpoint]
interval = 0.01
"#;

/// Runs a command and returns its exit code, standard output and standard error.
fn said(directory: &Path, words: &str, option: &str) -> (Option<i32>, String, String) {
    let words = words.split(' ').chain([option]).filter(|word| !word.is_empty());
    let output = command().current_dir(directory).args(words).output().unwrap();
    let text = |bytes| String::from_utf8(bytes).unwrap();
    (output.status.code(), text(output.stdout), text(output.stderr))
}

#[test]
fn json_and_quiet_mean_the_same_for_every_command() {
    let place = tempfile::tempdir().unwrap();
    let place = place.path();
    std::fs::write(place.join("scene.toml"), SCENE).unwrap();
    for (words, code) in [
        ("run scene.toml --out out", 0),
        ("resume out", 0),
        ("check scene.toml", 0),
        ("check scene.toml --set time.step=-1", 2),
        ("check scene.toml no-such.toml", 2),
        ("check-frames out", 0),
        ("info scene.toml", 0),
        ("info scene.toml --matrices matrices", 0),
        ("info out/scene_000000.vtu", 0),
        ("part out/scene_000000.vtu --parts 1 --out block.parted", 0),
        ("info block.parted", 0),
        ("modes scene.toml --count 2 --out modes", 0),
        ("convergence scene.toml --time --levels 2 --out convergence", 0),
        ("bench scene.toml --budget 1 --schemes stormer-verlet --out bench", 0),
        ("sweep scene.toml --over time.step=1e-3,5e-4 --out sweep", 0),
        ("stress --count 2", 0),
    ] {
        let (end, json, errors) = said(place, words, "--json");
        assert_eq!(end, Some(code), "{words}: {errors}");
        let document: Value =
            serde_json::from_str(&json).unwrap_or_else(|error| panic!("{words}: {error}: {json}"));
        assert!(document["provenance"]["version"].is_string(), "{words}: {document}");
        let (end, out, quiet_errors) = said(place, words, "--quiet");
        assert_eq!((end, out.as_str()), (Some(code), ""), "{words}");
        // Standard error holds no progress lines.
        for line in errors.lines().chain(quiet_errors.lines()) {
            let is_message = ["error: ", "warning: ", "note: "].iter().any(|kind| line.starts_with(kind));
            assert!(is_message, "{words}: {line}");
        }
        let (end, out, _) = said(place, words, "");
        assert_eq!(end, Some(code), "{words}");
        assert_eq!(out.is_empty(), words.ends_with("step=-1"), "{words}: {out}");
        assert!(serde_json::from_str::<Value>(&out).is_err(), "{words}: {out}");
    }
}

/// Notes that are known only at the end of a run are printed under `--quiet` too.
#[test]
fn quiet_prints_the_notes_at_the_end() {
    let place = tempfile::tempdir().unwrap();
    let place = place.path();
    // The impact inverts elements in a whole step, so that it is cut.
    let struck = SCENE
        .replace("step = 1e-3", "step = 2e-3")
        .replace("stormer-verlet", "implicit-midpoint")
        .replace("cells = [2, 1, 1]", "cells = [4, 2, 2]")
        .replace(
            "[[fix]]\nbody = \"block\"\nregion = \"x-min\"",
            "[[strike]]\nbody = \"block\"\nregion = \"x-min\"\nimpulse = [300.0, 0.0, 0.0]",
        );
    std::fs::write(place.join("struck.toml"), struck).unwrap();
    for option in ["--quiet", "--json", ""] {
        let (code, _, errors) = said(place, "run struck.toml --out out", option);
        assert_eq!(code, Some(0), "{errors}");
        let note = errors.lines().find(|line| line.starts_with("note: ") && line.contains("steps were cut"));
        assert!(note.is_some_and(|note| note.contains("run backwards")), "{option}: {errors}");
    }
}

#[test]
fn check_names_every_problem_in_json() {
    let place = tempfile::tempdir().unwrap();
    let place = place.path();
    std::fs::write(place.join("good.toml"), SCENE).unwrap();
    std::fs::write(place.join("bad.toml"), SCENE.replace("young = 1e6", "young = -1e6")).unwrap();
    let (code, out, errors) = said(place, "check good.toml bad.toml gone.toml", "--json");
    assert_eq!(code, Some(2));
    let report: Value = serde_json::from_str(&out).unwrap();
    let scenes = report["scenes"].as_array().unwrap();
    let sound: Vec<bool> = scenes.iter().map(|scene| scene["is_sound"].as_bool().unwrap()).collect();
    assert_eq!(sound, [true, false, false]);
    let problem = &scenes[1]["problems"][0];
    assert_eq!(problem["key"], "body[0].material", "{problem}");
    assert_eq!(problem["line"], 10, "{problem}");
    // Standard error repeats these problems.
    for scene in scenes {
        for problem in scene["problems"].as_array().unwrap() {
            assert!(errors.contains(problem["message"].as_str().unwrap()), "{problem}: {errors}");
        }
    }
}
