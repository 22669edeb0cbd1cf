//! Measures what each scheme conserves for each kind of body in contact, and prints the conformance table of
//! docs/validation-contact.md: `cargo test --test bodies conformance -- --nocapture`.
//!
//! A body flies at an angle onto a smooth floor and bounces. The floor has no friction, so that the energy and the
//! horizontal momentum of the body are conserved.

use crate::program::Program;

/// A scheme with the largest relative error of energy that is accepted, its step, and whether it takes free rigid bodies. The error
/// is round-off of the solves with `energy-momentum`, and the band of the scheme for the others. Schemes for comparison have no
/// band: `backward-euler` loses energy in an impact, and a run by `bdf2` may gain some in one of few steps, and then says so.
const SCHEMES: [(&str, Option<f64>, &str, bool); 7] = [
    ("energy-momentum", Some(1e-8), "1e-3", true),
    ("implicit-midpoint", Some(5e-2), "1e-3", true),
    ("stormer-verlet", Some(5e-2), "5e-4", true),
    ("blanes-moan-4", Some(1e-3), "2e-4", false),
    ("gauss", Some(1e-3), "1e-4", false),
    ("backward-euler", None, "1e-3", true),
    ("bdf2", None, "1e-3", true),
];

const BODIES: [(&str, &str); 7] = [
    ("tet4", SOLID),
    ("tet10", SOLID),
    ("hex8", SOLID),
    (
        "sheet",
        "[[body]]\nname = \"b\"\nsheet = { size = [0.2, 0.2], cells = [4, 4], origin = [0.0, 0.0, 0.02] }\nvelocity = [0.3, 0.2, \"-1.0 - 2*x\"]\nmaterial = { law = \"st-venant-kirchhoff\", young = 1e5, poisson = 0.3, area_density = 0.3, thickness = 2e-3 }\n",
    ),
    (
        "rigid box",
        "[[rigid]]\nname = \"b\"\nshape = { kind = \"box\", size = [0.1, 0.08, 0.06] }\ndensity = 1000.0\nposition = [0.0, 0.0, 0.1]\nangular_velocity = [1.0, 2.0, 0.0]\nvelocity = [0.3, 0.2, -1.0]\n",
    ),
    (
        "rigid ball",
        "[[rigid]]\nname = \"b\"\nshape = { kind = \"sphere\", radius = 0.05 }\ndensity = 1000.0\nposition = [0.0, 0.0, 0.1]\nangular_velocity = [1.0, 2.0, 0.0]\nvelocity = [0.3, 0.2, -1.0]\n",
    ),
    (
        "rigid capsule",
        "[[rigid]]\nname = \"b\"\nshape = { kind = \"capsule\", length = 0.1, radius = 0.03 }\ndensity = 1000.0\nposition = [0.0, 0.0, 0.08]\nangular_velocity = [1.0, 2.0, 0.0]\nvelocity = [0.3, 0.2, -1.0]\n",
    ),
];

const SOLID: &str = "[[body]]\nname = \"b\"\nbox = { size = [0.1, 0.1, 0.1], cells = [2, 2, 2], element = \"ELEMENT\", origin = [0.0, 0.0, 0.03] }\nvelocity = [0.3, 0.2, -1.0]\nmaterial = { law = \"neo-hookean\", young = 1e5, poisson = 0.3, density = 1000.0 }\n";

fn scene(body: &str, element: &str, scheme: &str, step: &str) -> String {
    let body = body.replace("ELEMENT", element);
    format!(
        r#"
gravity = [0.0, 0.0, -9.81]
[time]
end = 0.08
step = {step}
scheme = "{scheme}"
[contact]
[[rigid]]
name = "floor"
shape = {{ kind = "plane", normal = [0, 0, 1] }}
fixed = true
{body}
[solver]
tolerance = 1e-10
[assert]
smallest_gap = 1e-9
"#
    )
}

#[test]
fn every_body_keeps_its_energy_and_momentum_under_every_scheme() {
    println!("| body | scheme | energy | momentum | smallest gap / m | bits |\n|---|---|--:|--:|--:|---|");
    for (kind, body) in BODIES {
        for (scheme, bound, step, takes_rigid) in SCHEMES {
            if kind.starts_with("rigid") && !takes_rigid {
                continue;
            }
            let text = scene(body, kind, scheme, step);
            let [one, two] = ["1", "2"].map(|threads| Program::run_with(&text, &["--threads", threads]));
            let bits = [&one, &two].map(|run| std::fs::read(run.out().join("history.csv")).unwrap());
            assert!(bits[0] == bits[1], "{kind} {scheme}: 1 and 2 threads differ");
            let history = one.history();
            let kinetic = history.column("kinetic").into_iter().fold(0.0, f64::max);
            let total = history.column("total");
            let energy = total.iter().map(|e| (e - total[0]).abs()).fold(0.0, f64::max) / kinetic;
            let momentum = ["px", "py"].map(|name| {
                let p = history.column(name);
                p.iter().map(|value| (value / p[0] - 1.0).abs()).fold(0.0, f64::max)
            });
            let momentum = momentum[0].max(momentum[1]);
            let gap = history.column("smallest_gap").into_iter().fold(f64::INFINITY, f64::min);
            println!("| {kind} | `{scheme}` | {energy:.1e} | {momentum:.1e} | {gap:.1e} | same |");
            assert!(gap.is_finite() && gap > 0.0, "{kind} {scheme}: no contact");
            match bound {
                Some(bound) => assert!(energy < bound, "{kind} {scheme}: energy {energy:e}"),
                None => {
                    let has_gained = total[total.len() - 1] > total[0];
                    let notes = one.report()["notes"].to_string();
                    let is_told = scheme == "bdf2" && notes.contains("the energy grew without a source");
                    assert!(!has_gained || is_told, "{kind} {scheme}: gained, {notes}");
                }
            }
            assert!(momentum < 1e-10, "{kind} {scheme}: momentum {momentum:e}");
        }
    }
}

