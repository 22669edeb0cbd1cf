//! Tests paths of equilibria through limit points, from scenes. The rows follow exact curves down their falling
//! branches, controlled by arc length, by a displacement and by a volume. An interrupted run writes the same bytes.

use std::fmt::Write as _;

use crate::program::{History, Program};
use variational::prelude::*;
use variational::run::checkpoint::newest;
use variational::run::resume;

const YOUNG: f64 = 3.0;
const POISSON: f64 = 0.4;
/// Radii of the sphere at rest (m).
const INNER: f64 = 1.0;
const OUTER: f64 = 2.0;
/// Pressure at load factor 1 (Pa).
const PRESSURE: f64 = 1.0;

/// Returns the inner radius (m) and inner pressure (Pa) of a thick neo-Hookean sphere, W = μ/2 (I₁ − 3) − μ ln J + λ/2
/// ln² J, whose outer radius is `outer`. Integrates dP_r/dR + 2 (P_r − P_θ)/R = 0 from the outer surface inwards by the
/// Runge–Kutta method.
fn sphere(outer: f64) -> (f64, f64) {
    let mu = 0.5 * YOUNG / (1.0 + POISSON);
    let lambda = YOUNG * POISSON / ((1.0 + POISSON) * (1.0 - 2.0 * POISSON));
    let log = |radial: f64, hoop: f64| (radial * hoop * hoop).ln();
    let stress = |stretch: f64, log: f64| mu * (stretch - 1.0 / stretch) + lambda * log / stretch;
    let slope = |radial: f64, log: f64| mu * (1.0 + radial.powi(-2)) + lambda * (1.0 - log) / radial.powi(2);
    // The outer surface is free of stress. The iteration for its radial stretch starts from that of an incompressible
    // body.
    let mut radial = (OUTER / outer).powi(2);
    for _ in 0..60 {
        let log = log(radial, outer / OUTER);
        radial -= stress(radial, log) / slope(radial, log);
    }
    // Returns the derivatives of r and of the radial stretch with respect to R.
    let rates = |at: f64, [r, radial]: [f64; 2]| {
        let hoop = r / at;
        let log = log(radial, hoop);
        let turned = 2.0 * lambda / (radial * hoop) * (radial - hoop) / at;
        let balance = 2.0 * (stress(radial, log) - stress(hoop, log)) / at;
        [radial, -(balance + turned) / slope(radial, log)]
    };
    let (steps, mut at, mut y) = (400, OUTER, [outer, radial]);
    let h = (INNER - OUTER) / f64::from(steps);
    for _ in 0..steps {
        let ahead = |k: [f64; 2], h: f64| [y[0] + h * k[0], y[1] + h * k[1]];
        let a = rates(at, y);
        let b = rates(at + 0.5 * h, ahead(a, 0.5 * h));
        let c = rates(at + 0.5 * h, ahead(b, 0.5 * h));
        let d = rates(at + h, ahead(c, h));
        y = [0, 1].map(|i| y[i] + h / 6.0 * (a[i] + 2.0 * b[i] + 2.0 * c[i] + d[i]));
        at += h;
    }
    let hoop = y[0] / INNER;
    (y[0], -stress(y[1], log(y[1], hoop)) / hoop.powi(2))
}

/// Returns the pressure at an inner radius, found by bisection in the outer radius.
fn pressure_at(inner: f64) -> f64 {
    let (mut low, mut high) = (OUTER, OUTER + inner);
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if sphere(middle).0 < inner { low = middle } else { high = middle }
    }
    sphere(0.5 * (low + high)).1
}

