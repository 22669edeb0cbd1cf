//! Tests the summary at the end of a run: extremes with their positions, reactions, and no dynamics in statics.

use crate::program::Program;
use serde_json::Value;

/// A beam in statics that hangs from two fixes which share an edge.
const HANGING: &str = r#"
gravity = [1.0, 2.0, -9.81]
[time]
end = 1.0
step = 1.0
scheme = "implicit-midpoint"
[static]
tolerance = 1e-14
[[body]]
name = "beam"
box = { size = [1.0, 0.2, 0.3], cells = [6, 2, 2], element = "hex8" }
material = { law = "neo-hookean", young = 1e7, poisson = 0.3, density = 1000.0 }
[[fix]]
body = "beam"
region = "x-min"
[[fix]]
body = "beam"
region = "z-min"
axes = ["z"]
[[probe]]
name = "tip"
body = "beam"
point = [1.0, 0.2, 0.3]
[output]
interval = 1.0
precision = "f64"
fields = ["displacement", "von_mises", "reaction_force"]
"#;

/// Compares up to the last digit, which a JSON reader may change.
fn is_close(value: &Value, expected: f64) -> bool {
    (value.as_f64().unwrap() - expected).abs() <= 4.0 * f64::EPSILON * expected.abs()
}

fn vector(value: &Value) -> [f64; 3] {
    [0, 1, 2].map(|k| value[k].as_f64().unwrap())
}

/// Returns the sum of the reactions, and of their moments about the origin.
fn resultant(reactions: &[Value]) -> ([f64; 3], [f64; 3]) {
    let (mut force, mut moment) = ([0.0; 3], [0.0; 3]);
    for reaction in reactions {
        let (f, m, c) =
            (vector(&reaction["force"]), vector(&reaction["moment"]), vector(&reaction["centroid"]));
        for k in 0..3 {
            let (i, j) = ((k + 1) % 3, (k + 2) % 3);
            force[k] += f[k];
            moment[k] += m[k] + c[i] * f[j] - c[j] * f[i];
        }
    }
    (force, moment)
}

/// The forces and moments of clamps balance a load on the middle or the end of a plate, whatever holds the other end, on any mesh.
/// A cantilever's clamp takes F and F L.
#[test]
fn clamps_balance_force_and_moment() {
    let plate = |bending: &str, cells: u32, at: f64, far: &str| {
        let scene = format!(
            "[time]\nend = 1.0\nstep = 1.0\n[static]\ntolerance = 1e-13\n[[body]]\nname = \"plate\"\n\
             sheet = {{ size = [1.0, 0.5], cells = [{cells}, 4], pattern = \"random\" }}\n\
             material = {{ law = \"st-venant-kirchhoff\", young = 1e9, poisson = 0.3, density = 1000.0, \
             thickness = 2e-2, bending = \"{bending}\" }}\n\
             [[fix]]\nbody = \"plate\"\nregion = \"x-min\"\nrotation = true\n{far}\
             [[load]]\nkind = \"point\"\nbody = \"plate\"\npoint = [{at}, 0.25, 0.0]\nforce = [0.0, 0.0, 1.0]\n\
             [[probe]]\nname = \"all\"\nbody = \"plate\"\nsum = \"reaction_force\"\n\
             [[probe]]\nname = \"loaded\"\nbody = \"plate\"\npoint = [{at}, 0.25, 0.0]\n"
        );
        let program = Program::run(&scene);
        let report = program.report();
        let reactions = report["results"]["reactions"].as_array().unwrap().clone();
        let history = program.history();
        let place = ["loaded.x", "loaded.y", "loaded.z"].map(|column| history.last(column));
        (reactions, history.last("all.sum.reaction_force.z"), place)
    };
    let fix = "[[fix]]\nbody = \"plate\"\nregion = \"x-max\"\n";
    for bending in ["shell", "hinge", "quadratic"] {
        for (cells, at, far) in [
            (4, 1.0, String::new()),
            (16, 1.0, String::new()),
            (8, 0.5, format!("{fix}axes = [\"z\"]\n")),
            (8, 0.5, format!("{fix}rotation = true\n")),
        ] {
            let (reactions, sum, [x, y, _]) = plate(bending, cells, at, &far);
            let (force, moment) = resultant(&reactions);
            let what = format!("{bending}, {cells} cells, {far:?}: {force:?} N, {moment:?} N m");
            assert!((sum + 1.0).abs() < 1e-8, "{what}: {sum} N over the nodes");
            // The moment of a unit force along z at (x, y) is (y, −x, 0).
            for k in 0..3 {
                assert!((force[k] + [0.0, 0.0, 1.0][k]).abs() < 1e-8, "{what}");
                assert!((moment[k] + [y, -x, 0.0][k]).abs() < 1e-8, "{what}");
            }
        }
    }
}

