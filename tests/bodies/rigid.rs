//! Tests rigid bodies, joints and exact attachments in scenes: periods, momenta, energy ledgers, and refused input.

use crate::program::{History, Program};
use vi_core::problems::{complete_elliptic_k, flip_period};

/// Returns the times at which a column crosses zero upwards, by linear interpolation.
fn crossings(history: &History, values: &[f64]) -> Vec<f64> {
    let t = history.column("t");
    let rises = (1..t.len()).filter(|&i| values[i - 1] < 0.0 && values[i] >= 0.0);
    rises.map(|i| t[i] - (t[i] - t[i - 1]) * values[i] / (values[i] - values[i - 1])).collect()
}

fn drift(history: &History, name: &str) -> f64 {
    let values = history.column(name);
    values.iter().map(|value| (value - values[0]).abs()).fold(0.0, f64::max)
}

/// Describes a stiff cube of side a at the end of a rod of length 1 that hangs from the origin and starts with angular
/// velocity ω.
fn bob(scheme: &str, step: f64, omega: f64) -> String {
    let a = 0.2;
    let drop = -1.0 - 0.5 * a;
    format!(
        r#"
gravity = [0.0, -9.81, 0.0]
[time]
end = 4.5
step = {step}
scheme = "{scheme}"
[solver]
tolerance = 1e-7
[[rigid]]
name = "rod"
mass = 2.0
shape = {{ kind = "rod", length = 1.0, radius = 0.02 }}
position = [0.0, -0.5, 0.0]
orientation = {{ axis = [0.0, 0.0, 1.0], angle = -1.5707963267948966 }}
velocity = [{v}, 0.0, 0.0]
angular_velocity = [0.0, 0.0, {omega}]
[[joint]]
kind = "ball"
body = "rod"
point = [0.0, 0.0, 0.0]
[[body]]
name = "bob"
box = {{ size = [{a}, {a}, {a}], cells = [2, 2, 2], element = "hex8", origin = [-0.1, -1.2, -0.1] }}
material = {{ law = "neo-hookean", young = 1e7, poisson = 0.3, density = 500.0 }}
velocity = [{u}, 0.0, 0.0]
angular_velocity = [0.0, 0.0, {omega}]
[[attach]]
body = "bob"
region = "y-max"
to = "rod"
[output]
history = 1
"#,
        v = 0.5 * omega,
        u = -drop * omega,
    )
}

#[test]
fn a_bob_on_a_rod_swings_with_the_period_of_the_compound_pendulum() {
    let (omega, a) = (1.0, 0.2_f64);
    // The mass of the mesh is lumped at its nodes: 2 × 2 × 2 cells put ¼, ½ and ¼ of it along each axis.
    let (rod, cube) = (2.0, 500.0 * a.powi(3));
    let spread = 0.5 * (0.5 * a).powi(2);
    let inertia =
        rod * (1.0 / 3.0 + 0.02_f64.powi(2) / 4.0) + cube * (2.0 * spread + (1.0 + 0.5 * a).powi(2));
    let moment = 9.81 * (rod * 0.5 + cube * (1.0 + 0.5 * a));
    let sine = (0.25 * inertia * omega * omega / moment).sqrt();
    let period = 4.0 * (inertia / moment).sqrt() * complete_elliptic_k(sine);
    for (scheme, step, least) in [("implicit-midpoint", 4e-3, 5e-5), ("energy-momentum", 4e-3, 5e-5)] {
        let history = Program::run(&bob(scheme, step, omega)).history();
        let at = crossings(&history, &history.column("rod.x"));
        let found = (at[at.len() - 1] - at[0]) / (at.len() - 1) as f64;
        assert!((found / period - 1.0).abs() < least, "{scheme}: {found} s, not {period} s");
        // The rod stays in its plane and keeps its length.
        let (x, y) = (history.column("rod.x"), history.column("rod.y"));
        for (x, y) in x.iter().zip(&y) {
            assert!((x.hypot(*y) - 0.5).abs() < 1e-12);
        }
        assert!(drift(&history, "rod.z") < 1e-10);
    }
}

fn spinning_box(scheme: &str, step: f64, end: f64) -> String {
    format!(
        r#"
[time]
end = {end}
step = {step}
scheme = "{scheme}"
[solver]
tolerance = 1e-14
[[rigid]]
name = "box"
mass = 3.0
inertia = [1.0, 2.0, 2.5]
position = [0.3, 0.1, 0.0]
velocity = [0.1, 0.0, -0.2]
angular_velocity = [0.02, 1.0, 0.0]
[output]
history = 1
[assert]
momentum_drift = 1e-12
angular_momentum_drift = 1e-12
"#
    )
}

