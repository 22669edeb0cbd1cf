//! Makes the consistent mass of a system's bodies for analyses that need it, even if the motion uses the lumped mass.

use vi_core::Potential;
use vi_fem::{FemError, Sheet, consistent_mass};

use super::body::{BodyModel, MaterialPart};
use crate::scene::Substance;

/// Returns the kinetic energy of system number `component` as potentials of the velocities.
///
/// # Errors
/// Returns an error if an element has no consistent mass.
pub(crate) fn kinetic_terms(
    bodies: &[BodyModel],
    component: usize,
) -> Result<Vec<Box<dyn Potential>>, FemError> {
    let mut terms: Vec<Box<dyn Potential>> = Vec::new();
    for body in bodies.iter().filter(|body| body.component == component) {
        let mesh = body.numbering.mesh(&body.mesh);
        for MaterialPart { law, elements, .. } in
            body.materials.iter().filter(|part| !part.elements.is_empty())
        {
            match law {
                Substance::Solid(law) => {
                    let density = law.density();
                    terms.extend(consistent_mass(&mesh, elements, density, body.node_offset, &body.name)?);
                }
                Substance::Sheet(law) => {
                    let pattern = body.pattern.as_deref();
                    let sheet = Sheet::new(&mesh, elements, law, body.node_offset, &body.name);
                    terms.push(Sheet { pattern, ..sheet }.consistent_mass()?);
                }
            }
        }
    }
    Ok(terms)
}
