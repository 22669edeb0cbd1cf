//! Tests periodic pairs, mirror planes, initial fields, and membranes without stiffness across them.

use variational::prelude::*;

use super::{block, equilibrium, load, near, rubber, run};

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