/// A clamp that moves keeps the slope of its sheet: a sheet that moves with it stays free of stress and needs no force.
#[test]
fn a_sheet_that_moves_with_its_clamp_feels_nothing() {
    let program = Program::run(
        r#"
[time]
end = 0.01
step = 1e-3
scheme = "implicit-midpoint"
[[body]]
name = "plate"
sheet = { size = [1.0, 0.5], cells = [6, 3] }
material = { law = "st-venant-kirchhoff", young = 1e9, poisson = 0.3, density = 1000.0, thickness = 2e-2 }
velocity = [0.0, 0.0, 10.0]
[[fix]]
body = "plate"
region = "x-min"
rotation = true
motion = { kind = "translate", velocity = [0.0, 0.0, 10.0] }
"#,
    );
    let history = program.history();
    assert!(history.last("elastic").abs() < 1e-12, "{} J", history.last("elastic"));
    let report = program.report();
    let (force, moment) = resultant(report["results"]["reactions"].as_array().unwrap());
    assert!(force.iter().chain(&moment).all(|value| value.abs() < 1e-4), "{force:?} N, {moment:?} N m");
}

#[test]
fn reactions_of_statics_carry_the_weight() {
    let program = Program::run(HANGING);
    let report = program.report();
    let reactions = report["results"]["reactions"].as_array().unwrap();
    assert_eq!(reactions.len(), 2);
    let (force, moment) = resultant(reactions);
    let mass = 1000.0 * 0.06;
    let weight = [mass, 2.0 * mass, -9.81 * mass];
    for k in 0..3 {
        assert!((force[k] + weight[k]).abs() < 1e-9 * mass, "{force:?}");
    }
    // The second fix holds z alone.
    assert_eq!(vector(&reactions[1]["force"])[..2], [0.0, 0.0]);
    // The moment about the origin balances that of the weight of the deformed body. On a lattice of bricks each
    // interior node has the same row sum of mass; on each end plane it is halved.
    let frame = variational::io::read_mesh(&program.out().join("scene_000001.vtu")).unwrap();
    let u = &frame.point_array("displacement").unwrap().values;
    let mut of_weight = [0.0; 3];
    for (node, rest) in frame.mesh.points.iter().enumerate() {
        let inner = |x: f64, end: f64| if x.abs() < 1e-9 || (x - end).abs() < 1e-9 { 0.5 } else { 1.0 };
        let share = inner(rest[0], 1.0) * inner(rest[1], 0.2) * inner(rest[2], 0.3) / 24.0;
        let x = [0, 1, 2].map(|k| rest[k] + u[3 * node + k]);
        for k in 0..3 {
            let (i, j) = ((k + 1) % 3, (k + 2) % 3);
            of_weight[k] += share * (x[i] * weight[j] - x[j] * weight[i]);
        }
    }
    for k in 0..3 {
        assert!((moment[k] + of_weight[k]).abs() < 1e-8 * mass, "{moment:?} {of_weight:?}");
    }
}

