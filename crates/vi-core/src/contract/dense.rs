//! Energy, gradient and Hessian of a list of terms as dense arrays, computed in the simplest way: for small systems,
//! and as a reference for faster sums.

use std::sync::Arc;

use nalgebra::DMatrix;

use crate::contract::potential::{Potential, packed_len};
use crate::contract::terms::Terms;

/// Returns V(x, t), J.
pub fn energy(terms: &impl AsRef<Terms>, x: &[f64], t: f64) -> f64 {
    let mut total = 0.0;
    for potential in &all(terms, x) {
        let count = potential.stencils().count();
        let mut local = vec![0.0; count];
        potential.energies(0..count, x, t, &mut local);
        total += local.iter().sum::<f64>();
    }
    total
}

/// Returns ∂V/∂x (N), one entry per coordinate x_i, pulled back from tied nodes.
pub fn gradient(terms: &impl AsRef<Terms>, x: &[f64], t: f64) -> Vec<f64> {
    let mut total = vec![0.0; x.len()];
    for potential in &all(terms, x) {
        let count = potential.stencils().count();
        let size = potential.stencils().size();
        let mut local = vec![0.0; count * size];
        potential.gradients(0..count, x, t, &mut local);
        for (stencil, block) in local.chunks_exact(size).enumerate() {
            for (dof, value) in local_dofs(potential.as_ref(), stencil).zip(block) {
                total[dof] += value;
            }
        }
    }
    terms.as_ref().coordinates().pull_back(&mut total);
    total
}

/// Returns ∂²V/∂x² (N/m), a full symmetric matrix over all coordinates x_i, pulled back from tied nodes.
pub fn hessian(terms: &impl AsRef<Terms>, x: &[f64], t: f64) -> DMatrix<f64> {
    let mut total = DMatrix::zeros(x.len(), x.len());
    for potential in &all(terms, x) {
        let count = potential.stencils().count();
        let size = potential.stencils().size();
        let mut local = vec![0.0; count * packed_len(size)];
        potential.hessians(0..count, x, t, &mut local);
        for (stencil, block) in local.chunks_exact(packed_len(size)).enumerate() {
            let dofs: Vec<usize> = local_dofs(potential.as_ref(), stencil).collect();
            for i in 0..size {
                for j in 0..=i {
                    let value = block[packed_len(i) + j];
                    total[(dofs[i], dofs[j])] += value;
                    if i != j {
                        total[(dofs[j], dofs[i])] += value;
                    }
                }
            }
        }
    }
    if !terms.as_ref().coordinates().is_plain() {
        // SᵀKS: pull back the columns, then the rows.
        for _ in 0..2 {
            for mut column in total.column_iter_mut() {
                let mut pulled = column.iter().copied().collect::<Vec<f64>>();
                terms.as_ref().coordinates().pull_back(&mut pulled);
                column.copy_from_slice(&pulled);
            }
            total.transpose_mut();
        }
    }
    total
}

/// Returns the fixed terms, and the live ones evaluated near `x`.
fn all(terms: &impl AsRef<Terms>, x: &[f64]) -> Vec<Arc<dyn Potential>> {
    let terms = terms.as_ref();
    let live = terms.live().iter().map(|term| term.near(x, term.reach()));
    terms.fixed().iter().cloned().chain(live).collect()
}

/// Returns the coordinates of one stencil in the order of its local block.
fn local_dofs(potential: &dyn Potential, stencil: usize) -> impl Iterator<Item = usize> {
    let stencils = potential.stencils();
    let block = stencils.block;
    stencils.of(stencil).iter().flat_map(move |&node| (0..block).map(move |k| node as usize * block + k))
}
