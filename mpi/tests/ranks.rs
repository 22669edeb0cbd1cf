//! Runs the program on 1 to 4 ranks, and compares its files with those of one process.

mod launch;

use launch::files::{assert_in_parts, assert_same_files, files};
use launch::scenes::{BLOCK, BRACKET, BRACKET_MESH, CLOTH};
use launch::{assert_one_error, errors, place_of, room, run, run_well, scene};

/// Two bodies of several laws and elements, joined by a spring, and a third one apart.
const SEVERAL: &str = r#"
[time]
end = 5e-3
step = 1e-4
scheme = "symplectic-euler-b"
[[body]]
name = "left"
box = { size = [1.0, 0.2, 0.2], cells = [20, 4, 4], element = "hex8" }
material = { law = "st-venant-kirchhoff", young = 1e6, poisson = 0.3, density = 1000.0 }
velocity = [0.0, 1.0, 0.0]
[[body]]
name = "right"
box = { size = [0.5, 0.2, 0.2], cells = [8, 3, 3], element = "tet10", origin = [1.5, 0.0, 0.0] }
material = { law = "corotated", young = 5e5, poisson = 0.4, density = 1100.0 }
[[body]]
name = "apart"
box = { size = [0.5, 0.2, 0.2], cells = [10, 4, 4], element = "tet4", origin = [3.0, 0.0, 0.0] }
material = { law = "linear", young = 1e6, poisson = 0.3, density = 1000.0 }
angular_velocity = [0.0, 0.0, 3.0]
[[spring]]
from = { body = "left", point = [1.0, 0.1, 0.1] }
to = { body = "right", point = [1.5, 0.1, 0.1] }
stiffness = 1e3
[output]
history = 10
"#;

/// A moving support and a load that grows.
const DRIVEN: &str = r#"
gravity = [0.0, 0.0, -9.81]
[time]
end = 0.01
step = 2e-4
scheme = "stormer-verlet"
[[body]]
name = "beam"
box = { size = [1.0, 0.2, 0.2], cells = [20, 4, 4], element = "tet4" }
material = { law = "stable-neo-hookean", young = 1e6, poisson = 0.3, density = 1000.0 }
[[fix]]
body = "beam"
region = "x-min"
motion = { kind = "sine", amplitude = [0.0, 0.0, 0.01], frequency = 20.0 }
[output]
history = 9
ledger = false
interval = 5e-3
"#;

/// A soft bob on a rigid rod that hangs from a ball joint.
const RIGID: &str = r#"
gravity = [0.0, -9.81, 0.0]
[time]
end = 0.02
step = 2e-3
scheme = "implicit-midpoint"
[[rigid]]
name = "rod"
shape = { kind = "rod", length = 1.0, radius = 0.01 }
density = 7800.0
position = [0.5, 0.0, 0.0]
[[joint]]
kind = "ball"
body = "rod"
point = [0.0, 0.0, 0.0]
[[body]]
name = "bob"
box = { size = [0.3, 0.3, 0.3], cells = [6, 6, 6], element = "hex8", origin = [1.0, -0.15, -0.15] }
material = { law = "neo-hookean", young = 2e5, poisson = 0.3, density = 400.0 }
[[attach]]
body = "bob"
box = { min = [0.99, -0.06, -0.06], max = [1.01, 0.06, 0.06] }
to = "rod"
[output]
interval = 0.01
"#;

/// A block that falls on another one.
const CONTACT: &str = r#"
gravity = [0.0, 0.0, -9.81]
[time]
end = 0.02
step = 5e-4
scheme = "stormer-verlet"
[contact]
[[body]]
name = "lower"
box = { size = [0.4, 0.4, 0.1], cells = [8, 8, 2], element = "tet4" }
material = { law = "stable-neo-hookean", young = 2e5, poisson = 0.3, density = 1000.0 }
[[body]]
name = "upper"
box = { size = [0.2, 0.2, 0.2], cells = [6, 6, 6], element = "tet4", origin = [0.1, 0.1, 0.105] }
material = { law = "stable-neo-hookean", young = 2e5, poisson = 0.3, density = 1000.0 }
velocity = [0.0, 0.0, -1.0]
[[fix]]
body = "lower"
region = "z-min"
[output]
history = 5
interval = 0.01
"#;

/// A beam that bends under its weight in two load steps.
const STATICS: &str = r#"
gravity = [0.0, 0.0, -9.81]
[time]
end = 1.0
step = 0.5
[static]
[[body]]
name = "beam"
box = { size = [1.0, 0.2, 0.2], cells = [20, 4, 4], element = "hex8" }
material = { law = "neo-hookean", young = 1e6, poisson = 0.3, density = 1000.0 }
[[fix]]
body = "beam"
region = "x-min"
[[probe]]
name = "tip"
body = "beam"
point = [1.0, 0.2, 0.2]
[output]
interval = 1.0
fields = ["displacement", "reaction_force"]
[solver]
linear = "pcg"
"#;

/// A block that is thrown at its clamp so hard that its elements invert.
const BREAKS: &str = r#"
[time]
end = 0.05
step = 5e-4
scheme = "stormer-verlet"
substeps = false
[[body]]
name = "block"
box = { size = [1.0, 0.2, 0.2], cells = [20, 4, 4], element = "tet4" }
material = { law = "neo-hookean", young = 1e5, poisson = 0.3, density = 1000.0 }
velocity = [-60.0, 0.0, 0.0]
[[fix]]
body = "block"
region = "x-min"
[output]
history = 1
"#;