#[test]
fn a_box_flips_on_time_and_keeps_its_momenta() {
    let moments = [1.0, 2.0, 2.5];
    let period = flip_period(moments, [0.02, 2.0, 0.0]);
    let error = |scheme: &str, step: f64| {
        let history = Program::run(&spinning_box(scheme, step, 1.1 * period)).history();
        if scheme == "energy-momentum" {
            assert!(drift(&history, "total") < 1e-12);
        }
        // This is minus the component of the angular momentum (0.02, 2, 0) along the intermediate axis of the body.
        let [w, x, y, z] = ["box.qw", "box.qx", "box.qy", "box.qz"].map(|name| history.column(name));
        let t = history.column("t");
        let cosine: Vec<f64> = (0..t.len())
            .map(|i| {
                0.02 * 2.0 * (w[i] * z[i] - x[i] * y[i]) - 2.0 * (1.0 - 2.0 * (x[i] * x[i] + z[i] * z[i]))
            })
            .collect();
        let falls = (1..t.len()).filter(|&i| cosine[i - 1] > 0.0 && cosine[i] <= 0.0);
        let mut falls = falls.map(|i| t[i] - (t[i] - t[i - 1]) * cosine[i] / (cosine[i] - cosine[i - 1]));
        let (rise, fall) = (crossings(&history, &cosine)[0], falls.next_back().unwrap());
        // The body stays upside down for half a period.
        ((fall - rise) / (0.5 * period) - 1.0).abs()
    };
    for scheme in ["stormer-verlet", "implicit-midpoint", "energy-momentum"] {
        let (coarse, fine) = (error(scheme, 0.02), error(scheme, 0.01));
        assert!(fine < 2e-3 && coarse / fine > 3.0, "{scheme}: {coarse:e}, then {fine:e}");
    }
}

#[test]
fn blades_on_a_free_hub_keep_energy_and_momenta() {
    let text = std::fs::read_to_string(concat!(env!("CARGO_MANIFEST_DIR"), "/scenes/blades.toml")).unwrap();
    // This mesh is coarser and the run shorter than in the scene file; the assertions of the scene judge the run.
    let text = text
        .replace("[16, 3, 1]", "[5, 1, 1]")
        .replace("[3, 16, 1]", "[1, 5, 1]")
        .replace("end = 2.0 ", "end = 0.1 ")
        .replace("interval = 0.02", "history = 1\ninterval = 0.02");
    let program = Program::run(&text);
    assert!(program.out().join("scene_000005.vtu").exists());
    let history = program.history();
    assert!(drift(&history, "elastic") > 0.1, "{}", drift(&history, "elastic"));
}

#[test]
fn a_turning_arm_pays_for_what_it_swings() {
    let text =
        std::fs::read_to_string(concat!(env!("CARGO_MANIFEST_DIR"), "/scenes/rotating-arm.toml")).unwrap();
    let text = text.replace("[12, 2, 2]", "[4, 1, 1]").replace("end = 2.0 ", "end = 0.2 ");
    for scheme in ["implicit-midpoint", "stormer-verlet"] {
        let text = text
            .replace("\"implicit-midpoint\"", &format!("\"{scheme}\""))
            .replace("step = 2.0e-3", "step = 5.0e-4")
            .replace("interval = 0.01", "history = 1");
        let program = Program::run(&text);
        let (history, report) = (program.history(), program.report());
        let [x, y] = ["arm.x", "arm.y"].map(|name| history.last(name));
        let angle = std::f64::consts::TAU * 0.2;
        assert!((x - 0.5 * angle.cos()).abs() < 1e-12 && (y - 0.5 * angle.sin()).abs() < 1e-12);
        // The arm drags the tip after it, and the work of the arm equals the energy that the tip gained.
        let gained = history.last("total") - history.first("total");
        let work = report["energy"]["prescribed_work"].as_f64().unwrap_or(f64::NAN);
        assert!(gained > 10.0 && (work / gained - 1.0).abs() < 1e-2, "{gained} {work} {report}");
    }
}

