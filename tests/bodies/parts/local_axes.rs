//! Tests supports in local axes: rollers, faces that are held along their normals, cylinders and spheres.

use variational::prelude::*;

use super::{block, cross, equilibrium, load, near, rubber, run};

/// A body whose nodes all lie on rollers slides down an incline as a point mass does, and the incline reacts along its
/// normal alone.
#[test]
fn rollers_on_an_incline_answer_along_the_normal() {
    let angle: f64 = 0.4;
    let normal = [angle.sin(), 0.0, angle.cos()];
    let g = [0.0, 0.0, -9.81];
    let along = normal[2] * g[2];
    for scheme in [
        SchemeName::StormerVerlet,
        SchemeName::ImplicitMidpoint,
        SchemeName::Gauss,
        SchemeName::EnergyMomentum,
        SchemeName::Newmark,
    ] {
        let scene = Scene::new(Time::new(0.1, 1e-3, scheme))
            .gravity(g)
            .body(Body::from_box("block", block(CellKind::Hex8), rubber()))
            .fix(Fix::region("block", "z-min").axes(&[HeldAxis::Vector(normal.map(|n| 3.0 * n))]))
            .probe(Probe::over(
                "foot",
                "block",
                Selection::region("z-min"),
                Statistic::Sum,
                "reaction_force",
            ));
        let mut simulation = Simulation::new(scene).unwrap();
        let first = simulation.observe();
        while !simulation.is_done() {
            simulation.step().unwrap();
            for (node, reaction) in simulation.reactions(0).into_iter().enumerate() {
                let part: f64 = (0..3).map(|k| reaction[k] * normal[k]).sum();
                near(reaction, normal.map(|n| part * n), 1e-12 * (1.0 + part.abs()));
                let off_foot = simulation.bodies()[0].mesh.points[node][2] > 0.0;
                assert!(!off_foot || reaction == [0.0; 3], "node {node}: {reaction:?}");
            }
        }
        let seen = simulation.observe();
        // Along the incline only weight acts: the momentum is m g_t t to round-off, with m = 240 kg.
        let tangent = [normal[2], 0.0, -normal[0]];
        let p: f64 = (0..3).map(|k| seen.momentum[k] * tangent[k]).sum();
        let expected = 240.0 * (g[2] * tangent[2]) * 0.1;
        // The correction of `energy-momentum` preserves translations along the global axes only, hence its wider
        // tolerance.
        let tolerance = if scheme == SchemeName::EnergyMomentum { 1e-6 } else { 1e-9 };
        assert!((p - expected).abs() < tolerance * expected.abs(), "{scheme:?}: {p} {expected}");
        let drift = (seen.total() - first.total()).abs();
        assert!(drift < 2e-2 * seen.kinetic.max(240.0 * along.abs() * 1e-3), "{scheme:?}: {drift}");
    }
}

/// A body tied to nodes on rollers moves along the rollers' plane: ties also work where the nodes have local axes.
#[test]
fn what_is_tied_to_rollers_rolls_too() {
    let normal = [0.6, 0.0, 0.8];
    let tangent = [0.8, 0.0, -0.6];
    let upper =
        BoxMesh { size: [0.5, 0.3, 0.2], cells: [3, 2, 1], element: CellKind::Tet4, origin: [0.1, 0.1, 0.4] };
    let lower = block(CellKind::Hex8);
    let attach: Attach =
        serde_json::from_value(serde_json::json!({ "body": "upper", "region": "z-min", "to": "lower" }))
            .unwrap();
    for scheme in [SchemeName::StormerVerlet, SchemeName::ImplicitMidpoint] {
        let scene = Scene::new(Time::new(0.05, 5e-4, scheme))
            .gravity([0.0, 0.0, -9.81])
            .body(Body::from_box("lower", lower.clone(), rubber()))
            .body(Body::from_box("upper", upper.clone(), rubber()))
            .attach(attach.clone())
            .fix(Fix::region("lower", "box").axes(&[normal]));
        let mut simulation = Simulation::new(scene).unwrap();
        let first = simulation.observe();
        while !simulation.is_done() {
            simulation.step().unwrap();
        }
        let seen = simulation.observe();
        let p: f64 = (0..3).map(|k| seen.momentum[k] * tangent[k]).sum();
        let expected = (240.0 + 30.0) * (-9.81 * tangent[2]) * 0.05;
        assert!((p - expected).abs() < 1e-9 * expected, "{scheme:?}: {p} {expected}");
        assert!(
            seen.elastic > 1e-6 && (seen.total() - first.total()).abs() < 1e-2 * seen.kinetic,
            "{scheme:?}: {seen:?}"
        );
    }
}

