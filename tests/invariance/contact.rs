//! Tests invariance under units for bodies that meet, with friction and damping.

use super::{check_units, scene};

/// A block that hits a floor, and slides.
const BLOCK: &str = r#"
gravity = [0.0, -3.0, -9.81]
[contact]
friction = 0.3
damping = 1e-3
[[body]]
name = "block"
box = { size = [0.1, 0.125, 0.1], cells = [2, 3, 2], element = "tet4", origin = [0.0, 0.0, 0.002] }
material = { law = "neo-hookean", young = 1e5, poisson = 0.3, density = 1000.0 }
velocity = [0.5, 0.0, -1.0]
[[rigid]]
name = "floor"
shape = { kind = "plane", normal = [0, 0, 1] }
fixed = true
"#;

/// A rigid box that hits a floor while it turns.
const BOX: &str = r#"
gravity = [0.0, -3.0, -9.81]
[contact]
friction = 0.3
damping = 1e-3
[[rigid]]
name = "box"
shape = { kind = "box", size = [0.1, 0.05, 0.03] }
density = 1000.0
position = [0.05, 0.06, 0.03]
velocity = [0.5, 0.25, -1.0]
angular_velocity = [1.0, 2.0, -0.5]
[[rigid]]
name = "floor"
shape = { kind = "plane", normal = [0, 0, 1] }
fixed = true
"#;

/// Returns a scene without friction and damping.
fn smooth(body: &str) -> String {
    body.replace("friction = 0.3\ndamping = 1e-3\n", "")
}

/// Returns a scene whose floor is a capsule.
fn on_capsule(body: &str) -> String {
    let plane = "shape = { kind = \"plane\", normal = [0, 0, 1] }";
    let capsule =
        "shape = { kind = \"capsule\", length = 0.3, radius = 0.05 }\nposition = [0.0, 0.05, -0.06]";
    body.replace(plane, capsule)
}

/// Returns a scene whose box hits a soft block of so many nodes that its constraints are eliminated from the factors of the block.
fn on_soft_block(body: &str) -> String {
    let block = r#"
[[body]]
name = "block"
box = { size = [0.1, 0.125, 0.06], cells = [4, 5, 2], element = "hex8", origin = [0.0, 0.0, 0.002] }
material = { law = "neo-hookean", young = 1e5, poisson = 0.3, density = 1000.0 }
"#;
    body.replace("position = [0.05, 0.06, 0.03]", "position = [0.05, 0.06, 0.085]") + block
}

#[test]
fn units_that_are_powers_of_two_change_no_bit_of_a_block_that_hits() {
    for (scheme, step, steps) in [("energy-momentum", 1e-3, 8), ("stormer-verlet", 1.25e-4, 40)] {
        check_units(scheme, &scene(BLOCK, step, steps, &format!("\"{scheme}\"")));
        check_units(scheme, &scene(&smooth(BLOCK), step, steps, &format!("\"{scheme}\"")));
    }
}

#[test]
fn units_that_are_powers_of_two_change_no_bit_of_a_box_that_hits() {
    for (name, body, scheme, step, steps) in [
        ("box", BOX, "energy-momentum", 1e-3, 20),
        ("box", BOX, "stormer-verlet", 1.25e-4, 130),
        ("box", BOX, "backward-euler", 2e-3, 16),
        ("smooth box", &smooth(BOX), "energy-momentum", 1e-3, 20),
        ("smooth box", &smooth(BOX), "stormer-verlet", 1.25e-4, 130),
        ("smooth box", &smooth(BOX), "backward-euler", 2e-3, 12),
        ("smooth box on a capsule", &on_capsule(&smooth(BOX)), "backward-euler", 2e-3, 14),
    ] {
        check_units(&format!("{name}, {scheme}"), &scene(body, step, steps, &format!("\"{scheme}\"")));
    }
}

#[test]
fn units_that_are_powers_of_two_change_no_bit_of_a_box_on_a_soft_block() {
    check_units("box on block", &scene(&on_soft_block(BOX), 1e-3, 12, "\"energy-momentum\""));
}
