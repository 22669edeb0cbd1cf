//! Tests probes over regions, refinement that keeps layers, and the errors of keys that choose parts.

use crate::program::Program;
use variational::prelude::*;

use super::run;

const TENSION: &str = r#"
[time]
end = 1.0
step = 1.0
[static]
tolerance = 1e-12
[[body]]
name = "bar"
box = { size = [2.0, 1.0, 1.0], cells = [4, 2, 2], element = "hex8" }
material = { law = "linear", young = 1e9, poisson = 0.3, density = 1000.0 }
[[fix]]
body = "bar"
region = "x-min"
axes = ["x"]
[[fix]]
body = "bar"
plane = { point = [0, 0, 0], normal = [0, 1, 0] }
axes = ["y"]
[[fix]]
body = "bar"
node_file = "bottom.txt"
axes = ["z"]
[[load]]
kind = "force"
body = "bar"
region = "x-max"
force = [500.0, 0.0, 0.0]
[[probe]]
name = "grip"
body = "bar"
region = "x-min"
sum = "reaction_force"
[[probe]]
name = "middle"
body = "bar"
sphere = { centre = [1.0, 0.5, 0.5], radius = 0.6 }
max = "von_mises"
mean = "stress.xx"
min = "displacement.x"
[[probe]]
name = "all"
body = "bar"
mean = "nodal_strain.xx"
sum = "reaction_force.magnitude"
[[probe]]
name = "tip"
body = "bar"
point = [2.0, 0.0, 0.0]
"#;

/// In a bar under uniaxial tension the probes over its regions give the known sums, means and extremes.
#[test]
fn probes_over_regions_say_what_is_known() {
    let mesh = BoxMesh { size: [2.0, 1.0, 1.0], cells: [4, 2, 2], element: CellKind::Hex8, origin: [0.0; 3] };
    let bottom: Vec<String> =
        mesh.build().unwrap().region_nodes("z-min").unwrap().iter().map(u32::to_string).collect();
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("bottom.txt");
    std::fs::write(&path, format!("# the bottom\n{}\n", bottom.join(", "))).unwrap();
    let program = Program::run(&TENSION.replace("bottom.txt", path.to_str().unwrap()));
    let history = program.history();
    let last = |name: &str| history.last(name);
    for (column, expected) in [
        ("grip.sum.reaction_force.x", -500.0_f64),
        ("grip.sum.reaction_force.y", 0.0),
        ("middle.max.von_mises", 500.0),
        ("middle.mean.stress.xx", 500.0),
        ("middle.min.displacement.x", 0.5 * 500.0 / 1e9),
        ("all.mean.nodal_strain.xx", 500.0 / 1e9),
        ("all.sum.reaction_force.magnitude", 500.0),
        ("tip.ux", 2.0 * 500.0 / 1e9),
    ] {
        // The strains are small (5e-7), which bounds the error of the linear reference.
        let tolerance = if expected == 0.0 { 1e-6 } else { 1e-6 * expected.abs() };
        assert!(
            (last(column) - expected).abs() < tolerance,
            "{column}: {}, expected {expected}",
            last(column)
        );
    }
}

/// Refining Cook's membrane in plane strain in its plane alone keeps one layer and approaches the reference 30.749
/// (docs/validation.md).
#[test]
fn refinement_in_the_plane_keeps_one_layer() {
    let file = concat!(env!("CARGO_MANIFEST_DIR"), "/scenes/validation/cook-plane-strain.toml");
    let errors: Vec<f64> = [0, 1]
        .map(|levels| {
            let refine = format!("body.0.refine={{ axes = [\"x\", \"y\"], levels = {levels} }}");
            let parsed = Scene::read(std::path::Path::new(file), &[refine]).unwrap();
            assert!(parsed.problems.is_empty(), "{:?}", parsed.problems);
            let mut simulation = run(parsed.scene.unwrap());
            let mesh = &simulation.bodies()[0].mesh;
            let mut heights: Vec<i64> = mesh.points.iter().map(|x| (x[2] * 1e9).round() as i64).collect();
            heights.sort_unstable();
            heights.dedup();
            // One layer of quadratic elements has nodes at the bottom, the middle and the top.
            assert_eq!(heights.len(), 3);
            (simulation.observe().probes[0].displacement[1] - 30.749).abs() / 30.749
        })
        .to_vec();
    assert!(errors[0] < 3e-4 && errors[1] < 1.5e-4 && errors[1] < errors[0], "{errors:?}");
}

fn refused(change: &str, expected: &[&str]) {
    let program = Program::check(&format!(
        "{}{change}",
        TENSION.replace("node_file = \"bottom.txt\"", "region = \"z-min\"")
    ));
    let errors = program.errors();
    assert_eq!(program.code(), Some(2), "{change}: {errors}");
    expected.iter().for_each(|words| assert!(errors.contains(words), "{change}: no {words:?} in:\n{errors}"));
}

