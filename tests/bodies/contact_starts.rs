//! Tests starts that touch or cross: errors that name the pairs, bodies that are parted on request, and joined bodies.

use super::contact::{block, heap};
use crate::program::Program;

#[test]
fn a_start_that_touches_or_crosses_names_the_pair() {
    let refused = |scene: &str, words: &[&str]| {
        let program = Program::try_run(scene, &[]);
        assert_eq!(program.code(), Some(2), "{}", program.errors());
        assert!(words.iter().all(|word| program.errors().contains(word)), "{words:?}: {}", program.errors());
    };
    let sunk = block("energy-momentum", "").replace("origin = [0.0, 0.0, 0.1]", "origin = [0.0, 0.0, -0.05]");
    refused(&sunk, &["'block' and 'floor' meet at the start", "contact.exclude"]);
    let through =
        heap("energy-momentum", "").replace("position = [0.0, 0.0, 0.03]", "position = [0.0, 0.0, 0.01]");
    refused(&through, &["'table'", "'brick'", "at the start"]);
}

/// A body that starts entirely inside another one has no touching or crossing surfaces, but is still detected.
#[test]
fn a_start_within_another_body_names_the_pair() {
    let nested = |shape: &str, fixed: &str| {
        format!(
            r#"
[time]
end = 0.01
step = 1e-3
scheme = "energy-momentum"
[contact]
[[body]]
name = "jelly"
box = {{ size = [1.0, 1.0, 1.0], cells = [2, 2, 2], element = "tet4" }}
material = {{ law = "neo-hookean", young = 1e5, poisson = 0.3, density = 1000.0 }}
[[rigid]]
name = "stone"
shape = {shape}
{fixed}
density = 1000.0
position = [0.45, 0.52, 0.5]
"#
        )
    };
    for shape in [r#"{ kind = "box", size = [0.1, 0.1, 0.1] }"#, r#"{ kind = "sphere", radius = 0.05 }"#] {
        let program = Program::try_run(&nested(shape, ""), &[]);
        assert_eq!(program.code(), Some(2), "{}", program.errors());
        let said = program.errors();
        assert!(said.contains("'stone' starts within 'jelly': point "), "{said}");
        // The named place lies in the stone, at the named distance from the nearest node of the jelly's surface.
        let after = |word: &str| said.split_once(word).expect(&said).1;
        let (place, rest) = after("is at (").split_once(") m, ").unwrap();
        let place: Vec<f64> = place.split(", ").map(|number| number.parse().unwrap()).collect();
        let distance: f64 = rest.split(' ').next().unwrap().parse().unwrap();
        let from = |node: [f64; 3]| (0..3).map(|k| (place[k] - node[k]).powi(2)).sum::<f64>().sqrt();
        assert!(from([0.45, 0.52, 0.5]) < 0.1, "{said}");
        let nodes =
            (0..27).filter(|&k| k != 13).map(|k| [k % 3, k / 3 % 3, k / 9].map(|i| 0.5 * f64::from(i)));
        let nearest = nodes.map(from).fold(f64::INFINITY, f64::min);
        assert!((distance / nearest - 1.0).abs() < 1e-3, "{said}: {nearest}");
        let parted = nested(shape, "").replace("[contact]", "[contact]\nresolve = true");
        let report = Program::run(&parted).report();
        let moved = &report["contact"]["parted_at_start"][0];
        // The shortest way out is to the left, by 0.45 m and half of the stone's size.
        assert_eq!(moved["bodies"][0], "stone");
        let by = moved["moved_by"][0].as_f64().unwrap();
        assert!((-0.51..-0.49).contains(&by), "{moved}");
    }
}

