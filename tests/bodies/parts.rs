//! Tests the keys that act on a part of a body: total forces and moments, supports in local axes, mirror planes,
//! periodic pairs, quantities over regions, initial fields, refinement that keeps layers.

use crate::program::Program;
use variational::prelude::*;

const YOUNG: f64 = 1e6;

fn rubber() -> Law {
    Law::NeoHookean(Isotropic { young: YOUNG, poisson: 0.3, density: 1000.0 })
}

fn linear() -> Law {
    Law::Linear(Isotropic { young: YOUNG, poisson: 0.3, density: 1000.0 })
}

fn block(element: CellKind) -> BoxMesh {
    BoxMesh { size: [1.0, 0.6, 0.4], cells: [4, 3, 2], element, origin: [0.0; 3] }
}

/// Starts a scene that solves for the equilibrium at full load, to round-off.
fn equilibrium() -> Scene {
    let tolerance = Static { tolerance: 1e-13, ..Static::default() };
    Scene::new(Time::new(1.0, 1.0, SchemeName::ImplicitMidpoint)).statics(tolerance)
}

fn run(scene: Scene) -> Simulation {
    let mut simulation = Simulation::new(scene).unwrap_or_else(|problems| panic!("{problems:?}"));
    while !simulation.is_done() {
        simulation.step().unwrap();
    }
    simulation
}

fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

fn near(found: [f64; 3], expected: [f64; 3], tolerance: f64) {
    assert!((0..3).all(|k| (found[k] - expected[k]).abs() <= tolerance), "{found:?}, expected {expected:?}");
}

/// Returns the resultant of nodal forces on the first body and their moment about the origin, both at rest positions.
fn resultant(simulation: &Simulation, forces: &[[f64; 3]]) -> ([f64; 3], [f64; 3]) {
    let (mut force, mut moment) = ([0.0; 3], [0.0; 3]);
    for (x, f) in simulation.bodies()[0].mesh.points.iter().zip(forces) {
        let m = cross(*x, *f);
        (0..3).for_each(|k| (force[k] += f[k], moment[k] += m[k]).0);
    }
    (force, moment)
}

fn load(json: serde_json::Value) -> Load {
    serde_json::from_value(json).unwrap()
}