/// Unknown keys beside the keys of a selection are refused in JSON too.
#[test]
fn unknown_keys_are_refused_from_json() {
    let json = |key: &str| serde_json::json!({ "body": "b", "region": "r", key: 1.0 });
    assert!(serde_json::from_value::<Fix>(json("colour")).unwrap_err().to_string().contains("colour"));
    assert!(serde_json::from_value::<Attach>(json("colour")).unwrap_err().to_string().contains("colour"));
    assert!(serde_json::from_value::<Attach>(json("stiffness")).is_ok());
    let mut pressure = json("pressure");
    pressure["kind"] = "pressure".into();
    assert!(serde_json::from_value::<Load>(pressure.clone()).is_ok());
    pressure["colour"] = 1.into();
    assert!(serde_json::from_value::<Load>(pressure).unwrap_err().to_string().contains("colour"));
}

#[test]
fn wrong_parts_are_refused_with_the_way_out() {
    let fix = |keys: &str| format!("[[fix]]\nbody = \"bar\"\n{keys}\n");
    let load = |keys: &str| format!("[[load]]\nkind = \"force\"\nbody = \"bar\"\n{keys}\n");
    let probe = |keys: &str| format!("[[probe]]\nname = \"p\"\nbody = \"bar\"\n{keys}\n");
    let periodic = |keys: &str| format!("[[periodic]]\nbody = \"bar\"\n{keys}\n");
    refused(
        &fix(""),
        &["fix[3]: missing key: give one of `region`, `box`, `plane`, `sphere`, `nodes`, `node_file`"],
    );
    refused(&fix("region = \"x-min\"\nnodes = [0]"), &["fix[3]: give only one of"]);
    refused(
        &fix("plane = { point = [9, 0, 0], normal = [1, 0, 0] }"),
        &["fix[3].plane: no node is on this plane"],
    );
    refused(&fix("plane = { point = [9, 0, 0], normal = [0, 0, 0] }"), &["fix[3].plane", "not zero"]);
    refused(&fix("sphere = { centre = [9, 0, 0], radius = 1 }"), &["fix[3].sphere: no node is in this ball"]);
    refused(&fix("node_file = \"no-such.txt\""), &["fix[3].node_file", "cannot read", "no-such.txt"]);
    refused(&fix("region = \"x-max\"\naxes = [\"nromal\"]"), &["fix[3].axes[0]", "did you mean \"normal\"?"]);
    refused(&fix("region = \"x-max\"\naxes = [\"radial\"]"), &["fix[3].about: missing key `about`"]);
    refused(
        &fix("region = \"x-max\"\naxes = [\"hoop\"]\nabout = { point = [0, 0, 0] }"),
        &["give its `axis`"],
    );
    refused(
        &fix("region = \"x-max\"\naxes = [[0, 0, 0]]"),
        &["fix[3].axes[0]: a direction must be finite and not zero"],
    );
    refused(
        &fix("region = \"x-max\"\naxes = [\"radial\"]\nabout = { point = [0, 1, 0], axis = [1, 0, 0] }"),
        &["fix[3].about: node", "lies on the axis"],
    );
    refused(&fix("nodes = [0]\naxes = [\"normal\"]"), &["fix[3].nodes: no facet of the surface"]);
    refused(&fix("region = \"bar\"\naxes = [\"x\"]\nsymmetry = true"), &["fix[3].region"]);
    refused(
        &fix("region = \"box\"\naxes = [\"x\"]\nsymmetry = true"),
        &["fix[3].symmetry", "do not lie in one plane"],
    );
    refused(&load("region = \"x-max\""), &["load[1]: missing key: give `force` (N), `moment`"]);
    refused(&load("nodes = [0]\nforce = [1, 0, 0]"), &["load[1].nodes: no facet of the surface"]);
    refused(&probe("region = \"x-max\""), &["probe[4].region", "needs `sum`, `mean`, `max` or `min`"]);
    refused(&probe("sum = \"displacement\""), &["probe[4].sum: applies to forces"]);
    refused(&probe("max = \"stres\""), &["probe[4].max: there is no field \"stres\"", "stress"]);
    refused(
        &probe("max = \"stress.magnitude\""),
        &["probe[4].max: stress has no component \"magnitude\"", "xx, xy"],
    );
    refused(&probe("point = [0, 0, 0]\nmax = \"von_mises\""), &["probe[4].point: is one node"]);
    refused(
        &periodic("from = { region = \"x-min\" }\nto = { region = \"y-max\" }"),
        &["periodic[0]: `from` has 9 nodes and `to` has 15"],
    );
    refused(&periodic("from = { region = \"x-min\" }\nto = { }"), &["periodic[0].to: missing key"]);
    refused(
        &(periodic("from = { region = \"x-min\" }\nto = { region = \"x-max\" }")
            + &fix("nodes = [24]\naxes = [\"z\"]")),
        &["fix[3]: holds node 24", "hold the nodes of `from`"],
    );
    let refine = "[[body]]\nname = \"tets\"\nbox = { size = [1, 1, 1], cells = [1, 1, 1] }\n\
                  material = { law = \"linear\", young = 1e6, poisson = 0.3, density = 1.0 }\n";
    refused(
        &format!("{refine}refine = {{ axes = [\"x\", \"y\"], levels = 1 }}"),
        &["body[1].refine", "is not a prism"],
    );
    refused(&format!("{refine}refine = {{ axes = [], levels = 1 }}"), &["body[1].refine", "one or two"]);
    refused(&format!("{refine}velocity = [\"sin(\", 0, 0]"), &["body[1].velocity", "sin("]);
}
