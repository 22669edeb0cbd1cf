//! Iterates that stay on the manifold g(q₁) = 0, so that the potential Φ of the stage is a merit: along the manifold, the
//! solution minimises it. The stage is the end of the step, where N = G₁. With Z = A⁻¹N₀ᵀ of the first iterate and
//! P = I − Z (G₁Z)⁻¹G₁, the projection onto the tangent space along Z, a correction is
//! ```text
//! δ = P A⁻¹ Pᵀ r,   r = −c ∇Φ,   so that −∇Φ·δ = (Pᵀr)·A⁻¹(Pᵀr)/c ≥ 0:
//! ```
//! Φ descends along δ, although Z is not computed anew where N turns. At the first iterate δ is Newton's correction of the
//! equations with multipliers; Pᵀr = 0 is the solution. What lies beside the manifold returns to it along Z, in the metric of A,
//! so that what is attached to a rigid body moves with it. Neither takes a further solve with A.

use nalgebra::{DMatrix, DVector};
use vi_core::System;

use super::Multipliers;
use crate::assemble::evaluator::Evaluator;
use crate::error::SolverError;
use crate::newton::inverse::Inverse;
use crate::schemes::constraint::cluster::is_met;
use crate::schemes::constraint::units::{Factored, Units};

/// Number of iterations after which a return to the manifold fails: the correction was too long. A pendulum that is moved sideways by .84
/// of its length takes 5, by .99 of it 7; from beyond its length there is no way back.
const MOST_RETURNS: u32 = 20;

impl Multipliers {
    /// If `is_kept`, keeps further iterates on the manifold; otherwise stops doing so.
    pub(crate) fn keep(&mut self, is_kept: bool) {
        self.is_kept = is_kept;
        self.failure = None;
    }

    /// Forgets that an iterate did not reach the manifold, because the stage goes elsewhere.
    pub(crate) fn forget_failure(&mut self) {
        self.failure = None;
    }

    /// Returns whether iterates are kept on the manifold.
    pub(crate) fn is_kept(&self) -> bool {
        self.is_kept
    }

    /// Returns why the last iterate did not reach the manifold.
    pub(crate) fn failure(&self) -> Option<&SolverError> {
        self.failure.as_ref()
    }

    /// Moves the start w of an iteration onto the manifold along M⁻¹Nᵀ of the beginning (q₀, t₀) of the step.
    pub(crate) fn place_start(
        &mut self,
        system: &System,
        c: f64,
        beginning: (&[f64], f64),
        end: impl Fn(usize, f64) -> f64,
        w: &mut [f64],
    ) {
        // The impulses of the projection are no forces of the constraints.
        let forces = self.forces.clone();
        self.manifold.set_directions(system, beginning.0, beginning.1);
        self.failure = self.project_end(system, c, end, w, self.end_t).err();
        self.forces = forces;
    }

    /// Moves w onto the manifold along Z.
    pub(crate) fn return_to_manifold(
        &mut self,
        system: &System,
        c: f64,
        end: impl Fn(usize, f64) -> f64,
        w: &mut [f64],
    ) {
        (self.failure, self.factored) = (None, None);
        let mut last = f64::INFINITY;
        for _ in 0..MOST_RETURNS {
            self.q_end.iter_mut().enumerate().for_each(|(k, q)| *q = end(k, w[k]));
            (self.defect, self.rows) = self.manifold.linearize(system, &self.q_end, self.end_t);
            let worst = self.manifold.worst();
            if is_met(worst, last) {
                return;
            }
            let Some(step) = self.factor(c).solve(&self.defect).filter(|_| worst.is_finite()) else { break };
            self.move_along(c, &step, w);
            last = worst;
        }
        self.failure = Some(self.manifold.not_met(MOST_RETURNS));
    }

    /// Computes the load Pᵀr from the residual r, and takes the multipliers that balance the rest of it.
    pub(crate) fn balance(
        &mut self,
        c: f64,
        inverse: &mut Inverse,
        evaluator: &mut Evaluator,
        residual: &[f64],
    ) -> Result<&[f64], SolverError> {
        let n = residual.len();
        self.refresh(inverse, evaluator, n)?;
        self.load.copy_from_slice(residual);
        let along = |column: &[f64]| column.iter().zip(residual).map(|(z, r)| z * r).sum::<f64>();
        let rhs = DVector::from_iterator(self.forces.len(), self.z.chunks_exact(n).map(along));
        let matrix = self.rates(c).transpose();
        // Where N has turned by a right angle, Z spans no complement: the residual is taken whole, and the merit decides.
        if let Some(change) = self.factor_of(matrix).solve(&rhs) {
            self.manifold.add_force(change.as_slice(), -c, &mut self.load);
            self.forces.iter_mut().zip(&change).for_each(|(force, change)| *force += change);
        }
        Ok(&self.load)
    }

    /// Returns s c G₁ Z, with G₁ of the last evaluation.
    pub(super) fn rates(&self, c: f64) -> DMatrix<f64> {
        let (m, n, s) = (self.forces.len(), self.load.len(), self.end_per_stage);
        let along = |i: usize, z: &[f64]| self.rows[i].iter().map(|&(k, g)| g * z[k as usize]).sum::<f64>();
        DMatrix::from_fn(m, m, |i, j| s * c * along(i, &self.z[j * n..(j + 1) * n]))
    }

    /// Factors s c G₁ Z.
    pub(super) fn factor(&self, c: f64) -> Factored {
        self.factor_of(self.rates(c))
    }

    fn factor_of(&self, matrix: DMatrix<f64>) -> Factored {
        Units::of(&matrix.diagonal().map(f64::abs)).factor(matrix, self.manifold.is_redundant())
    }

    /// Computes v ← v − c Z s.
    pub(super) fn move_along(&self, c: f64, step: &DVector<f64>, v: &mut [f64]) {
        for (change, column) in step.iter().zip(self.z.chunks_exact(v.len())) {
            for (value, z) in v.iter_mut().zip(column) {
                *value -= c * change * z;
            }
        }
    }
}