/// Writes an octant of the sphere as a Gmsh 2.2 file with the surface `inside`: curved wedges of 15 nodes, `n` per side
/// and `layers` through the thickness.
fn octant(n: usize, layers: usize) -> String {
    let (fine, levels) = (2 * n, 2 * layers);
    let mut nodes = Vec::new();
    let mut number = std::collections::HashMap::new();
    for level in 0..=levels {
        for i in 0..=fine {
            for j in 0..=fine - i {
                // The middle nodes of a wedge's triangles have no counterpart half way through a layer.
                if level % 2 == 1 && (i % 2, j % 2) != (0, 0) {
                    continue;
                }
                let direction = [i, j, fine - i - j].map(|k| k as f64);
                let norm = direction.iter().map(|x| x * x).sum::<f64>().sqrt();
                let radius = INNER + (OUTER - INNER) * level as f64 / levels as f64;
                number.insert((i, j, level), nodes.len() + 1);
                nodes.push(direction.map(|x| radius * x / norm));
            }
        }
    }
    let mut elements = Vec::new();
    let mut wedges = |corners: [[usize; 2]; 3]| {
        // Returns the nodes of a triangle on the fine grid: its corners and the middles between them.
        let middle = |a: usize, b: usize| [0, 1].map(|k| (corners[a][k] + corners[b][k]) / 2);
        let plane = [corners[0], corners[1], corners[2], middle(0, 1), middle(1, 2), middle(2, 0)];
        let at = |place: usize, level: usize| number[&(plane[place][0], plane[place][1], level)];
        for layer in 0..layers {
            let [low, half, high] = [2 * layer, 2 * layer + 1, 2 * layer + 2];
            let nodes = [
                at(0, low),
                at(1, low),
                at(2, low),
                at(0, high),
                at(1, high),
                at(2, high),
                at(3, low),
                at(5, low),
                at(0, half),
                at(4, low),
                at(1, half),
                at(2, half),
                at(3, high),
                at(5, high),
                at(4, high),
            ];
            elements.push((18, 1, nodes.to_vec()));
        }
        // Numbers the triangle so that its normal points out of the cavity.
        elements.push((9, 2, [0, 2, 1, 5, 4, 3].map(|place| at(place, 0)).to_vec()));
    };
    for i in (0..fine).step_by(2) {
        for j in (0..fine - i).step_by(2) {
            wedges([[i, j], [i + 2, j], [i, j + 2]]);
            if i + j + 2 < fine {
                wedges([[i + 2, j], [i + 2, j + 2], [i, j + 2]]);
            }
        }
    }
    let mut text = String::from(
        "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$PhysicalNames\n2\n2 2 \"inside\"\n3 1 \"wall\"\n$EndPhysicalNames\n",
    );
    let _ = writeln!(text, "$Nodes\n{}", nodes.len());
    for (index, [x, y, z]) in nodes.iter().enumerate() {
        let _ = writeln!(text, "{} {x:?} {y:?} {z:?}", index + 1);
    }
    let _ = writeln!(text, "$EndNodes\n$Elements\n{}", elements.len());
    for (index, (kind, tag, nodes)) in elements.iter().enumerate() {
        let nodes: Vec<_> = nodes.iter().map(ToString::to_string).collect();
        let _ = writeln!(text, "{} {kind} 2 {tag} {tag} {}", index + 1, nodes.join(" "));
    }
    text + "$EndElements\n"
}

/// Describes the octant under inner pressure, with the given lines of [time] and [static].
fn inflation(mesh: &std::path::Path, time: &str, statics: &str) -> String {
    let planes: String = ["x", "y", "z"]
        .iter()
        .enumerate()
        .map(|(axis, name)| {
            let mut max = [9.0; 3];
            max[axis] = 1e-9;
            format!(
                "[[fix]]\nbody = \"ball\"\naxes = [\"{name}\"]\nbox = {{ min = [-1e-9, -1e-9, -1e-9], max = {max:?} }}\n"
            )
        })
        .collect();
    format!(
        r#"
        [time]
        scheme = "implicit-midpoint"
        {time}
        [static]
        {statics}
        [[body]]
        name = "ball"
        mesh = "{}"
        material = {{ law = "neo-hookean", young = {YOUNG}, poisson = {POISSON}, density = 1.0 }}
        {planes}
        [[load]]
        kind = "pressure"
        body = "ball"
        region = "inside"
        pressure = {PRESSURE}
        amplitude = "t"
        [[probe]]
        name = "inner"
        body = "ball"
        point = [{INNER}, 0.0, 0.0]
        "#,
        mesh.display()
    )
}

/// Checks the pressures of all rows against the exact curve, and that the sphere is pushed down its falling branch.
/// Returns the largest inner radius.
fn assert_on_curve(history: &History, what: &str) -> f64 {
    let (radius, factor) = (history.column("inner.x"), history.column("load_factor"));
    let largest = factor.iter().fold(0.0_f64, |most, &p| most.max(p));
    for (&radius, &factor) in radius.iter().zip(&factor) {
        let exact = pressure_at(radius) / PRESSURE;
        assert!(
            (factor - exact).abs() < 0.006 * largest,
            "{what}, radius {radius}: {factor}, exactly {exact}"
        );
    }
    assert!(factor.last().unwrap() < &(0.95 * largest), "{what} falls: {factor:?}");
    radius.into_iter().fold(0.0, f64::max)
}

