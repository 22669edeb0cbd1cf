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
            self.contact_values_at(rigid.component, &nodes, field)
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
        let Some(watch) = &component.contact else {
            return vec![0.0; points.len() * field.component_count()];
        };
        let (x, v) = (component.system.positions(&component.state), component.velocities());
        let mut all = vec![ContactAt { gap: watch.farthest_gap(), ..ContactAt::default() }; points.len()];
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
    pub(super) fn contact_values_of(&self, body: usize, field: Field) -> Vec<f64> {
        let body = &self.bodies[body];
        let nodes: Vec<usize> = (0..body.mesh.points.len()).map(|node| body.node(node)).collect();
        self.contact_values_at(body.component, &nodes, field)
    }

    fn contact_values_at(&self, component: usize, nodes: &[usize], field: Field) -> Vec<f64> {
        let component = &self.components[component];
        let Some(watch) = &component.contact else { return vec![0.0; nodes.len() * field.component_count()] };
        let all = watch.fields(&component.system.positions(&component.state), &component.velocities());
        of_field(field, nodes.iter().map(|&node| all[node]))
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
