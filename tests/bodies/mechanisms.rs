//! Tests mechanisms of rigid bodies that move chaotically: a double pendulum of two rods, and a chain.

use crate::program::Program;

/// Describes the double pendulum, which falls from a horizontal line for 30 s.
fn double_pendulum(time: &str, tolerance: f64) -> Program {
    spun_double_pendulum(&format!("end = 30.0\n{time}"), [0.0; 3], tolerance)
}

/// Describes the double pendulum, whose outer rod spins at the start (rad/s).
fn spun_double_pendulum(time: &str, spin: [f64; 3], tolerance: f64) -> Program {
    Program::run(&format!(
        r#"
gravity = [0.0, -9.81, 0.0]
[time]
{time}
[[rigid]]
name = "a"
shape = {{ kind = "rod", length = 1.0, radius = 0.02 }}
density = 1000.0
position = [0.5, 0.0, 0.0]
[[rigid]]
name = "c"
shape = {{ kind = "rod", length = 0.7, radius = 0.02 }}
density = 3000.0
position = [1.35, 0.0, 0.0]
angular_velocity = {spin:?}
[[joint]]
kind = "ball"
body = "a"
point = [0.0, 0.0, 0.0]
[[joint]]
kind = "hinge"
body = "a"
to = "c"
point = [1.0, 0.0, 0.0]
axis = [0.0, 1.0, 1.0]
[output]
history = 1
[solver]
tolerance = {tolerance:e}
"#
    ))
}

/// Adaptive steps follow the fastest turn inside an interval: no step is cut, and the tolerance bounds the drift of energy.
#[test]
fn adaptive_steps_follow_the_turns_of_a_mechanism() {
    for (tolerance, bound) in [(1e-2, 0.2), (1e-4, 2e-3)] {
        let time = format!("scheme = \"implicit-midpoint\"\nstep = \"adaptive\"\ntolerance = {tolerance:e}");
        let report = double_pendulum(&time, 1e-13).report();
        let drift = report["energy"]["relative_drift"].as_f64().unwrap().abs();
        assert!(drift < bound, "tolerance {tolerance:e}: {drift:e}, {}", report["adaptive"]);
        assert_eq!(report["substeps"]["steps_cut"], 0, "tolerance {tolerance:e}: {}", report["adaptive"]);
    }
}

/// A step that had to be cut makes its interval again with twice as many steps, and not again and again because the steps before it
/// were cut.
#[test]
fn a_cut_step_does_not_multiply_the_steps_of_its_interval() {
    let report = Program::run(
        r#"
gravity = [0.0, 0.0, -9.81]
[time]
end = 0.4
step = "adaptive"
tolerance = 0.1
largest_step = 0.02
scheme = "energy-momentum"
[[body]]
name = "sheet"
sheet = { size = [0.6, 0.6], cells = [6, 6] }
material = { law = "st-venant-kirchhoff", young = 1e6, poisson = 0.2, density = 400.0, thickness = 4e-4 }
[[fix]]
body = "sheet"
region = "x-min"
[[rigid]]
name = "tip"
mass = 0.05
inertia = [1e-5, 1e-5, 1e-5]
position = [0.6, 0.6, 0.0]
[[attach]]
body = "sheet"
region = "x-max-y-max"
to = "tip"
"#,
    )
    .report();
    let adaptive = &report["adaptive"];
    assert!(adaptive["steps"].as_u64().unwrap() < 100, "{adaptive}");
    assert_eq!(report["substeps"]["steps_cut"], 0, "{}", report["substeps"]);
}

/// `energy-momentum` keeps the energy of joined bodies to round-off, also if they turn by .2 rad in a step, with three to five
/// iterations per step.
#[test]
fn joints_keep_energy_to_round_off_at_large_turns() {
    let step = "end = 5.0\nscheme = \"energy-momentum\"\nstep = 1e-2";
    // The spin about the axis of the rod leaves the hinge, so it is taken along the axis of the hinge.
    let report = spun_double_pendulum(step, [0.0, 12.0, 12.0], 1e-8).report();
    let drift = report["energy"]["relative_drift"].as_f64().unwrap().abs();
    assert!(drift < 1e-13, "{drift:e}");
    let count = |name: &str| report["work"][name].as_u64().unwrap();
    assert!(count("newton_iterations") < 6 * count("steps"), "{}", report["work"]);
}

/// The cost of an iteration grows with the number of links of a chain, not with its cube: factors of the complete tangent are sparse.
#[test]
fn a_chain_is_solved_with_sparse_factors() {
    let link = |i: usize| {
        let to = if i == 0 { String::new() } else { format!("to = \"l{}\"\n", i - 1) };
        let (centre, joint) = (0.2 * i as f64 + 0.1, 0.2 * i as f64);
        format!(
            r#"
[[rigid]]
name = "l{i}"
shape = {{ kind = "rod", length = 0.2, radius = 0.02 }}
density = 1000.0
position = [{centre:?}, 0.0, 0.0]
[[joint]]
kind = "ball"
body = "l{i}"
{to}point = [{joint:?}, 0.0, 0.0]
"#
        )
    };
    let links: String = (0..12).map(link).collect();
    let report = Program::run(&format!(
        r#"
gravity = [0.0, -9.81, 0.0]
[time]
end = 0.4
step = 5e-3
scheme = "energy-momentum"
{links}
[output]
history = 1
[solver]
tolerance = 1e-9
"#
    ))
    .report();
    let drift = report["energy"]["relative_drift"].as_f64().unwrap().abs();
    assert!(drift < 1e-13, "{drift:e}");
    // Elimination of dense multipliers makes one solve with the model per multiplier and step.
    let count = |name: &str| report["work"][name].as_u64().unwrap();
    assert!(count("solves") <= 6 * count("steps"), "{}", report["work"]);
}
