//! Tests models that are cut off on planes of symmetry and on periodic seams: they press as the whole body does there.

use crate::program::Program;

/// A block of E = 1e5 Pa under a traction, from `low` to .1 m along x, in `cells` elements. Its plane x = 0 is held along x.
fn block(low: f64, cells: u32, element: &str) -> String {
    format!(
        r#"
[time]
end = 1.0
step = 0.5
[static]
[contact]
distance = 1e-3
[[body]]
name = "b"
box = {{ size = [{}, 0.1, 0.05], cells = [{cells}, 2, 2], element = "{element}", origin = [{low}, -0.05, 0.0012] }}
material = {{ law = "neo-hookean", young = 1e5, poisson = 0.3, density = 1000.0 }}
[[fix]]
body = "b"
plane = {{ point = [0, 0, 0], normal = [1, 0, 0] }}
axes = ["x"]
[[fix]]
body = "b"
plane = {{ point = [0, 0, 0], normal = [0, 1, 0] }}
axes = ["y"]
[[rigid]]
name = "floor"
shape = {{ kind = "plane", normal = [0, 0, 1] }}
fixed = true
[[load]]
kind = "traction"
body = "b"
region = "z-max"
traction = [0, 0, -300]
amplitude = "t"
[[probe]]
name = "edge"
body = "b"
point = [0.1, 0, 0.0512]
"#,
        0.1 - low
    )
}

/// A half of a block moves as the whole one, and has half of its energies.
#[test]
fn a_half_moves_as_the_whole() {
    let [half, whole] =
        [block(0.0, 2, "hex8"), block(-0.1, 4, "hex8")].map(|scene| Program::run(&scene).history());
    let last = |history: &crate::program::History, name: &str| *history.column(name).last().unwrap();
    for name in ["edge.x", "edge.z", "edge.ux", "edge.uz"] {
        let [half, whole] = [&half, &whole].map(|history| last(history, name));
        assert!((half / whole - 1.0).abs() < 1e-8, "{name}: {half} {whole}");
    }
    for name in ["elastic", "contact"] {
        let [half, whole] = [&half, &whole].map(|history| last(history, name));
        assert!((2.0 * half / whole - 1.0).abs() < 1e-8, "{name}: {half} {whole}");
    }
}

/// A periodic block on a floor is pressed alike everywhere along its period, and the mean pressure is its weight on its base.
#[test]
fn a_seam_presses_as_the_inside() {
    let program = Program::run(
        r#"
gravity = [0.0, 0.0, -9.81]
[time]
end = 1.0
step = 1.0
[static]
[contact]
[[body]]
name = "b"
box = { size = [0.2, 0.1, 0.05], cells = [4, 2, 2], element = "hex8", origin = [0.0, 0.0, 0.001] }
material = { law = "neo-hookean", young = 1e5, poisson = 0.3, density = 1000.0 }
[[periodic]]
body = "b"
from = { region = "x-min" }
to = { region = "x-max" }
[[fix]]
body = "b"
plane = { point = [0, 0.05, 0], normal = [0, 1, 0] }
axes = ["y"]
[[fix]]
body = "b"
box = { min = [-0.01, 0.04, 0.0], max = [0.01, 0.06, 0.01] }
axes = ["x"]
[[rigid]]
name = "floor"
shape = { kind = "plane", normal = [0, 0, 1] }
fixed = true
[output]
interval = 1.0
precision = "f64"
fields = ["contact_pressure"]
"#,
    );
    let frame = vi_io::read_mesh(&program.out().join("scene_000001.vtu")).unwrap();
    let pressure = &frame.point_array("contact_pressure").unwrap().values;
    let base: Vec<([f64; 3], f64)> =
        frame.mesh.points.iter().copied().zip(pressure.iter().copied()).take(15).collect();
    assert!(base.iter().all(|(_, pressure)| *pressure > 0.0), "{base:?}");
    // Nodes are numbered along x first: three rows of five.
    for row in base.chunks_exact(5) {
        row.iter().for_each(|(place, value)| {
            assert!((value / row[0].1 - 1.0).abs() < 1e-6, "{place:?}: {value} {}", row[0].1);
        });
    }
    // The trapezoidal rule across the block.
    let mean = 0.25 * base[0].1 + 0.5 * base[5].1 + 0.25 * base[10].1;
    assert!((mean / (1000.0 * 9.81 * 0.05) - 1.0).abs() < 1e-2, "{mean}");
}

