//! Tests that `variational check-frames` judges the frames of a run.

use std::process::Command;

use crate::program::Program;

/// Runs two sheets without contact; at a nonzero speed one of them is thrown at the other. Returns the exit code and the words of
/// `check-frames`.
fn run(speed: f64, more: &str) -> (Option<i32>, String) {
    let scene = format!(
        r#"
[time]
end = 0.1
step = 0.01
scheme = "stormer-verlet"
[[body]]
name = "low"
sheet = {{ size = [1.0, 1.0], cells = [4, 4] }}
material = {{ law = "st-venant-kirchhoff", young = 1e3, poisson = 0.3, density = 1000.0, thickness = 1e-3 }}
[[body]]
name = "high"
sheet = {{ size = [0.5, 0.5], cells = [3, 3], origin = [0.2, 0.2, 0.5] }}
angular_velocity = [1.0, 0.0, 0.0]
velocity = [0.0, 0.0, {speed}]
material = {{ law = "st-venant-kirchhoff", young = 1e3, poisson = 0.3, density = 1000.0, thickness = 1e-3 }}
[output]
interval = 0.05
precision = "f64"
{more}
"#
    );
    let program = Program::run(&scene);
    let output = Command::new(env!("CARGO_BIN_EXE_variational"))
        .arg("check-frames")
        .arg(program.out())
        .output()
        .expect("the program runs");
    (output.status.code(), String::from_utf8_lossy(&output.stdout).into_owned())
}

#[test]
fn crossing_sheets_are_found_and_sheets_apart_are_not() {
    let (code, text) = run(0.0, "");
    assert_eq!(code, Some(0), "{text}");
    assert!(text.contains("3 frames, 0 intersections"), "{text}");
    let (code, text) = run(-5.0, "");
    assert_eq!(code, Some(3), "{text}");
    assert!(text.contains("meets triangle"), "{text}");
}

/// Frames in pieces have the same intersections as whole ones.
#[test]
fn frames_in_pieces_are_judged_like_whole_ones() {
    for speed in [0.0, -5.0] {
        let (code, whole) = run(speed, "");
        for most in [3, 10, 25] {
            let (other, pieces) = run(speed, &format!("piece_points = {most}"));
            assert_eq!(code, other, "{pieces}");
            let count = |text: &str| text.lines().last().map(str::to_owned);
            assert_eq!(count(&whole), count(&pieces), "{most}");
        }
    }
}

#[test]
fn a_directory_without_frames_is_bad_input() {
    let directory = tempfile::tempdir().expect("a directory");
    let output = Command::new(env!("CARGO_BIN_EXE_variational"))
        .arg("check-frames")
        .arg(directory.path())
        .output()
        .expect("the program runs");
    assert_eq!(output.status.code(), Some(2));
    assert!(String::from_utf8_lossy(&output.stderr).contains("no .vtu frames"));
}
