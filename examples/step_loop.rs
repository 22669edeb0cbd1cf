//! Steps a scene in its own loop: it watches a body fall, and reverses its velocity half-way.

use variational::prelude::*;

fn main() {
    let law = Law::NeoHookean(Isotropic { young: 1e5, poisson: 0.3, density: 1000.0 });
    let shape = BoxMesh { size: [0.2; 3], cells: [2; 3], element: CellKind::Tet4, origin: [0.0; 3] };
    let scene = Scene::new(Time::new(0.4, 1e-3, SchemeName::ImplicitMidpoint))
        .gravity([0.0, -9.81, 0.0])
        .body(Body::from_box("cube", shape, law));
    let mut simulation = Simulation::new(scene).expect("a valid scene");
    let start = simulation.positions(0);
    let mut given = 0.0;
    while !simulation.is_done() {
        given += simulation.step().expect("a step").energy.force;
        if simulation.steps() == simulation.step_count() / 2 {
            let (x, mut v) = (simulation.positions(0), simulation.velocities(0));
            v.iter_mut().for_each(|v| *v = v.map(|v| -v));
            simulation.set_motion(0, &x, &v).expect("as many nodes as the body has");
        }
    }
    // The body rises for as long as it fell: it returns to its start, without any gain of energy.
    let end = simulation.positions(0);
    let gap = start.iter().zip(&end).map(|(a, b)| (a[1] - b[1]).abs()).fold(0.0, f64::max);
    println!("{gap:.1e} m from where it began");
    assert!(gap < 1e-6 && given.abs() < 1e-9);
}
