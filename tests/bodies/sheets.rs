//! Tests sheets in scenes: conserved quantities, refused input, written files.

use crate::program::Program;
use variational::prelude::*;

fn cloth() -> SheetLaw {
    let text = r#"{ "law": "st-venant-kirchhoff", "young": 1e5, "poisson": 0.3, "area_density": 0.2,
                    "thickness": 1e-3 }"#;
    serde_json::from_str(text).unwrap()
}

fn square() -> SheetMesh {
    serde_json::from_str(r#"{ "size": [1.0, 1.0], "cells": [6, 6], "pattern": "cross" }"#).unwrap()
}

fn exact() -> Solver {
    Solver { tolerance: 1e-14, ..Solver::default() }
}

/// A free, spinning, struck sheet keeps its linear and angular momentum to 1e-12 of the sums of absolute values, for
/// every law, every bending model, and every scheme that promises to conserve them.
#[test]
fn a_free_sheet_keeps_its_momenta() {
    let shape: SheetMesh =
        serde_json::from_str(r#"{ "size": [1.0, 0.8], "cells": [3, 2], "pattern": "random" }"#).unwrap();
    let keeps_momenta =
        |name: &SchemeName| name.method().is_some_and(|method| method.facts().conserves.angular_momentum);
    let schemes: Vec<SchemeName> = SchemeName::ALL.into_iter().filter(keeps_momenta).collect();
    for law in SheetLaw::examples() {
        for bending in [&[Bending::None], Bending::ALL].concat() {
            let law = law.clone().with_bending(bending);
            for &scheme in &schemes {
                let what = format!("{}, {}, {scheme:?}", law.name(), bending.name());
                let body = Body::from_sheet("cloth", shape.clone(), law.clone())
                    .velocity([1.0, 0.5, -0.3])
                    .angular_velocity([0.5, 1.0, 2.0]);
                let scene = Scene::new(Time::new(0.02, 1e-3, scheme))
                    .body(body)
                    .strike(Strike {
                        body: "cloth".into(),
                        on: Selection::region("x-max"),
                        impulse: [0.0, 2.0, 6.0],
                    })
                    .solver(exact());
                let mut simulation = Simulation::new(scene).unwrap();
                let first = simulation.observe();
                while !simulation.is_done() {
                    simulation.step().unwrap_or_else(|error| panic!("{what}: {error}"));
                }
                let last = simulation.observe();
                // By Cauchy's inequality this bounds Σ m |v| for a mass of 8 kg.
                let scale = (2.0 * first.kinetic * 8.0).sqrt();
                for k in 0..3 {
                    let linear = (last.momentum[k] - first.momentum[k]).abs();
                    let angular = (last.angular_momentum[k] - first.angular_momentum[k]).abs();
                    assert!(linear < 1e-12 * scale, "{what}: linear {k}: {linear:e}");
                    assert!(angular < 1e-12 * scale, "{what}: angular {k}: {angular:e}");
                }
                let moved = (last.elastic - first.elastic).abs();
                assert!(moved > 1e-4 * first.kinetic, "{what}: nothing was deformed, {moved:e}");
            }
        }
    }
}

/// In rigid flight faster than sound the round-off of the elastic energy is not a deformation: energy–momentum must not
/// correct it along a direction that is round-off too.
#[test]
fn a_sheet_in_rigid_flight_is_left_alone() {
    let law = r#"{ "law": "neo-hookean", "young": 6e8, "poisson": 0.4, "density": 56.0, "thickness": 0.02,
                   "bending": "quadratic" }"#;
    let law: SheetLaw = serde_json::from_str(law).unwrap();
    let shape: SheetMesh = serde_json::from_str(r#"{ "size": [1.3, 0.9], "cells": [2, 1] }"#).unwrap();
    let body = Body::from_sheet("cloth", shape, law).velocity([17029.0, 47056.0, -1865.0]);
    let scene = Scene::new(Time::new(6e-4, 3e-5, SchemeName::EnergyMomentum))
        .body(body)
        .solver(Solver { tolerance: 1e-4, ..Solver::default() });
    let mut simulation = Simulation::new(scene).unwrap();
    let first = simulation.observe();
    while !simulation.is_done() {
        simulation.step().unwrap();
    }
    let last = simulation.observe();
    assert_eq!(simulation.substeps().substeps, 0);
    for k in 0..3 {
        let drift = last.momentum[k] - first.momentum[k];
        assert!(drift.abs() <= 1e-13 * first.momentum[1].abs(), "{drift:e} of {:e}", first.momentum[k]);
    }
}

/// A sheet that swings down from horizontal keeps its energy to 1e-3 of the potential energy exchanged: Störmer–Verlet
/// has a bounded energy error of second order.
#[test]
fn a_hanging_sheet_keeps_its_energy() {
    let scene = Scene::new(Time::new(0.5, 2.5e-4, SchemeName::StormerVerlet))
        .gravity([0.0, 0.0, -9.81])
        .body(Body::from_sheet("cloth", square(), cloth()))
        .fix(Fix::region("cloth", "x-min"));
    let mut simulation = Simulation::new(scene).unwrap();
    let first = simulation.observe();
    let (mut drift, mut exchange): (f64, f64) = (0.0, 0.0);
    while !simulation.is_done() {
        simulation.step().unwrap();
        let seen = simulation.observe();
        drift = drift.max((seen.total() - first.total()).abs());
        exchange = exchange.max((seen.gravity - first.gravity).abs());
    }
    assert!(exchange > 0.1, "it fell: {exchange} J");
    assert!(drift < 1e-3 * exchange, "{drift:e} of {exchange:e} J");
}

/// A strip that is clamped at one end is stiffer against its weight than one that is hinged there.
#[test]
fn a_clamp_holds_the_normal() {
    let deflection = |fix: Fix| {
        let scene = Scene::new(Time::new(0.05, 5e-4, SchemeName::StormerVerlet))
            .gravity([0.0, 0.0, -9.81])
            .body(Body::from_sheet("strip", square(), cloth()))
            .fix(fix)
            .probe(Probe::at("end", "strip", [1.0, 0.0, 0.0]));
        let mut simulation = Simulation::new(scene).unwrap();
        while !simulation.is_done() {
            simulation.step().unwrap();
        }
        simulation.observe().elastic
    };
    let (hinged, clamped) =
        (deflection(Fix::region("strip", "x-min")), deflection(Fix::region("strip", "x-min").rotation()));
    assert!(clamped > hinged, "{clamped:e} {hinged:e}");
}

#[test]
fn the_matter_of_a_solid_is_refused_for_a_sheet_and_the_reverse() {
    let solid = Law::StVenantKirchhoff(Isotropic { young: 1e6, poisson: 0.3, density: 1000.0 });
    let block: BoxMesh =
        serde_json::from_str(r#"{ "size": [1.0, 1.0, 1.0], "cells": [1, 1, 1], "element": "hex8" }"#)
            .unwrap();
    let time = Time::new(1.0, 0.1, SchemeName::StormerVerlet);
    for (body, words) in [
        (Body::from_sheet("b", square(), solid), "missing key `thickness`"),
        (Body::from_box("b", block, cloth()), "a box is a solid, which has no `thickness`"),
    ] {
        let problems = Scene::new(time.clone()).body(body).problems();
        assert_eq!(problems.len(), 1, "{problems:?}");
        assert!(problems[0].key == "body[0].material" && problems[0].message.contains(words), "{problems:?}");
    }
}

const SCENE: &str = r#"
gravity = [0.0, 0.0, -9.81]
[time]
end = 0.02
step = 0.001
scheme = "stormer-verlet"
[[body]]
name = "flag"
sheet = { size = [1.0, 0.5], cells = [4, 2] }
material = { law = "neo-hookean", young = 1e5, poisson = 0.3, area_density = 0.2, thickness = 1e-3 }
[[fix]]
body = "flag"
region = "x-min"
[output]
interval = 0.01
"#;

/// The frames consist of triangles, and a scene can start from a frame as its mesh.
#[test]
fn a_run_writes_frames_that_are_read_back() {
    let program = Program::run(SCENE);
    let mut frames: Vec<_> = walk(&program.out());
    frames.retain(|path| path.extension().is_some_and(|extension| extension == "vtu"));
    frames.sort();
    assert_eq!(frames.len(), 3);
    let frame = variational::io::read_mesh(&frames[2]).unwrap();
    assert_eq!((frame.mesh.points.len(), frame.mesh.cell_count()), (15, 16));
    assert!(frame.point_array("displacement").unwrap().values.iter().any(|u| *u < -1e-4));
    let shape = "sheet = { size = [1.0, 0.5], cells = [4, 2] }";
    let again = SCENE
        .replace(shape, &format!("mesh = {:?}", frames[2]))
        .replace("region = \"x-min\"", "box = { min = [-1e-9, 0.0, 0.0], max = [1e-9, 1.0, 0.0] }");
    assert_eq!(Program::check(&again).code(), Some(0));
    let program = Program::check(&again.replace(", thickness = 1e-3", "").replace("area_density", "density"));
    assert!(program.errors().contains("needs the key `thickness`"), "{}", program.errors());
}

fn walk(directory: &std::path::Path) -> Vec<std::path::PathBuf> {
    let mut files = Vec::new();
    for entry in std::fs::read_dir(directory).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() { files.extend(walk(&path)) } else { files.push(path) }
    }
    files
}

#[test]
fn a_forgotten_thickness_is_asked_for() {
    let program = Program::check(&SCENE.replace(", thickness = 1e-3", ""));
    assert_eq!(program.code(), Some(2));
    assert!(program.errors().contains("missing key `thickness`"), "{}", program.errors());
}

/// Drag in still air takes energy from a falling sheet, and the ledger books it as work of forces.
#[test]
fn air_slows_a_falling_sheet() {
    let fall = |wind: Option<Wind>| {
        let mut scene = Scene::new(Time::new(0.3, 1e-3, SchemeName::ImplicitMidpoint))
            .gravity([0.0, 0.0, -9.81])
            .body(Body::from_sheet("cloth", square(), cloth()));
        scene.wind = wind;
        let mut simulation = Simulation::new(scene).unwrap();
        while !simulation.is_done() {
            simulation.step().unwrap();
        }
        simulation.observe().momentum[2]
    };
    let wind: Wind = serde_json::from_str("{}").unwrap();
    let (free, slowed) = (fall(None), fall(Some(wind)));
    assert!((free + 0.2 * 9.81 * 0.3).abs() < 1e-9, "{free}");
    // For a sheet that stays flat m v̇ = m g − ½ ρ C A v² gives v = v∞ tanh(g t / v∞) with v∞² = 2 m g / (ρ C A).
    let limit = (2.0 * 0.2 * 9.81 / (1.2 * 1.28_f64)).sqrt();
    let expected = -0.2 * limit * (9.81 * 0.3 / limit).tanh();
    assert!((slowed / expected - 1.0).abs() < 1e-2, "{slowed} {expected}");
}
