//! Tests steps with a fixed number of solves: they are stable, give no energy, and tell if they stop far from convergence.

use crate::program::Program;

/// Wind that is linearised once per step gives no more energy than it does to a converged step. It blows against a
/// cloth so fast that the cloth moves by several cells per step.
#[test]
fn truncated_steps_are_stable_in_wind() {
    let run = |scheme: &str| {
        let scene = r#"
gravity = [0, 0, -9.81]
[time]
end = 0.3
step = 0.01
scheme = "SCHEME"
[[body]]
name = "cloth"
sheet = { size = [0.6, 0.6], cells = [10, 10] }
material = { law = "st-venant-kirchhoff", young = 1e6, poisson = 0.3, area_density = 0.2, thickness = 5e-4 }
[[fix]]
body = "cloth"
region = "x-min"
[[fix]]
body = "cloth"
region = "x-max"
[wind]
velocity = [0, 0, 6.0]
[guard]
action = "off"
[output]
history = 1
"#;
        Program::run(&scene.replace("SCHEME", scheme))
    };
    let (truncated, converged) = (run("truncated-euler"), run("backward-euler"));
    assert_eq!(truncated.report()["substeps"]["steps_cut"], 0);
    let [truncated, converged] = [truncated, converged].map(|run| run.history().column("total"));
    for (truncated, converged) in truncated.iter().zip(&converged) {
        assert!((truncated - converged).abs() < 0.05, "{truncated} instead of {converged} J");
    }
}

/// Constraints give a truncated step no energy: a rod on a hinge, a box on a ball joint and a cloth on the box fall from rest with steps of
/// many periods of the cloth. With more solves, the motion is that of backward Euler.
#[test]
fn truncated_steps_of_mechanisms_gain_no_energy() {
    let run = |scheme: &str, step: f64, solves: u32| {
        let solves = if solves > 0 { format!("solves = {solves}") } else { String::new() };
        let scene = format!(
            r#"
gravity = [0, 0, -9.81]
[time]
end = 0.6
step = {step}
scheme = "{scheme}"
{solves}
[[rigid]]
name = "rod"
shape = {{ kind = "rod", length = 0.5, radius = 0.02 }}
density = 1000.0
position = [0.25, 0, 0]
[[joint]]
kind = "hinge"
axis = [0, 1, 0]
body = "rod"
point = [0, 0, 0]
[[rigid]]
name = "box"
shape = {{ kind = "box", size = [0.2, 0.1, 0.05] }}
density = 1000.0
position = [0.6, 0, 0]
[[joint]]
kind = "ball"
body = "rod"
to = "box"
point = [0.5, 0, 0]
[[body]]
name = "cloth"
sheet = {{ size = [0.4, 0.1], cells = [8, 2], origin = [0.7, -0.05, 0] }}
material = {{ law = "neo-hookean", young = 2e6, poisson = 0.3, density = 900.0, thickness = 1e-3 }}
[[attach]]
body = "cloth"
region = "x-min"
to = "box"
[guard]
action = "off"
[output]
history = 1
"#
        );
        let run = Program::run(&scene);
        assert_eq!(run.report()["substeps"]["steps_cut"], 0, "{scheme} {step} {solves}");
        run.history()
    };
    for (step, solves) in [(1.0 / 60.0, 2), (1.0 / 60.0, 8), (1.0 / 30.0, 4), (0.1, 8)] {
        let history = run("truncated-euler", step, solves);
        let (total, kinetic) = (history.column("total"), history.column("kinetic"));
        let scale = kinetic.iter().copied().fold(0.0, f64::max);
        for pair in total.windows(2) {
            assert!(pair[1] <= pair[0] + 1e-12 * scale, "{step} s, {solves} solves: {total:?}");
        }
        // The hinge holds the middle of the rod at a distance of .25 m.
        for (x, z) in history.column("rod.x").iter().zip(&history.column("rod.z")) {
            assert!((x.hypot(*z) - 0.25).abs() < 1e-12, "{step} s, {solves} solves: {x} {z}");
        }
    }
    let [few, many] = [("truncated-euler", 200), ("backward-euler", 0)].map(|(scheme, solves)| {
        let history = run(scheme, 2e-3, solves);
        (history.last("total"), history.last("kinetic"))
    });
    assert!((few.0 - many.0).abs() < 1e-3 * many.1, "{few:?} {many:?}");
}

