//! Tests attachments and seams in scenes: what they conserve, how stiff they are, and what is refused.

use crate::program::Program;
use variational::prelude::*;

/// Describes a strip of cloth whose edge lies on a soft block, both free and spinning.
fn held(scheme: &str, step: f64, joint: &str) -> String {
    format!(
        r#"
[time]
end = 0.1
step = {step}
scheme = "{scheme}"
[[body]]
name = "block"
box = {{ size = [1.0, 1.0, 0.5], cells = [3, 2, 2], element = "hex8", origin = [-1.0, 0.0, -0.25] }}
material = {{ law = "neo-hookean", young = 1e5, poisson = 0.3, density = 100.0 }}
angular_velocity = [0.3, 0.0, 1.0]
[[body]]
name = "cloth"
sheet = {{ size = [1.0, 1.0], cells = [5, 7], pattern = "random" }}
material = {{ law = "neo-hookean", young = 1e5, poisson = 0.3, area_density = 0.5, thickness = 1e-2 }}
velocity = [0.5, 0.0, 0.4]
{joint}
[output]
history = 1
[solver]
tolerance = 1e-14
"#
    )
}

#[test]
fn attached_bodies_keep_their_momenta_and_their_energy() {
    let ties = [
        "[[attach]]\nbody = \"cloth\"\nregion = \"x-min\"\nto = \"block\"\nstiffness = 1000.0",
        "[[attach]]\nbody = \"cloth\"\nregion = \"x-min\"\nto = \"block\"\nsurface = \"z-max\"\nstiffness = 300.0",
        "[[attach]]\nbody = \"block\"\nbox = { min = [-0.1, 0, 0.2], max = [0.1, 1, 1] }\nto = \"cloth\"\nstiffness = 50.0\nlength = 0.1",
    ];
    for joint in ties {
        for (scheme, step) in [("stormer-verlet", 5e-4), ("implicit-midpoint", 2e-3)] {
            let history = Program::run(&held(scheme, step, joint)).history();
            let drift = |name: &str| {
                let values = history.column(name);
                values.iter().map(|value| (value - values[0]).abs()).fold(0.0, f64::max)
            };
            for name in ["px", "py", "pz", "lx", "ly", "lz"] {
                assert!(drift(name) < 1e-11, "{scheme} {joint}: {name} drifts by {:e}", drift(name));
            }
            let exchange = drift("kinetic");
            assert!(exchange > 1e-3, "{exchange}");
            assert!(
                drift("total") < 0.02 * exchange,
                "{scheme} {joint}: {:e} of {exchange:e}",
                drift("total")
            );
        }
    }
}

/// A nearly rigid sheet of weight Σ m g hangs from n springs of stiffness k: the mean extension is Σ m g / (n k).
#[test]
fn a_sheet_hangs_from_its_springs_as_deep_as_they_say() {
    let scene = r#"
gravity = [0.0, 0.0, -9.81]
[time]
end = 1.0
step = 1.0
scheme = "implicit-midpoint"
[static]
[[body]]
name = "cloth"
sheet = { size = [1.0, 1.0], cells = [4, 4], directions = [[1, 0, 0], [0, 0, 1]] }
material = { law = "st-venant-kirchhoff", young = 1e8, poisson = 0.0, area_density = 0.5, thickness = 1e-2 }
[[attach]]
body = "cloth"
region = "y-max"
stiffness = 20.0
[[probe]]
name = "low"
body = "cloth"
point = [0.5, 0.0, 0.0]
"#;
    let history = Program::run(scene).history();
    let expected = -0.5 * 9.81 / (5.0 * 20.0);
    let found = history.last("low.uz");
    assert!((found / expected - 1.0).abs() < 1e-4, "{found} {expected}");
}

/// A cloth is carried around by springs with moving ends. The work of these ends closes the energy ledger.
#[test]
fn what_moves_the_places_does_work_that_is_accounted_for() {
    let joint = "[[attach]]\nbody = \"cloth\"\nregion = \"x-max\"\nstiffness = 200.0\n\
                 motion = { kind = \"rotate\", axis = [0, 0, 1], rate = 8.0 }";
    let mut closures = Vec::new();
    for step in [2e-3, 1e-3] {
        let text = held("implicit-midpoint", step, joint).replace("[output]", "[output]\nledger = true");
        let program = Program::run(&text);
        let (report, history) = (program.report(), program.history());
        let energy = &report["energy"];
        let outside = energy["force_work"].as_f64().unwrap();
        let change = history.last("total") - history.first("total");
        assert!(change.abs() > 0.1, "{change} {report}");
        closures.push(((change - outside).abs() / change.abs(), energy.clone()));
    }
    let [(coarse, _), (fine, energy)] = &closures[..] else { panic!() };
    assert!(*fine < 0.02 && *fine < 0.5 * coarse, "{coarse} {fine} {energy}");
}

