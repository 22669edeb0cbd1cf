//! Loads that contact and friction cannot bear: equilibria end at the load that they can, and the run says so.

use crate::program::Program;

/// A block of 4 kg that lies on `support` with friction .3 and is pulled sideways by 20 N.
fn pulled(support: &str) -> String {
    format!(
        r#"
gravity = [0.0, 0.0, -9.81]
[time]
end = 1.0
step = 0.25
[static]
[contact]
friction = 0.3
[[body]]
name = "block"
box = {{ size = [0.2, 0.2, 0.1], cells = [3, 3, 2], element = "hex8", origin = [0.0, 0.0, 0.0005] }}
material = {{ law = "neo-hookean", young = 1e6, poisson = 0.3, density = 1000.0 }}
[[load]]
kind = "traction"
body = "block"
region = "x-max"
traction = [1000.0, 0.0, 0.0]
amplitude = "t"
{support}
"#
    )
}

const FLOOR: &str = r#"
[[rigid]]
name = "floor"
shape = { kind = "plane", normal = [0, 0, 1] }
position = [0.0, 0.0, 0.0]
fixed = true
"#;

const SLAB: &str = r#"
[[body]]
name = "slab"
box = { size = [0.4, 0.3, 0.1], cells = [4, 3, 1], element = "hex8", origin = [-0.1, -0.05, -0.1] }
material = { law = "neo-hookean", young = 1e6, poisson = 0.3, density = 1000.0 }
[[fix]]
body = "slab"
region = "z-min"
"#;

/// Returns the load factor beyond which a run found no equilibrium, and what it said.
fn limit(scene: &str) -> (f64, String, Program) {
    let program = Program::try_run(scene, &[]);
    let said = program.errors();
    assert_eq!(program.code(), Some(4), "{said}");
    let (_, rest) = said.split_once("no equilibrium beyond load factor ").expect("a load factor");
    let (factor, _) = rest.split_once(':').expect("a colon");
    (factor.parse().expect("a number"), said, program)
}

/// A rigid floor holds a block up to F = μ m g: a load factor of .3 · 4 · 9.81 N / 20 N. An increment is a thousandth of the step where
/// the block slides away, so the limit is known to that. On a soft slab the dent adds to friction.
#[test]
fn a_block_is_held_up_to_the_limit_of_friction() {
    let expected = 0.3 * 4.0 * 9.81 / 20.0;
    let (factor, said, program) = limit(&pulled(FLOOR));
    assert!((factor - expected).abs() < 2e-3 * 0.25, "{factor}, expected {expected}");
    for words in ["nothing stops the bodies", "'block' and the half-space 'floor'", "contact.friction"] {
        assert!(said.contains(words), "{words}: {said}");
    }
    let iterations = program.report()["work"]["newton_iterations"].as_u64().unwrap();
    assert!(iterations < 600, "{iterations} iterations");
    let (factor, said, _) = limit(&pulled(SLAB));
    assert!((0.98 * expected..1.2 * expected).contains(&factor), "{factor}, expected {expected}");
    assert!(said.contains("'block' and nodes"), "{said}");
}
