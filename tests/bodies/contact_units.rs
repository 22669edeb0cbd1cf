//! Tests that contact of rigid bodies depends neither on the place and orientation of the scene nor on its unit of length.

use crate::program::{Program, command};

/// A floor and a box above it, in units of `unit` (m), turned about z by `angle` (rad) and shifted by `shift` (m) along x.
fn box_over_floor(unit: f64, angle: f64, shift: f64) -> String {
    let (sin, cos) = angle.sin_cos();
    let place = |[x, y, z]: [f64; 3]| {
        let [x, y] = [cos * x - sin * y, sin * x + cos * y];
        format!("[{}, {}, {}]", unit * x + shift, unit * y, unit * z)
    };
    let size = |size: [f64; 3]| format!("{:?}", size.map(|size| unit * size));
    format!(
        r#"
gravity = [0.0, 0.0, -9.81]
[time]
end = 0.01
step = 0.001
scheme = "energy-momentum"
[contact]
[[rigid]]
name = "floor"
shape = {{ kind = "box", size = {} }}
position = {}
orientation = {{ axis = [0.0, 0.0, 1.0], angle = {angle} }}
fixed = true
[[rigid]]
name = "cube"
shape = {{ kind = "box", size = {} }}
density = 800.0
position = {}
orientation = {{ axis = [0.0, 0.0, 1.0], angle = {angle} }}
"#,
        size([0.5, 0.4, 0.02]),
        place([0.1, 0.0, -0.01]),
        size([0.1, 0.08, 0.06]),
        place([0.0, 0.03, 0.08]),
    )
}

/// Returns the stiffness of contact of floor and box, Pa, to four digits.
fn stiffness(scene: &str) -> f64 {
    let directory = tempfile::tempdir().unwrap();
    std::fs::write(directory.path().join("scene.toml"), scene).unwrap();
    let output = command().current_dir(directory.path()).args(["info", "scene.toml"]).output().unwrap();
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    let line = text.lines().find(|line| line.contains("'floor' with 'cube'")).expect(&text).to_owned();
    let words: Vec<&str> = line.split_whitespace().collect();
    let unit = words.iter().position(|word| word.starts_with("Pa")).expect(&line);
    words[unit - 1].parse().expect(&line)
}

/// κ = 10 ρ (g a + 2 g L) depends on lengths within the scene alone, and is proportional to them.
#[test]
fn the_default_stiffness_follows_the_scene() {
    let here = stiffness(&box_over_floor(1.0, 0.0, 0.0));
    let same = |other: f64| (other / here - 1.0).abs() < 2e-3;
    for shift in [-3.0, 50.0] {
        let there = stiffness(&box_over_floor(1.0, 0.0, shift));
        assert!(same(there), "shifted by {shift} m: {there:e} for {here:e} Pa");
    }
    for angle in [0.5, 1.2] {
        let turned = stiffness(&box_over_floor(1.0, angle, 0.0));
        assert!(same(turned), "turned by {angle}: {turned:e} for {here:e} Pa");
    }
    for unit in [10.0, 0.1, 0.01, 0.001] {
        let scaled = stiffness(&box_over_floor(unit, 0.0, 0.0));
        assert!(same(scaled / unit), "in units of {unit} m: {scaled:e} for {here:e} Pa");
    }
}

