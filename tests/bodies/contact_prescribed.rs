//! Tests that bodies whose motion is prescribed are seen where they cross: at the start, by assertions, and in notes.

use std::process::Command;

use crate::program::Program;

/// A box that moves down at 1 m/s through a fixed one, from a gap of `gap` (m), and a soft cube far away.
fn through(gap: f64, more: &str) -> String {
    let height = 0.1 + gap;
    format!(
        r#"
[time]
end = 0.1
step = 0.002
scheme = "energy-momentum"
[contact]
{more}
[[rigid]]
name = "still"
shape = {{ kind = "box", size = [0.1, 0.1, 0.1] }}
fixed = true
[[rigid]]
name = "press"
shape = {{ kind = "box", size = [0.1, 0.1, 0.1] }}
position = [0.02, 0.03, {height}]
motion = {{ kind = "translate", velocity = [0, 0, -1.0] }}
[[body]]
name = "cube"
box = {{ size = [0.05, 0.05, 0.05], cells = [1, 1, 1], element = "hex8", origin = [1, 1, 1] }}
material = {{ law = "neo-hookean", young = 1e5, poisson = 0.3, density = 1000.0 }}
"#
    )
}

/// A cube whose clamped face moves through the face of a rising half-space.
fn below(more: &str) -> String {
    format!(
        r#"
[time]
end = 0.1
step = 0.002
scheme = "energy-momentum"
[contact]
{more}
[[body]]
name = "cube"
box = {{ size = [0.05, 0.05, 0.05], cells = [1, 1, 1], element = "hex8", origin = [0, 0, 0.02] }}
material = {{ law = "neo-hookean", young = 1e5, poisson = 0.3, density = 1000.0 }}
[[fix]]
body = "cube"
region = "z-min"
motion = {{ kind = "translate", velocity = [0, 0, -0.3] }}
[[rigid]]
name = "ground"
shape = {{ kind = "plane", normal = [0, 0, 1] }}
motion = {{ kind = "translate", velocity = [0, 0, 0.1] }}
"#
    )
}

const FRAMES: &str = "[output]\ninterval = 0.02\nprecision = \"f64\"\n";

/// Returns the exit code of `check-frames` on the frames of a run, and what it says.
fn check_frames(program: &Program) -> (Option<i32>, String) {
    let mut command = Command::new(env!("CARGO_BIN_EXE_variational"));
    let output = command.arg("check-frames").arg(program.out()).output().expect("the program runs");
    (output.status.code(), String::from_utf8_lossy(&output.stdout).into_owned())
}

#[test]
fn an_assertion_sees_prescribed_bodies_pass_and_names_them() {
    for (assert, said) in
        [("intersections = 0", "intersections are"), ("smallest_gap = 1e-9", "smallest_gap: ")]
    {
        for (scene, bodies) in
            [(through(0.02, ""), ["'still'", "'press'"]), (below(""), ["'cube'", "'ground'"])]
        {
            let program = Program::try_run(&format!("{scene}{FRAMES}[assert]\n{assert}\n"), &[]);
            assert_eq!(program.code(), Some(3), "{assert}: {}", program.errors());
            let broken = program.report()["broken"][0].as_str().unwrap().to_owned();
            assert!(broken.contains(said) && bodies.iter().all(|name| broken.contains(name)), "{broken}");
            let (code, text) = check_frames(&program);
            assert_eq!(code, Some(3), "{text}");
        }
    }
}

#[test]
fn an_assertion_does_not_see_prescribed_bodies_that_stay_apart_or_may_pass() {
    let apart = through(0.2, "");
    let excluded = through(0.02, "exclude = [[\"press\", \"still\"]]");
    let above = below("").replace("[0, 0, -0.3]", "[0, 0, 0.3]");
    for scene in [apart, excluded, above] {
        let program =
            Program::try_run(&format!("{scene}[assert]\nintersections = 0\nsmallest_gap = 1e-9\n"), &[]);
        assert_eq!(program.code(), Some(0), "{}", program.errors());
        assert!(!program.errors().contains("cross at t"), "{}", program.errors());
    }
}

