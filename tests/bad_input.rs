//! Bad input ends with exit code 2, a message that names the file, the place and the way out, and
//! nothing written. `check` finds everything at once.

mod program;

use program::Program;

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

/// A missing key hides nothing, and what follows from a problem is not reported as a second one.
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
    let contact = format!("{GOOD}\n[contact]\ndistance = 1e-3\n");
    refused(&contact, &["there is no contact in this program", "Remove this key"]);
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

#[test]
fn an_equilibrium_needs_no_scheme() {
    let scene = GOOD.replace("scheme = \"stormer-verlet\"\n", "") + "\n[static]\n";
    let program = Program::check(&scene);
    assert_eq!(program.code(), Some(0), "{}", program.errors());
}