fn panels(cells: [u32; 2], gap: f64, seam: &str) -> String {
    format!(
        r#"
[time]
end = 0.4
step = 0.0005
scheme = "stormer-verlet"
[[body]]
name = "left"
sheet = {{ size = [0.5, 1.0], cells = [3, {}] }}
material = {{ law = "st-venant-kirchhoff", young = 1e4, poisson = 0.3, area_density = 0.2, thickness = 1e-2 }}
[[body]]
name = "right"
sheet = {{ size = [0.5, 1.0], cells = [3, {}], pattern = "cross", origin = [{}, 0, 0] }}
material = {{ law = "st-venant-kirchhoff", young = 1e4, poisson = 0.3, area_density = 0.2, thickness = 1e-2 }}
[[seam]]
body = "left"
to = "right"
{seam}
stiffness = 5.0
[output]
history = 1
[[probe]]
name = "a"
body = "left"
point = [0.5, 1.0, 0.0]
[[probe]]
name = "b"
body = "right"
point = [{}, 1.0, 0.0]
"#,
        cells[0],
        cells[1],
        0.5 + gap,
        0.5 + gap
    )
}

/// Sheets that springs sew together may cross at the stitches: a note and report.json tell how many pairs of parts do not meet there.
#[test]
fn stitches_of_springs_tell_what_they_exclude_from_contact() {
    let seam = "region = \"x-max\"\nto_region = \"x-min\"";
    let scene = panels([2, 2], 0.1, seam)
        .replace("[[seam]]", "[contact]\n[[seam]]")
        .replace("end = 0.4", "end = 5e-4");
    let program = Program::run(&scene);
    let count = program.report()["contact"]["pairs_of_parts_sewn_by_springs"].as_u64().unwrap();
    let note =
        format!("keep {count} pairs of points with faces and of edges of 'left' and 'right' out of contact");
    assert!(count > 0 && program.errors().contains(&note), "{}", program.errors());
}

#[test]
fn a_seam_of_unequal_edges_has_no_force_where_they_meet_and_pulls_where_they_do_not() {
    let curves = "region = \"x-max\"\nto_region = \"x-min\"";
    for cells in [[6, 6], [6, 9], [9, 4]] {
        let history = Program::run(&panels(cells, 0.0, curves)).history();
        assert!(history.column("elastic").iter().all(|&e| e < 1e-20));
        let history = Program::run(&panels(cells, 0.2, curves)).history();
        // Each stitch stores ½ k g², with one stitch per node of the finer edge.
        let stitches = f64::from(cells[0].max(cells[1]) + 1);
        assert!((history.first("elastic") - stitches * 0.5 * 5.0 * 0.04).abs() < 1e-12);
        let gaps: Vec<f64> =
            history.column("a.x").iter().zip(history.column("b.x")).map(|(a, b)| b - a).collect();
        assert!(gaps.iter().any(|gap| gap.abs() < 0.02), "the edges never met");
        let [px, total] = ["px", "total"].map(|name| history.column(name));
        assert!(px.iter().all(|p| p.abs() < 1e-13));
        let drift = total.iter().map(|e| (e / total[0] - 1.0).abs()).fold(0.0, f64::max);
        assert!(drift < 0.01, "{cells:?}: {drift}");
    }
}

#[test]
fn a_seam_by_pairs_and_one_run_backwards_do_as_told() {
    // These are nodes of x-max of the left panel (4 per row) and of x-min of the right panel, from bottom to top.
    let pairs = "nodes = [3, 7, 11]\nto_nodes = [0, 4, 8]";
    let curves = "region = \"x-max\"\nto_region = \"x-min\"";
    let energy = |seam: &str| Program::run(&panels([2, 2], 0.1, seam)).history().first("elastic");
    assert!((energy(pairs) - energy(curves)).abs() < 1e-14);
    // If one edge is reversed, its two ends cross over and its middle stays.
    let crossed = 0.5 * 5.0 * (3.0 * 0.01 + 2.0);
    assert!((energy(&format!("{curves}\nreverse = true")) - crossed).abs() < 1e-12);
}

