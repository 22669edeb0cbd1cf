//! Tests that strikes give a scene the momentum that they say, whatever the struck nodes are tied to.

use crate::program::Program;
use variational::prelude::*;

const IMPULSE: [f64; 3] = [1.0, 2.0, 3.0];

/// Describes a bar of 20 kg along x from `from` to `from` + ½ m.
fn bar(name: &str, from: f64, keys: &str) -> String {
    format!(
        r#"
[[body]]
name = "{name}"
box = {{ size = [0.5, 0.2, 0.2], cells = [2, 2, 2], element = "hex8", origin = [{from}, 0, 0] }}
material = {{ law = "neo-hookean", young = 1e5, poisson = 0.3, density = 1000.0 }}
{keys}
"#
    )
}

fn panel(name: &str, from: f64) -> String {
    format!(
        r#"
[[body]]
name = "{name}"
sheet = {{ size = [0.5, 0.5], cells = [4, 4], pattern = "cross", origin = [{from}, 0, 0] }}
material = {{ law = "st-venant-kirchhoff", young = 1e5, poisson = 0.3, density = 1000.0, thickness = 0.01 }}
"#
    )
}

/// A rigid box of 20 kg from 0 to ½ m.
const RIGID: &str = r#"
[[rigid]]
name = "a"
shape = { kind = "box", size = [0.5, 0.2, 0.2] }
density = 1000.0
position = [0.25, 0.1, 0.1]
"#;
const ATTACHED: &str = "[[attach]]\nbody = \"b\"\nregion = \"x-min\"\nto = \"a\"\n";
const PERIODIC: &str =
    "[[periodic]]\nbody = \"a\"\nfrom = { region = \"x-min\" }\nto = { region = \"x-max\" }\n";
const SEWN: &str = "[[seam]]\nbody = \"a\"\nregion = \"x-max\"\nto = \"b\"\nto_region = \"x-min\"\n";

fn scene(scheme: &str, parts: &[&str]) -> Scene {
    let text = format!("[time]\nend = 0.01\nstep = 1e-4\nscheme = \"{scheme}\"\n{}", parts.concat());
    let parsed = Scene::parse(&text, &[]);
    assert_eq!(parsed.problems, [], "{text}");
    parsed.scene.unwrap()
}

fn struck(body: &str, on: Selection, impulse: [f64; 3]) -> Strike {
    Strike { body: body.into(), on, impulse }
}

fn assert_near(found: [f64; 3], wanted: [f64; 3], what: &str) {
    for (found, wanted) in found.into_iter().zip(wanted) {
        assert!((found - wanted).abs() < 1e-11, "{what}: {found} instead of {wanted}");
    }
}

fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [0, 1, 2].map(|k| a[(k + 1) % 3] * b[(k + 2) % 3] - a[(k + 2) % 3] * b[(k + 1) % 3])
}

/// Σp = Σm v + J, and Σ x × p grows by c × J with the centre c of the struck mass, if nothing but other bodies holds the struck nodes.
#[test]
fn the_momentum_is_the_impulse_whatever_nodes_are_tied_to() {
    let (a, b, moving) = (bar("a", 0.0, ""), bar("b", 0.5, ""), bar("b", 0.5, "velocity = [0.3, -0.2, 0.1]"));
    let panels = [panel("a", 0.0), panel("b", 0.5)].concat();
    let face = [0.5, 0.1, 0.1];
    let cases = [
        (vec![&a[..], &b, ATTACHED], ("b", "x-min"), face),
        (vec![&a, &b, ATTACHED], ("a", "x-max"), face),
        (vec![&a, &b, ATTACHED], ("b", "box"), [0.75, 0.1, 0.1]),
        (vec![&a, &moving, ATTACHED], ("b", "x-min"), face),
        (vec![&panels, SEWN], ("a", "x-max"), [0.5, 0.25, 0.0]),
        (vec![&panels, SEWN], ("b", "x-min"), [0.5, 0.25, 0.0]),
        (vec![&b, RIGID, ATTACHED], ("b", "x-min"), face),
        (vec![&b, RIGID, ATTACHED], ("b", "y-max"), [0.75, 0.2, 0.1]),
        (vec![&b, RIGID, ATTACHED], ("b", "box"), [0.75, 0.1, 0.1]),
    ];
    for (parts, (body, region), centre) in cases {
        let what = format!("'{region}' of '{body}' of {}", parts.concat());
        let scene = scene("implicit-midpoint", &parts);
        let before = Simulation::new(scene.clone()).unwrap().observe();
        let strike = struck(body, Selection::region(region), IMPULSE);
        let mut simulation = Simulation::new(scene.strike(strike)).unwrap();
        let after = simulation.observe();
        let change = |a: [f64; 3], b: [f64; 3]| [0, 1, 2].map(|k| a[k] - b[k]);
        assert_near(change(after.momentum, before.momentum), IMPULSE, &what);
        assert_near(change(after.angular_momentum, before.angular_momentum), cross(centre, IMPULSE), &what);
        assert!(simulation.notes().is_empty(), "{:?}", simulation.notes());
    }
}