fn same_files(name: &str, text_of_scene: &str) {
    let room = room(name);
    let scene = scene(&room, text_of_scene);
    let expected = room.join("one");
    run_well(0, &scene, &expected);
    assert!(expected.join("history.csv").exists());
    for ranks in 1..=4 {
        let out = room.join(ranks.to_string());
        run_well(ranks, &scene, &out);
        assert_same_files(&out, &expected, &format!("{name} on {ranks} ranks"));
    }
}

#[test]
fn a_block_has_the_files_of_one_process() {
    same_files("block", BLOCK);
}

/// A body from a mesh file, of which every rank builds only the part that it needs.
#[test]
fn a_mesh_file_has_the_files_of_one_process() {
    let probe = "[[probe]]\nname = \"pin\"\nbody = \"bracket\"\nregion = \"pin\"\nmean = \"displacement\"\n";
    same_files("file", &(BRACKET.replace("MESH", BRACKET_MESH) + probe));
    assert_in_parts(&place_of("file").join("4"));
}

/// The energy guard goes back to a state that the ranks keep: to the start, and to a later one.
#[test]
fn a_run_that_goes_back_has_the_files_of_one_process() {
    for (name, step, end, from) in
        [("back-to-start", "8e-4", "0.04", "0e0"), ("back", "7.65e-4", "0.0765", "4.896e-2")]
    {
        let text = BLOCK
            .replace("step = 2.5e-4", &format!("step = {step}"))
            .replace("end = 0.02", &format!("end = {end}"));
        same_files(name, &(text + "[guard]\naction = \"halve\"\n"));
        let report = std::fs::read_to_string(place_of(name).join("4/report.json")).unwrap();
        assert!(report.contains(&format!("from t = {from} s on with steps of")), "{report}");
    }
}

#[test]
fn cloth_has_the_files_of_one_process() {
    same_files("cloth", CLOTH);
}

#[test]
fn several_bodies_have_the_files_of_one_process() {
    same_files("several", SEVERAL);
}

#[test]
fn a_moving_support_has_the_files_of_one_process() {
    same_files("driven", DRIVEN);
}

#[test]
fn equilibria_have_the_files_of_one_process() {
    same_files("static-pcg", STATICS);
    // The first rank factors alone.
    same_files("static-cholesky", &STATICS.replace("\"pcg\"", "\"cholesky\""));
}

/// A frame of more points than a file may hold is in pieces, the same on any number of ranks.
#[test]
fn pieces_of_frames_have_the_files_of_one_process() {
    same_files("pieces", &BLOCK.replace("[output]", "[output]\npiece_points = 300"));
    let names = files(&place_of("pieces").join("4"));
    assert!(names.contains_key("scene_000001.pvtu") && names.contains_key("scene_000001_p003.vtu"));
    assert!(!names.contains_key("scene_000001.vtu"));
}

/// Scenes in which the first rank makes the steps, and all ranks sum energies and forces.
#[test]
fn schemes_and_forces_of_the_first_rank_have_the_files_of_one_process() {
    let implicit = BLOCK.replace("stormer-verlet", "implicit-midpoint").replace("step = 1e-4", "step = 1e-3");
    let pcg = implicit.clone() + "[solver]\nlinear = \"pcg\"\n";
    let wind = CLOTH.replace("blanes-moan-4", "stormer-verlet") + "[wind]\nvelocity = [1.0, 0.0, 0.0]\n";
    let adaptive = BLOCK.replace("step = 2.5e-4", "step = \"adaptive\"");
    let ledger = DRIVEN.replace("ledger = false", "ledger = true");
    for (name, text_of_scene) in [
        ("euler", &implicit.replace("implicit-midpoint", "backward-euler")),
        ("cholesky", &implicit),
        ("pcg", &pcg),
        ("implicit-cloth", &CLOTH.replace("blanes-moan-4", "implicit-midpoint")),
        ("adaptive", &adaptive),
        ("wind", &wind),
        ("ledger", &ledger),
        ("rigid", &RIGID.to_owned()),
        ("contact", &CONTACT.to_owned()),
    ] {
        same_files(name, text_of_scene);
    }
}

/// The bytes that a rank sends per force are at most 1.6 times those of one sum per shared node.
#[test]
fn the_report_states_the_bytes_between_ranks() {
    let room = room("traffic");
    let scene =
        scene(&room, &BLOCK.replace("cells = [24, 6, 6]", "cells = [64, 16, 16]").replace("0.02", "5e-4"));
    for ranks in [2, 4] {
        let out = room.join(ranks.to_string());
        run_well(ranks, &scene, &out);
        let report = std::fs::read_to_string(out.join("report.json")).unwrap();
        let number = |key: &str| -> f64 {
            let rest = report.split(&format!("\"{key}\": ")).nth(1).expect(key);
            rest.split([',', '\n']).next().unwrap().trim().parse().unwrap()
        };
        assert_eq!(number("count"), ranks as f64);
        let ratio = number("bytes_per_force") / number("bytes_per_force_of_node_sums");
        assert!((1.0..=1.6).contains(&ratio), "{ratio}");
    }
}

#[test]
fn a_step_that_fails_on_one_rank_ends_all_with_one_message() {
    let room = room("breaks");
    let scene = scene(&room, BREAKS);
    let expected = run(0, &scene, &room.join("one"));
    assert_one_error(&expected, Some(4), &["element"]);
    for ranks in [2, 4] {
        let out = room.join(ranks.to_string());
        let output = run(ranks, &scene, &out);
        assert_eq!((output.status.code(), errors(&output)), (Some(4), errors(&expected)));
        assert_same_files(&out, &room.join("one"), &format!("{ranks} ranks"));
    }
}