/// A cloth whose nodes and triangles have other numbers in its file moves as before to round-off, with friction too.
#[test]
fn numbers_of_nodes_do_not_matter_to_contact() {
    let directory = tempfile::TempDir::new().unwrap();
    let count = 9;
    let file = |name: &str, order: &dyn Fn(usize) -> usize| {
        // The node at lattice place k has the number order(k).
        let mut points = vec![String::new(); count * count];
        for k in 0..count * count {
            let (i, j) = (k % count, k / count);
            let place = |i: usize| 0.05 * i as f64 - 0.2;
            points[order(k)] = format!("v {} {} 0.3\n", place(i), place(j));
        }
        let mut faces = Vec::new();
        for k in 0..(count - 1) * (count - 1) {
            let a = k % (count - 1) + count * (k / (count - 1));
            let number = |k: usize| order(k) + 1;
            faces.push(format!("f {} {} {}\n", number(a), number(a + 1), number(a + count + 1)));
            faces.push(format!("f {} {} {}\n", number(a), number(a + count + 1), number(a + count)));
        }
        if order(0) != 0 {
            faces.reverse();
        }
        let path = directory.path().join(name);
        std::fs::write(&path, points.concat() + &faces.concat()).unwrap();
        path.display().to_string()
    };
    let run = |path: &String, friction: f64, end: f64, tolerance: f64| {
        Program::run(&format!(
            r#"
gravity = [0.0, 0.0, -9.81]
[time]
end = {end}
step = 4e-4
scheme = "stormer-verlet"
[solver]
tolerance = {tolerance:e}
[contact]
friction = {friction}
[[body]]
name = "cloth"
mesh = {path:?}
translate = [0.01, 0.02, 0.01]
velocity = [0.0, 0.0, -1.0]
material = {{ law = "st-venant-kirchhoff", young = 1e5, poisson = 0.3, area_density = 0.2, thickness = 1e-3 }}
[[rigid]]
name = "ball"
shape = {{ kind = "sphere", radius = 0.3 }}
fixed = true
"#
        ))
        .history()
    };
    let last = count * count - 1;
    let files = [file("plain.obj", &|k| k), file("shuffled.obj", &|k| last - (37 * k) % (last + 1))];
    for (friction, end, tolerance) in [(0.0, 0.12, 1e-6), (0.3, 0.08, 1e-6), (0.3, 0.08, 1e-7)] {
        let [plain, shuffled] = files.each_ref().map(|path| run(path, friction, end, tolerance));
        assert!(plain.column("pairs").iter().any(|&pairs| pairs > 0.0));
        for name in ["total", "kinetic", "friction", "pz", "lx", "ly"] {
            let (a, b) = (plain.column(name), shuffled.column(name));
            let scale = a.iter().fold(0.0, |most: f64, value| most.max(value.abs()));
            let error = a.iter().zip(&b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
            assert!(
                error < 1e-10 * scale.max(1e-3),
                "{friction} {tolerance:e} {name}: {error:e} of {scale:e}"
            );
        }
    }
}

/// Blocks that meet and slide move as before, to round-off, if their tables change places. Nodes of aligned lattices lie above edges, where
/// cells are equally near.
#[test]
fn the_order_of_bodies_does_not_matter_to_contact() {
    for (element, cells, offset) in [("hex8", 2, 0.05), ("hex8", 4, 0.0625), ("tet4", 4, 0.05)] {
        let block = |name: &str, size: &str, cells: &str, place: String, velocity: &str| {
            format!(
                r#"
[[body]]
name = "{name}"
box = {{ size = {size}, cells = {cells}, element = "{element}" }}
material = {{ law = "st-venant-kirchhoff", young = 1e6, poisson = 0.3, density = 1000.0 }}
translate = {place}
velocity = {velocity}
"#
            )
        };
        let upper = block(
            "upper",
            "[0.1, 0.1, 0.1]",
            &format!("[{cells}, {cells}, {cells}]"),
            format!("[{offset}, 0.05, 0.1005]"),
            "[0.5, 0.2, -0.5]",
        );
        let lower = block("lower", "[0.2, 0.2, 0.1]", "[4, 4, 2]", "[0, 0, 0]".to_owned(), "[0, 0, 0]");
        for (scheme, step) in [("energy-momentum", 1e-3), ("stormer-verlet", 1e-4)] {
            let head = format!(
                r#"
gravity = [0.0, 0.0, -9.81]
[time]
end = 0.008
step = {step}
scheme = "{scheme}"
[contact]
friction = 0.3
distance = 1e-3
"#
            );
            let bodies = [format!("{upper}{lower}"), format!("{lower}{upper}")];
            let [own, changed] = bodies.map(|bodies| Program::run(&format!("{head}{bodies}")).history());
            assert!(
                own.column("friction").iter().any(|joules| joules.abs() > 1e-6),
                "{element} {scheme}: no slip"
            );
            let scale = own.column("kinetic").into_iter().fold(0.0, f64::max);
            for name in ["kinetic", "elastic", "contact", "friction"] {
                let (a, b) = (own.column(name), changed.column(name));
                let error = a.iter().zip(&b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
                assert!(error < 1e-10 * scale, "{element} {cells} {scheme} {name}: {error:e} of {scale:e}");
            }
        }
    }
}
