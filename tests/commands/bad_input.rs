//! Bad input ends with exit code 2 and a message that names the file, the place and the remedy. Nothing is written.
//! `check` finds all problems at once.

mod effect;
mod numbers;

use crate::program::Program;

const GOOD: &str = r#"
[time]
end = 0.1
step = 0.01
scheme = "stormer-verlet"
[[body]]
name = "beam"
mesh = "MESHES/beam.msh"
material = { law = "neo-hookean", young = 1e6, poisson = 0.3, density = 1000.0 }
[[fix]]
body = "beam"
region = "clamp"
"#;

fn refused(scene: &str, expected: &[&str]) {
    for program in [Program::try_run(scene, &[]), Program::check(scene)] {
        let errors = program.errors();
        assert_eq!(program.code(), Some(2), "{errors}");
        for words in expected {
            assert!(errors.contains(words), "no {words:?} in:\n{errors}");
        }
        assert!(errors.contains("scene.toml"), "no file in:\n{errors}");
        assert!(!program.out().exists(), "something was written");
    }
}

fn change(from: &str, to: &str, expected: &[&str]) {
    assert!(GOOD.contains(from));
    refused(&GOOD.replace(from, to), expected);
}

#[test]
fn the_scene_itself_is_good() {
    assert_eq!(Program::check(GOOD).code(), Some(0));
}

#[test]
fn keys_and_types() {
    change("end = 0.1", "end = 0.1\nsteps = 3", &["scene.toml:4", "unknown key `steps`", "step"]);
    change("end = 0.1", "", &["missing key `end`", "scene.toml:2"]);
    change("step = 0.01", "step = \"short\"", &["scene.toml:4", "time.step", "string"]);
    change("law = \"neo-hookean\"", "law = \"jelly\"", &["scene.toml:9", "jelly", "st-venant-kirchhoff"]);
    change("scheme = \"stormer-verlet\"", "scheme = \"magic\"", &["scene.toml:5", "implicit-midpoint"]);
    change("[time]", "[time", &["scene.toml:2", "not TOML"]);
}

#[test]
fn values() {
    change("density = 1000.0", "density = -5.0", &["scene.toml:9", "density", "-5"]);
    change("young = 1e6", "young = -1.0", &["scene.toml:9", "young", "-1"]);
    change("poisson = 0.3", "poisson = 0.5", &["poisson", "0.5"]);
    change("poisson = 0.3", "poisson = -1.0", &["poisson", "-1"]);
    change("step = 0.01", "step = -0.01", &["scene.toml:4", "time.step", "-0.01"]);
    change("region = \"clamp\"", "region = \"clmap\"", &["scene.toml:12", "clmap", "clamp", "tip"]);
    change("body = \"beam\"", "body = \"bean\"", &["scene.toml:11", "bean", "beam"]);
}

#[test]
fn everything_at_once() {
    let scene = GOOD
        .replace("end = 0.1", "end = 0.1\ncolour = 1")
        .replace("step = 0.01", "step = -0.01")
        .replace("density = 1000.0", "density = 0.0")
        .replace("\"clamp\"", "\"clmap\"");
    refused(&scene, &["colour", "time.step", "density", "clmap"]);
}

const POINTS: &str = "# vtk DataFile Version 3.0\nbroken\nASCII\nDATASET UNSTRUCTURED_GRID\n";

fn mesh(name: &str, content: &[u8], expected: &[&str]) {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join(name);
    std::fs::write(&path, content).unwrap();
    let scene =
        GOOD.replace("MESHES/beam.msh", path.to_str().unwrap()).replace("region = \"clamp\"", "nodes = [0]");
    let mut expected = expected.to_vec();
    expected.push(name);
    refused(&scene, &expected);
}