/// A body held by "normal" on faces that are rotated in space deforms like the same body held along the global axes.
#[test]
fn normals_turn_with_the_body() {
    let (c, s) = (0.6, 0.8);
    // Rotates about z, then about x.
    let turn = |[x, y, z]: [f64; 3]| {
        let [a, b] = [c * x - s * y, s * x + c * y];
        [a, c * b - s * z, s * b + c * z]
    };
    let shape = block(CellKind::Hex8);
    let mesh = shape.build().unwrap();
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("turned.vtk");
    let mut text = format!(
        "# vtk DataFile Version 3.0\nb\nASCII\nDATASET UNSTRUCTURED_GRID\nPOINTS {} double\n",
        mesh.points.len()
    );
    for point in &mesh.points {
        let [x, y, z] = turn(*point);
        text += &format!("{x:.17e} {y:.17e} {z:.17e}\n");
    }
    let cells: Vec<&[u32]> =
        mesh.cells_of_dimension(3).iter().map(|&cell| mesh.cell(cell as usize).unwrap().1).collect();
    text += &format!("CELLS {} {}\n", cells.len(), 9 * cells.len());
    for cell in &cells {
        text += &format!("8 {}\n", cell.iter().map(u32::to_string).collect::<Vec<_>>().join(" "));
    }
    text += &format!("CELL_TYPES {}\n{}", cells.len(), "12\n".repeat(cells.len()));
    std::fs::write(&path, text).unwrap();

    let shear = [2e4, -1e4, 0.5e4];
    let traction = |on: serde_json::Value, t: [f64; 3]| {
        let mut json = on;
        (json["kind"], json["body"], json["traction"]) = ("traction".into(), "block".into(), t.into());
        load(json)
    };
    let straight = run(equilibrium()
        .body(Body::from_box("block", shape, rubber()))
        .fix(Fix::region("block", "x-min").axes(&[Axis::X]))
        .fix(Fix::region("block", "y-min").axes(&[Axis::Y]))
        .fix(Fix::region("block", "z-min").axes(&[Axis::Z]))
        .load(traction(serde_json::json!({ "region": "x-max" }), shear)));
    let plane = |point: [f64; 3], normal: [f64; 3]| Selection::plane(turn(point), turn(normal));
    let held = |normal: [f64; 3]| Fix::on("block", plane([0.0; 3], normal)).axes(&[LocalAxis::Normal]);
    let turned = run(equilibrium()
        .body(Body::from_mesh("block", &path, rubber()))
        .fix(held([1.0, 0.0, 0.0]))
        .fix(held([0.0, 1.0, 0.0]))
        .fix(held([0.0, 0.0, 1.0]))
        .load(traction(serde_json::json!({ "plane": { "point": turn([1.0, 0.0, 0.0]), "normal": turn([1.0, 0.0, 0.0]) } }), turn(shear))));
    for (x, y) in straight.positions(0).into_iter().zip(turned.positions(0)) {
        near(y, turn(x), 1e-9);
    }
    for (x, y) in straight.reactions(0).into_iter().zip(turned.reactions(0)) {
        near(y, turn(x), 1e-5);
    }
}

