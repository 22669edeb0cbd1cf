//! Computes the compliance of the nodes over a step: their displacement per unit force if inertia alone resists, m/N.

use std::sync::Arc;

use vi_core::System;

/// The compliance of the nodes of a system, found again only if the step changes.
#[derive(Default)]
pub(crate) struct Compliance {
    /// Compliance times mass, s².
    per_mass: f64,
    of_nodes: Arc<[f64]>,
}

impl Compliance {
    /// Returns the compliance of each node, m/N: the mean over its three coordinates, where a free coordinate of mass m
    /// has the compliance `per_mass`/m (`per_mass` in s²) and a prescribed one zero. A tied node has the compliance
    /// with which the nodes move that it is tied to.
    pub(crate) fn over_step(&mut self, system: &System, per_mass: f64) -> Arc<[f64]> {
        if self.per_mass != per_mass {
            *self = Self { per_mass, of_nodes: of_nodes(system, per_mass) };
        }
        Arc::clone(&self.of_nodes)
    }
}

fn of_nodes(system: &System, per_mass: f64) -> Arc<[f64]> {
    let coordinates = system.coordinates();
    let mut own = vec![0.0; coordinates.dof_count() / 3];
    for (dof, mass) in coordinates.free().iter().zip(system.free_mass()) {
        own[*dof as usize / 3] += per_mass / (3.0 * mass);
    }
    let of = |node: usize| match coordinates.combination(node as u32) {
        Some(terms) => terms.iter().map(|&(k, weight)| weight * weight * own[k as usize]).sum(),
        None => own[node],
    };
    (0..own.len()).map(of).collect()
}