#[test]
fn meshes() {
    change("beam.msh", "no-such.msh", &["no-such.msh", "scene.toml:8"]);
    let vtk = |points: &str, cells: &str| format!("{POINTS}{points}\n{cells}\n").into_bytes();
    let four = "POINTS 4 double\n0 0 0 1 0 0 0 1 0 0 0 1";
    mesh("surface.vtk", &vtk(four, "CELLS 1 4\n3 0 1 2\nCELL_TYPES 1\n5"), &["no volume cells", "thickness"]);
    let tet = "CELLS 1 5\n4 0 1 2 3\nCELL_TYPES 1\n10";
    let two = "CELLS 2 10\n4 0 1 2 3\n4 1 2 0 3\nCELL_TYPES 2\n10\n10";
    mesh("doubled.vtk", &vtk(four, two), &["elements 0 and 1 have the same corners", "remove one"]);
    mesh("inverted.vtk", &vtk(four, "CELLS 1 5\n4 0 2 1 3\nCELL_TYPES 1\n10"), &["element 0", "inverted"]);
    mesh("flat.vtk", &vtk("POINTS 4 double\n0 0 0 1 0 0 0 1 0 1 1 0", tet), &["element 0", "volume"]);
    let five = "POINTS 5 double\n0 0 0 1 0 0 0 1 0 0 0 1 7 7 7";
    mesh("unused.vtk", &vtk(five, tet), &["1 of 5 nodes", "4"]);
    mesh("nan.vtk", &vtk("POINTS 4 double\n0 0 0 1 nan 0 0 1 0 0 0 1", tet), &["NaN", "node 1"]);
    mesh("truncated.vtk", &vtk("POINTS 4 double\n0 0 0 1 0 0", ""), &["truncated"]);
    mesh("garbage.msh", &[0xde, 0xad, 0xbe, 0xef, 0, 1, 2, 3, 0xff, 0xfe], &[]);
    mesh("kind.vtk", &vtk(four, "CELLS 1 5\n4 0 1 2 3\nCELL_TYPES 1\n41"), &["41"]);
    let beam = std::fs::read(concat!(env!("CARGO_MANIFEST_DIR"), "/meshes/beam.msh")).unwrap();
    mesh("half.msh", &beam[..beam.len() / 2], &["truncated"]);
}

#[test]
fn an_output_directory_that_cannot_be_made() {
    let program = Program::try_run(GOOD, &["--out", "scene.toml/out"]);
    assert_eq!(program.code(), Some(2), "{}", program.errors());
    assert!(program.errors().contains("not writable"), "{}", program.errors());
}

/// A missing key hides no other problem, and the consequences of a problem are not reported as further problems.
#[test]
fn structure() {
    let without_scheme = GOOD
        .replace("scheme = \"stormer-verlet\"\n", "")
        .replace("density = 1000.0", "density = -5.0")
        .replace("\"clamp\"", "\"clmap\"");
    refused(&without_scheme, &["scene.toml:2: time.scheme: missing key `scheme`", "density", "clmap"]);
    let without_end = GOOD.replace("end = 0.1\n", "").replace("step = 0.01", "step = -0.01");
    refused(&without_end, &["scene.toml:2: time.end: missing key `end`, a number", "time.step"]);
    refused(&GOOD.replace("[time]", "title = 3\n[time]"), &["title: must be a string, is a whole number"]);
    let without_time = &GOOD[GOOD.find("[[body]]").unwrap()..];
    refused(&without_time.replace("\"clamp\"", "\"clmap\""), &["missing key `time`", "clmap"]);
    refused(&format!("{GOOD}\n[collision]\nfriction = 0.3\n"), &["the table [contact]", "remove this key"]);
    refused(
        &format!("{GOOD}\n[contact]\nfriction = -0.3\n"),
        &["contact.friction", "must be zero or positive"],
    );
    let load = "\n[[load]]\nbody = \"beam\"\nregion = \"tip\"\npressure = 1.0\n";
    refused(&format!("{GOOD}{load}"), &["load[0].kind: missing key `kind`", "traction"]);
    refused(&format!("{GOOD}{load}kind = \"presure\""), &["load[0].kind", "did you mean \"pressure\"?"]);
    let formula = format!("{GOOD}{load}kind = \"pressure\"\namplitude = \"sin(\"\n");
    refused(&formula.replace("step = 0.01", "step = -0.01"), &["load[0]", "sin(", "time.step"]);
}