/// Nodes held along the radial and axial directions of a cylinder move in its hoop direction alone. Nodes held in the
/// hoop direction, or along the radius or the tangents of a sphere, do not move along these. No reaction acts along
/// the free directions.
#[test]
fn cylinders_and_spheres_hold_their_directions() {
    let shape = BoxMesh { origin: [0.5, -0.2, 0.1], ..block(CellKind::Tet4) };
    for (axes, axis) in [
        (vec![LocalAxis::Radial, LocalAxis::Axial], Some([0.0, 0.0, 2.0])),
        (vec![LocalAxis::Hoop], Some([0.0, 0.0, 2.0])),
        (vec![LocalAxis::Radial], None),
        (vec![LocalAxis::Tangent], None),
    ] {
        let scene = equilibrium()
            .body(Body::from_box("block", shape.clone(), rubber()))
            .fix(Fix::region("block", "x-max"))
            .fix(Fix::on("block", Selection::sphere([0.5, 0.1, 0.3], 0.35)).axes(&axes).about([0.0; 3], axis))
            .load(load(
                serde_json::json!({ "kind": "body-force", "body": "block", "force": [3e4, 2e4, 4e4] }),
            ));
        let simulation = run(scene);
        let mesh = &simulation.bodies()[0].mesh;
        let (x, reactions) = (simulation.positions(0), simulation.reactions(0));
        let (mut count, mut moved) = (0, 0.0_f64);
        for node in mesh.nodes_in_ball([0.5, 0.1, 0.3], 0.35) {
            let node = node as usize;
            let rest = mesh.points[node];
            let flat = if axis.is_some() { [rest[0], rest[1], 0.0] } else { rest };
            let length = flat.iter().map(|c| c * c).sum::<f64>().sqrt();
            let radial = flat.map(|c| c / length);
            let hoop = cross([0.0, 0.0, 1.0], radial);
            let u = [0, 1, 2].map(|k| x[node][k] - rest[k]);
            let part = |v: [f64; 3], e: [f64; 3]| (0..3).map(|k| v[k] * e[k]).sum::<f64>();
            let along = |e: [f64; 3]| [0, 1, 2].map(|k| part(u, e) * e[k]);
            let (free, reaction_free) = match (&axes[..], axis) {
                ([LocalAxis::Radial, _], _) => (along(hoop), part(reactions[node], hoop)),
                ([LocalAxis::Hoop], _) => {
                    ([0, 1, 2].map(|k| u[k] - along(hoop)[k]), part(reactions[node], radial))
                }
                ([LocalAxis::Tangent], _) => (along(radial), part(reactions[node], radial)),
                _ => ([0, 1, 2].map(|k| u[k] - along(radial)[k]), 0.0),
            };
            near(u, free, 1e-14);
            assert!(reaction_free.abs() < 1e-9, "{axes:?}: {reaction_free}");
            moved = moved.max(u.iter().map(|c| c.abs()).fold(0.0, f64::max));
            count += 1;
        }
        assert!(count > 3 && moved > 1e-4, "{axes:?}: {count} nodes, {moved}");
    }
}

/// The work of a support that moves along local axes equals the energy that the system gains.
#[test]
fn a_moving_support_in_local_axes_closes_the_ledger() {
    let motion: Motion =
        serde_json::from_str(r#"{ "kind": "sine", "amplitude": [0.01, 0.02, 0.01], "frequency": 3.0 }"#)
            .unwrap();
    for scheme in ["stormer-verlet", "implicit-midpoint", "gauss"] {
        let scheme: SchemeName = serde_json::from_value(scheme.into()).unwrap();
        let scene = Scene::new(Time::new(0.2, 1e-3, scheme))
            .body(Body::from_box("block", block(CellKind::Hex8), rubber()))
            .fix(
                Fix::region("block", "x-min")
                    .axes(&[[1.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
                    .motion(motion.clone()),
            );
        let mut simulation = Simulation::new(scene).unwrap();
        let first = simulation.observe().total();
        let mut work = 0.0;
        while !simulation.is_done() {
            work += simulation.step().unwrap().energy.prescribed;
        }
        let seen = simulation.observe();
        let gained = seen.total() - first;
        assert!(
            seen.kinetic > 1e-3 && (gained - work).abs() < 2e-3 * gained.abs(),
            "{scheme:?}: {gained} {work}"
        );
    }
}
