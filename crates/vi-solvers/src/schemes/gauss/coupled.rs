//! The linear equations of all stages with one K: (M + h² QᵀTQ K) Δ = r in the rotated stages. One sweep through the
//! triangular splitting M + h² L K, whose blocks all are A = M + h²θK, solves them approximately. GMRES solves them accurately, with
//! the sweeps as preconditioner.
//!
//! With W = (QᵀTQ − L)/θ (s × s) the system is (M + h² L K) Δ + W (A − M) Δ = r. Every vector v is followed by A v, which a sweep yields. So
//! products with K are not needed, and norms are those of energies.

use vi_core::System;

use crate::assemble::evaluator::Evaluator;
use crate::assemble::inertia::Inertia;
use crate::error::SolverError;
use crate::linear::gmres;
use crate::newton::inverse::Inverse;
use crate::schemes::gauss::collocation::{Collocation, combine};
use crate::vectors;

/// Relative error of an accurate solution. With .1, bars and blocks whose steps are long compared to their fast periods take
/// 1.1 to 1.9 times as many factors and up to half as many iterations more; with .01, up to a tenth more solves.
pub(super) const FORCING: f64 = 0.03;
/// Largest number of sweeps after the first one. Five stages take about 20.
const MOST_SWEEPS: usize = 40;

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
    /// Returns the solution Δ for the right side r, followed by AΔ.
    pub(super) fn solve(&mut self, r: &[f64]) -> Result<Vec<f64>, SolverError> {
        let first = self.sweep(r.to_vec())?;
        let length = r.len();
        let energy = |a: &[f64], b: &[f64]| vectors::dot(&a[..length], &b[length..]);
        let size = energy(&first, &first);
        if size.is_nan() || size <= 0.0 {
            return Ok(first);
        }
        // Take roots of energies in a unit that is a power of two, so that the solution does not depend on units.
        let per_unit = vectors::per_unit(size);
        let energy = |a: &[f64], b: &[f64]| per_unit * energy(a, b);
        let (mut delta, _) = gmres::solve(|v| self.product(v), energy, &first, FORCING, MOST_SWEEPS)?;
        // A last sweep solves for the motions without forces exactly, so that every iterate keeps the linear momentum.
        let image = self.product(&delta)?;
        vectors::update(&mut delta, |k, value| *value += first[k] - image[k]);
        Ok(delta)
    }

    /// Returns v + (M + h² L K)⁻¹ W (A − M) v.
    fn product(&mut self, v: &[f64]) -> Result<Vec<f64>, SolverError> {
        let (values, loads) = v.split_at(v.len() / 2);
        let mut stiff = loads.to_vec();
        for (value, stiff) in values.chunks_exact(self.n).zip(stiff.chunks_exact_mut(self.n)) {
            let inertial = self.inertia.momentum(self.system, value, self.scratch);
            vectors::update(stiff, |k, stiff| *stiff -= inertial.at(k));
        }
        let mut omitted = vec![0.0; stiff.len()];
        for (row, omitted) in self.coefficients.omitted.iter().zip(omitted.chunks_exact_mut(self.n)) {
            vectors::fill(omitted, |k| combine(row, &stiff, self.n, k));
        }
        let mut image = self.sweep(omitted)?;
        vectors::update(&mut image, |k, value| *value += v[k]);
        Ok(image)
    }

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
