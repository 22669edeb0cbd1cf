//! Theory of the meshes of a scene: the formal order of a quantity, and whether elements lock.

use vi_fem::LockingCure;
use vi_mesh::CellKind;

use crate::scene::Substance;
use crate::simulation::Simulation;

/// λ/μ above which linear elements lock volumetrically: ν = 0.455.
const LOCKING: f64 = 10.0;

/// Returns the formal order in space of a quantity: degree + 1 for displacements, twice the degree for energies and
/// frequencies.
pub(super) fn order_in_space(simulation: &Simulation, quantity: &str) -> f64 {
    let kinds = simulation.bodies().iter().flat_map(|body| body.mesh.blocks.iter().map(|block| block.kind));
    let mut kinds = kinds.filter(|kind| kind.dimension() > 1);
    let degree = if kinds.any(CellKind::is_linear) { 1.0 } else { 2.0 };
    let is_displacement = [".ux", ".uy", ".uz"].iter().any(|axis| quantity.ends_with(axis));
    if is_displacement { degree + 1.0 } else { 2.0 * degree }
}

/// Returns the names of the bodies with locking elements: nearly incompressible linear solids without a cure.
pub(super) fn locking_bodies(simulation: &Simulation) -> Vec<String> {
    let scene = simulation.scene();
    let is_stiff = |substance: &Substance| match substance {
        Substance::Solid(law) => {
            let (lambda, mu) = law.parameters().lame();
            lambda > LOCKING * mu
        }
        Substance::Sheet(_) => false,
    };
    let bodies = scene.bodies.iter().zip(simulation.bodies());
    let locks = bodies.filter(|(said, body)| {
        said.locking == LockingCure::None
            && said.material.0.iter().any(|entry| is_stiff(&entry.law))
            && body.mesh.blocks.iter().any(|block| block.kind.dimension() == 3 && block.kind.is_linear())
    });
    locks.map(|(said, _)| said.name.clone()).collect()
}
