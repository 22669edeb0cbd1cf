//! Values of probes over a part of a body: sums, means and extremes of fields. Only the quantities of the probes are
//! computed.

use vi_fem::{element_field, nodal_field};

use super::Simulation;
use crate::model::RegionProbe;
use crate::scene::{Component, Field, Quantity, Statistic, Substance};

impl Simulation {
    /// Returns the values of the probes over parts of bodies, in the order of their columns
    /// ([`crate::scene::Probe::columns`]).
    pub fn measures(&self) -> Vec<f64> {
        let mut values = Vec::new();
        let mut regions = self.region_probes.iter();
        for probe in self.scene.probes.iter().filter(|probe| !probe.is_node()) {
            if let Some(between) = &probe.between {
                values.extend(self.contact_force(between));
                continue;
            }
            let Some(probe) = regions.next() else { continue };
            for &(statistic, quantity) in &probe.quantities {
                let entries = self.field_over(probe, quantity.field);
                values.extend(reduced(&entries, statistic, quantity));
            }
        }
        values
    }

    /// Returns the mean contact force of the second body on the first over the last step, N; zero at the start.
    fn contact_force(&self, names: &[String; 2]) -> [f64; 3] {
        let rigids = self.rigids.iter().map(|rigid| &rigid.name);
        let all: Vec<&String> = self.bodies.iter().map(|body| &body.name).chain(rigids).collect();
        let [Some(first), Some(second)] =
            names.each_ref().map(|name| all.iter().position(|other| *other == name))
        else {
            return [0.0; 3];
        };
        let watches = self.components.iter().filter_map(|component| component.contact.as_ref());
        watches
            .map(|watch| watch.force(first, second))
            .fold([0.0; 3], |sum, force| [0, 1, 2].map(|k| sum[k] + force[k]))
    }

    /// Returns the values of a field at the nodes or elements of a probe, each with its weight in a mean.
    fn field_over(&self, probe: &RegionProbe, field: Field) -> Vec<(f64, Vec<f64>)> {
        let number = probe.body.index();
        let body = &self.bodies[number];
        let at_nodes = |values: Vec<[f64; 3]>| -> Vec<(f64, Vec<f64>)> {
            probe.nodes.iter().map(|&node| (1.0, values[node as usize].to_vec())).collect()
        };
        match field.of_elements() {
            Some((of_elements, false)) => {
                let x = self.positions(number);
                let mut all = Vec::new();
                for (part, (elements, volumes)) in body.materials.iter().zip(&probe.elements) {
                    let Substance::Solid(law) = &part.law else { continue };
                    // These cells were accepted as solid elements of this mesh when the body was built.
                    let values =
                        element_field(&body.mesh, elements, law, body.locking, x.as_flattened(), of_elements);
                    let values = values.unwrap_or_default();
                    let chunks = values.chunks_exact(of_elements.component_count());
                    all.extend(volumes.iter().copied().zip(chunks.map(<[f64]>::to_vec)));
                }
                all
            }
            Some((of_elements, true)) => {
                let x = self.positions(number);
                let parts = body.solids().collect::<Vec<_>>();
                let values = nodal_field(&body.mesh, &parts, body.locking, x.as_flattened(), of_elements);
                let (values, count) = (values.unwrap_or_default(), of_elements.component_count());
                let of_node = |node: u32| values[count * node as usize..][..count].to_vec();
                probe.nodes.iter().map(|&node| (1.0, of_node(node))).collect()
            }
            None if field.is_of_contact() => {
                let values = self.contact_values_of(number, field);
                let values: Vec<&[f64]> = values.chunks_exact(field.component_count()).collect();
                probe.nodes.iter().map(|&node| (1.0, values[node as usize].to_vec())).collect()
            }
            None => match field {
                Field::Velocity => at_nodes(self.velocities(number)),
                Field::Acceleration => at_nodes(self.accelerations(number)),
                Field::ExternalForce => at_nodes(self.external_forces(number)),
                Field::ReactionForce => at_nodes(self.reactions(number)),
                _ => {
                    let x = self.positions(number);
                    let u =
                        x.iter().zip(&body.mesh.points).map(|(x, rest)| [0, 1, 2].map(|k| x[k] - rest[k]));
                    at_nodes(u.collect())
                }
            },
        }
    }
}

/// Returns one number per column of a quantity.
fn reduced(entries: &[(f64, Vec<f64>)], statistic: Statistic, quantity: Quantity) -> Vec<f64> {
    let count = quantity.field.component_count();
    let length = |v: &[f64]| v.iter().map(|c| c * c).sum::<f64>().sqrt();
    // The magnitude of a sum or a mean is that of the vector; an extreme is the extreme of the magnitudes.
    let over = |value: &dyn Fn(&[f64]) -> f64| -> f64 {
        let values = entries.iter().map(|(weight, v)| (weight, value(v)));
        match statistic {
            Statistic::Sum => values.map(|(_, value)| value).sum(),
            Statistic::Mean => {
                let whole: f64 = entries.iter().map(|(weight, _)| weight).sum();
                values.map(|(weight, value)| weight * value).sum::<f64>() / whole
            }
            Statistic::Max => values.map(|(_, value)| value).fold(f64::NEG_INFINITY, larger),
            Statistic::Min => -values.map(|(_, value)| -value).fold(f64::NEG_INFINITY, larger),
        }
    };
    let entry = |k: usize| over(&|v: &[f64]| v[k]);
    match (quantity.component, statistic) {
        (Some(Component::Entry(k)), _) => vec![entry(k)],
        (Some(Component::Magnitude), Statistic::Sum | Statistic::Mean) => {
            vec![length(&(0..count).map(entry).collect::<Vec<_>>())]
        }
        (Some(Component::Magnitude), _) => vec![over(&|v: &[f64]| length(v))],
        (None, _) => (0..count).map(entry).collect(),
    }
}

/// Returns the larger number, or NaN if one of them is NaN.
fn larger(a: f64, b: f64) -> f64 {
    if a.is_nan() || b.is_nan() { f64::NAN } else { a.max(b) }
}