#[test]
fn a_thick_sphere_is_inflated_down_the_falling_branch() {
    let directory = tempfile::TempDir::new().unwrap();
    let mesh = directory.path().join("octant.msh");
    std::fs::write(&mesh, octant(3, 3)).unwrap();
    let octant_volume = |radius: f64| std::f64::consts::PI / 6.0 * radius.powi(3);
    let growth = octant_volume(3.0) - octant_volume(INNER);

    let volume =
        format!("control = {{ kind = \"volume\", body = \"ball\", region = \"inside\", to = {growth} }}");
    let program = Program::run(&inflation(&mesh, "end = 1.0\nstep = 0.05", &volume));
    let history = program.history();
    let largest = assert_on_curve(&history, "volume");
    assert!((largest - 3.0).abs() < 0.01, "{largest}");
    assert_eq!(history.column("t").len(), 21);
    let report = program.report();
    let limit = report["notes"].to_string().matches("a limit point").count();
    assert_eq!(limit, 1, "{report}");

    let displacement = "control = { kind = \"displacement\", probe = \"inner\", axis = \"x\", to = 2.0 }";
    let program = Program::run(&inflation(&mesh, "end = 1.0\nstep = 0.05", displacement));
    let radius = program.history().column("inner.x");
    for (row, radius) in radius.iter().enumerate() {
        assert!((radius - 1.0 - 0.1 * row as f64).abs() < 1e-12, "{radius}");
    }
    assert_on_curve(&program.history(), "displacement");

    let program = Program::run(&inflation(&mesh, "end = 1.0\nstep = 0.2", "arc_steps = 60"));
    let history = program.history();
    assert_on_curve(&history, "arc");
    assert_eq!(history.column("t").len(), 61);
    assert!(program.errors().contains("for all 60 arc steps"), "{}", program.errors());
}

/// Ends the run after the given step, as Ctrl-C does.
struct StopAfter(u64);

impl Watch for StopAfter {
    fn step(&mut self, simulation: &Simulation) -> bool {
        simulation.steps() < self.0
    }
}

#[test]
fn a_path_that_was_interrupted_goes_on_to_the_same_bytes() {
    let directory = tempfile::TempDir::new().unwrap();
    let mesh = directory.path().join("octant.msh");
    std::fs::write(&mesh, octant(1, 2)).unwrap();
    let displacement = "control = { kind = \"displacement\", probe = \"inner\", axis = \"x\", to = 1.5 }";
    for statics in ["arc_steps = 30", displacement] {
        let text = inflation(&mesh, "end = 1.0\nstep = 0.05", statics)
            + "[output]\ninterval = 0.1\n[checkpoint]\ninterval = 0.15\n";
        let parsed = Scene::parse(&text, &[]);
        let scene = || parsed.scene.clone().unwrap();
        let (whole, cut) = (directory.path().join("whole"), directory.path().join("cut"));
        let report = run(scene(), "ball", &whole, &mut ()).unwrap();
        run(scene(), "ball", &cut, &mut StopAfter(14)).unwrap();
        let found = newest(&cut).unwrap();
        let resumed = resume(scene(), &found.checkpoint, &cut, &mut ()).unwrap();
        assert_eq!(report.notes, resumed.notes, "{statics}");
        for entry in std::fs::read_dir(&whole).unwrap() {
            let path = entry.unwrap().path();
            let name = path.file_name().unwrap();
            if path.extension().is_none_or(|ending| ending != "vck") && name != "report.json" {
                assert!(std::fs::read(&path).unwrap() == std::fs::read(cut.join(name)).unwrap(), "{name:?}");
            }
        }
        assert!(report.frames > 5, "{}", report.frames);
    }
}

#[test]
fn what_cannot_be_followed_is_refused_with_the_way_out() {
    let directory = tempfile::TempDir::new().unwrap();
    let mesh = directory.path().join("octant.msh");
    std::fs::write(&mesh, octant(1, 1)).unwrap();
    let said = |statics: &str, code: i32, expected: &str| {
        let program = Program::try_run(&inflation(&mesh, "end = 1.0\nstep = 0.5", statics), &[]);
        let errors = program.errors();
        assert!(program.code() == Some(code) && errors.contains(expected), "{statics}: {errors}");
    };
    let volume = "control = { kind = \"volume\", body = \"ball\", region = \"inside\", to = 1.0 }";
    said(&format!("arc_steps = 5\n{volume}"), 2, "only one of");
    said("arc_steps = 0", 2, "at least 1");
    said("arc_steps = 5\npush = 0.1", 2, "remove this key");
    said(
        "control = { kind = \"displacement\", probe = \"outer\", axis = \"x\", to = 1.0 }",
        2,
        "no probe named 'outer'",
    );
    said(
        "control = { kind = \"volume\", body = \"bal\", region = \"inside\", to = 1.0 }",
        2,
        "there is no body 'bal'",
    );
    said(
        "control = { kind = \"volume\", body = \"ball\", region = \"wall\", to = 1.0 }",
        2,
        "name a surface region",
    );
    said(
        "control = { kind = \"displacement\", probe = \"inner\", axis = \"y\", to = 1.0 }",
        4,
        "does not respond to the load",
    );
}

