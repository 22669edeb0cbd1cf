//! Fields of contact at nodes: traction, pressure, gap and slip. This file does not change the state.

use nalgebra::Vector3;

use super::Simulation;
use super::contact::{ContactAt, Press};
use crate::model::RigidModel;
use crate::scene::Field;

impl Simulation {
    /// Returns a contact field at the nodes of all bodies, then at the surface points of rigid bodies.
    pub(crate) fn contact_values(&self, field: Field) -> Vec<f64> {
        let bodies = (0..self.bodies.len()).flat_map(|body| self.contact_values_of(body, field));
        // A half-space has no surface in frames, though a rotating one has nodes that carry its normal.
        let is_shown = |rigid: &RigidModel| rigid.form.as_ref().is_some_and(|form| !form.points.is_empty());
        let shown = self.rigids.iter().enumerate().filter(|(_, rigid)| is_shown(rigid));
        let rigids = shown.flat_map(|(number, rigid)| {
            if rigid.radius > 0.0 {
                return self.contact_values_of_round(number, field);
            }
            let nodes = rigid.surface_nodes().collect::<Vec<_>>();
            self.contact_values_at((self.bodies.len() + number, rigid.component), &nodes, field)
        });
        bodies.chain(rigids).collect()
    }

    /// Returns a contact field at the surface points of a ball or a capsule. Each force on its skeleton is moved to
    /// the nearest of these points.
    fn contact_values_of_round(&self, number: usize, field: Field) -> Vec<f64> {
        let rigid = &self.rigids[number];
        let Some(form) = &rigid.form else { return Vec::new() };
        let (points, triangles) = (&form.points, &form.triangles);
        let places = self.carried(number, points);
        let component = &self.components[rigid.component];
        let layer = self.widest_layer(self.bodies.len() + number);
        let Some(watch) = &component.contact else {
            return of_field(field, points.iter().map(|_| ContactAt::away(layer)));
        };
        let (x, v) = (component.system.positions(&component.state), component.velocities());
        let mut all = vec![ContactAt::away(layer); points.len()];
        for Press { place, force, gap, slip } in watch.presses(&x, &v, &rigid.surface_nodes()) {
            let square = |k: usize| (0..3).map(|axis| (places[k][axis] - place[axis]).powi(2)).sum::<f64>();
            let nearest = (1..places.len()).fold(0, |a, b| if square(b) < square(a) { b } else { a });
            let at = &mut all[nearest];
            (0..3).for_each(|axis| at.traction[axis] += force[axis]);
            if gap < at.gap {
                (at.gap, at.slip) = (gap, slip);
            }
        }
        let mut areas = vec![0.0; points.len()];
        for triangle in triangles {
            let [a, b, c] = triangle.map(|k| Vector3::from(points[k as usize]));
            let area = (b - a).cross(&(c - a)).norm() / 6.0;
            triangle.iter().for_each(|&k| areas[k as usize] += area);
        }
        for (at, area) in all.iter_mut().zip(&areas) {
            at.traction.iter_mut().for_each(|value| *value /= area);
            at.pressure = at.traction.iter().map(|value| value * value).sum::<f64>().sqrt();
        }
        of_field(field, all.into_iter())
    }

    /// Returns a contact field at the nodes of body number `body`.
    pub(super) fn contact_values_of(&self, number: usize, field: Field) -> Vec<f64> {
        let body = &self.bodies[number];
        let nodes: Vec<usize> = (0..body.mesh.points.len()).map(|node| body.node(node)).collect();
        self.contact_values_at((number, body.component), &nodes, field)
    }

    /// Returns a contact field at nodes of a body, given its number in the scene and its component.
    fn contact_values_at(
        &self,
        (number, component): (usize, usize),
        nodes: &[usize],
        field: Field,
    ) -> Vec<f64> {
        let (component, layer) = (&self.components[component], self.widest_layer(number));
        let Some(watch) = &component.contact else {
            return of_field(field, nodes.iter().map(|_| ContactAt::away(layer)));
        };
        let all = watch.fields(&component.system.positions(&component.state), &component.velocities());
        // The gap of a pair that presses is less than its layer.
        of_field(field, nodes.iter().map(|&node| ContactAt { gap: all[node].gap.min(layer), ..all[node] }))
    }

    /// Returns the widest layer d̂ of the pairs that a body forms, m; of all pairs of the scene if it forms none.
    fn widest_layer(&self, number: usize) -> f64 {
        let watches = || self.components.iter().filter_map(|component| component.contact.as_ref());
        let own = watches().filter_map(|watch| watch.widest_layer(Some(number))).reduce(f64::max);
        own.or_else(|| watches().filter_map(|watch| watch.widest_layer(None)).reduce(f64::max)).unwrap_or(0.0)
    }
}

/// Returns the values of a field.
fn of_field(field: Field, values: impl Iterator<Item = ContactAt>) -> Vec<f64> {
    match field {
        Field::ContactTraction => values.flat_map(|at| at.traction).collect(),
        Field::ContactPressure => values.map(|at| at.pressure).collect(),
        Field::Slip => values.flat_map(|at| at.slip).collect(),
        _ => values.map(|at| at.gap).collect(),
    }
}
