//! Tests half-spaces whose faces rotate.

use crate::program::Program;

/// A thin rigid box, or a soft one, on a plane that tilts about y by `rate` (rad/s).
fn tilt(body: &str, rate: f64, end: f64, step: f64, more: &str) -> String {
    format!(
        r#"
gravity = [0.0, 0.0, -9.81]
[time]
end = {end}
step = {step}
scheme = "energy-momentum"
[solver]
tolerance = 1e-8
[contact]
damping = 2e-3
self = false
{more}
{body}
[[rigid]]
name = "slope"
shape = {{ kind = "plane", normal = [0, 0, 1] }}
position = [0.3, 0.1, 0.0]
motion = {{ kind = "rotate", axis = [0.0, 1.0, 0.0], point = [0.0, 0.0, 0.0], rate = {rate} }}
[[probe]]
name = "foot"
between = ["block", "slope"]
sum = "contact_force"
[output]
ledger = true
"#
    )
}

const RIGID: &str = r#"
[[rigid]]
name = "block"
shape = { kind = "box", size = [0.2, 0.2, 0.02] }
density = 1000.0
position = [0.0, 0.0, 0.0101]
"#;

/// A block on a plane that tilts slowly starts to slide where tan θ = μ. Before that, it moves with the plane.
#[test]
fn a_block_slides_where_the_tangent_of_the_tilt_is_the_friction() {
    let (friction, rate) = (0.2_f64, 0.5_f64);
    let angle = friction.atan();
    let end = 1.3 * angle / rate;
    let program = Program::run(&tilt(RIGID, rate, end, 1e-3, &format!("friction = {friction}")));
    let history = program.history();
    let [t, x, z] = ["t", "block.x", "block.z"].map(|name| history.column(name));
    // Coordinate along the plane, which is positive downhill.
    let along = |row: usize| x[row] * (rate * t[row]).cos() - z[row] * (rate * t[row]).sin();
    let start = along(20);
    let slides = (20..t.len()).find(|&row| (along(row) - start).abs() > 1e-5).expect("it slides");
    // From rest at tan θ = μ, the way is about g ω Δt³/6 (cos θ + μ sin θ): 1e-5 m after 23 ms.
    let late = (6.0 * 1e-5 / (9.81 * rate * angle.cos() * (1.0 + friction * friction))).cbrt();
    let found = rate * (t[slides] - late);
    assert!((found.tan() / friction - 1.0).abs() < 0.02, "{found}: tan {} for {friction}", found.tan());
    assert!(history.column("smallest_gap").iter().all(|&gap| gap > 0.0));
    let unexplained = program.report()["energy"]["unexplained"].as_f64().unwrap();
    assert!(unexplained.abs() < 1e-9, "{unexplained:e}");
}

/// A plane that rotates about its own normal carries a body around by friction. Without friction the body stays.
#[test]
fn a_plane_that_spins_carries_a_body_by_friction_alone() {
    for (friction, carried) in [(0.5, 1.0), (0.0, 0.0)] {
        let rate = 0.6;
        let scene = tilt(RIGID, rate, 0.5, 1e-3, &format!("friction = {friction}"))
            .replace("axis = [0.0, 1.0, 0.0]", "axis = [0.0, 0.0, 1.0]");
        let program = Program::run(&scene);
        let history = program.history();
        let turn = |row: usize| 2.0 * history.column("block.qz")[row].atan2(history.column("block.qw")[row]);
        // The body falls by 0.1 mm at first, without friction.
        let last = history.column("t").len() - 1;
        let turned = turn(last) - turn(last / 2);
        assert!((turned - carried * rate * 0.25).abs() < 1e-5, "{friction}: {turned}");
    }
}

/// Round and soft bodies, and an explicit scheme, keep above a plane that rises under them.
#[test]
fn bodies_of_all_kinds_stay_above_a_plane_that_rises() {
    let ball = r#"
[[rigid]]
name = "block"
shape = { kind = "sphere", radius = 0.02 }
density = 1000.0
position = [-0.1, 0.0, 0.0201]
"#;
    let soft = r#"
[[body]]
name = "block"
box = { size = [0.1, 0.1, 0.04], cells = [3, 3, 1], element = "hex8", origin = [-0.15, -0.05, 0.001] }
material = { law = "neo-hookean", young = 1e5, poisson = 0.3, density = 1000.0 }
"#;
    for (body, scheme, step) in [
        (ball, "energy-momentum", 1e-3),
        (soft, "energy-momentum", 1e-3),
        (soft, "stormer-verlet", 2e-4),
        (RIGID, "implicit-midpoint", 1e-3),
    ] {
        let scene = tilt(body, 2.0, 0.15, step, "friction = 0.3").replace("energy-momentum", scheme);
        let program = Program::run(&scene);
        let history = program.history();
        assert!(history.column("smallest_gap").iter().all(|&gap| gap > 0.0), "{scheme}");
        assert!(history.column("foot.fz").iter().any(|&force| force > 0.0), "{scheme}");
        let unexplained = program.report()["energy"]["unexplained"].as_f64().unwrap();
        let largest = history.column("kinetic").into_iter().fold(0.0, f64::max);
        assert!(unexplained.abs() < 2e-2 * largest, "{scheme}: {unexplained:e} of {largest:e}");
    }
}