/// Hinges, a distance joint and a weld keep their points, axes, distance and rotation in a chain that falls out of its
/// plane.
#[test]
fn joints_keep_what_they_say() {
    let scene = r#"
gravity = [0.0, -9.81, 0.0]
[time]
end = 1.0
step = 2e-3
scheme = "stormer-verlet"
[[rigid]]
name = "upper"
mass = 1.0
shape = { kind = "box", size = [1.0, 0.1, 0.2] }
position = [0.5, 0.0, 0.0]
[[rigid]]
name = "lower"
density = 500.0
shape = { kind = "rod", length = 1.0, radius = 0.05 }
position = [1.5, 0.0, 0.0]
[[rigid]]
name = "ball"
density = 500.0
shape = { kind = "sphere", radius = 0.1 }
position = [2.5, 0.0, 0.0]
velocity = [0.0, 0.0, 0.5]
[[rigid]]
name = "lid"
mass = 0.3
inertia = [[0.02, 0.001, 0.0], [0.001, 0.02, 0.0], [0.0, 0.0, 0.03]]
position = [0.5, 0.3, 0.0]
[[joint]]
kind = "hinge"
body = "upper"
point = [0.0, 0.0, 0.0]
axis = [0.0, 0.0, 2.0]
[[joint]]
kind = "hinge"
body = "upper"
to = "lower"
point = [1.0, 0.0, 0.0]
axis = [0.0, 1.0, 1.0]
[[joint]]
kind = "distance"
body = "ball"
to = "lower"
point = [2.5, 0.0, 0.0]
to_point = [2.0, 0.0, 0.0]
[[joint]]
kind = "weld"
body = "lid"
to = "upper"
[output]
history = 1
[assert]
energy_drift = 2e-2
"#;
    let history = Program::run(scene).history();
    let at = |name: &str, part: &str| history.last(&format!("{name}.{part}"));
    let place = |name: &str| ["x", "y", "z"].map(|part| at(name, part));
    let turned = |name: &str, v: [f64; 3]| {
        let [w, x, y, z] = ["qw", "qx", "qy", "qz"].map(|part| at(name, part));
        let q = nalgebra::UnitQuaternion::from_quaternion(nalgebra::Quaternion::new(w, x, y, z));
        let v = q * nalgebra::Vector3::from(v);
        [v.x, v.y, v.z]
    };
    let point = |name: &str, local: [f64; 3]| {
        let (c, r) = (place(name), turned(name, local));
        [0, 1, 2].map(|k| c[k] + r[k])
    };
    let same = |a: [f64; 3], b: [f64; 3], what: &str| {
        assert!((0..3).all(|k| (a[k] - b[k]).abs() < 1e-11), "{what}: {a:?} {b:?}");
    };
    same(point("upper", [-0.5, 0.0, 0.0]), [0.0; 3], "pivot");
    same(turned("upper", [0.0, 0.0, 1.0]), [0.0, 0.0, 1.0], "axis of the world");
    same(point("upper", [0.5, 0.0, 0.0]), point("lower", [-0.5, 0.0, 0.0]), "elbow");
    same(turned("upper", [0.0, 1.0, 1.0]), turned("lower", [0.0, 1.0, 1.0]), "axis of the elbow");
    same(point("upper", [0.0, 0.3, 0.0]), place("lid"), "weld");
    same(turned("upper", [0.3, 0.5, 0.7]), turned("lid", [0.3, 0.5, 0.7]), "turn of the weld");
    let (a, b) = (place("ball"), point("lower", [0.5, 0.0, 0.0]));
    let distance = (0..3).map(|k| (a[k] - b[k]).powi(2)).sum::<f64>().sqrt();
    assert!((distance - 0.5).abs() < 1e-12, "{distance}");
    assert!(place("upper")[1] < -0.2, "it falls");
}

#[test]
fn what_cannot_be_is_refused_with_the_way_out() {
    let scene =
        |rigid: &str| format!("[time]\nend = 1.0\nstep = 0.1\nscheme = \"implicit-midpoint\"\n{rigid}");
    let good = "[[rigid]]\nname = \"a\"\nmass = 1.0\ninertia = [1.0, 1.0, 1.0]\n";
    for (rigid, words) in [
        ("[[rigid]]\nname = \"a\"\nmass = 1.0\n".to_owned(), "`inertia` or a `shape`"),
        ("[[rigid]]\nname = \"a\"\nmass = 1.0\ninertia = [1.0, 1.0, 3.0]\n".to_owned(), "at most the sum"),
        ("[[rigid]]\nname = \"a\"\n".to_owned(), "has no mass"),
        (
            format!("{good}[[joint]]\nkind = \"ball\"\nbody = \"b\"\npoint = [0.0, 0.0, 0.0]\n"),
            "there are: a",
        ),
        (
            format!("{good}fixed = true\n[[joint]]\nkind = \"weld\"\nbody = \"a\"\n"),
            "whose motion is prescribed",
        ),
        (format!("{good}spring = 1\n"), "spring"),
    ] {
        let program = Program::try_run(&scene(&rigid), &[]);
        assert_eq!(program.code(), Some(2), "{rigid}\n{}", program.errors());
        assert!(program.errors().contains(words), "{words}: {}", program.errors());
    }
    let gauss = scene(good).replace("implicit-midpoint", "gauss");
    let program = Program::try_run(&gauss, &[]);
    assert_eq!(program.code(), Some(2));
    assert!(program.errors().contains("energy-momentum"), "{}", program.errors());
}

