//! Tells that equilibria under loads without a potential are not judged: their stability is not that of a symmetric stiffness.

use vi_core::System;
use vi_solvers::circulatory;

use super::Simulation;
use crate::scene::{Problem, Scene};

/// Returns the problem of a scene whose statics shall leave unstable paths of a system whose stability is not judged.
pub(super) fn problem_of_push(scene: &Scene, system: &System) -> Option<Problem> {
    scene.statics.as_ref()?.push?;
    let name = circulatory(system)?;
    let message = format!(
        "'{name}' has no potential, so that a symmetric stiffness does not tell where a path becomes unstable: leave out `push`, \
         or follow the motion by a scheme in [time]"
    );
    Some(Problem::new("static.push", message))
}

impl Simulation {
    /// Adds a note on the first load without a potential in statics.
    pub(super) fn tell_of_circulation(&mut self) {
        if self.scene.statics.is_none() {
            return;
        }
        let mut moving = self.components.iter().filter(|component| component.stepper.is_some());
        let Some(name) = moving.find_map(|component| circulatory(&component.system)) else { return };
        self.notes.push(format!(
            "'{name}' has no potential: equilibria under it are found, but not whether they are stable, and no bifurcation is \
             reported; a body may diverge or flutter, which only a run in time shows"
        ));
    }
}