#[test]
fn one_typo_is_one_problem() {
    for (from, to, expected) in [
        (
            "young =",
            "yuong =",
            "scene.toml:9: body[0].material.yuong: unknown key `yuong`; did you mean `young`?",
        ),
        ("name =", "nmae =", "did you mean `name`?"),
        ("name = \"beam\"", "name = 7", "body[0].name: must be a string, is a whole number"),
        ("[[body]]", "[[boddy]]", "boddy: unknown key `boddy`; did you mean `body`?"),
        ("law = \"neo-hookean\"", "law = \"neo-hokean\"", "did you mean \"neo-hookean\"?"),
        ("region = \"clamp\"", "regoin = \"clamp\"", "did you mean `region`?"),
        ("mesh = \"MESHES/beam.msh\"", "mesh = 3", "body[0].mesh: must be a string"),
    ] {
        let program = Program::check(&GOOD.replace(from, to));
        let errors = program.errors();
        assert_eq!(program.code(), Some(2), "{errors}");
        assert_eq!(errors.matches("error:").count(), 1, "{errors}");
        assert!(errors.contains(expected), "no {expected:?} in {errors}");
    }
}

/// An element of which no box consists is one problem, and the error names those of which boxes consist.
#[test]
fn boxes_name_their_elements() {
    for (element, expected) in
        [("hex", "did you mean \"hex8\"? Expected one of \"tet4\""), ("quad4", "expected one of \"tet4\"")]
    {
        let shape = format!("box = {{ size = [1.0, 0.1, 0.1], cells = [4, 1, 1], element = \"{element}\" }}");
        let scene = GOOD.replace("mesh = \"MESHES/beam.msh\"", &shape).replace("\"clamp\"", "\"x-min\"");
        let errors = Program::check(&scene).errors();
        assert_eq!(errors.matches("error:").count(), 1, "{errors}");
        assert!(errors.contains(expected), "{errors}");
    }
}

#[test]
fn an_equilibrium_needs_no_scheme() {
    let scene = GOOD.replace("scheme = \"stormer-verlet\"\n", "") + "\n[static]\n";
    let program = Program::check(&scene);
    assert_eq!(program.code(), Some(0), "{}", program.errors());
}

/// Names that head columns are checked: no two columns of history.csv have the same name, and no name needs quotes.
#[test]
fn names_of_columns() {
    let probe = |name: &str| format!("[[probe]]\nname = {name:?}\nbody = \"beam\"\nnode = 0\n");
    let rigid = |name: &str| {
        format!(
            "[[rigid]]\nname = {name:?}\nmass = 1.0\nshape = {{ kind = \"rod\", length = 0.5, radius = 0.02 }}\n"
        )
    };
    let scene = |parts: &[String]| GOOD.to_owned() + &parts.concat();
    assert_eq!(Program::check(&scene(&[probe("a"), rigid("b")])).code(), Some(0));
    refused(&scene(&[probe("tip"), probe("tip")]), &["probe[1].name", "`tip.x`", "probe[0].name"]);
    refused(&scene(&[probe("tip"), rigid("tip")]), &["rigid[0].name", "`tip.x`", "probe[0].name"]);
    for name in ["", "a,b", "a\"b"] {
        refused(&scene(&[probe(name)]), &["probe[0].name", "without commas or quotes"]);
        refused(&scene(&[rigid(name)]), &["rigid[0].name", "without commas or quotes"]);
    }
    for (name, control) in [("a\\rb", "\\r"), ("a\\nb", "\\n"), ("a\\u0007b", "\\u{7}"), ("a\\tb", "\\t")] {
        let raw = |text: String| text.replace("\"N\"", &format!("\"{name}\""));
        refused(&raw(scene(&[probe("N")])), &["probe[0].name", "control character", control]);
        refused(&raw(scene(&[rigid("N")])), &["rigid[0].name", "control character", control]);
        let body = GOOD.replace("\"beam\"", "\"N\"");
        refused(&raw(body), &["body[0].name", "control character", control]);
    }
}

