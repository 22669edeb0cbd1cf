//! pyvista and meshio read every file that a run writes, and its values equal those of history.csv. Blender shows its
//! point caches.
//!
//! Three of these tests need Python with the packages of tests/python/requirements.txt and are ignored by default: `cargo
//! test --test files viewers -- --ignored` runs them. `VARIATIONAL_PYTHON` names another interpreter.

use std::process::Command;

use crate::program::Program;

const SCENE: &str = r#"
gravity = [0.0, 0.0, -9.81]
[time]
end = 0.02
step = 0.001
scheme = "stormer-verlet"
[[body]]
name = "beam"
box = { size = [1.0, 0.2, 0.2], cells = [5, 1, 1] }
material = { law = "neo-hookean", young = 1e5, poisson = 0.3, density = 1000.0 }
[[fix]]
body = "beam"
region = "x-min"
[[probe]]
name = "tip"
body = "beam"
point = [1.0, 0.2, 0.2]
[output]
interval = 0.005
fields = ["displacement", "velocity", "body_id", "material_id"]
precision = "PRECISION"
encoding = "ENCODING"
"#;

/// Returns the name of the Python interpreter.
fn python() -> String {
    std::env::var("VARIATIONAL_PYTHON").unwrap_or_else(|_| "python3".to_owned())
}

#[test]
#[ignore = "needs Python with pyvista and meshio"]
fn python_reads_what_was_written() {
    let python = python();
    for (precision, encoding) in [("f32", "raw"), ("f64", "raw"), ("f32", "base64"), ("f64", "base64")] {
        let run = Program::run(&SCENE.replace("PRECISION", precision).replace("ENCODING", encoding));
        let mut check = Command::new(&python);
        check.arg(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/python/check_outputs.py")).arg(run.out());
        if encoding == "base64" {
            check.arg("--meshio");
        }
        let output = check.output().unwrap();
        let said =
            String::from_utf8_lossy(&output.stdout).into_owned() + &String::from_utf8_lossy(&output.stderr);
        assert!(output.status.success(), "{precision} {encoding}:\n{said}");
    }
}

/// Pieces that pyvista joins are the frame of one file: the same cells, with the same displacements at the same points.
const JOINED: &str = r#"
import pathlib, sys
import numpy as np
import pyvista

whole, parted = (pyvista.get_reader(path) for path in sys.argv[1:3])
assert whole.time_values == parted.time_values
for time in whole.time_values:
    grids = []
    for reader in (whole, parted):
        reader.set_active_time_value(time)
        grids.append(reader.read().combine())
    a, b = grids
    assert a.n_cells == b.n_cells > 0 and b.n_points > a.n_points
    for cell in range(a.n_cells):
        one, other = (grid.get_cell(cell) for grid in grids)
        assert np.array_equal(one.points, other.points)
        for field in ("displacement", "velocity"):
            one_values = a.point_data[field][one.point_ids]
            assert np.array_equal(one_values, b.point_data[field][other.point_ids])
    assert np.array_equal(a.cell_data["body_id"], b.cell_data["body_id"])
"#;

#[test]
#[ignore = "needs Python with pyvista"]
fn pyvista_joins_the_pieces_of_a_frame() {
    let scene = SCENE.replace("PRECISION", "f64").replace("ENCODING", "raw");
    let whole = Program::run(&scene);
    let parted = Program::run(&scene.replace("interval = 0.005", "interval = 0.005\npiece_points = 10"));
    let series = |run: &Program| {
        let files = std::fs::read_dir(run.out()).unwrap().map(|entry| entry.unwrap().path());
        files.into_iter().find(|file| file.extension().is_some_and(|found| found == "pvd")).unwrap()
    };
    let mut check = Command::new(python());
    let output = check.args(["-c", JOINED]).args([series(&whole), series(&parted)]).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
}

/// A falling, spinning cloth with texture coordinates, and a moving block.
const FILM: &str = r#"
gravity = [0.0, 0.0, -9.81]
[time]
end = 0.1
step = 0.004
scheme = "stormer-verlet"
[[body]]
name = "cloth"
sheet = { size = [0.4, 0.2], cells = [4, 2], origin = [1.0, 0.0, 0.0] }
material = { law = "st-venant-kirchhoff", young = 1e3, poisson = 0.3, density = 300.0, thickness = 1e-3 }
angular_velocity = [0.0, 1.0, 2.0]
[[body]]
name = "block"
box = { size = [0.1, 0.1, 0.1], cells = [1, 1, 1], element = "hex8" }
material = { law = "neo-hookean", young = 1e4, poisson = 0.3, density = 1000.0 }
velocity = [1.0, 2.0, 3.0]
[[probe]]
name = "corner"
body = "cloth"
node = 0
[[probe]]
name = "tip"
body = "block"
node = 7
[output]
fps = 50
cache = "mdd"
"#;

#[test]
#[ignore = "needs Python with bpy"]
fn blender_shows_the_point_caches() {
    let python = python();
    let run = Program::run(FILM);
    for arguments in [
        &["pc2", "cloth", "corner", "0", "--textured"][..],
        &["mdd", "cloth", "corner", "0", "--textured"],
        &["pc2", "block", "tip", "7"],
        &["mdd", "block", "tip", "7"],
    ] {
        let mut check = Command::new(&python);
        check.arg(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/python/check_blender.py"));
        let output = check.arg(run.out()).args(arguments).output().unwrap();
        let said =
            String::from_utf8_lossy(&output.stdout).into_owned() + &String::from_utf8_lossy(&output.stderr);
        assert!(output.status.success() && said.contains("as they were computed"), "{arguments:?}:\n{said}");
    }
}

/// A run that starts from a frame in double precision continues the motion of the run that wrote it.
#[test]
fn a_frame_can_start_a_run() {
    let scene = SCENE.replace("PRECISION", "f64").replace("ENCODING", "raw");
    let whole = Program::run(&scene).history();
    let first = Program::run(&scene.replace("end = 0.02", "end = 0.01"));
    let frame = first.out().join("scene_000002.vtu");
    let again = scene
        .replace("end = 0.02", "end = 0.01")
        .replace("box = { size = [1.0, 0.2, 0.2], cells = [5, 1, 1] }", &format!("mesh = {frame:?}"))
        .replace("region = \"x-min\"", "box = { min = [0.0, 0.0, 0.0], max = [0.0, 1.0, 1.0] }");
    let second = Program::run(&again).history();
    for column in ["tip.x", "tip.z", "total"] {
        let (a, b) = (whole.last(column), second.last(column));
        assert!((a - b).abs() < 1e-12 * a.abs().max(1.0), "{column}: {a} and {b}");
    }
}
