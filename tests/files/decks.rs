//! Tests input decks of Abaqus and CalculiX as meshes of scenes.

use crate::program::{Program, command};

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

/// Equal elements give equal results however their nodes are numbered: a deck in millimetres and a generated box.
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
    for words in ["16 hex20", "'root', surface, 2 cells", "'pressed', surface, 16 cells", "'bar', volume"] {
        assert!(said.contains(words), "{words}: {said}");
    }
}

/// A byte order mark of UTF-8, quotes around names and commas in them change nothing. A set without a name is refused.
#[test]
fn marks_and_quotes_of_other_programs() {
    let deck = std::fs::read_to_string(concat!(env!("CARGO_MANIFEST_DIR"), "/meshes/bar.inp")).unwrap();
    let read = |text: &str| variational::io::parse_mesh(text.as_bytes(), "deck.inp".as_ref());
    let own = read(&deck).unwrap();
    let marked = read(&format!("\u{feff}{}", deck.replace('\n', "\r\n"))).unwrap();
    assert_eq!((&own.mesh.points, &own.mesh.regions), (&marked.mesh.points, &marked.mesh.regions));
    let set = "*NSET, NSET=\"held, left\"\n1, 2\n*NSET, NSET=\"more\"\n\"held, left\", 3\n";
    let named = read(&format!("{deck}\n{set}")).unwrap();
    let members = |name: &str| {
        named.mesh.regions.iter().find(|region| region.name == name).map(|region| region.cells.len())
    };
    assert_eq!((members("held, left"), members("more")), (Some(2), Some(3)));
    let error = read(&format!("{deck}\n*NSET, NSET=\n1, 2\n")).unwrap_err().to_string();
    assert!(error.contains("NSET=<name>"), "{error}");
}

/// Decks with lost, doubled, moved or changed lines and words are either refused, with a problem of the body or of a
/// key that names its parts, or give a body of finite mass and energy.
#[test]
fn corrupted_decks_are_refused_or_sound() {
    use variational::prelude::*;
    let deck = std::fs::read_to_string(concat!(env!("CARGO_MANIFEST_DIR"), "/meshes/bar.inp")).unwrap();
    let lines: Vec<&str> = deck.lines().collect();
    let place = tempfile::tempdir().unwrap();
    let path = place.path().join("deck.inp");
    // SplitMix64 (Steele, Lea, Flood 2014).
    let mut state = 13_u64;
    let mut below = |count: usize| {
        state = state.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = state;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        ((z ^ (z >> 31)) % count.max(1) as u64) as usize
    };
    let words = [
        "0", "-1", "1", "7", "999999", "1e30", "-1e300", "1.5", "C3D8", "S1", "*NODE", "root", "", ",",
        "GENERATE",
    ];
    let (mut sound, mut refused) = (0, 0);
    for _ in 0..600 {
        let mut text: Vec<String> = lines.iter().map(|&line| line.to_owned()).collect();
        for _ in 0..1 + below(3) {
            let (at, other) = (below(text.len()), below(text.len()));
            match below(6) {
                0 => drop(text.remove(at)),
                1 => text.insert(other, text[at].clone()),
                2 => text.swap(at, other),
                3 => text.truncate(at.max(1)),
                _ => {
                    let mut parts: Vec<String> = text[at].split(',').map(str::to_owned).collect();
                    let part = below(parts.len());
                    parts[part] = words[below(words.len())].to_owned();
                    text[at] = parts.join(",");
                }
            }
        }
        std::fs::write(&path, text.join("\n")).unwrap();
        let law = Law::Linear(Isotropic { young: 2.1e11, poisson: 0.3, density: 7850.0 });
        let scene = Scene::new(Time::new(1e-3, 1e-3, SchemeName::ImplicitMidpoint))
            .body(Body::from_mesh("bar", &path, law))
            .fix(Fix::region("bar", "root"));
        match Simulation::new(scene) {
            Ok(mut simulation) => {
                assert!(simulation.observe().is_finite());
                let mass: f64 = simulation.components()[0].system().mass().iter().sum();
                assert!(mass > 0.0 && mass.is_finite());
                sound += 1;
            }
            Err(problems) => {
                assert!(!problems.is_empty());
                for problem in problems {
                    let key = &problem.key;
                    assert!(
                        key.starts_with("body[0]") || key.starts_with("fix[0]"),
                        "{problem}: {}",
                        text.join("\n")
                    );
                }
                refused += 1;
            }
        }
    }
    assert!(sound > 20 && refused > 200, "{sound} sound, {refused} refused");
}