/// A scene that is too large for any machine is refused at once, before memory is allocated. The message names the key.
#[test]
fn scenes_beyond_memory() {
    let begin = std::time::Instant::now();
    let solid =
        |shape: &str| GOOD.replace("mesh = \"MESHES/beam.msh\"", shape).replace("\"clamp\"", "\"x-min\"");
    let cells =
        |cells: &str| format!("box = {{ size = [1.0, 1.0, 1.0], cells = {cells}, element = \"tet4\" }}");
    refused(&solid(&cells("[600, 600, 600]")), &["body[0].box.cells", "1.296e9 elements", "GB"]);
    refused(&solid(&cells("[4294967295, 4294967295, 4294967295]")), &["body[0].box.cells", "elements"]);
    refused(&solid(&(cells("[40, 40, 40]") + "\nrefine = 6")), &["body[0].refine", "GB"]);
    let sheet = solid("sheet = { size = [1.0, 1.0], cells = [1000000000, 2] }")
        .replace("density = 1000.0", "density = 1000.0, thickness = 0.001");
    refused(&sheet, &["body[0].sheet.cells", "4.000e9 elements", "GB"]);
    // This mesh file has 64 000 tetrahedra, all on the same nodes; it is refused for its memory first.
    let directory = tempfile::tempdir().unwrap();
    let count = 64_000;
    let mut text = format!("{POINTS}POINTS 4 double\n0 0 0 1 0 0 0 1 0 0 0 1\nCELLS {count} {}\n", 5 * count);
    text += &"4 0 1 2 3\n".repeat(count);
    text += &format!("CELL_TYPES {count}\n{}", "10\n".repeat(count));
    let path = directory.path().join("large.vtk");
    std::fs::write(&path, text).unwrap();
    let mesh =
        GOOD.replace("MESHES/beam.msh", path.to_str().unwrap()).replace("[[fix]]", "refine = 6\n[[fix]]");
    refused(&mesh.replace("region = \"clamp\"", "nodes = [0]"), &["body[0].refine", "GB"]);
    assert!(begin.elapsed().as_secs() < 20);
}

/// A scene name that cannot be part of file names is refused, because output files carry it.
#[cfg(unix)]
#[test]
fn names_of_scenes() {
    let directory = tempfile::tempdir().unwrap();
    let mesh = concat!(env!("CARGO_MANIFEST_DIR"), "/meshes/beam.msh");
    std::fs::write(directory.path().join("a\nb.toml"), GOOD.replace("MESHES/beam.msh", mesh)).unwrap();
    let mut command = crate::program::command();
    let output =
        command.current_dir(directory.path()).args(["run", "a\nb.toml", "--out", "out"]).output().unwrap();
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.code() == Some(2) && said.contains("names of files"), "{said}");
    assert!(!directory.path().join("out").exists());
}

#[test]
fn more_threads_than_a_machine_has_use_for() {
    for threads in ["0", "1000000"] {
        let program = Program::try_run(GOOD, &["--threads", threads]);
        assert_eq!(program.code(), Some(2), "{}", program.errors());
        assert!(program.errors().contains("--threads must be 1 to"), "{}", program.errors());
        assert!(!program.out().exists());
    }
}

/// An override is applied or refused with a reason. A key can be set in the form in which messages print it.
#[test]
fn overrides() {
    let scene = GOOD.replace("step = 0.01", "step = 1e-4").replace("end = 0.1", "end = 1e-3");
    for (assignment, code) in [
        ("body[0].material.density=900", 0),
        ("body.0.material.density=900", 0),
        ("body[0].material.density=-900", 2),
        ("body.box.cells=[1,1,1]", 2),
        ("body[7].name=x", 2),
        ("time=3", 2),
    ] {
        let program = Program::try_run(&scene, &["--set", assignment]);
        assert_eq!(program.code(), Some(code), "{assignment}: {}", program.errors());
        assert!(!program.errors().contains("panicked"), "{assignment}: {}", program.errors());
    }
}

