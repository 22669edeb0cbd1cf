//! Tests the keys that act on a part of a body: total forces and moments, supports in local axes, mirror planes,
//! periodic pairs, quantities over regions, initial fields, refinement that keeps layers.

mod loads;
mod local_axes;
mod regions;
mod symmetry;

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
