//! Notes entries of a scene that have no effect on the motion, or act at another place than they name.

use std::collections::HashSet;

use vi_core::{Stencils, System};
use vi_mesh::Bounds;

use super::Simulation;
use crate::scene::{Load, Solver};

impl Simulation {
    /// Adds notes on points far from the bodies on which they name a node, on loads that act on held nodes alone, on keys of `[solver]`
    /// that explicit steps do not read, on a scheme beside `[static]`, and on damping that does not act on rigid bodies.
    pub(super) fn note_idle(&mut self) {
        let mut notes = self.far_points();
        notes.extend(self.held_loads());
        notes.extend(self.unread_solver_keys());
        if self.scene.time.scheme.is_some() && self.scene.statics.is_some() {
            let note = "time.scheme has no effect: [static] finds equilibria without a time integrator";
            notes.push(note.to_owned());
        }
        let damping = self.scene.damping.as_ref().is_some_and(|damping| damping.mass_rate != 0.0);
        if let Some(rigid) = self.scene.rigids.iter().find(|rigid| damping && !rigid.is_prescribed()) {
            notes.push(format!(
                "`damping.mass_rate` acts on bodies of elements and not on rigid bodies, such as '{}'",
                rigid.name
            ));
        }
        self.notes.extend(notes);
    }

    /// Returns a note for each point that lies outside the box of its body by more than the diagonal of the box.
    fn far_points(&self) -> Vec<String> {
        let probes = self.scene.probes.iter().enumerate();
        let probes = probes.map(|(k, probe)| (format!("probe[{k}]"), Some(probe.body.as_str()), probe.point));
        let loads = self.scene.loads.iter().enumerate().map(|(k, load)| match load {
            Load::Point { body, point, .. } => (format!("load[{k}]"), Some(body.as_str()), *point),
            _ => (String::new(), None, None),
        });
        let springs = self.scene.springs.iter().enumerate().flat_map(|(k, spring)| {
            [&spring.from, &spring.to].map(|end| (format!("spring[{k}]"), end.body.as_deref(), end.point))
        });
        let mut notes = Vec::new();
        for (key, body, point) in probes.chain(loads).chain(springs) {
            let (Some(body), Some(point)) = (body, point) else { continue };
            let Some(body) = self.bodies.iter().find(|other| other.name == body) else { continue };
            let Bounds { low, high } = Bounds::of(body.mesh.points.iter().copied());
            let outside = |k: usize| (low[k] - point[k]).max(point[k] - high[k]).max(0.0);
            let length = |part: &dyn Fn(usize) -> f64| (0..3).map(|k| part(k).powi(2)).sum::<f64>().sqrt();
            let (distance, size) = (length(&outside), length(&|k| high[k] - low[k]));
            if distance > size {
                notes.push(format!(
                    "{key}.point is {distance:.3e} m away from '{}', which is {size:.3e} m long: the nearest node is taken",
                    body.name
                ));
            }
        }
        notes
    }

    /// Returns a note for each key of `[solver]` with another value than its default that explicit steps do not read. They read both
    /// where contact acts in the drift.
    fn unread_solver_keys(&self) -> Vec<String> {
        let (facts, solver, default) = (self.method.facts(), &self.scene.solver, Solver::default());
        let has_contact = self.components.iter().any(|component| !component.system.terms().live().is_empty());
        if !facts.is_explicit || self.scene.statics.is_some() || has_contact {
            return Vec::new();
        }
        let keys = [
            ("linear", solver.linear != default.linear),
            ("tolerance", solver.tolerance != default.tolerance),
        ];
        let set = keys.into_iter().filter(|(_, is_set)| *is_set);
        set.map(|(key, _)| format!("solver.{key} has no effect: '{}' solves no equations", facts.name))
            .collect()
    }

    /// Returns a note for each load all of whose nodes are held.
    fn held_loads(&self) -> Vec<String> {
        let mut held: Vec<Option<bool>> = vec![None; self.scene.loads.len()];
        for component in &self.components {
            let system = &component.system;
            let fixed = prescribed(system);
            let terms = system.potentials().iter().filter(|term| term.elsewhere().is_none());
            let terms = terms.map(|term| (term.name(), term.stencils()));
            let forces = system.forces().iter().map(|force| (force.name(), force.stencils()));
            for (name, stencils) in terms.chain(forces) {
                let number = name.strip_prefix("load[").and_then(|rest| rest.split(']').next()?.parse().ok());
                let Some(all) = number.and_then(|number: usize| held.get_mut(number)) else { continue };
                *all = Some(all.unwrap_or(true) && is_held(&stencils, &fixed));
            }
        }
        let is_idle = |(_, held): &(usize, Option<bool>)| *held == Some(true);
        let idle = held.into_iter().enumerate().filter(is_idle);
        idle.map(|(number, _)| {
            format!("load[{number}] acts on held nodes alone: their supports take all of it")
        })
        .collect()
    }
}

/// Returns the prescribed coordinates of a system.
fn prescribed(system: &System) -> HashSet<u32> {
    system.coordinates().prescribed().iter().flat_map(|group| group.dofs.iter().copied()).collect()
}

/// Returns whether all coordinates of the nodes of some stencils are in the set.
fn is_held(stencils: &Stencils<'_>, prescribed: &HashSet<u32>) -> bool {
    let block = stencils.block as u32;
    stencils.nodes.iter().all(|&node| (block * node..block * (node + 1)).all(|dof| prescribed.contains(&dof)))
}