/// 2000 wrong names of bodies, keys, regions or values give 2000 messages, in a time linear in their number.
#[test]
fn many_wrong_names() {
    let many = |part: &dyn Fn(usize) -> String| (0..2000).map(part).collect::<String>();
    let fix = |i: usize| format!("[[fix]]\nbody = \"wrong{i}\"\nregion = \"x\"\n");
    let unknown = |i: usize| format!("[[fix]]\nbody = \"beam\"\nregion = \"clamp\"\nwrong{i} = 1\n");
    let region = |i: usize| format!("[[fix]]\nbody = \"beam\"\nregion = \"wrong{i}\"\n");
    let probe = |i: usize| format!("[[probe]]\nname = \"p{i}\"\nbody = \"beam\"\nnode = -{i}.5\n");
    let body = |i: usize| {
        format!(
            "[[body]]\nname = \"b{i}\"\nmesh = \"MESHES/beam.msh\"\nmaterial = {{ law = \"jelly{i}\" }}\n"
        )
    };
    let key = |i: usize| format!("wrong{i} = 1\n");
    for (what, scene) in [
        ("bodies", GOOD.to_owned() + &many(&fix)),
        ("keys", GOOD.to_owned() + &many(&unknown)),
        ("keys of one table", GOOD.replace("[[body]]", &(many(&key) + "[[body]]"))),
        ("regions", GOOD.to_owned() + &many(&region)),
        ("types", GOOD.to_owned() + &many(&probe)),
        ("laws", GOOD.to_owned() + &many(&body)),
    ] {
        let begin = std::time::Instant::now();
        let program = Program::check(&scene);
        let seconds = begin.elapsed().as_secs_f64();
        let messages = program.errors().lines().filter(|line| line.starts_with("error: ")).count();
        assert!(program.code() == Some(2) && messages >= 2000, "{what}: {messages} messages");
        assert!(program.errors().len() < 400 * messages, "{what}: {} bytes", program.errors().len());
        // It takes less than a second on one processor without optimisation; printing the messages alone once took
        // 47 s.
        assert!(seconds < 20.0, "{what}: {seconds} s");
    }
}

/// A box that is unbounded along an axis selects everything between its other bounds, whether `inf` is written or left
/// out. A box that selects nothing is refused.
#[test]
fn boxes_may_be_half_infinite() {
    let fixed = |on: &str| {
        let program =
            Program::run(&GOOD.replace("region = \"clamp\"", on).replace("end = 0.1", "end = 0.01"));
        let reactions = program.report()["results"]["reactions"].clone();
        (reactions[0]["nodes"].as_u64().unwrap(), reactions[0]["centroid"].clone())
    };
    let clamp = fixed("box = { min = [-1.0, -1.0, -1.0], max = [1e-9, 1.0, 1.0] }");
    assert_eq!(clamp.0, 25);
    for on in [
        "box = { min = [-inf, -inf, -inf], max = [1e-9, inf, inf] }",
        "box = { max = [1e-9, inf, inf] }",
        "box = { min = [-1.0, -inf, -1.0], max = [1e-9, 1.0, inf] }",
    ] {
        assert_eq!(fixed(on), clamp, "{on}");
    }
    assert!(fixed("box = { min = [0.99, -inf, -inf] }").0 == 25 && fixed("box = {}").0 == 425);
    for (on, way_out) in [
        ("box = { min = [inf, 0.0, 0.0] }", "contains nothing along x"),
        ("box = { max = [0.0, -inf, 0.0] }", "contains nothing along y"),
        ("box = { min = [0.0, nan, 0.0] }", "neither may be nan"),
        ("box = { min = [2.0, -inf, -inf] }", "no node is in this box"),
    ] {
        change("region = \"clamp\"", on, &["fix[0].box", way_out, "scene.toml:12"]);
    }
}

/// Tables that name a body of the other kind say so, and what to write instead.
#[test]
fn rigid_and_deformable_bodies_are_told_apart() {
    let rigid = "[[rigid]]\nname = \"r\"\nshape = { kind = \"sphere\", radius = 0.1 }\ndensity = 1000.0\n";
    for (table, rest, instead) in [
        ("fix", "nodes = [0]", "`fixed = true`"),
        ("strike", "nodes = [0]\nimpulse = [0, 0, 1]", "`velocity`"),
        ("probe", "name = \"p\"\nnode = 0", "history.csv has columns"),
        ("load", "kind = \"point\"\nnode = 0\nforce = [0, 0, 1]", "[[attach]]"),
    ] {
        let scene = format!("{GOOD}{rigid}[[{table}]]\nbody = \"r\"\n{rest}\n");
        refused(&scene, &["'r' is a rigid body", instead]);
    }
    let alone = &GOOD[..GOOD.find("[[body]]").unwrap()];
    let fix = "[[fix]]\nbody = \"x\"\nnodes = [0]\n";
    refused(&format!("{alone}{rigid}{fix}"), &["there is no body 'x': the scene has no table [[body]]"]);
    let joint = "[[joint]]\nkind = \"ball\"\nbody = \"beam\"\npoint = [0, 0, 0]\n";
    refused(&format!("{GOOD}{joint}"), &["'beam' is deformable", "[[attach]]"]);
}

