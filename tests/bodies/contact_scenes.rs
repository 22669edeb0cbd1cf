//! Tests scenes of scenes/contact that finish within seconds, and fields of contact.
//!
//! Cases H8 and H16 are described in docs/validation-contact.md, with the sources of the numbers.

use crate::program::{History, Program};

/// Runs a scene of scenes/contact, with further arguments; its assertions must hold.
fn run(name: &str, arguments: &[&str]) -> Program {
    let path = format!("{}/scenes/contact/{name}.toml", env!("CARGO_MANIFEST_DIR"));
    Program::run_with(&std::fs::read_to_string(path).unwrap().replace("../../meshes", "MESHES"), arguments)
}

/// Case H8: a smooth cylinder carries the whole weight λ g (2 ℓ + π R) of a strap that hangs over it.
#[test]
fn a_strap_rests_on_a_cylinder_with_all_its_weight() {
    let history = run("strap", &[]).history();
    // The strap consists of 48 chords of half a circle, and of two ends.
    let length = 0.8 + 96.0 * 0.1008 * (std::f64::consts::PI / 96.0).sin();
    let weight = 0.5 * 9.81 * length;
    assert!((history.last("push.fz") / weight - 1.0).abs() < 1e-6, "{}", history.last("push.fz"));
    assert!(history.last("push.fx").abs() < 1e-6 * weight);
}

/// Case H7 by backward Euler in steps of 5 ms: a strap over half a cylinder holds up to e^{μπ} = 2.566 times the pull of its other end.
/// Beyond, it slides with the excess over its drag, 880 N s/m.
#[test]
fn a_strap_holds_up_to_the_ratio_of_the_capstan() {
    let speed = |pull: f64| {
        let load = format!("load.1.force=[0.0, 0.0, -{pull}]");
        let scheme = "time.scheme=\"backward-euler\"";
        let changes = [scheme, "time.step=5e-3", "time.end=1.5", "output.history=10", &load];
        let arguments: Vec<&str> = changes.into_iter().flat_map(|change| ["--set", change]).collect();
        let history = run("capstan", &arguments).history();
        let (t, place) = (history.column("t"), history.column("right.uz"));
        let last = t.len() - 1;
        let before = t.iter().position(|time| *time > t[last] - 0.1).unwrap();
        (place[before] - place[last]) / (t[last] - t[before])
    };
    let (held, sliding) = (speed(2.56), speed(2.63));
    assert!(held.abs() < 1e-6, "{held:e}");
    let excess = 2.63 - (0.3 * std::f64::consts::PI).exp();
    assert!((sliding * 880.0 / excess - 1.0).abs() < 0.03, "{sliding:e}");
}

/// Case H16: the bar of H1 at 64 times the step in which a wave crosses an element, and 30 times the speed. The constants
/// of the layer are unchanged; it does not close, and the energy is kept.
#[test]
fn a_hard_blow_in_large_steps_closes_no_gap() {
    let program = run("bar-impact-large-step", &["--set", "time.end=0.30360"]);
    let history: History = program.history();
    let (total, p) = (history.column("total"), history.column("px"));
    assert!(total.iter().all(|energy| (energy / total[0] - 1.0).abs() < 1e-9), "{total:?}");
    assert!(history.column("smallest_gap").iter().all(|&gap| gap > 0.0));
    assert!(history.column("pairs").iter().any(|&pairs| pairs > 0.0));
    assert!(p[0] < 0.0 && *p.last().unwrap() > 0.0);
}

/// One ball comes in and one ball goes out, as high as the first one started.
#[test]
fn a_cradle_passes_its_momentum_on() {
    let history = run("newtons-cradle", &["--set", "time.end=0.75", "--set", "output.history=50"]).history();
    let last = |ball: usize| history.last(&format!("ball {ball}.x"));
    for ball in 1..5 {
        assert!((last(ball) - 0.062 * (ball - 1) as f64).abs() < 5e-3, "{ball}: {}", last(ball));
    }
    let highest = history.column("ball 5.z").into_iter().fold(f64::NEG_INFINITY, f64::max);
    let fall = 0.5 - 0.75_f64.sqrt() * 0.5;
    assert!(((highest + 0.5) / fall - 1.0).abs() < 0.02, "{highest}");
}

/// The field `slip` is the velocity with which surfaces slide over each other: at first that of a ball that slides at
/// 2 m/s, and zero once it rolls, although it still moves at 1.43 m/s.
#[test]
fn slip_vanishes_when_a_ball_rolls() {
    let history = Program::run(
        r#"
gravity = [0.0, 0.0, -9.81]
[time]
end = 0.12
step = 5e-4
scheme = "energy-momentum"
[contact]
friction = 0.9
damping = 1e-3
[[body]]
name = "pad"
box = { size = [1.0, 0.4, 0.1], cells = [10, 4, 1], element = "hex8", origin = [-0.2, -0.2, -0.1] }
material = { law = "linear", young = 1e8, poisson = 0.3, density = 1000.0 }
[[fix]]
body = "pad"
region = "box"
[[rigid]]
name = "ball"
shape = { kind = "sphere", radius = 0.1 }
density = 1000.0
position = [0.0, 0.01, 0.1018]
velocity = [2.0, 0, 0]
[[probe]]
name = "pad"
body = "pad"
max = "slip.magnitude"
"#,
    )
    .history();
    let (slip, momentum) = (history.column("pad.max.slip.magnitude"), history.column("px"));
    let mass = momentum[0] / 2.0;
    let largest = slip.iter().copied().fold(0.0, f64::max);
    assert!((1.8..2.0 + 1e-9).contains(&largest), "{largest}");
    let last = slip.len() - 1;
    assert!(slip[last] < 1e-2 && momentum[last] / mass > 1.4, "{} {}", slip[last], momentum[last] / mass);
}

