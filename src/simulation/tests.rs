//! Time symmetry: a symmetric scheme with equal steps returns to its start when it runs backwards.

use crate::prelude::*;

/// Returns a soft block that spins and vibrates, with hω = 10 at its highest frequency.
fn block(stages: usize, tolerance: f64, young: f64) -> Simulation {
    let shape =
        BoxMesh { size: [1.0, 0.2, 0.2], cells: [5, 1, 1], element: CellKind::Tet4, origin: [0.0; 3] };
    let law = Law::NeoHookean(Isotropic { young, poisson: 0.3, density: 1000.0 });
    let mut time = Time::new(0.4, 0.01, SchemeName::Gauss);
    time.stages = Some(stages);
    let scene = Scene::new(time)
        .solver(Solver { tolerance, ..Solver::default() })
        .body(Body::from_box("block", shape, law).angular_velocity([1.0, 6.0, 3.0]));
    Simulation::new(scene).unwrap()
}

/// Runs half of the steps forward, and the other half with reversed momenta; returns the largest distance from the
/// start, m.
fn reversal(mut simulation: Simulation) -> (f64, u64) {
    let start = simulation.components[0].state.q.clone();
    for _ in 0..simulation.step_count() / 2 {
        simulation.step().unwrap();
    }
    simulation.components[0].state.p.iter_mut().for_each(|p| *p = -*p);
    while !simulation.is_done() {
        simulation.step().unwrap();
    }
    let end = &simulation.components[0].state.q;
    let off = start.iter().zip(end).fold(0.0_f64, |off, (a, b)| off.max((a - b).abs()));
    (off, simulation.substeps().steps)
}

/// No step of a smooth motion is cut, at any tolerance. With equations solved to round-off, the scheme returns to its
/// start to round-off.
#[test]
fn gauss_runs_back_to_its_start() {
    for (stages, young) in [(2, 1e5), (2, 1e6), (3, 1e5), (3, 1e6)] {
        for tolerance in [1e-6, 1e-10, 1e-14] {
            let (off, cut) = reversal(block(stages, tolerance, young));
            assert_eq!(cut, 0, "{stages} stages, E = {young:e} Pa, tolerance {tolerance:e}");
            if tolerance == 1e-14 {
                assert!(off < 1e-11, "{stages} stages, E = {young:e} Pa: off by {off:e} m");
            }
        }
    }
}