#[test]
fn what_cannot_be_sewn_or_attached_is_refused() {
    let curves = "region = \"x-max\"\nto_region = \"x-min\"";
    for (seam, words) in [
        ("region = \"x-max\"", "give `region` and `to_region`"),
        ("nodes = [3]\nto_nodes = [0, 4]", "has 2 nodes, but `nodes` has 1"),
        ("nodes = [300]\nto_nodes = [0]", "no node 300"),
        ("region = \"sheet\"\nto_region = \"x-min\"", "has no lines"),
        ("region = \"seam\"\nto_region = \"x-min\"", "seam"),
    ] {
        let program = Program::check(&panels([2, 2], 0.1, seam));
        assert!(program.code() == Some(2) && program.errors().contains(words), "{}", program.errors());
    }
    let good = panels([2, 2], 0.1, curves);
    let program = Program::check(&good.replace("stiffness = 5.0", "stiffness = 0.0"));
    assert!(program.errors().contains("must be positive"), "{}", program.errors());
    for (joint, words) in [
        ("to = \"cloth\"\nnodes = [0]", "cannot be attached to itself"),
        ("to = \"wall\"\nnodes = [0]", "no body 'wall'"),
        ("to = \"block\"", "give one of `region`, `box`, `plane`, `sphere`, `nodes`"),
        ("surface = \"z-max\"\nnodes = [0]", "`to`"),
        ("to = \"block\"\nsurface = \"top\"\nnodes = [0]", "'top'"),
    ] {
        let joint = format!("[[attach]]\nbody = \"cloth\"\nstiffness = 1.0\n{joint}");
        let program = Program::check(&held("stormer-verlet", 1e-3, &joint));
        assert!(program.code() == Some(2) && program.errors().contains(words), "{}", program.errors());
    }
}

/// Two closed curves, the inner rims of two rings with different numbers of nodes, are sewn all round.
#[test]
fn closed_curves_are_sewn_all_round() {
    let ring = |name: &str, z: f64, count: usize| -> String {
        let mut text = format!("o {name}\n");
        for k in 0..count {
            let angle = (k as f64 + 0.3) / count as f64 * std::f64::consts::TAU;
            for r in [1.0, 2.0] {
                text += &format!("v {} {} {z}\n", r * angle.cos(), r * angle.sin());
            }
        }
        for k in 0..count {
            let (a, b) = (2 * k + 1, 2 * ((k + 1) % count) + 1);
            text += &format!("f {a} {} {} {b}\n", a + 1, b + 1);
        }
        text += &format!(
            "g rim\nl {} 1\n",
            (0..count).map(|k| (2 * k + 1).to_string()).collect::<Vec<_>>().join(" ")
        );
        text
    };
    let directory = tempfile::TempDir::new().unwrap();
    let (a, b) = (directory.path().join("a.obj"), directory.path().join("b.obj"));
    std::fs::write(&a, ring("a", 0.0, 24)).unwrap();
    std::fs::write(&b, ring("b", 0.25, 16)).unwrap();
    let body = |name: &str, path: &std::path::Path| {
        let law =
            r#"{ "law": "corotated", "young": 1e4, "poisson": 0.3, "area_density": 0.2, "thickness": 1e-2 }"#;
        Body::from_mesh(name, path, serde_json::from_str::<SheetLaw>(law).unwrap())
    };
    let seam: Seam = serde_json::from_str(
        r#"{ "body": "a", "region": "rim", "to": "b", "to_region": "rim", "stiffness": 10.0 }"#,
    )
    .unwrap();
    let scene = Scene::new(Time::new(0.1, 1e-3, SchemeName::StormerVerlet))
        .body(body("a", &a))
        .body(body("b", &b))
        .seam(seam);
    let elastic = Simulation::new(scene).unwrap().observe().elastic;
    // 24 stitches have length ¼; the corners of the polygons add a little.
    let least = 24.0 * 0.5 * 10.0 / 16.0;
    assert!(elastic > least && elastic < 1.15 * least, "{elastic} {least}");
}