#[test]
fn the_largest_values_are_those_of_the_last_frame() {
    let program = Program::run(HANGING);
    let report = program.report();
    let frame = variational::io::read_mesh(&program.out().join("scene_000001.vtu")).unwrap();
    let u = frame.point_array("displacement").unwrap().values.as_chunks::<3>().0.to_vec();
    let length = |u: &[f64; 3]| u.iter().map(|u| u * u).sum::<f64>().sqrt();
    let peak = &report["results"]["largest_displacement"];
    let node = peak["node"].as_u64().unwrap() as usize;
    let largest = u.iter().map(length).fold(0.0, f64::max);
    assert!(is_close(&peak["value"], length(&u[node])), "{peak}");
    assert!((largest - length(&u[node])).abs() < 1e-15);
    assert!((0..3).all(|k| is_close(&peak["position"][k], frame.mesh.points[node][k])), "{peak}");
    assert_eq!(peak["body"], "beam");
    let stress = &frame.cell_array("von_mises").unwrap().values;
    let peak = &report["results"]["largest_von_mises"];
    let element = peak["element"].as_u64().unwrap() as usize;
    assert!(is_close(&peak["value"], stress.iter().copied().fold(0.0, f64::max)), "{peak}");
    assert!(is_close(&peak["value"], stress[element]), "{peak}");
    let said = String::from_utf8_lossy(&program.output.stdout).into_owned();
    for words in
        ["largest displacement", "largest von Mises stress", "reaction of fix 0, region 'x-min'", "tip.uz: "]
    {
        assert!(said.contains(words), "{words}: {said}");
    }
}

#[test]
fn statics_have_no_scheme_and_no_drift() {
    let program = Program::run(HANGING);
    let report = program.report();
    assert!(report["scheme"].is_null() && report["variational"].is_null());
    assert!(report["energy"].get("drift").is_none() && report["energy"].get("relative_drift").is_none());
    let said = String::from_utf8_lossy(&program.output.stdout).into_owned() + &program.errors();
    assert!(
        said.contains("load step") && !said.contains("implicit-midpoint") && !said.contains("drift"),
        "{said}"
    );
}

#[test]
fn extremes_of_probes_are_those_of_the_rows() {
    let region = "[[probe]]\nname = \"root\"\nbody = \"beam\"\nregion = \"x-min\"\nsum = \"reaction_force\"\n\
                  max = \"von_mises\"\n[[probe]]\nname = \"tip\"";
    let scene = HANGING
        .replace("[static]\ntolerance = 1e-14\n", "")
        .replace("end = 1.0\nstep = 1.0", "end = 0.2\nstep = 0.002")
        .replace("[[probe]]\nname = \"tip\"", region);
    let program = Program::run(&scene);
    let (report, history) = (program.report(), program.history());
    let times = history.column("t");
    let ranges = report["results"]["probes"].as_array().unwrap();
    assert_eq!(ranges.len(), 3 + 4);
    let root = ["root.sum.reaction_force.x", "root.sum.reaction_force.z", "root.max.von_mises"];
    for column in ["tip.ux", "tip.uy", "tip.uz"].into_iter().chain(root) {
        let values = history.column(column);
        let range =
            ranges.iter().find(|range| range["column"] == column).unwrap_or_else(|| panic!("{column}"));
        let least = values.iter().copied().fold(f64::INFINITY, f64::min);
        let most = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        assert!(
            is_close(&range["min"], least) && is_close(&range["max"], most),
            "{range} {least:e} {most:e}"
        );
        let at = times.iter().position(|&t| is_close(&range["at_max"], t)).unwrap();
        assert_eq!(values[at], most);
    }
}

#[test]
fn a_mesh_that_looks_like_millimetres_is_told() {
    let said = |keys: &str, young: &str| {
        let program = Program::run(&format!(
            "[time]\nend = 1.0\nstep = 1.0\nscheme = \"implicit-midpoint\"\n[static]\n[[body]]\nname = \"bar\"\n\
             mesh = \"MESHES/bar.inp\"\n{keys}\n\
             material = {{ law = \"linear\", young = {young}, poisson = 0.3, density = 7850.0 }}\n\
             [[fix]]\nbody = \"bar\"\nregion = \"root\"\n"
        ));
        let notes = program.report()["notes"].to_string();
        assert_eq!(notes.contains("millimetre"), program.errors().contains("millimetre"));
        notes.contains("millimetre")
    };
    assert!(said("", "2.1e11"));
    assert!(!said("scale = 1e-3", "2.1e11") && !said("scale = 1.0", "2.1e11") && !said("", "1e6"));
}

