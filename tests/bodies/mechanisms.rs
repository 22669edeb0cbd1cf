//! Tests mechanisms of rigid bodies that move chaotically: a double pendulum of two rods.

use crate::program::Program;

/// Describes the double pendulum, which falls from a horizontal line for 30 s.
fn double_pendulum(time: &str, tolerance: f64) -> Program {
    Program::run(&format!(
        r#"
gravity = [0.0, -9.81, 0.0]
[time]
end = 30.0
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
