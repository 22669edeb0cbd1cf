//! Fields of contact at nodes: traction, pressure and gap. It must not change a state.

use super::{Component, Simulation};
use crate::scene::Field;

impl Simulation {
    /// A field of contact at the nodes of all bodies, then at the points of the surfaces of rigid bodies.
    pub(crate) fn contact_values(&self, field: Field) -> Vec<f64> {
        let bodies = (0..self.bodies.len()).flat_map(|body| self.contact_values_of(body, field));
        let rigids = self.rigids.iter().flat_map(|rigid| {
            let nodes = rigid.surface_nodes().collect::<Vec<_>>();
            self.contact_values_at(rigid.component, &nodes, field)
        });
        bodies.chain(rigids).collect()
    }

    /// A field of contact at the nodes of body number `body`.
    pub(super) fn contact_values_of(&self, body: usize, field: Field) -> Vec<f64> {
        let body = &self.bodies[body];
        let nodes: Vec<usize> = (0..body.mesh.points.len()).map(|node| body.node(node)).collect();
        self.contact_values_at(body.component, &nodes, field)
    }

    fn contact_values_at(&self, component: usize, nodes: &[usize], field: Field) -> Vec<f64> {
        let Component { system, state, contact, .. } = &self.components[component];
        let Some(watch) = contact else { return vec![0.0; nodes.len() * field.component_count()] };
        let (tractions, gaps) = watch.fields(&system.positions(state));
        let length = |v: [f64; 3]| v.iter().map(|v| v * v).sum::<f64>().sqrt();
        match field {
            Field::ContactTraction => nodes.iter().flat_map(|&node| tractions[node]).collect(),
            Field::ContactPressure => nodes.iter().map(|&node| length(tractions[node])).collect(),
            _ => nodes.iter().map(|&node| gaps[node]).collect(),
        }
    }
}
