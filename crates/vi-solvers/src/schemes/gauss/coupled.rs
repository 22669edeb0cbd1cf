//! The linear equations of all stages with one K: (M + h² QᵀTQ K) Δ = r in the rotated stages. One sweep through the
//! triangular splitting M + h² L K, whose blocks all are A = M + h²θK, solves them approximately.

use vi_core::System;

use crate::assemble::evaluator::Evaluator;
use crate::assemble::inertia::Inertia;
use crate::error::SolverError;
use crate::newton::inverse::Inverse;
use crate::schemes::gauss::collocation::Collocation;
use crate::vectors;

/// The linear equations of stages of `n` coordinates each.
pub(super) struct CoupledStages<'a> {
    pub(super) system: &'a System,
    pub(super) inertia: &'a Inertia,
    pub(super) coefficients: &'a Collocation,
    pub(super) inverse: &'a mut Inverse,
    pub(super) evaluator: &'a mut Evaluator,
    pub(super) scratch: &'a mut Vec<f64>,
    pub(super) n: usize,
}

impl CoupledStages<'_> {
    /// Returns Δ = (M + h² L K)⁻¹ r, followed by AΔ: with ρ_i = r_i − Σ_{j<i} (L_ij/θ)(ρ_j − M Δ_j), A Δ_i = ρ_i.
    pub(super) fn sweep(&mut self, mut r: Vec<f64>) -> Result<Vec<f64>, SolverError> {
        let (n, length) = (self.n, r.len());
        let mut delta = vec![0.0; length];
        for i in 0..self.coefficients.stages() {
            let (done, rest) = delta.split_at_mut(i * n);
            let (rho, rest_of_r) = r.split_at_mut(i * n);
            let (delta, current) = (&mut rest[..n], &mut rest_of_r[..n]);
            for (j, l) in self.coefficients.l[i].iter().enumerate() {
                let coupling = l / self.coefficients.theta;
                let (rho, done) = (&rho[j * n..][..n], &done[j * n..][..n]);
                let inertial = self.inertia.momentum(self.system, done, self.scratch);
                vectors::update(current, |k, r| *r -= coupling * (rho[k] - inertial.at(k)));
            }
            delta.copy_from_slice(current);
            self.inverse.apply(self.evaluator, delta)?;
        }
        delta.append(&mut r);
        Ok(delta)
    }
}