/// Without constraints too, a truncated step gives no energy: a block swings on a spring, with steps from a tenth of its period to half
/// of it. Nor does it lose more than backward Euler needs to lose: with shorter steps and enough solves, less is lost.
#[test]
fn truncated_steps_gain_no_energy_without_constraints() {
    let run = |step: f64, solves: u32, stiffness: f64, length: f64| {
        let run = Program::run(&format!(
            r#"
[time]
end = 1.5
step = {step}
scheme = "truncated-euler"
solves = {solves}
[[body]]
name = "b"
box = {{ size = [0.1, 0.1, 0.1], cells = [1, 1, 1], element = "hex8", origin = [0.95, -0.05, -0.05] }}
material = {{ law = "st-venant-kirchhoff", young = 1.0e5, poisson = 0.3, density = 1000.0 }}
velocity = [0.0, 1.5, 0.0]
[[spring]]
from = {{ body = "b", point = [0.95, -0.05, -0.05] }}
to = {{ point = [0, 0, 0] }}
stiffness = {stiffness}
length = {length}
[guard]
action = "off"
[output]
history = 1
"#
        ));
        run.history()
    };
    for (stiffness, length) in [(5.0, 0.5), (5.0, 0.0), (50.0, 0.5)] {
        for (step, solves) in [(0.5, 4), (0.3, 2), (0.1, 1), (0.1, 2), (0.1, 30)] {
            let history = run(step, solves, stiffness, length);
            let (total, kinetic) = (history.column("total"), history.column("kinetic"));
            let scale = kinetic.iter().copied().fold(0.0, f64::max);
            for pair in total.windows(2) {
                assert!(pair[1] <= pair[0] + 1e-12 * scale, "{step} s, {solves}, {stiffness} N/m: {total:?}");
            }
        }
    }
    let lost = [4e-3, 2e-3, 1e-3].map(|step| {
        let history = run(step, 30, 5.0, 0.5);
        history.first("total") - history.last("total")
    });
    assert!(lost[1] < 0.6 * lost[0] && lost[2] < 0.6 * lost[1] && lost[2] > 0.0, "{lost:?}");
}

/// A stiff cloth looks softer if its solves are too few, and the run says so; of a soft one, for which they suffice, it does not.
#[test]
fn solves_that_stop_far_from_convergence_are_told() {
    for (young, is_short) in [("1e8", true), ("1e5", false)] {
        let scene = r#"
gravity = [0, 0, -9.81]
[time]
end = 0.5
step = 0.0166666666666666667
scheme = "truncated-euler"
[[body]]
name = "flag"
sheet = { size = [0.6, 0.4], cells = [12, 8] }
material = { law = "st-venant-kirchhoff", young = YOUNG, poisson = 0.3, area_density = 0.3, thickness = 1e-3 }
[[fix]]
body = "flag"
region = "x-min"
"#;
        let run = Program::run(&scene.replace("YOUNG", young));
        let report = run.report();
        let (short, steps) = (&report["work"]["stopped_short"], report["steps"].as_u64().unwrap());
        let tells = |text: &str| text.contains("far from convergence") && text.contains("time.solves");
        let is_noted =
            report["notes"].as_array().unwrap().iter().any(|note| note.as_str().is_some_and(tells));
        let is_said = tells(&run.errors());
        assert_eq!([is_noted, is_said], [is_short; 2], "E = {young} Pa: {short} of {steps} steps");
    }
}

/// A free body keeps its linear momentum although all steps stop short of convergence: a block that was stretched tenfold, with steps of
/// many periods.
#[test]
fn truncated_steps_keep_the_linear_momentum_of_free_bodies() {
    let scene = r#"
[time]
end = 0.08
step = 0.02
scheme = "truncated-euler"
solves = 2
[[body]]
name = "block"
box = { size = [1.0, 0.5, 0.5], cells = [4, 2, 2], element = "tet4" }
material = { law = "neo-hookean", young = 5e4, poisson = 0.3, density = 15.0 }
velocity = [30.0, 20.0, -40.0]
displacement = ["9*x + 3*x*x", "0.5*sin(9*x)", "0"]
[output]
history = 1
"#;
    let run = Program::run(scene);
    let report = run.report();
    assert!(report["work"]["stopped_short"].as_u64().unwrap() > 0, "{}", report["work"]);
    let drift = report["momentum"]["relative_linear_drift"].as_f64().unwrap();
    assert!(drift < 1e-13, "{drift:e}");
}
