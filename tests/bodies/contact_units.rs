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
