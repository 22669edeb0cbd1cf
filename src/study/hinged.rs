//! Notes sheets whose bending model does not converge to a plate, in studies that compare numbers with those of a
//! plate.

use vi_fem::Bending;

use crate::scene::{Scene, Substance};

/// Returns a note for each sheet whose bending does not converge to that of a plate.
pub(super) fn hinge_notes(scene: &Scene) -> Vec<String> {
    let is_hinged = |substance: &Substance| match substance {
        Substance::Sheet(law) => law.parameters().common().bending == Bending::Hinge,
        Substance::Solid(_) => false,
    };
    let bodies = scene.bodies.iter();
    let hinged = bodies.filter(|body| body.material.0.iter().any(|entry| is_hinged(&entry.law)));
    let note = |name: &str| {
        format!(
            "sheet '{name}' has bending = \"hinge\", whose bending stiffness depends on the directions of the edges: finer meshes \
             converge, but not to a plate or shell; bending = \"shell\" does"
        )
    };
    hinged.map(|body| note(&body.name)).collect()
}
