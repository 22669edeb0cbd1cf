//! Notes that the stability of equilibria under loads without a potential is not judged: the symmetric part of the
//! stiffness does not determine it.

use vi_solvers::circulatory;

use super::Simulation;

impl Simulation {
    /// Adds a note on the first load without a potential in statics.
    pub(super) fn note_circulation(&mut self) {
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