/// Two fixes may hold the same axis of a node, if neither moves it along this axis.
#[test]
fn fixes_that_hold_an_axis_still_agree() {
    let scene = |axes: &str, motion: &str| {
        format!(
            r#"
[time]
end = 0.02
step = 1e-3
scheme = "implicit-midpoint"
[[body]]
name = "block"
box = {{ size = [0.4, 0.2, 0.2], cells = [2, 1, 1], element = "hex8" }}
material = {{ law = "neo-hookean", young = 1e6, poisson = 0.3, density = 1000.0 }}
[[fix]]
body = "block"
region = "x-min"
axes = ["x", "y"]
[[fix]]
body = "block"
region = "x-min"
axes = [{axes}]
motion = {motion}
[output]
history = 1
"#
        )
    };
    for motion in [
        r#"{ kind = "translate", velocity = [0.0, 0.0, 0.5] }"#,
        r#"{ kind = "sine", amplitude = [0.0, 0.0, 0.01], frequency = 20.0 }"#,
        r#"{ kind = "table", times = [0.0, 0.01], displacements = [[0, 0, 0], [0, 0, 0.01]] }"#,
    ] {
        let alone = Program::run(&scene(r#""z""#, motion)).history();
        let shared = Program::run(&scene(r#""x", "y", "z""#, motion)).history();
        for name in ["kinetic", "elastic", "total", "pz"] {
            assert_eq!(alone.column(name), shared.column(name), "{motion}: {name}");
        }
        assert!(alone.last("elastic") > 0.0);
        let moved = motion
            .replace("[0.0, 0.0, 0.5]", "[0.1, 0.0, 0.5]")
            .replace("[0.0, 0.0, 0.01]", "[0.1, 0.0, 0.01]");
        let moved = moved.replace("[0, 0, 0.01]", "[0.1, 0, 0.01]");
        let program = Program::try_run(&scene(r#""x", "z""#, &moved), &[]);
        assert!(program.errors().contains("with another motion than fix[0]"), "{}", program.errors());
    }
}

/// The reactions balance an applied total force and moment, on every kind of facet.
#[test]
fn reactions_balance_a_total_force_and_moment() {
    let (force, moment, about) = ([30.0, -20.0, 10.0], [1.0, 2.0, -3.0], [1.2, 0.1, 0.3]);
    for element in [CellKind::Tet4, CellKind::Tet10, CellKind::Hex8, CellKind::Hex20] {
        for region in [
            serde_json::json!({ "region": "x-max" }),
            serde_json::json!({ "plane": { "point": [1.0, 0.0, 0.0], "normal": [2.0, 0.0, 0.0] } }),
        ] {
            let mut json = region;
            for (key, value) in [("force", force), ("moment", moment), ("about", about)] {
                json[key] = value.into();
            }
            (json["kind"], json["body"]) = ("force".into(), "block".into());
            let scene = equilibrium()
                .body(Body::from_box("block", block(element), linear()))
                .fix(Fix::region("block", "x-min"))
                .load(load(json))
                .probe(Probe::over(
                    "grip",
                    "block",
                    Selection::region("x-min"),
                    Statistic::Sum,
                    "reaction_force",
                ));
            let simulation = run(scene);
            let (applied, applied_moment) = resultant(&simulation, &simulation.external_forces(0));
            near(applied, force, 1e-12);
            let carried = cross(about, force);
            near(applied_moment, [0, 1, 2].map(|k| moment[k] + carried[k]), 1e-12);
            // The linear law balances moments about the rest positions.
            let (reaction, reaction_moment) = resultant(&simulation, &simulation.reactions(0));
            near(reaction, applied.map(|f| -f), 1e-9);
            near(reaction_moment, applied_moment.map(|m| -m), 1e-9);
            near(simulation.measures().try_into().unwrap(), reaction, 1e-12);
        }
    }
}

/// A sheet accepts a total force on its edge, a force per volume, and weight with an amplitude. The reactions balance
/// their sum.
#[test]
fn sheets_and_weight_are_loaded_as_asked() {
    let sheet = SheetMesh {
        size: [1.0, 0.5],
        cells: [6, 3],
        pattern: SheetPattern::Cross,
        seed: 0,
        origin: [0.0; 3],
        directions: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]],
    };
    let law: SheetLaw = serde_json::from_value(serde_json::json!({
        "law": "st-venant-kirchhoff", "young": 1e7, "poisson": 0.3, "density": 1000.0, "thickness": 0.01
    }))
    .unwrap();
    let mut scene = equilibrium()
        .gravity([0.0, 0.0, -10.0])
        .gravity_amplitude(Amplitude::expression("t").unwrap())
        .body(Body::from_sheet("sheet", sheet, law))
        .fix(Fix::region("sheet", "sheet"))
        .load(load(serde_json::json!({ "kind": "force", "body": "sheet", "region": "x-max", "force": [1.0, 2.0, 3.0] })))
        .load(load(serde_json::json!({ "kind": "body-force", "body": "sheet", "force": [200.0, 0.0, "100*x"] })));
    scene.time.step = Some(variational::scene::TimeStep::Fixed(0.5));
    let mut simulation = Simulation::new(scene).unwrap();
    for factor in [0.5, 1.0] {
        simulation.step().unwrap();
        let (force, _) = resultant(&simulation, &simulation.external_forces(0));
        // The volume is 0.005 m³, the mass 5 kg, and the mean of 100 x is 50 N/m³.
        near(force, [1.0 + 1.0, 2.0, 3.0 + 0.25 - 50.0 * factor], 1e-12);
        let (reaction, _) = resultant(&simulation, &simulation.reactions(0));
        near(reaction, force.map(|f| -f), 1e-10);
    }
}

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

/// Partners of a periodic pair have equal displacements, and the pair leaves rigid translation free: momentum is kept.
#[test]
fn periodic_pairs_move_alike_and_keep_momentum() {
    let pair = |from: &str, to: &str| Periodic {
        body: "cell".into(),
        from: Selection::region(from),
        to: Selection::region(to),
    };
    for scheme in [
        SchemeName::StormerVerlet,
        SchemeName::ImplicitMidpoint,
        SchemeName::Gauss,
        SchemeName::EnergyMomentum,
    ] {
        let mut body = Body::from_box("cell", block(CellKind::Hex8), rubber());
        body.velocity = Some(
            ["sin(2*pi*x) + 0.3", "cos(2*pi*y/0.6)", "x*(1-x) + y*(0.6-y)"]
                .map(|f| FieldComponent::Formula(f.into())),
        );
        let scene = Scene::new(Time::new(0.05, 5e-4, scheme))
            .body(body)
            .periodic(pair("x-min", "x-max"))
            .periodic(pair("y-min", "y-max"))
            .fix(Fix::region("cell", "z-min").axes(&[Axis::Z]));
        let mut simulation = Simulation::new(scene).unwrap();
        let first = simulation.observe();
        while !simulation.is_done() {
            simulation.step().unwrap();
        }
        let mesh = &simulation.bodies()[0].mesh;
        let x = simulation.positions(0);
        let u = |node: u32| [0, 1, 2].map(|k| x[node as usize][k] - mesh.points[node as usize][k]);
        for (region, step) in [("x-max", [1.0, 0.0, 0.0]), ("y-max", [0.0, 0.6, 0.0])] {
            for node in mesh.region_nodes(region).unwrap() {
                let place = mesh.points[node as usize];
                let other = mesh.nearest_node([0, 1, 2].map(|k| place[k] - step[k])).unwrap();
                near(u(node), u(other), 1e-15);
            }
        }
        let seen = simulation.observe();
        let size = (2.0 * 240.0 * first.kinetic).sqrt();
        (0..2)
            .for_each(|k| assert!((seen.momentum[k] - first.momentum[k]).abs() < 1e-9 * size, "{scheme:?}"));
        assert!((seen.total() / first.total() - 1.0).abs() < 2e-2, "{scheme:?}");
        assert!(seen.elastic > 0.01 * first.kinetic);
    }
}

/// Initial displacements and velocities given by formulas equal the values of the formulas.
#[test]
fn initial_fields_are_their_formulas() {
    let formulas = |f: [&str; 3]| Some(f.map(|f| FieldComponent::Formula(f.into())));
    let mut body = Body::from_box("block", block(CellKind::Tet10), rubber());
    body.displacement = formulas(["0.01*x*y", "0", "-0.02*z^2"]);
    body.velocity = formulas(["-3*y", "3*x", "sin(z)"]);
    let simulation =
        Simulation::new(Scene::new(Time::new(1e-4, 1e-4, SchemeName::StormerVerlet)).body(body)).unwrap();
    let rest = &simulation.bodies()[0].mesh.points;
    for ((rest, x), v) in rest.iter().zip(simulation.positions(0)).zip(simulation.velocities(0)) {
        let [a, b, c] = *rest;
        near(x, [a + 0.01 * a * b, b, c - 0.02 * c * c], 1e-15);
        near(v, [-3.0 * b, 3.0 * a, c.sin()], 1e-14);
    }
}

/// Half a plate with a mirror plane bends like the whole plate, at any rotation.
#[test]
fn a_mirror_plane_stands_for_the_other_half() {
    let plate = |length: f64, cells: u32| SheetMesh {
        size: [length, 0.3],
        cells: [cells, 4],
        pattern: SheetPattern::Cross,
        seed: 0,
        origin: [0.0; 3],
        directions: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]],
    };
    for (bending, tolerance) in [("hinge", 1e-9), ("quadratic", 1e-9), ("shell", 5e-3)] {
        let law: SheetLaw = serde_json::from_value(serde_json::json!({
            "law": "st-venant-kirchhoff", "young": 1e7, "poisson": 0.3, "density": 1000.0, "thickness": 0.004, "bending": bending
        }))
        .unwrap();
        let scene = |length: f64, cells: u32| {
            equilibrium()
                .body(Body::from_sheet("plate", plate(length, cells), law.clone()))
                .fix(Fix::region("plate", "x-min"))
                .load(load(
                    serde_json::json!({ "kind": "body-force", "body": "plate", "force": [0.0, 0.0, 1.0] }),
                ))
        };
        let whole = run(scene(1.0, 12).fix(Fix::region("plate", "x-max")));
        let half = run(scene(0.5, 6).fix(Fix::region("plate", "x-max").axes(&[Axis::X]).symmetry()));
        let middle = |simulation: &Simulation| {
            let node = simulation.bodies()[0].mesh.nearest_node([0.5, 0.15, 0.0]).unwrap();
            simulation.positions(0)[node as usize]
        };
        let (a, b) = (middle(&whole), middle(&half));
        assert!(a[2] > 1e-4, "{bending}: {a:?}");
        near(b, a, tolerance * a[2]);
        let free = run(scene(0.5, 6).fix(Fix::region("plate", "x-max").axes(&[Axis::X])));
        // Supported edges rotate freely. Without the mirror plane the middle also rotates freely, and membrane stress
        // alone carries the load on the half.
        let further = middle(&free)[2] / a[2] - 1.0;
        assert!(further > 1.0, "{bending}: {further}");
    }
}

/// A membrane that is flat at rest has no transverse stiffness there: its tangent is singular, or regular by round-off
/// alone. It carries a load f per volume by its tension as a cable does, w³ = 3 f L⁴/(64 E) in the middle.
#[test]
fn a_slack_membrane_carries_its_load_by_tension() {
    let (length, young) = (0.5_f64, 1e7);
    let law: SheetLaw = serde_json::from_value(serde_json::json!({
        "law": "st-venant-kirchhoff", "young": young, "poisson": 0.0, "density": 1000.0, "thickness": 0.004, "bending": "none"
    }))
    .unwrap();
    let expected = (3.0 * length.powi(4) / (64.0 * young)).cbrt();
    for ripple in [0.0, 1e-13, 1e-9] {
        let mesh = SheetMesh {
            size: [length, 0.1],
            cells: [40, 2],
            pattern: SheetPattern::Cross,
            seed: 0,
            origin: [0.0; 3],
            directions: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]],
        };
        let mut mesh = mesh.build().unwrap();
        for (n, p) in mesh.points.iter_mut().enumerate() {
            p[2] = ripple * (n as f64 * 1.7).sin();
        }
        let scene = equilibrium()
            .body(Body::from_arrays("strip", mesh, law.clone()))
            .fix(Fix::region("strip", "x-min"))
            .fix(Fix::region("strip", "x-max"))
            .load(load(
                serde_json::json!({ "kind": "body-force", "body": "strip", "force": [0.0, 0.0, 1.0] }),
            ));
        let simulation = run(scene);
        let node = simulation.bodies()[0].mesh.nearest_node([0.5 * length, 0.05, 0.0]).unwrap();
        let found = simulation.positions(0)[node as usize][2];
        assert!((found / expected - 1.0).abs() < 0.01, "{ripple:e}: {found}, expected {expected}");
    }
}

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
