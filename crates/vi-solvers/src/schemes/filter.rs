//! Makes the filter of a system's mass: the links of its strain energies at rest, and the highest eigenvalue of M⁻¹L by
//! Lanczos' method.

use vi_core::{MassFilter, Padded, System};

use crate::assemble::links::links;
use crate::error::SolverError;
use crate::schemes::stability::{Lanczos, noise, per_unit};
use crate::vectors;

/// Relative error of the highest eigenvalue. The estimate is at most this much too high.
const ACCURACY: f64 = 0.01;

/// Returns the filter of the lumped mass of `system`, whose strain energies are at rest at positions `x` of all
/// coordinates, m. It depends on nothing else, so that a run that continues has the same one.
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
    let highest = highest_eigenvalue(system, &filter);
    Ok(filter.with_highest(highest))
}

/// Returns the highest eigenvalue of M⁻¹L, 1/s², by Lanczos' method in the inner product of M.
fn highest_eigenvalue(system: &System, filter: &MassFilter) -> f64 {
    let (free, mass, unit) = (system.coordinates().free(), system.free_mass(), per_unit(system));
    let (n, count) = (free.len(), system.mass().len());
    if n == 0 || filter.entries() == 0 {
        return 0.0;
    }
    let product = |a: &[f64], b: &[f64]| vectors::sum(n, |k| (mass[k] * unit) * (a[k] * b[k]));
    let mut current: Vec<f64> = (0..n as u64).map(noise).collect();
    let (mut previous, mut next) = (vec![0.0; n], vec![0.0; n]);
    let [mut spread, mut image] = [(); 2].map(|()| vec![Padded::default(); count / 3]);
    let size = product(&current, &current).sqrt();
    vectors::update(&mut current, |_, value| *value /= size);
    let mut iteration = Lanczos::new(n);
    loop {
        for (&dof, value) in free.iter().zip(&current) {
            spread[dof as usize / 3].0[dof as usize % 3] = *value;
        }
        filter.laplacian(0, &spread, &mut image);
        vectors::fill(&mut next, |k| image[free[k] as usize / 3].0[free[k] as usize % 3]);
        let (alpha, beta) = (product(&next, &current), iteration.beta);
        vectors::update(&mut next, |k, next| *next -= alpha * current[k] + beta * previous[k]);
        let beta = product(&next, &next).sqrt();
        if beta > 0.0 {
            vectors::update(&mut next, |_, value| *value /= beta);
        }
        if let Some(found) = iteration.enter(alpha, beta, ACCURACY) {
            return found.omega * found.omega;
        }
        std::mem::swap(&mut previous, &mut current);
        std::mem::swap(&mut current, &mut next);
    }
}