/// A ball, a cylinder and a box that hit a floor and each other, with all lengths times `unit`.
fn impacts(scheme: &str, unit: f64) -> String {
    let list = |values: [f64; 3]| format!("{:?}", values.map(|value| unit * value));
    format!(
        r#"
gravity = {}
[time]
end = 0.06
step = 0.001
scheme = "{scheme}"
[contact]
friction = 0.4
damping = 0.001
stiffness = {}
distance = {}
[[rigid]]
name = "floor"
shape = {{ kind = "box", size = {} }}
position = {}
fixed = true
[[rigid]]
name = "ball"
shape = {{ kind = "sphere", radius = {} }}
density = 800.0
position = {}
velocity = {}
angular_velocity = [1.0, 2.0, 3.0]
[[rigid]]
name = "can"
shape = {{ kind = "cylinder", radius = {}, length = {} }}
density = 900.0
position = {}
orientation = {{ axis = [1.0, 3.0, 9.0], angle = 1.4 }}
velocity = {}
[[rigid]]
name = "crate"
shape = {{ kind = "box", size = {} }}
density = 900.0
position = {}
orientation = {{ axis = [5.0, 3.0, 9.0], angle = 1.4 }}
velocity = {}
"#,
        list([0.0, 0.0, -9.81]),
        2e5 * unit * unit,
        0.002 * unit,
        list([0.5, 0.5, 0.02]),
        list([0.013, 0.017, -0.01]),
        0.05 * unit,
        list([0.0, 0.0, 0.06]),
        list([0.5, 0.0, -0.5]),
        0.03 * unit,
        0.1 * unit,
        list([0.02, 0.01, 0.17]),
        list([0.0, 0.2, -1.0]),
        list([0.08, 0.06, 0.04]),
        list([-0.08, 0.05, 0.07]),
        list([0.8, -0.2, -1.0]),
    )
}

/// The unit of length is a power of two, so that both runs have the same round-off: histories are equal in their units, and so is the
/// work. Directors of rigid bodies are the only numbers that do not change. One iteration in a hundred may differ.
#[test]
fn small_bodies_take_the_work_of_large_ones() {
    let unit = 1.0 / 128.0;
    for scheme in ["energy-momentum", "backward-euler", "stormer-verlet"] {
        let [large, small] = [1.0, unit].map(|unit| Program::run(&impacts(scheme, unit)));
        for (name, part) in [("searches", 0.0), ("newton_iterations", 0.02), ("path_checks", 0.02)] {
            let [a, b] = [&large, &small].map(|run| run.report()["work"][name].as_f64().unwrap());
            assert!((a - b).abs() <= part * a, "{scheme}, {name}: {a} and {b}");
        }
        let [a, b] = [&large, &small].map(|run| run.report()["substeps"]["substeps"].clone());
        assert_eq!(a, b, "{scheme}");
        let (of_large, of_small) = (large.history(), small.history());
        assert!(of_large.column("pairs").iter().any(|&pairs| pairs > 0.0), "{scheme}");
        for (name, unit) in [("crate.x", unit), ("can.z", unit), ("kinetic", unit.powi(5))] {
            let size = of_large.column(name).iter().fold(0.0_f64, |size, value| size.max(value.abs()));
            for (large, small) in of_large.column(name).iter().zip(of_small.column(name)) {
                assert!((small / unit - large).abs() < 1e-10 * size, "{scheme}, {name}: {large:e} {small:e}");
            }
        }
    }
}

/// A box without friction that tumbles on a floor takes the same iterations and factors whatever its size is: bounds on corrections are
/// lengths, also of the directors of rigid bodies.
#[test]
fn a_tumbling_box_takes_the_same_iterations_at_any_size() {
    let counts = |unit: f64| {
        let list = |values: [f64; 3]| format!("{:?}", values.map(|value| unit * value));
        let program = Program::run(&format!(
            r#"
gravity = {}
[time]
end = 0.5
step = 2e-3
scheme = "energy-momentum"
[contact]
[[rigid]]
name = "box"
shape = {{ kind = "box", size = {} }}
density = 1000.0
position = {}
orientation = {{ axis = [1, 2, 0.5], angle = 0.7 }}
velocity = {}
[[rigid]]
name = "floor"
shape = {{ kind = "plane", normal = [0, 0, 1] }}
fixed = true
"#,
            list([0.0, 0.0, -9.81]),
            list([0.3, 0.2, 0.1]),
            list([0.0, 0.0, 0.3]),
            list([0.5, 0.0, 0.0])
        ));
        let report = program.report();
        let of = |name: &str| report["work"][name].clone();
        (of("newton_iterations"), of("factorizations"), report["substeps"]["steps_cut"].clone())
    };
    let large = counts(1.0);
    for unit in [1.0 / 1024.0, 1.0 / 32.0, 64.0] {
        assert_eq!(counts(unit), large, "{unit} m");
    }
}