/// Returns a column of square section with one end clamped, which bends in the plane xy. The load on its other end is `load` t (N).
fn column(length: f64, height: f64, young: f64, load: f64) -> String {
    format!(
        r#"
[[body]]
name = "b"
box = {{ size = [{length}, {height}, {height}], cells = [12, 1, 1], element = "hex20" }}
material = {{ law = "st-venant-kirchhoff", young = {young}, poisson = 0.0, density = 1000.0 }}
[[fix]]
body = "b"
region = "x-min"
[[fix]]
body = "b"
region = "box"
axes = ["z"]
[[load]]
kind = "force"
body = "b"
region = "x-max"
force = [{}, 0.0, 0.0]
amplitude = "t"
[[probe]]
name = "tip"
body = "b"
point = [{length}, {}, 0.0]
"#,
        -load,
        0.5 * height
    )
}

/// A column buckles once: at Euler's load, and no other load factor is named however far the unstable path is followed. Its load is
/// π² E I/(4 L²) times (1 − π² (h/L)²/48) or so, by the shortening before.
#[test]
fn a_column_buckles_once() {
    let (length, height, young) = (1.0_f64, 0.05_f64, 1e8_f64);
    let euler = std::f64::consts::PI.powi(2) * young * height.powi(4) / 12.0 / (4.0 * length * length);
    let program = Program::run(&format!(
        "[time]\nend = 1.3\nstep = 0.05\n[static]\n{}",
        column(length, height, young, euler)
    ));
    let report = program.report();
    let notes: Vec<&str> =
        report["notes"].as_array().unwrap().iter().filter_map(|note| note.as_str()).collect();
    let found: Vec<f64> = notes
        .iter()
        .filter(|note| note.contains("buckles"))
        .map(|note| note.split_whitespace().nth(3).unwrap().parse().unwrap())
        .collect();
    assert_eq!(found.len(), 1, "{notes:?}");
    assert!((found[0] - 1.0).abs() < 5e-3, "{found:?}");
}

/// Returns how far the end of an inextensible column moves sideways, over its length, at the load P (over Euler's): 4 k/(π √P), where
/// 2 K(k)/π = √P with the complete elliptic integral K (Timoshenko and Gere, Theory of Elastic Stability).
fn elastica(load: f64) -> f64 {
    let complete = |k: f64| {
        // The arithmetic-geometric mean of 1 and √(1 − k²).
        let (mut a, mut b) = (1.0, (1.0 - k * k).sqrt());
        for _ in 0..40 {
            (a, b) = (0.5 * (a + b), f64::sqrt(a * b));
        }
        std::f64::consts::FRAC_PI_2 / a
    };
    let (mut low, mut high) = (0.0, 1.0 - 1e-12);
    for _ in 0..60 {
        let k = 0.5 * (low + high);
        if complete(k) < std::f64::consts::FRAC_PI_2 * load.sqrt() { low = k } else { high = k }
    }
    4.0 * low / (std::f64::consts::PI * load.sqrt())
}

/// A column that is pushed from its straight path comes to rest as the elastica, whatever the push and the increments: also where the
/// first unstable equilibrium is so close to the critical load that the energy hardly falls along the mode.
#[test]
fn a_pushed_column_bends_as_the_elastica() {
    let (length, height, young) = (1.0_f64, 0.05_f64, 1e8_f64);
    let euler = std::f64::consts::PI.powi(2) * young * height.powi(4) / 12.0 / (4.0 * length * length);
    for (push, step, end) in [(1e-5, 0.25, 1.5), (1e-2, 0.1, 1.2)] {
        let program = Program::run(&format!(
            "[time]\nend = {end}\nstep = {step}\n[static]\npush = {push}\n{}",
            column(length, height, young, euler)
        ));
        let sideways = program.history().last("tip.uy").abs();
        let exact = elastica(end) * length;
        assert!((sideways / exact - 1.0).abs() < 1e-2, "{push} m, {step}: {sideways} of {exact} m");
        let notes = program.report()["notes"].to_string();
        assert_eq!(notes.matches("a bifurcation").count(), 1, "{push} m, {step}: {notes}");
    }
}
