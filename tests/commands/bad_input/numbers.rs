//! Tests that numbers and amplitudes that are nan or infinite are refused by their names.

use super::{GOOD, change, refused};
use crate::program::Program;

/// How TOML writes numbers that are not finite.
const NOT_FINITE: [&str; 3] = ["nan", "inf", "-inf"];

/// Every number of a scene that uses every table is refused if it is nan or infinite, whatever its key.
#[test]
fn numbers_that_are_not_finite() {
    let scene = r#"
gravity = [0.0, 0.0, -9.81]
[time]
end = 0.1
step = 0.01
scheme = "stormer-verlet"
tolerance = 0.01
[[body]]
name = "a"
box = { size = [1.0, 1.0, 1.0], cells = [1, 1, 1], element = "tet4", origin = [0.5, 0.5, 0.5] }
material = { law = "neo-hookean", young = 1e6, poisson = 0.3, density = 1000.0 }
scale = 1.5
translate = [1.5, 1.5, 1.5]
velocity = [1.5, 1.5, 1.5]
angular_velocity = [1.5, 1.5, 1.5]
[[body]]
name = "s"
sheet = { size = [1.0, 1.0], cells = [1, 1], origin = [5.5, 5.5, 5.5], directions = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]] }
material = { law = "st-venant-kirchhoff", young = 1e6, poisson = 0.3, density = 1000.0, thickness = 0.001 }
[[rigid]]
name = "r"
mass = 1.5
shape = { kind = "rod", length = 0.5, radius = 0.02 }
position = [8.5, 0.5, 0.5]
[[joint]]
kind = "ball"
body = "r"
point = [8.5, 0.5, 0.5]
[[fix]]
body = "a"
box = { min = [-9.5, -9.5, -9.5], max = [9.5, 9.5, 9.5] }
motion = { kind = "sine", amplitude = [0.5, 0.5, 0.5], frequency = 8.5 }
[[spring]]
from = { body = "a", point = [0.5, 0.5, 0.5] }
to = { point = [0.5, 0.5, 0.5] }
stiffness = 10.5
length = 0.5
[[load]]
kind = "pressure"
body = "a"
region = "x-max"
pressure = 10.5
[[strike]]
body = "a"
region = "x-max"
impulse = [0.5, 0.5, 0.5]
[wind]
velocity = [0.5, 0.5, 0.5]
density = 1.5
[damping]
shear_viscosity = 0.5
mass_rate = 0.5
[[probe]]
name = "p"
body = "a"
point = [0.5, 0.5, 0.5]
[solver]
tolerance = 0.001
[output]
interval = 0.05
[checkpoint]
interval = 0.05
[guard]
action = "warn"
bound = 0.05
[assert]
energy_drift = 0.5
momentum_drift = 0.5
angular_momentum_drift = 0.5
"#;
    let problems = |scene: &str| variational::scene::Scene::parse(scene, &[]).problems;
    assert!(problems(scene).is_empty(), "{:?}", problems(scene));
    let is_number = |c: char| c.is_ascii_digit() || ".-+e".contains(c);
    let mut tried = 0;
    for (at, line) in scene.lines().enumerate().filter(|(_, line)| line.contains('=')) {
        for (start, _) in line.match_indices(|c: char| c.is_ascii_digit() || c == '-') {
            let is_start =
                !line[..start].ends_with(|c: char| is_number(c) || c.is_ascii_alphanumeric() || c == '_');
            let number: String = line[start..].chars().take_while(|&c| is_number(c)).collect();
            if !is_start || !number.contains(['.', 'e']) || line[..start].matches('"').count() % 2 == 1 {
                continue;
            }
            for word in NOT_FINITE {
                let changed = format!("{}{word}{}", &line[..start], &line[start + number.len()..]);
                let lines = scene.lines().enumerate();
                let text: Vec<&str> = lines.map(|(i, old)| if i == at { &*changed } else { old }).collect();
                let found = problems(&text.join("\n"));
                // A box that selects nodes may be unbounded: below in `min` and above in `max`.
                let is_bound = line.starts_with("box = { min");
                let is_open = is_bound && word == if line[..start].contains("max") { "inf" } else { "-inf" };
                let is_refused = found.iter().any(|problem| problem.line == Some(at + 1));
                assert_eq!(is_refused, !is_open, "{changed}: {found:?}");
                tried += 1;
            }
        }
    }
    assert!(tried > 200, "{tried}");
}

/// A number that is not finite is named by its key and its value, also in the tables of materials.
#[test]
fn numbers_that_are_not_finite_are_named() {
    change(
        "young = 1e6",
        "young = nan",
        &["scene.toml:9: body[0].material.young: must be a finite number, is NaN"],
    );
    change("density = 1000.0", "density = inf", &["scene.toml:9: body[0].material.density", "is inf"]);
    change("step = 0.01", "step = -inf", &["scene.toml:4: time.step", "is -inf"]);
}

/// An amplitude without a finite value is named with its key, its value and the time: at the start by the check, later by the run.
#[test]
fn amplitudes_that_are_not_finite() {
    let load = |amplitude: &str| {
        format!(
            "{GOOD}[[load]]\nkind = \"traction\"\nbody = \"beam\"\nregion = \"tip\"\ntraction = [1, 0, 0]\n\
             amplitude = \"{amplitude}\"\n"
        )
    };
    for (amplitude, value) in [("sin(t)/t", "NaN"), ("log(-1-t)", "NaN"), ("1/t", "inf")] {
        refused(&load(amplitude), &["scene.toml:18: load[0].amplitude", &format!("is {value} at t = 0 s")]);
    }
    let gravity = format!("gravity = [0, 0, -9.81]\ngravity_amplitude = \"0/0\"\n{GOOD}");
    refused(&gravity, &["scene.toml:2: gravity_amplitude", "is NaN at t = 0 s"]);
    let late = Program::try_run(&load("sqrt(0.05 - t)").replace("step = 0.01", "step = 1e-4"), &[]);
    assert_eq!(late.code(), Some(4), "{}", late.errors());
    let errors = late.errors();
    assert!(errors.contains("load[0]") && errors.contains("amplitude = NaN must be finite"), "{errors}");
    assert!(errors.contains("from t = 0.05") || errors.contains("from t = 0.049"), "{errors}");
    // No state and no shorter step changes this, so that the run neither goes back nor advises another step.
    let report = late.report();
    assert_eq!(report["guard"]["failed_steps"], 0, "{}", report["guard"]);
    assert!(!report["notes"].to_string().contains("Use a step"), "{}", report["notes"]);
}
