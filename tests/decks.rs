//! Input decks of Abaqus and CalculiX as meshes of scenes.

mod program;

use program::{Program, command};

const BENT: &str = r#"
    [time]
    end = 1.0
    step = 1.0
    scheme = "implicit-midpoint"
    [static]
    tolerance = 1e-12
    [[body]]
    name = "bar"
    SHAPE
    material = { law = "linear", young = 2.1e11, poisson = 0.3, density = 7850.0 }
    [[fix]]
    body = "bar"
    region = "ROOT"
    [[load]]
    kind = "pressure"
    body = "bar"
    region = "TOP"
    pressure = 1e5
    [[probe]]
    name = "end"
    body = "bar"
    point = [0.1, 0.02, 0.01]
"#;

/// The same elements give the same answer, whoever numbered their nodes: a deck in millimetres and a generated box.
#[test]
fn a_deck_and_a_generated_box_bend_alike() {
    let bent = |shape: &str, root: &str, top: &str| {
        let scene = BENT.replace("SHAPE", shape).replace("ROOT", root).replace("TOP", top);
        let history = Program::run(&scene).history();
        ["end.ux", "end.uy", "end.uz"].map(|column| history.last(column))
    };
    let deck = bent("mesh = \"MESHES/bar.inp\"\n    scale = 1e-3", "root", "pressed");
    let box_shape = r#"box = { size = [0.1, 0.02, 0.01], cells = [8, 2, 1], element = "hex20" }"#;
    let generated = bent(box_shape, "x-min", "z-max");
    assert!(deck[2] < -1e-6, "{deck:?}");
    for (one, other) in deck.iter().zip(generated) {
        assert!((one - other).abs() < 1e-9 * deck[2].abs(), "{deck:?} {generated:?}");
    }
}

#[test]
fn info_tells_what_a_deck_holds() {
    let output =
        command().arg("info").arg(concat!(env!("CARGO_MANIFEST_DIR"), "/meshes/bar.inp")).output().unwrap();
    assert!(output.status.success());
    let said = String::from_utf8_lossy(&output.stdout);
    for words in
        ["16 hexahedron20", "'root', surface, 2 cells", "'pressed', surface, 16 cells", "'bar', volume"]
    {
        assert!(said.contains(words), "{words}: {said}");
    }
}