/// A `distance` larger than a gap at the start compresses the layer, which then throws the bodies apart; a note names the energy.
#[test]
fn a_start_inside_a_layer_of_the_scene_is_noted_with_its_energy() {
    let notes = |distance: &str| {
        let program = Program::run_with(&block("energy-momentum", distance), &["--set", "time.end=0.002"]);
        let notes = program.report()["notes"].to_string();
        (
            program.history().first("contact"),
            notes.split_once("contact stores ").map(|(_, note)| note.to_owned()),
        )
    };
    let (energy, note) = notes("distance = 0.15");
    let note = note.expect("a note");
    let told: f64 = note.split(' ').next().unwrap().parse().unwrap();
    assert!(energy > 0.0 && (told / energy - 1.0).abs() < 1e-3, "{energy:e}: {note}");
    assert!(note.contains("gap") && note.contains("1.000e-1 m, of a layer of 1.500e-1 m"), "{note}");
    // The gap is .1 m, up to round-off.
    for distance in ["distance = 0.1", "distance = 0.01", ""] {
        let (energy, note) = notes(distance);
        assert!(note.is_none() && energy < 1e-20, "{distance}: {energy:e}, {note:?}");
    }
}

/// `contact.resolve` moves whole bodies the shortest way out, and the run that starts there conserves its energy.
#[test]
fn a_start_that_touches_is_parted_where_that_is_asked_for() {
    let sunk = block("energy-momentum", "resolve = true")
        .replace("origin = [0.0, 0.0, 0.1]", "origin = [0.0, 0.0, -0.05]")
        .replace("density = 1000.0 }", "density = 1000.0 }\nvelocity = [0.0, 0.0, -0.5]");
    let program = Program::run(&sunk);
    let moved = program.report()["contact"]["parted_at_start"][0].clone();
    let by = moved["moved_by"][2].as_f64().unwrap();
    // The depth of 50 mm, plus the layer: a tenth of the edges of 0.1 m.
    assert!((by - 0.06).abs() < 1e-6, "{moved}");
    // The weight of 8 kg was lifted by this distance.
    let energy = moved["potential_energy"].as_f64().unwrap();
    assert!((energy / (8.0 * 9.81 * by) - 1.0).abs() < 1e-12, "{moved}");
    assert!(program.history().imbalance() < 1e-9);
    let through = heap("energy-momentum", "")
        .replace("position = [0.0, 0.0, 0.03]", "position = [0.0, 0.0, 0.01]")
        .replace("[contact]", "[contact]\nresolve = true");
    let report = Program::run(&through).report();
    let names: Vec<&str> = report["contact"]["parted_at_start"]
        .as_array()
        .unwrap()
        .iter()
        .flat_map(|moved| moved["bodies"].as_array().unwrap())
        .map(|name| name.as_str().unwrap())
        .collect();
    assert!(names.contains(&"brick"), "{names:?}");
    let held = sunk
        .replace("-0.05]", "-0.15]")
        .replace("[solver]", "[[fix]]\nbody = \"block\"\nregion = \"z-min\"\n[solver]");
    let program = Program::try_run(&held, &[]);
    assert_eq!(program.code(), Some(2));
    assert!(program.errors().contains("neither 'block' nor 'floor' can be moved"), "{}", program.errors());
}

/// A box between two plates that leave it no room comes out of one into the other. The error names both pairs.
#[test]
fn a_start_that_cannot_be_parted_names_the_pairs() {
    let program = Program::try_run(
        r#"
[time]
end = 1e-3
step = 1e-3
scheme = "energy-momentum"
[contact]
resolve = true
[[rigid]]
name = "floor"
shape = { kind = "plane", normal = [0, 0, 1] }
fixed = true
[[rigid]]
name = "ceiling"
shape = { kind = "plane", normal = [0, 0, -1] }
position = [0.0, 0.0, 0.09]
fixed = true
[[rigid]]
name = "box"
shape = { kind = "box", size = [0.1, 0.1, 0.1] }
position = [0.0, 0.0, 0.05]
density = 1000.0
"#,
        &[],
    );
    assert_eq!(program.code(), Some(2));
    let said = program.errors();
    assert!(said.contains("together again"), "{said}");
    for name in ["'floor'", "'ceiling'", "'box'"] {
        assert!(said.contains(name), "{name}: {said}");
    }
}