/// A tie without `stiffness` holds its nodes exactly where they are attached, under any scheme, and keeps momenta.
#[test]
fn exact_ties_hold_exactly() {
    let joint = "[[attach]]\nbody = \"cloth\"\nregion = \"x-min\"\nto = \"block\"\n\
                 [[probe]]\nname = \"a\"\nbody = \"cloth\"\npoint = [0.0, 0.0, 0.0]\n\
                 [[probe]]\nname = \"b\"\nbody = \"block\"\npoint = [0.0, 0.0, 0.0]";
    for (scheme, step) in [("stormer-verlet", 5e-4), ("implicit-midpoint", 2e-3), ("energy-momentum", 2e-3)] {
        let history = Program::run(&held(scheme, step, joint)).history();
        let drift = |name: &str| {
            let values = history.column(name);
            values.iter().map(|value| (value - values[0]).abs()).fold(0.0, f64::max)
        };
        for axis in ["x", "y", "z"] {
            let [a, b] = ["a", "b"].map(|probe| history.column(&format!("{probe}.{axis}")));
            assert!(a.iter().zip(&b).all(|(a, b)| (a - b).abs() < 1e-14), "{scheme} {axis}");
        }
        for name in ["px", "py", "pz", "lx", "ly", "lz"] {
            assert!(drift(name) < 1e-10, "{scheme}: {name} drifts by {:e}", drift(name));
        }
        assert!(drift("kinetic") > 1e-3 && drift("total") < 0.02 * drift("kinetic"), "{scheme}");
    }
}

/// Four panels are sewn around a common corner and one side is held: every pair of edges stays together.
#[test]
fn exact_seams_share_corners_and_may_be_held() {
    let mut text = String::from(
        "gravity = [0.0, 0.0, -9.81]\n[time]\nend = 0.05\nstep = 0.0005\nscheme = \"stormer-verlet\"\n\
         [[fix]]\nbody = \"b01\"\nregion = \"x-min\"\n[output]\nhistory = 1\n",
    );
    for (i, j) in [(0, 0), (1, 0), (0, 1), (1, 1)] {
        // The upper panels have twice as many cells per side.
        let cells = 3 + 3 * j;
        text += &format!(
            "[[body]]\nname = \"b{i}{j}\"\nsheet = {{ size = [0.5, 0.5], cells = [{cells}, {cells}], \
             origin = [{}, {}, 0] }}\nmaterial = {{ law = \"neo-hookean\", young = 1e4, poisson = 0.3, \
             area_density = 0.2, thickness = 1e-3 }}\n",
            0.5 * f64::from(i),
            0.5 * f64::from(j)
        );
        for (k, corner) in [[0.5, 0.5, 0.0], [0.5, 1.0 * f64::from(j), 0.0]].iter().enumerate() {
            text += &format!("[[probe]]\nname = \"p{i}{j}{k}\"\nbody = \"b{i}{j}\"\npoint = {corner:?}\n");
        }
    }
    for (a, b, region, to) in
        [("b00", "b10", "x-max", "x-min"), ("b00", "b01", "y-max", "y-min"), ("b01", "b11", "x-max", "x-min")]
    {
        text +=
            &format!("[[seam]]\nbody = \"{a}\"\nregion = \"{region}\"\nto = \"{b}\"\nto_region = \"{to}\"\n");
    }
    let history = Program::run(&text).history();
    assert!(history.last("p000.z") < -1e-3);
    for axis in ["x", "y", "z"] {
        let corner = |body: &str| history.last(&format!("p{body}0.{axis}"));
        for body in ["10", "01", "11"] {
            assert!((corner("00") - corner(body)).abs() < 1e-14, "{body} {axis}");
        }
        assert_eq!(history.last(&format!("p001.{axis}")), history.last(&format!("p101.{axis}")));
    }
}

#[test]
fn what_does_not_meet_cannot_be_held_exactly() {
    let exact = |gap: f64| {
        panels([2, 2], gap, "region = \"x-max\"\nto_region = \"x-min\"").replace("stiffness = 5.0\n", "")
    };
    let program = Program::check(&exact(0.1));
    assert!(program.errors().contains("needs edges that meet"), "{}", program.errors());
    assert_eq!(Program::check(&exact(0.0)).code(), Some(0));
    for (joint, words) in [
        ("to = \"block\"\nregion = \"x-max\"", "from the surface"),
        ("region = \"x-max\"", "[[fix]]"),
        ("to = \"block\"\nregion = \"x-min\"\nlength = 0.1", "give a `stiffness`"),
    ] {
        let program =
            Program::check(&held("stormer-verlet", 1e-3, &format!("[[attach]]\nbody = \"cloth\"\n{joint}")));
        assert!(program.code() == Some(2) && program.errors().contains(words), "{}", program.errors());
    }
}