/// The nodes of both ends of a periodic body move alike: each gets the whole impulse of either end, and two strikes their sum.
#[test]
fn periodic_partners_share_an_impulse() {
    let a = bar("a", 0.0, "");
    let energies = [&["x-min"][..], &["x-max"], &["x-min", "x-max"]].map(|regions| {
        let mut scene = scene("stormer-verlet", &[&a, PERIODIC]);
        for region in regions {
            scene = scene.strike(struck("a", Selection::region(*region), IMPULSE));
        }
        let seen = Simulation::new(scene).unwrap().observe();
        let count = regions.len() as f64;
        assert_near(seen.momentum, IMPULSE.map(|impulse| count * impulse), &format!("{regions:?}"));
        seen.kinetic / (count * count)
    });
    assert!(energies.iter().all(|energy| (energy / energies[0] - 1.0).abs() < 1e-13), "{energies:?}");
}

/// The momentum is the impulse with every mass matrix, near a support too. A struck body of which every node is struck moves as one,
/// with the least energy J²/2m.
#[test]
fn the_momentum_is_the_impulse_with_every_mass() {
    let clamp = "[[fix]]\nbody = \"a\"\nregion = \"x-min\"\n";
    let mut cases = Vec::new();
    for element in ["hex8", "tet4"] {
        for order in ["", "order = 2"] {
            let a = bar("a", 0.0, order).replace("hex8", element);
            cases.push(("implicit-midpoint", "consistent", a));
        }
    }
    cases.push(("stormer-verlet", "filtered", bar("a", 0.0, "")));
    for (scheme, mass, a) in cases {
        let solver = format!("[solver]\nmass = \"{mass}\"\n");
        let near_clamp = Selection {
            plane: serde_json::from_str(r#"{ "point": [0.25, 0, 0], "normal": [1, 0, 0] }"#).unwrap(),
            ..Selection::default()
        };
        for (held, on) in [
            ("", Selection::region("x-max")),
            ("", Selection::region("box")),
            ("", Selection { nodes: Some(vec![0]), ..Selection::default() }),
            (clamp, near_clamp),
        ] {
            let scene = scene(scheme, &[&solver, &a, held]).strike(struck("a", on.clone(), IMPULSE));
            let mut simulation = Simulation::new(scene).unwrap();
            let (seen, what) = (simulation.observe(), format!("{mass} {a} {held} {on:?}"));
            assert_near(seen.momentum, IMPULSE, &what);
            // A note on the filtered mass of few elements is expected, but none on a strike.
            let is_of_strike = |note: &String| note.contains("strike");
            assert!(!simulation.notes().iter().any(is_of_strike), "{what}: {:?}", simulation.notes());
            if on == Selection::region("box") {
                assert!((seen.kinetic - 14.0 / 40.0).abs() < 1e-12, "{what}: {}", seen.kinetic);
            }
        }
    }
}

/// Held nodes take up the part of an impulse that falls on them: a note says how much. A strike of which nothing is left is
/// refused.
#[test]
fn what_supports_take_up_is_told() {
    let a = bar("a", 0.0, "");
    for (fix, kept) in [("", [0.75, 1.5, 2.25]), ("axes = [\"x\", \"z\"]", [0.75, 2.0, 2.25])] {
        let fix = format!("[[fix]]\nbody = \"a\"\nregion = \"x-min\"\n{fix}\n");
        let scene = scene("stormer-verlet", &[&a, &fix]);
        let scene = scene.strike(struck("a", Selection::region("box"), IMPULSE));
        let mut simulation = Simulation::new(scene).unwrap();
        assert_near(simulation.observe().momentum, kept, &fix);
        let lost = [0, 1, 2].map(|k| format!("{:.3e}", IMPULSE[k] - kept[k]));
        let [note] = simulation.notes() else { panic!("{:?}", simulation.notes()) };
        assert!(note.contains("strike[0]") && note.contains(&lost.join(", ")), "{note}");
    }
    let b = bar("b", 0.5, "");
    let strike = "[[strike]]\nbody = \"b\"\nregion = \"x-min\"\nimpulse = [1, 2, 3]\n";
    let fixed = RIGID.replace("density", "fixed = true\ndensity");
    let held = format!("{a}[[fix]]\nbody = \"a\"\nregion = \"x-max\"\n");
    for to in [&fixed, &held] {
        let time = "[time]\nend = 0.01\nstep = 1e-4\nscheme = \"stormer-verlet\"\n";
        let refused = Program::check(&[time, &b, to, ATTACHED, strike].concat());
        assert_eq!(refused.code(), Some(2), "{}", refused.errors());
        assert!(refused.errors().contains("strike[0]: acts on nodes that"), "{}", refused.errors());
    }
}