/// One mistake gives one message, also if a value that stands in for it, or the same value later, would give another.
#[test]
fn one_mistake_is_one_problem() {
    let without = |from: &str, to: &str| GOOD.replace(from, to);
    for (scene, expected) in [
        (without("poisson = 0.3, ", ""), "body[0].material.poisson: missing key"),
        (without("step = 0.01", "step = 0"), "time.step: must be positive"),
        (without("[[body]]", "[windd]\nvelocity = [1, 0, 0]\n[[body]]"), "did you mean `wind`?"),
        (
            without("region = \"clamp\"", "box = { min = [1, 0, 0], max = [0, 1, 1] }"),
            "`min` must not exceed",
        ),
        (without("step = 0.01", "step = 0.01\nstp = 0.02"), "unknown key `stp`; did you mean `step`?"),
        (
            without("mesh = \"MESHES/beam.msh\"", "sheet = { size = [1, 1], cells = [2, 2] }")
                .replace("density = 1000.0", "density = 1000.0, thickness = 0.01")
                .replace("\"clamp\"", "\"x-min\"")
                + "[[probe]]\nname = \"q\"\nbody = \"beam\"\nmax = \"stress\"\n",
            "probe[0].max",
        ),
    ] {
        let program = Program::check(&scene);
        let errors = program.errors();
        assert_eq!(program.code(), Some(2), "{errors}");
        assert_eq!(errors.matches("error:").count(), 1, "{errors}");
        assert!(errors.contains(expected), "no {expected:?} in {errors}");
    }
    // Solids and sheets share names of laws, which are listed once.
    let errors = Program::check(&without("neo-hookean", "jelly")).errors();
    assert_eq!(errors.matches("\"st-venant-kirchhoff\"").count(), 1, "{errors}");
    let cells = "box = { size = [1, 1, 1], cells = [1, -4, 0] }";
    let scene = without("mesh = \"MESHES/beam.msh\"", cells).replace("\"clamp\"", "\"x-min\"");
    refused(
        &scene,
        &["body[0].box.cells[1]: must be at least 1, is -4", "cells[2]: must be at least 1, is 0"],
    );
}

/// Messages shorten long names and still end with the remedy.
#[test]
fn very_long_names() {
    let long = "n".repeat(100_000);
    for (from, to, way_out) in [
        ("region = \"clamp\"", format!("region = \"{long}\""), "clamp"),
        ("[[fix]]", format!("{long} = 1\n[[fix]]"), "unknown key"),
        ("scheme = \"stormer-verlet\"", format!("scheme = \"{long}\""), "implicit-midpoint"),
        (
            "[time]",
            format!("gravity_amplitude = \"{}$\"\n[time]", "1+".repeat(100_000)),
            "character 200001: expected a number",
        ),
    ] {
        let program = Program::check(&GOOD.replace(from, &to));
        let said = program.errors();
        assert!(program.code() == Some(2) && said.contains(way_out), "{}", &said[..1000]);
        assert!(said.len() < 10_000, "{} bytes", said.len());
    }
    // A body may have a very long name: the names of its files are shortened.
    let film = GOOD.replace("beam\"\n", &format!("{long}\"\n")).replace("end = 0.1", "end = 0.01")
        + "[output]\nfps = 100\ncache = \"pc2\"\n";
    let program = Program::run(&film);
    let files = std::fs::read_dir(program.out()).unwrap().map(|entry| entry.unwrap().path());
    assert_eq!(files.filter(|file| file.extension().is_some_and(|ending| ending == "pc2")).count(), 1);
}

#[test]
fn a_scene_that_is_no_utf_8() {
    let directory = tempfile::tempdir().unwrap();
    let wide: Vec<u8> =
        "\u{feff}".chars().chain(GOOD.chars()).flat_map(|c| (c as u16).to_le_bytes()).collect();
    std::fs::write(directory.path().join("scene.toml"), wide).unwrap();
    let output = crate::program::command()
        .current_dir(directory.path())
        .args(["check", "scene.toml"])
        .output()
        .unwrap();
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.code() == Some(2) && said.contains("save it as UTF-8"), "{said}");
}