/// The gap of 2 cm closes after 20 ms; the note is given to 1/64 of the run.
#[test]
fn a_note_tells_where_prescribed_bodies_pass() {
    let program = Program::run(&through(0.02, ""));
    let notes = program.report()["notes"].to_string();
    let (_, rest) = notes.split_once("'still' and 'press' cross at t = ").expect(&notes);
    let time: f64 = rest.split_once(' ').expect(rest).0.parse().expect(rest);
    assert!((0.02..=0.02 + 0.1 / 64.0).contains(&time), "{notes}");
    let notes = Program::run(&through(0.2, "")).report()["notes"].to_string();
    assert!(!notes.contains("cross at t"), "{notes}");
}

/// Parts of one obstacle may overlap, which a note says; `resolve` requires a start at which nothing overlaps.
#[test]
fn prescribed_bodies_that_cross_at_the_start_are_named() {
    let assert = "[assert]\nintersections = 0\nsmallest_gap = 1e-9\n";
    let program = Program::run(&format!("{}{assert}", through(-0.05, "")));
    let notes = program.report()["notes"].to_string();
    assert!(notes.contains("'still' and 'press' cross at the start"), "{notes}");
    let excluded = Program::run(&through(-0.05, "exclude = [[\"press\", \"still\"]]"));
    assert!(!excluded.report()["notes"].to_string().contains("cross"));
    let buried = |more: &str| below(more).replace("origin = [0, 0, 0.02]", "origin = [0, 0, -0.01]");
    for (scene, names) in [
        (through(-0.05, "resolve = true"), ["'still'", "'press'"]),
        (buried(""), ["'cube'", "'ground'"]),
        (buried("resolve = true"), ["'cube'", "'ground'"]),
    ] {
        let program = Program::try_run(&scene, &[]);
        let said = program.errors();
        assert_eq!(program.code(), Some(2), "{said}");
        assert!(names.iter().all(|name| said.contains(name)) && said.contains("contact.exclude"), "{said}");
    }
}

/// A table `[contact]` without effect is noted, and one in which two bodies may meet is not.
#[test]
fn contact_in_which_nothing_can_meet_is_noted() {
    let alone = r#"
[time]
end = 0.1
step = 0.01
scheme = "energy-momentum"
[contact]
[[rigid]]
name = "ball"
shape = { kind = "sphere", radius = 0.1 }
density = 1000.0
"#;
    let notes = |scene: &str| Program::run(scene).report()["notes"].to_string();
    assert!(notes(alone).contains("nothing can meet"));
    let wall = alone.to_owned() + &alone[alone.find("[[rigid]]").unwrap()..].replace("ball", "other");
    let apart = wall.replace("\"other\"", "\"other\"\nposition = [1.0, 0.0, 0.0]");
    assert!(!notes(&apart).contains("nothing can meet"));
}

/// Equilibria follow a die that is pressed into a block, by a hundred times its gap in an increment, and dragged.
/// Nodes in its way are taken along, so that increments are not cut to the size of the gap, which took 1114 iterations.
#[test]
fn equilibria_follow_a_die_in_few_increments() {
    let scene = r#"
[time]
end = 1.0
step = 0.5
[static]
[contact]
friction = 0.5
self = false
[[body]]
name = "block"
box = { size = [0.3, 0.3, 0.1], cells = [5, 5, 2], element = "tet4", origin = [0.0, 0.0, 0.0] }
material = { law = "neo-hookean", young = 2e7, poisson = 0.3, density = 1000.0 }
[[fix]]
body = "block"
region = "z-min"
[[rigid]]
name = "die"
shape = { kind = "box", size = [0.06, 0.2, 0.12] }
position = [0.15, 0.15, 0.165]
motion = { kind = "translate", velocity = [0.01, 0.0, -0.015] }
[[probe]]
name = "die"
between = ["block", "die"]
sum = "contact_force"
[output]
ledger = true
"#;
    let program = Program::run(scene);
    let history = program.history();
    let [drag, press] = ["die.fx", "die.fz"].map(|name| history.last(name));
    assert!(press < -1e5 && drag > 0.0 && drag <= 0.5 * press.abs(), "{drag} N, {press} N");
    let iterations = program.report()["work"]["newton_iterations"].as_u64().unwrap();
    assert!(iterations < 400, "{iterations} iterations");
}