/// A flat body, whose largest principal moment is the sum of the others, moves as the limit of ever thinner bodies,
/// both free and held by a joint off its plane.
#[test]
fn a_flat_body_moves_as_thin_ones_do() {
    let end = |scheme: &str, largest: f64, joint: &str| {
        let program = Program::run(&format!(
            r#"
gravity = [0.0, -9.81, 0.0]
[time]
end = 1.0
step = 2e-3
scheme = "{scheme}"
[solver]
tolerance = 1e-10
[[rigid]]
name = "plate"
mass = 3.0
inertia = [1.0, 2.0, {largest:?}]
angular_velocity = [1.0, 2.0, 0.5]
{joint}
[output]
history = 1
"#
        ));
        let history = program.history();
        let exchange = drift(&history, "kinetic");
        assert!(drift(&history, "total") < 1e-4 * exchange, "{scheme}: {:e}", drift(&history, "total"));
        ["x", "y", "z", "qw", "qx", "qy", "qz"].map(|name| history.last(&format!("plate.{name}")))
    };
    let off_plane = "[[joint]]\nkind = \"ball\"\nbody = \"plate\"\npoint = [0.2, 0.3, 0.5]";
    for scheme in ["stormer-verlet", "implicit-midpoint", "energy-momentum"] {
        for joint in ["", off_plane] {
            let flat = end(scheme, 3.0, joint);
            for thin in [1e-3, 1e-5] {
                let near = end(scheme, 3.0 - thin, joint);
                let off = flat.iter().zip(near).fold(0.0_f64, |off, (a, b)| off.max((a - b).abs()));
                assert!(off < thin, "{scheme} {joint}: off by {off:e} for {thin:e}");
            }
        }
    }
}

/// `auto` chooses for a body that turns, whose rate counts as its highest frequency, and for bodies that meet. Explicit steps of the
/// latter are not changed on the way, and are shorter than the flight by a tenth of the thickness of a body.
#[test]
fn auto_chooses_for_rigid_bodies() {
    let scene = |rigids: &str, end: f64| {
        Program::run(&format!("[time]\nend = {end}\nscheme = \"auto\"\ntolerance = 0.01\n{rigids}"))
    };
    let spinning = "[[rigid]]\nname = \"top\"\nmass = 2.0\ninertia = [1.0, 2.0, 2.8]\nangular_velocity = [0.05, 1.0, 0.01]\n";
    let turned = scene(spinning, 6.0).report();
    assert!(turned["auto"]["highest_frequency"].as_f64().unwrap() > 0.9, "{}", turned["auto"]);
    assert!(
        turned["auto"]["candidates"][0]["predicted_error"].as_f64().unwrap() < 0.01,
        "{}",
        turned["auto"]
    );
    let balls = r#"
[contact]
[[rigid]]
name = "left"
shape = { kind = "sphere", radius = 0.05 }
density = 1000.0
velocity = [1.0, 0.0, 0.0]
[[rigid]]
name = "right"
shape = { kind = "sphere", radius = 0.05 }
density = 1000.0
position = [0.2, 0.01, 0.0]
"#;
    let program = scene(balls, 0.4);
    let (report, history) = (program.report(), program.history());
    assert!(report["h"].as_f64().unwrap() <= 0.01, "{}", report["h"]);
    assert_eq!(report["substeps"]["steps_cut"], 0);
    assert!(history.column("smallest_gap").iter().all(|&gap| gap > 0.0));
    assert!(history.column("right.x").last().unwrap() > &0.3, "{:?}", history.column("right.x").last());
}

/// A bench of a scene with a rigid body takes a reference that accepts constraints.
#[test]
fn a_rigid_body_can_be_measured() {
    let program = crate::program::Program::check(
        r#"
gravity = [0.0, -9.81, 0.0]
[time]
end = 0.02
step = 1e-3
scheme = "stormer-verlet"
[[rigid]]
name = "a"
shape = { kind = "rod", length = 0.5, radius = 0.05 }
density = 500.0
position = [-0.25, 0.1, 0.1]
[[body]]
name = "b"
box = { size = [0.4, 0.2, 0.2], cells = [2, 1, 1] }
material = { law = "neo-hookean", young = 1e5, poisson = 0.3, density = 1000.0 }
[[attach]]
body = "b"
region = "x-min"
to = "a"
"#,
    );
    let output = crate::program::command()
        .current_dir(program.directory())
        .args(["bench", "scene.toml", "--budget", "3", "--schemes", "stormer-verlet", "--json"])
        .output()
        .unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let report: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(report["reference"]["scheme"], "stormer-verlet", "{}", report["reference"]);
}