/// Two cards at rest that lean on each other slide by a few nanometres in a step, in a layer of 40 µm, while Newton's
/// corrections may be longer. If these corrections are solved only to a fraction of their own length, the error closes the
/// gaps, and a step takes 570 iterations; if the forces are solved for, it takes 60.
#[test]
fn corrections_are_solved_as_accurately_as_gaps_are_small() {
    let report = run("cards", &["--set", "time.end=0.02"]).report();
    let iterations = report["work"]["newton_iterations"].as_u64().unwrap();
    assert!(iterations < 20 * 150, "{iterations}");
}

/// `info` lists each pair of bodies with the constants of its contact, or the reason why it is not searched.
#[test]
fn info_lists_the_pairs_that_can_meet() {
    let path = format!("{}/scenes/contact/gripper.toml", env!("CARGO_MANIFEST_DIR"));
    let output = crate::program::command().args(["info", &path, "--json"]).output().unwrap();
    let facts: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    let pairs = facts["contact"].as_array().unwrap();
    // A ball, two fingers and a table: ten pairs with those of a body with itself.
    assert_eq!(pairs.len(), 10);
    let searched: Vec<_> = pairs.iter().filter(|pair| pair["skipped"].is_null()).collect();
    assert_eq!(searched.len(), 4, "{searched:?}");
    for pair in searched {
        assert_eq!(pair["between"][0], "ball");
        assert_eq!(pair["friction"], 0.8);
        // d̂ is at most 0.01 of the thickness of a finger or the table, 20 mm; κ is a tenth of Young's modulus.
        assert!(pair["distance"].as_f64().unwrap() <= 5e-3 && pair["stiffness"] == 3e3, "{pair}");
    }
}

/// A cloth falls on a ball, drapes and crumples in steps of twice the longest stable one. Schemes that minimise a function in each step
/// seldom divide it, if Newton's method uses the whole positive part of the Hessian. With the normal stiffness alone, and with steps
/// given up for their estimated cost, there were 342 and 481 parts.
#[test]
fn large_steps_of_a_cloth_on_a_ball_are_seldom_divided() {
    const STEPS: u64 = 60;
    for scheme in ["backward-euler", "newmark"] {
        let scene = format!(
            r#"
gravity = [0.0, 0.0, -9.81]
[time]
end = 0.3
step = 5e-3
scheme = "{scheme}"
[contact]
[[body]]
name = "cloth"
sheet = {{ size = [1.0, 1.0], cells = [12, 12], origin = [-0.5, -0.5, 0.02] }}
material = {{ law = "st-venant-kirchhoff", young = 1e5, poisson = 0.3, area_density = 0.2, thickness = 1e-3, bending = "none" }}
[[rigid]]
name = "ball"
shape = {{ kind = "sphere", radius = 0.3 }}
position = [0.0, 0.0, -0.3]
fixed = true
[assert]
intersections = 0
"#
        );
        let work = &Program::run(&scene).report()["work"];
        let (parts, iterations) =
            (work["steps"].as_u64().unwrap(), work["newton_iterations"].as_u64().unwrap());
        assert!(parts < 3 * STEPS && iterations < 25 * STEPS, "{scheme}: {parts} parts, {iterations}");
    }
}

/// A ball of 20 kg on a clamped sheet. Few of its steps need bristles that are soft at first. When each step that needed them made
/// the next one begin with them too, 31 of 92 did.
#[test]
fn few_steps_under_a_heavy_ball_need_soft_bristles() {
    let fixed = ["x-min", "x-max", "y-min", "y-max"];
    let fixed = fixed.map(|region| format!("[[fix]]\nbody = \"sheet\"\nregion = \"{region}\"\n")).concat();
    let scene = format!(
        r#"
gravity = [0.0, 0.0, -9.81]
[time]
end = 0.14
step = 2e-3
scheme = "energy-momentum"
[contact]
friction = 0.3
[[body]]
name = "sheet"
sheet = {{ size = [0.4, 0.4], cells = [12, 12], origin = [-0.2, -0.2, 0.0] }}
material = {{ law = "st-venant-kirchhoff", young = 1e6, poisson = 0.3, area_density = 0.1, thickness = 1e-3, bending = "hinge" }}
{fixed}
[[rigid]]
name = "ball"
shape = {{ kind = "sphere", radius = 0.06 }}
position = [0.0, 0.0, 0.065]
mass = 20.0
[assert]
intersections = 0
"#
    );
    let work = &Program::run(&scene).report()["work"];
    let (steps, softenings) = (work["steps"].as_u64().unwrap(), work["softenings"].as_u64().unwrap());
    assert!(softenings > 0 && 5 * softenings < steps, "{softenings} of {steps}");
}