/// A deformable punch, driven into a block by `fixes`.
fn punch(fixes: &str) -> String {
    format!(
        r#"
[time]
end = 1.0
step = 1.0
[static]
[contact]
[[body]]
name = "block"
box = {{ size = [0.08, 0.08, 0.04], cells = [4, 4, 2], element = "hex8", origin = [0, 0, 0] }}
material = {{ law = "neo-hookean", young = 1e6, poisson = 0.3, density = 1000.0 }}
[[fix]]
body = "block"
region = "z-min"
[[body]]
name = "punch"
box = {{ size = [0.04, 0.04, 0.02], cells = [2, 2, 1], element = "hex8", origin = [0.017, 0.023, 0.041] }}
material = {{ law = "neo-hookean", young = 1e6, poisson = 0.3, density = 1000.0 }}
{fixes}
[[probe]]
name = "p"
between = ["block", "punch"]
sum = "contact_force"
"#
    )
}

/// A face that is pressed is no plane of symmetry, even if it is held or driven. A punch exerts the same force however
/// its motion is written, and a bearing that is held along its normal alone the same as one that is held in all
/// directions.
#[test]
fn punches_and_bearings_press_with_their_whole_area() {
    const DOWN: &str = "motion = { kind = \"translate\", velocity = [0.0, 0.0, -0.001] }";
    let force = |fixes: &str| {
        let history = Program::run(&punch(fixes)).history();
        *history.column("p.fz").last().unwrap()
    };
    let all = "body = \"punch\"\nbox = { min = [0.0, 0.0, 0.04], max = [0.1, 0.1, 0.1] }\n";
    let whole = force(&format!("[[fix]]\n{all}{DOWN}\n"));
    assert!(whole < -1.0, "{whole}");
    let two = force(&format!("[[fix]]\n{all}axes = [\"x\", \"y\"]\n[[fix]]\n{all}axes = [\"z\"]\n{DOWN}\n"));
    assert!((two / whole - 1.0).abs() < 1e-9, "{two} {whole}");
    let bearing = |axes: &str| {
        let text = format!(
            r#"
[time]
end = 1.0
step = 1.0
[static]
[contact]
[[body]]
name = "anvil"
box = {{ size = [0.04, 0.04, 0.02], cells = [2, 2, 1], element = "hex8", origin = [0.02, 0.02, -0.02] }}
material = {{ law = "neo-hookean", young = 1e6, poisson = 0.0, density = 1000.0 }}
[[fix]]
body = "anvil"
region = "z-max"
axes = {axes}
[[fix]]
body = "anvil"
region = "z-min"
[[body]]
name = "block"
box = {{ size = [0.08, 0.08, 0.04], cells = [4, 4, 2], element = "hex8", origin = [0, 0, 0.001] }}
material = {{ law = "neo-hookean", young = 1e5, poisson = 0.3, density = 1000.0 }}
[[fix]]
body = "block"
region = "z-max"
{DOWN}
[[probe]]
name = "p"
between = ["block", "anvil"]
sum = "contact_force"
"#
        );
        let history = Program::run(&text).history();
        *history.column("p.fz").last().unwrap()
    };
    let [wholly, along] = [bearing("[\"x\", \"y\", \"z\"]"), bearing("[\"z\"]")];
    // The face that is held along its normal alone can stretch, so the forces are only nearly equal. Without the area of the face they
    // would differ by a tenth.
    assert!(wholly > 1.0 && (along / wholly - 1.0).abs() < 2e-3, "{along} {wholly}");
}
