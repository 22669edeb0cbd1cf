//! Tests that a step or a start that fails in contact names both bodies, their nodes, the gap, and what to write
//! instead.

use crate::program::Program;

/// A plate that is moved down onto a block, 10 mm below it, on a floor.
fn press(block: &str, plate: &str, time: &str, more: &str) -> String {
    format!(
        r#"
{time}
[contact]
{more}
{block}
[[rigid]]
name = "floor"
shape = {{ kind = "plane", normal = [0, 0, 1] }}
position = [0.0, 0.0, 0.0]
fixed = true
[[rigid]]
name = "plate"
shape = {{ kind = "box", size = [0.3, 0.3, 0.02] }}
position = [0.0, 0.0, 0.121]
{plate}
"#
    )
}

const SOFT: &str = r#"
[[body]]
name = "block"
box = { size = [0.1, 0.1, 0.1], cells = [2, 2, 2], element = "hex8", origin = [-0.05, -0.05, 0.001] }
material = { law = "neo-hookean", young = 1e5, poisson = 0.3, density = 1000.0 }
[[fix]]
body = "block"
region = "z-min"
"#;
const RIGID: &str = r#"
[[rigid]]
name = "block"
shape = { kind = "box", size = [0.1, 0.1, 0.1] }
density = 1000.0
position = [0.0, 0.0, 0.051]
"#;
/// The plate moves by 0.12 m, through the floor.
const DOWN: &str = r#"motion = { kind = "table", times = [0.0, 0.01], displacements = [[0.0, 0.0, 0.0], [0.0, 0.0, -0.12]] }"#;

/// Runs a scene that fails with exit code `code`. The message must contain all words; it is returned.
fn fails(scene: &str, code: i32, words: &[&str]) -> String {
    let program = Program::try_run(scene, &[]);
    let said = program.errors();
    assert_eq!(program.code(), Some(code), "{said}");
    for word in words {
        assert!(said.contains(word), "'{word}' is missing in: {said}");
    }
    said
}

/// Returns the gap (m) that a message names.
fn gap(said: &str) -> f64 {
    let (_, after) = said.split_once(") m is ").expect(said);
    after.split(' ').next().unwrap().parse().unwrap()
}

/// The plate is moved through the block and the floor, by implicit steps down to h/16384, and by an explicit step that is
/// not divided.
#[test]
fn a_squeezed_block_names_the_pair_and_the_way_out() {
    let coarse = SOFT.replace("[2, 2, 2]", "[1, 1, 1]");
    for (scheme, more) in [
        ("energy-momentum", "contact.exclude"),
        ("implicit-midpoint", "contact.exclude"),
        ("backward-euler", "contact.self = false"),
        ("stormer-verlet", "'plate' more room or more time"),
    ] {
        let time = format!("[time]\nend = 0.012\nstep = 1e-3\nscheme = \"{scheme}\"");
        let block = if scheme == "backward-euler" { &coarse } else { RIGID };
        let words = ["of 'block'", "in contact, the gap of", "of a layer of", "`time.step`", more];
        let said = fails(&press(block, DOWN, &time, ""), 4, &words);
        assert!(
            scheme == "backward-euler" || said.contains("'plate'") || said.contains("the half-space 'floor'"),
            "{said}"
        );
        let gap = gap(&said);
        assert!(gap > 0.0 && (scheme == "stormer-verlet" || gap < 1e-4), "{said}");
    }
}

#[test]
fn a_step_that_may_not_be_divided_names_the_pair_and_the_way_out() {
    let time = "[time]\nend = 0.012\nstep = 3e-3\nsubsteps = false\nscheme = \"energy-momentum\"";
    let words = ["gap of vertex", "of 'block' and", "of 'plate' at", "`time.step` (3e-3 s)"];
    let said = fails(&press(RIGID, DOWN, time, ""), 4, &words);
    assert!(gap(&said) > 0.0, "{said}");
}

#[test]
fn an_equilibrium_that_is_squeezed_names_the_pair_and_the_way_out() {
    let said = fails(
        &press(
            &SOFT.replace("[2, 2, 2]", "[1, 1, 1]"),
            DOWN,
            "[time]\nend = 0.012\nstep = 0.012\n[static]\nsmallest_increment = 1e-4",
            "",
        ),
        4,
        &["of 'block'", "'plate'", "in contact, the gap of", "`time.step`", "more room or more time"],
    );
    assert!(gap(&said) > 0.0, "{said}");
}

/// Surfaces that meet at the start: an own gap that is not positive, a gap below 1e-4 d̂, and edges through triangles.
#[test]
fn a_start_that_meets_names_nodes_gap_and_way_out() {
    let time = "[time]\nend = 0.012\nstep = 1e-3\nscheme = \"energy-momentum\"";
    let ways = ["`contact.resolve = true`", "contact.exclude"];
    // A pair of prescribed parts is not a pair.
    let free = SOFT.split("[[fix]]").next().unwrap();
    let scene = press(free, "fixed = true", time, "");
    let sunk = scene.replace("-0.05, 0.001]", "-0.05, -0.02]");
    let said = fails(&sunk, 2, &["of 'block' and the half-space 'floor' is -2.000e-2 m", ways[0], ways[1]]);
    assert!(said.contains("gap of node"), "{said}");
    let close = scene.replace("-0.05, 0.001]", "-0.05, 1e-9]");
    fails(&close, 2, &["the half-space 'floor' is 1.000e-9 m", "are closer than", ways[0], ways[1]]);
    let through = scene.replace("position = [0.0, 0.0, 0.121]", "position = [0.02, 0.01, 0.1]");
    fails(&through, 2, &["'block' through 'plate' (edge ", "through triangle", ways[0], "contact.exclude"]);
}
