//! Tests total forces and moments, and fixes that overlap.

use crate::program::Program;
use variational::prelude::*;

use super::{block, cross, equilibrium, linear, load, near, resultant, run};

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