/// A body at rest has no energy drift: a ratio of round-off to round-off is not reported as drift and breaks no
/// assertion.
#[test]
fn a_body_at_rest_does_not_drift() {
    let scene = |scheme: &str| {
        format!(
            r#"
            [time]
            end = 0.02
            step = 1e-3
            scheme = "{scheme}"
            [[body]]
            name = "beam"
            box = {{ size = [1.0, 0.2, 0.2], cells = [3, 1, 1] }}
            material = {{ law = "neo-hookean", young = 1e6, poisson = 0.3, density = 1000.0 }}
            [[fix]]
            body = "beam"
            region = "x-min"
            [assert]
            energy_drift = 1e-6
            "#
        )
    };
    for scheme in ["implicit-midpoint", "stormer-verlet", "energy-momentum"] {
        let program = Program::run(&scene(scheme));
        assert_eq!(program.report()["energy"]["relative_drift"], 0.0, "{scheme}");
    }
}

/// The energy that a scheme loses is reported however small the motion is: a steel bar whose nodes move by 1e-8 of its length, or less.
#[test]
fn the_drift_of_small_motions_is_reported() {
    let drift = |velocity: &str| {
        let program = Program::run(&format!(
            r#"
            [time]
            end = 2e-3
            step = 1e-4
            scheme = "backward-euler"
            [[body]]
            name = "bar"
            box = {{ size = [0.5, 0.02, 0.01], cells = [10, 1, 1], element = "hex8" }}
            material = {{ law = "st-venant-kirchhoff", young = 2e11, poisson = 0.3, density = 7850.0 }}
            velocity = [0.0, 0.0, "{velocity}*x"]
            [[fix]]
            body = "bar"
            region = "x-min"
            "#
        ));
        program.report()["energy"]["relative_drift"].as_f64().unwrap()
    };
    let [large, small, least] = ["1e-2", "1e-4", "1e-6"].map(drift);
    assert!(large > 0.01 && (small / large - 1.0).abs() < 1e-3, "{large} {small}");
    assert!((least / large - 1.0).abs() < 1e-2, "{large} {least}");
}

/// The support of a fixed rigid body takes the load, the weight and their moment of what is attached to it.
#[test]
fn a_fixed_rigid_body_bears_what_is_attached_to_it() {
    let program = Program::run(
        r#"
        gravity = [1.0, -2.0, 3.0]
        [time]
        end = 1.0
        step = 1.0
        [static]
        tolerance = 1e-13
        [[body]]
        name = "b"
        box = { size = [0.5, 0.2, 0.2], cells = [2, 2, 2], element = "hex8", origin = [0.5, 0, 0] }
        material = { law = "neo-hookean", young = 1e9, poisson = 0.3, density = 1000.0 }
        [[rigid]]
        name = "a"
        shape = { kind = "box", size = [0.5, 0.2, 0.2] }
        position = [0.25, 0.1, 0.1]
        fixed = true
        [[attach]]
        body = "b"
        region = "x-min"
        to = "a"
        [[load]]
        kind = "traction"
        body = "b"
        region = "x-max"
        traction = [100.0, 50.0, -30.0]
        "#,
    );
    let report = program.report();
    let reactions = report["results"]["reactions"].as_array().unwrap();
    assert_eq!((reactions.len(), &reactions[0]["body"]), (1, &Value::from("a")));
    let (force, moment) = resultant(reactions);
    let (weight, load) = ([20.0, -40.0, 60.0], [4.0, 2.0, -1.2]);
    let arms = [[0.75, 0.1, 0.1], [1.0, 0.1, 0.1]];
    for k in 0..3 {
        assert!((force[k] + weight[k] + load[k]).abs() < 1e-7, "{force:?}");
        let (i, j) = ((k + 1) % 3, (k + 2) % 3);
        let of = |arm: [f64; 3], f: [f64; 3]| arm[i] * f[j] - arm[j] * f[i];
        // Up to the displacement of the loads, some 1e-6 m.
        assert!((moment[k] + of(arms[0], weight) + of(arms[1], load)).abs() < 1e-3, "{moment:?}");
    }
}