/// Frames hold the fields of contact beside a half-space that rotates: it has no points there. The mean pressure on the face of a block
/// at rest is that of its weight.
#[test]
fn frames_hold_contact_beside_a_rotating_plane() {
    let fields = "interval = 0.2\nprecision = \"f64\"\nfields = [\"contact_traction\", \"contact_pressure\", \"slip\", \"gap\"]\n";
    let program = Program::run(&(tilt(RIGID, 0.02, 0.2, 1e-3, "friction = 0.5") + fields));
    let frame = vi_io::read_mesh(&program.out().join("scene_000001.vtu")).unwrap();
    assert_eq!(frame.mesh.points.len(), 8);
    let values = |name: &str| &frame.point_array(name).unwrap_or_else(|| panic!("{name}")).values;
    let (traction, pressure) = (values("contact_traction"), values("contact_pressure"));
    assert_eq!((traction.len(), values("slip").len(), values("gap").len()), (24, 24, 8));
    for (traction, pressure) in traction.chunks_exact(3).zip(pressure) {
        let size = traction.iter().map(|value| value * value).sum::<f64>().sqrt();
        assert!((size - pressure).abs() < 1e-9 * size.max(1.0), "{size} {pressure}");
    }
    let below: Vec<f64> = pressure.iter().copied().filter(|&pressure| pressure > 0.0).collect();
    assert_eq!(below.len(), 4, "{pressure:?}");
    let (mean, weight) = (below.iter().sum::<f64>() / 4.0, 1000.0 * 0.02 * 9.81);
    assert!((mean / weight - 1.0).abs() < 2e-2, "{mean} {weight}");
}

/// A sheet between a floor and a plate carries the weight of the plate on both sides: its net traction is small, its pressure is not.
#[test]
fn a_pinched_sheet_has_the_pressure_of_its_sides() {
    let program = Program::run(
        r#"
gravity = [0.0, 0.0, -9.81]
[time]
end = 0.1
step = 1e-3
scheme = "energy-momentum"
[contact]
damping = 2e-3
distance = 2e-4
[[rigid]]
name = "floor"
shape = { kind = "plane", normal = [0, 0, 1] }
fixed = true
[[body]]
name = "s"
sheet = { size = [0.1, 0.1], cells = [4, 4], origin = [0, 0, 0.0006] }
material = { law = "st-venant-kirchhoff", young = 1e6, poisson = 0, area_density = 0.5, thickness = 1e-3 }
[[body]]
name = "plate"
box = { size = [0.1, 0.1, 0.02], cells = [4, 4, 1], element = "hex8", origin = [0, 0, 0.0012] }
material = { law = "linear", young = 1e7, poisson = 0, density = 10000 }
[[probe]]
name = "under"
between = ["s", "floor"]
sum = "contact_force"
[[probe]]
name = "pressure"
body = "s"
region = "sheet"
mean = "contact_pressure"
[[probe]]
name = "traction"
body = "s"
region = "sheet"
mean = "contact_traction.z"
"#,
    );
    let history = program.history();
    let last = |name: &str| history.column(name).last().copied().unwrap();
    // 2 kg on 0.01 m², and 5 g of the sheet itself.
    let pressure = 2.005 * 9.81 / 0.01;
    assert!((0.01_f64.recip() * last("under.fz") / pressure - 1.0).abs() < 0.1, "{}", last("under.fz"));
    let found = last("pressure.mean.contact_pressure");
    assert!((found / pressure - 1.0).abs() < 0.05, "{found} {pressure}");
    let net = last("traction.mean.contact_traction.z");
    assert!(net.abs() < 0.02 * pressure, "{net}");
}

/// Where nothing presses, the field `gap` is the widest layer of the body's own pairs; a body without pairs has that of the scene.
#[test]
fn gaps_of_nodes_without_contact_are_the_layers_of_their_bodies() {
    let body = |name: &str, cells: usize| {
        format!(
            r#"
[[body]]
name = "{name}"
box = {{ size = [0.1, 0.1, 0.1], cells = [{cells}, 1, 1], element = "hex8", origin = [{cells}, 0.0, 0.1] }}
material = {{ law = "neo-hookean", young = 1e6, poisson = 0.3, density = 1000.0 }}
[[probe]]
name = "{name}"
body = "{name}"
max = "gap"
min = "gap"
"#
        )
    };
    let scene = format!(
        r#"
[time]
end = 1e-3
step = 1e-3
scheme = "implicit-midpoint"
[contact]
self = false
exclude = [["a", "b"], ["a", "c"], ["b", "c"], ["c", "floor"]]
[[contact.pair]]
between = ["a", "floor"]
distance = 1e-3
[[contact.pair]]
between = ["b", "floor"]
distance = 2e-2
{}{}{}
[[rigid]]
name = "floor"
shape = {{ kind = "plane", normal = [0, 0, 1] }}
fixed = true
[output]
history = 1
"#,
        body("a", 2),
        body("b", 1),
        body("c", 3)
    );
    let history = Program::run(&scene).history();
    for (name, layer) in [("a", 1e-3), ("b", 2e-2), ("c", 2e-2)] {
        for statistic in ["max", "min"] {
            let gap = history.last(&format!("{name}.{statistic}.gap"));
            assert_eq!(gap, layer, "{name}.{statistic}");
        }
    }
}
