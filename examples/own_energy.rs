//! Adds a user-defined energy to a body of a scene: a soft floor that pushes nodes back up. Its derivatives are
//! computed automatically.

use variational::core::lagrange::Scalar;
use variational::core::{Derived, LocalEnergy};
use variational::prelude::*;
use variational::simulation::AddedTerm;

/// The energy V = k/2 z² for each node below z = 0.
struct SoftFloor {
    stiffness: f64,
}

impl LocalEnergy<3> for SoftFloor {
    fn value<D: Scalar>(&self, _stencil: usize, x: &[D; 3]) -> D {
        if x[2].re() < 0.0 { x[2] * x[2] * (0.5 * self.stiffness) } else { x[2] * 0.0 }
    }
}

fn main() {
    let rubber = Law::NeoHookean(Isotropic { young: 1e5, poisson: 0.3, density: 1000.0 });
    let shape = BoxMesh { size: [0.2; 3], cells: [2; 3], element: CellKind::Tet4, origin: [0.0, 0.0, 0.1] };
    let scene = Scene::new(Time::new(0.6, 2e-4, SchemeName::StormerVerlet))
        .gravity([0.0, 0.0, -9.81])
        .body(Body::from_box("cube", shape, rubber));
    let mut simulation = Simulation::with_terms(scene, |bodies| {
        let cube = &bodies[0];
        let nodes = (0..cube.mesh.points.len()).map(|node| cube.node(node) as u32).collect();
        vec![AddedTerm::potential(cube, Derived::new("floor", nodes, SoftFloor { stiffness: 5e3 }))]
    })
    .expect("a valid scene");
    let before = simulation.observe().total();
    let mut lowest = f64::INFINITY;
    while !simulation.is_done() {
        simulation.step().expect("a stable step");
        let z = simulation.positions(0).into_iter().map(|x| x[2]).fold(f64::INFINITY, f64::min);
        lowest = lowest.min(z);
    }
    let drift = (simulation.observe().total() / before - 1.0).abs();
    println!("lowest point {lowest:.4} m, energy drift {drift:.1e}");
    assert!(lowest < 0.0 && lowest > -0.05);
    assert!(drift < 1e-2);
}