/// Joined bodies are moved together, and the potential energy that this takes is that of all of them.
#[test]
fn joined_bodies_are_parted_as_one() {
    let program = Program::run(
        r#"
gravity = [0.0, 0.0, -9.81]
[time]
end = 1e-3
step = 1e-3
scheme = "energy-momentum"
[contact]
resolve = true
[[rigid]]
name = "lower"
shape = { kind = "box", size = [0.1, 0.1, 0.1] }
mass = 2.0
position = [0.0, 0.0, 0.03]
[[rigid]]
name = "upper"
shape = { kind = "box", size = [0.1, 0.1, 0.1] }
mass = 3.0
position = [0.0, 0.0, 0.2]
[[joint]]
kind = "ball"
body = "lower"
to = "upper"
point = [0.0, 0.0, 0.1]
[[rigid]]
name = "floor"
shape = { kind = "plane", normal = [0, 0, 1] }
fixed = true
"#,
    );
    let report = program.report();
    let parted = report["contact"]["parted_at_start"].as_array().unwrap();
    assert_eq!(parted.len(), 1);
    assert_eq!(parted[0]["bodies"], serde_json::json!(["lower", "upper"]));
    let (by, energy) = (&parted[0]["moved_by"][2], &parted[0]["potential_energy"]);
    assert!(
        (energy.as_f64().unwrap() / (5.0 * 9.81 * by.as_f64().unwrap()) - 1.0).abs() < 1e-12,
        "{}",
        parted[0]
    );
}

/// Bodies that are joined by a hinge or an attachment have contact everywhere except at the joint.
#[test]
fn joined_bodies_meet_elsewhere_than_where_they_are_joined() {
    let scene = |scheme: &str| {
        format!(
            r#"
gravity = [0.0, 0.0, -9.81]
[time]
end = 0.4
step = 1e-3
scheme = "{scheme}"
[contact]
[[rigid]]
name = "base"
shape = {{ kind = "box", size = [0.4, 0.1, 0.02] }}
position = [0.0, 0.0, -0.01]
fixed = true
[[rigid]]
name = "leaf"
shape = {{ kind = "box", size = [0.02, 0.1, 0.4] }}
density = 1000.0
position = [-0.19, 0.0, 0.215]
angular_velocity = [0.0, 2.0, 0.0]
velocity = [0.41, 0.0, -0.02]
[[joint]]
kind = "hinge"
body = "leaf"
to = "base"
point = [-0.2, 0.0, 0.01]
axis = [0.0, 1.0, 0.0]
[[body]]
name = "flap"
sheet = {{ size = [0.15, 0.1], cells = [3, 2], origin = [0.2005, -0.05, -0.005] }}
material = {{ law = "st-venant-kirchhoff", young = 1e5, poisson = 0.3, density = 300.0, thickness = 1e-3 }}
[[attach]]
body = "flap"
to = "base"
region = "x-min"
[output]
ledger = true
[assert]
intersections = 0
smallest_gap = 1e-9
"#
        )
    };
    for scheme in ["energy-momentum", "implicit-midpoint"] {
        let program = Program::run(&scene(scheme));
        let history = program.history();
        assert!(history.column("pairs").iter().any(|&pairs| pairs > 0.0), "{scheme}");
        // Without contact the leaf would fall through the base.
        assert!(history.column("leaf.z").iter().all(|&z| z > 0.05), "{scheme}");
        let report = program.report();
        let skipped = &report["contact"]["reasons_to_skip"];
        assert_eq!(skipped["a rigid body does not meet itself"], 2, "{scheme}: {skipped}");
        assert_eq!(report["contact"]["pairs_of_bodies_searched"], 4, "{scheme}: {}", report["contact"]);
        assert!(
            program.history().imbalance() < if scheme == "energy-momentum" { 1e-8 } else { 3e-2 },
            "{scheme}"
        );
    }
}
