//! Finds the bodies that move freely in a scene that has no equilibrium: no support holds them along an axis, and their
//! loads along this axis do not balance.

use vi_core::{State, System};
use vi_solvers::{SolverError, net_forces};

use super::Simulation;
use crate::model::name_of;
use crate::scene::Axis;

/// Displacement, as a fraction of the extent of the bodies, that a support resists by a force.
const TRIAL: f64 = 0.1;

/// A change of force below this fraction of the loads is round-off, and so is a load below this fraction of the forces that it sums.
const ROUND_OFF: f64 = 1e-6;

impl Simulation {
    /// Returns the error for a search of equilibria in component `number` that failed because nothing holds some of its bodies.
    /// `from` is the last equilibrium, and `load_factor` the one at which there is none.
    pub(super) fn unheld(&self, number: usize, from: &State, load_factor: f64) -> Option<SolverError> {
        let system = &self.components[number].system;
        let coordinates = system.coordinates();
        let bodies: Vec<usize> =
            (0..self.bodies.len()).filter(|&body| self.bodies[body].component == number).collect();
        let all: Vec<usize> =
            (0..coordinates.dof_count() / 3).filter(|&node| !coordinates.is_director(node as u32)).collect();
        let nodes_of = |&body: &usize| {
            let body = &self.bodies[body];
            (0..body.mesh.points.len()).map(|node| body.node(node)).collect::<Vec<usize>>()
        };
        let rigids = (0..self.rigids.len()).filter(|&rigid| self.rigids[rigid].component == number);
        let names: Vec<usize> =
            bodies.iter().copied().chain(rigids.map(|rigid| self.bodies.len() + rigid)).collect();
        let each = bodies.iter().map(|body| (nodes_of(body), vec![*body]));
        let groups = each.chain(std::iter::once((all, names)));
        let loaded = State { t: load_factor, ..from.clone() };
        let [extent, _] = coordinates.extent_and_reach(&system.positions(from));
        for (nodes, names) in groups {
            for (k, axis) in [Axis::X, Axis::Y, Axis::Z].into_iter().enumerate() {
                let mut along = vec![0.0; coordinates.dof_count()];
                nodes.iter().for_each(|node| along[3 * node + k] = 1.0);
                let mut change = vec![0.0; coordinates.free_count()];
                coordinates.coordinates_of(&along, &mut change);
                // Returns the force along the motion after a part of it, and the sum of its absolute values at the nodes, N.
                let force = |part: f64| {
                    let q = loaded.q.iter().zip(&change).map(|(q, change)| q + part * change).collect();
                    let net = net_forces(system, &State { q, ..loaded.clone() });
                    let at = coordinates.free().iter().zip(&change);
                    at.map(|(&dof, change)| net[dof as usize] * change)
                        .fold([0.0; 2], |[sum, size], force| [sum + force, size + force.abs()])
                };
                let [load, size] = force(0.0);
                let is_free = |part: f64| {
                    let moved = State {
                        q: loaded.q.iter().zip(&change).map(|(q, change)| q + part * change).collect(),
                        ..loaded.clone()
                    };
                    (force(part)[0] - load).abs() <= ROUND_OFF * load.abs() && meets_joints(system, &moved)
                };
                if load.abs() > ROUND_OFF * size && is_free(TRIAL * extent) && is_free(-TRIAL * extent) {
                    let names: Vec<String> =
                        names.iter().map(|&body| format!("'{}'", name_of(&self.scene, body))).collect();
                    let (bodies, axis) = (names.join(", "), format!("{axis:?}").to_lowercase());
                    return Some(SolverError::Unheld { load_factor, bodies, axis, load });
                }
            }
        }
        None
    }
}

/// Returns whether a state meets the constraints of a system, up to a small part of the terms that they sum.
fn meets_joints(system: &System, state: &State) -> bool {
    let x = system.positions(state);
    let size = |node: u32| x[3 * node as usize..][..3].iter().fold(0.0, |size: f64, x| size.max(x.abs()));
    system.constraints().iter().all(|joint| joint.value(&x).abs() <= ROUND_OFF * joint.magnitude(&x, size))
}
