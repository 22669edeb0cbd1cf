//! Makes the filter of a system's mass: the links of its strain energies at rest, and the highest eigenvalue of M⁻¹L by
//! Lanczos' method.

use vi_core::{MassFilter, Padded, System};

use crate::assemble::links::links;
use crate::error::SolverError;
use crate::schemes::lanczos::{self, SymmetricOperator};
use crate::unit_of_mass::per_unit_of_mass;
use crate::vectors;

/// Returns the filter of the lumped mass of `system`, whose strain energies are at rest at positions `x` of all
/// coordinates, m. The filter depends on nothing else, so that a continued run has the same one.
///
/// # Errors
/// Returns [`SolverError::NotFinite`] if a strain energy has no finite Hessian at `x`.
pub fn mass_filter(system: &System, x: &[f64]) -> Result<MassFilter, SolverError> {
    let links = links(system.terms(), x);
    if let Some(link) = links.iter().find(|link| !link.weight.is_finite()) {
        let dof = 3 * link.nodes[0] as usize;
        return Err(SolverError::NotFinite { what: "the Hessian at rest", dof, at_start: true });
    }
    let filter = MassFilter::new(system.coordinates(), &system.mass(), &links);
    let highest = highest_eigenvalue(system, &filter)?;
    Ok(filter.with_highest(highest))
}

/// Returns the highest eigenvalue of M⁻¹L, 1/s². The motion depends on this number. It is therefore computed to
/// round-off, so that it does not depend on the orientation of the body or on the numbering of its nodes.
fn highest_eigenvalue(system: &System, filter: &MassFilter) -> Result<f64, SolverError> {
    let n = system.coordinates().free_count();
    if n == 0 || filter.entries() == 0 {
        return Ok(0.0);
    }
    let [spread, image] = [(); 2].map(|()| vec![Padded::default(); system.mass().len() / 3]);
    let mut laplacian =
        Laplacian { system, filter, unit: per_unit_of_mass(system.free_mass()), spread, image };
    Ok(lanczos::largest_eigenvalue(&mut laplacian, n)?.max(0.0))
}

/// The operator M⁻¹L on the free coordinates, which is symmetric in the inner product of M.
struct Laplacian<'a> {
    system: &'a System,
    filter: &'a MassFilter,
    /// The inverse of the unit in which the inner product measures masses.
    unit: f64,
    /// A vector and its product with M⁻¹L at all nodes.
    spread: Vec<Padded>,
    image: Vec<Padded>,
}

impl SymmetricOperator for Laplacian<'_> {
    fn apply(&mut self, v: &[f64], out: &mut [f64]) -> Result<(), SolverError> {
        let Self { system, filter, spread, image, .. } = self;
        let free = system.coordinates().free();
        for (&dof, value) in free.iter().zip(v) {
            spread[dof as usize / 3].0[dof as usize % 3] = *value;
        }
        filter.laplacian(0, spread, image);
        vectors::fill(out, |k| image[free[k] as usize / 3].0[free[k] as usize % 3]);
        Ok(())
    }

    fn product(&self, a: &[f64], v: &[f64]) -> f64 {
        let mass = self.system.free_mass();
        vectors::sum(a.len(), |k| (mass[k] * self.unit) * (a[k] * v[k]))
    }

    fn normalize(&mut self, v: &mut [f64]) -> f64 {
        let norm = self.product(v, v).sqrt();
        if norm > 0.0 {
            vectors::update(v, |_, value| *value /= norm);
        }
        norm
    }
}
