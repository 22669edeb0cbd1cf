//! Solves linear systems by PETSc on 1 to 4 ranks, and compares the results with those of our own conjugate gradients.
#![cfg(feature = "petsc")]

mod launch;

use std::path::Path;

use launch::{program, room, run, scene, text, to_run};

/// A block of 41 472 tetrahedra that bends under its weight.
const BENDS: &str = r#"
gravity = [0.0, 0.0, -9.81]
[time]
end = 1.0
step = 1.0
[static]
[[body]]
name = "block"
box = { size = [4.0, 1.0, 1.0], cells = [48, 12, 12], element = "tet4" }
material = { law = "neo-hookean", young = 1e6, poisson = 0.3, density = 100.0 }
[[fix]]
body = "block"
region = "x-min"
[[probe]]
name = "tip"
body = "block"
point = [4.0, 1.0, 1.0]
[output]
interval = 1.0
[solver]
linear = "petsc"
tolerance = 1e-9
"#;

const ROLLS: &str = r#"
gravity = [3.0, -9.81, 0.0]
[time]
end = 0.012
step = 4e-3
substeps = false
scheme = "implicit-midpoint"
[[body]]
name = "block"
box = { size = [1.0, 0.25, 0.25], cells = [48, 12, 12], element = "tet4" }
material = { law = "neo-hookean", young = 1e7, poisson = 0.3, density = 1000.0 }
[[fix]]
body = "block"
region = "x-min"
axes = ["x"]
[[fix]]
body = "block"
region = "y-min"
axes = ["y"]
[[fix]]
body = "block"
region = "z-min"
axes = ["z"]
[[probe]]
name = "tip"
body = "block"
point = [1.0, 0.25, 0.25]
[output]
history = 1
[solver]
linear = "petsc"
tolerance = 1e-9
"#;

/// A column of 1.5 times the weight under which it buckles, nearly upright: the smaller its weight across, the longer its tangents
/// stay indefinite.
const BUCKLES: &str = r#"
gravity = [0.01, 0.0, -9.81]
[time]
end = 1.0
step = 0.5
[static]
[[body]]
name = "column"
box = { size = [0.1, 0.1, 1.0], cells = [2, 2, 16], element = "hex8" }
material = { law = "neo-hookean", young = 1e6, poisson = 0.3, density = 1000.0 }
[[fix]]
body = "column"
region = "z-min"
[[probe]]
name = "tip"
body = "column"
point = [0.1, 0.1, 1.0]
[output]
interval = 1.0
[solver]
linear = "petsc"
tolerance = 1e-9
"#;

/// Returns the last row of history.csv by the names of its columns.
fn last_row(directory: &Path) -> Vec<(String, f64)> {
    let history = std::fs::read_to_string(directory.join("history.csv")).unwrap();
    let lines: Vec<&str> = history.lines().filter(|line| !line.starts_with('#')).collect();
    let values = lines[lines.len() - 1].split(',').map(|value| value.parse().unwrap_or(f64::NAN));
    lines[0].split(',').map(str::to_owned).zip(values).collect()
}

/// Returns the displacement of the tip.
fn tip(directory: &Path) -> [f64; 3] {
    let row = last_row(directory);
    ["tip.ux", "tip.uy", "tip.uz"].map(|name| row.iter().find(|(column, _)| column == name).expect(name).1)
}

/// Returns a number of report.json.
fn number(directory: &Path, key: &str) -> f64 {
    let report = std::fs::read_to_string(directory.join("report.json")).unwrap();
    let rest = report.split(&format!("\"{key}\": ")).nth(1).expect(key);
    rest.split([',', '\n']).next().unwrap().trim().parse().unwrap()
}

fn succeeds(ranks: usize, path: &Path, out: &Path) {
    let output = run(ranks, path, out);
    assert!(output.status.success(), "{ranks} ranks: {}", text(&output.stderr));
}

/// Asserts that PETSc on 1, 2 and 4 ranks leads to the tip of our own conjugate gradients, relative to its length.
fn agrees_with_pcg(name: &str, text_of_scene: &str, most_iterations: f64) {
    let room = room(name);
    let own = room.join("pcg");
    succeeds(2, &scene(&room, &text_of_scene.replace("petsc", "pcg")), &own);
    let expected = tip(&own);
    let length = expected.iter().map(|u| u * u).sum::<f64>().sqrt();
    let path = scene(&room, text_of_scene);
    for ranks in [1, 2, 4] {
        let out = room.join(ranks.to_string());
        succeeds(ranks, &path, &out);
        for (found, expected) in tip(&out).into_iter().zip(expected) {
            assert!((found - expected).abs() < 1e-6 * length, "{ranks} ranks: {found} {expected}");
        }
        let report = std::fs::read_to_string(out.join("report.json")).unwrap();
        assert!(report.contains("\"petsc\""), "{report}");
        let mean = number(&out, "pcg_iterations") / number(&out, "solves");
        assert!(mean > 1.0 && mean <= most_iterations, "{ranks} ranks: {mean} iterations per solve");
        let of_pcg = number(&own, "pcg_iterations") / number(&own, "solves");
        assert!(mean < 0.5 * of_pcg, "{ranks} ranks: {mean} iterations per solve, {of_pcg} of pcg");
    }
}

/// Measured: 10 iterations per solve on 1, 2 and 4 ranks, 27 of pcg with its coarse space.
#[test]
fn equilibria_agree_with_pcg_in_few_iterations() {
    agrees_with_pcg("petsc-static", BENDS, 15.0);
}

/// Steps at a Courant number of about 20 of a block on rollers: nodes of which one or two coordinates are held. Measured:
/// 3 iterations per solve, 9 of pcg.
#[test]
fn large_implicit_steps_agree_with_pcg() {
    agrees_with_pcg("petsc-steps", ROLLS, 15.0);
}

/// PETSc reads its options from PETSC_OPTIONS: another preconditioner takes the place of the default, and PETSc shows it.
#[test]
fn options_of_petsc_are_read_from_the_environment() {
    let room = room("petsc-options");
    let (path, out) = (scene(&room, BENDS), room.join("out"));
    let mut command = program(1);
    let output =
        to_run(command.env("PETSC_OPTIONS", "-pc_type jacobi -ksp_view"), &path, &out).output().unwrap();
    assert!(output.status.success(), "{}", text(&output.stderr));
    let view = text(&output.stdout);
    assert!(view.contains("type: jacobi") && !view.contains("type: gamg"), "{view}");
    // Multigrid needs less than 15.
    assert!(number(&out, "pcg_iterations") / number(&out, "solves") > 50.0);
}

/// The equilibria of a column that buckles under its weight have indefinite tangents on the way. PETSc says so, and our own
/// conjugate gradients take its place by name.
#[test]
fn indefinite_tangents_fall_back_by_name() {
    let room = room("petsc-buckling");
    let own = room.join("pcg");
    succeeds(1, &scene(&room, &BUCKLES.replace("petsc", "pcg")), &own);
    let expected = tip(&own);
    let path = scene(&room, BUCKLES);
    for ranks in [1, 2] {
        let out = room.join(ranks.to_string());
        succeeds(ranks, &path, &out);
        for (found, expected) in tip(&out).into_iter().zip(expected) {
            assert!((found - expected).abs() < 1e-5, "{ranks} ranks: {found} {expected}");
        }
        let report = std::fs::read_to_string(out.join("report.json")).unwrap();
        let note = "solved by \\\"pcg\\\", because \\\"petsc\\\" stopped with DIVERGED_INDEFINITE";
        assert!(report.contains(note), "{report}");
    }
}
