//! Drifts that do more than q += a h M⁻¹p: they project onto the manifold of constraints, or resolve collisions with
//! live terms that act by discrete gradients.

use vi_core::{StepEnergy, System};

use crate::error::SolverError;
use crate::schemes::kick_drift::KickDrift;
use crate::schemes::kick_drift::collisions::Collisions;
use crate::schemes::stepper::Stepper;

impl KickDrift {
    /// Drifts from time t by `drift` (s) and resolves collisions; returns as [`KickDrift::kick_drift`].
    pub(super) fn drift_past(
        &mut self,
        system: &System,
        t: f64,
        drift: f64,
        energy: &mut StepEnergy,
    ) -> Result<f64, SolverError> {
        let stored = self.stored_energy();
        let Some(collisions) = &mut self.collisions else { return Ok(0.0) };
        match collisions.drift((&mut self.q, &mut self.p), t, drift, self.ledger)? {
            None => Ok(self.kick_drift(system, t, 0.0, drift, energy)),
            Some(drifted) => {
                self.evaluator.work += drifted.work;
                let done = drifted.energy;
                energy.prescribed += done.prescribed;
                energy.residual += done.residual;
                energy.friction += done.friction;
                energy.contact_damping += done.contact_damping;
                if self.collisions.as_ref().is_some_and(Collisions::is_exact) {
                    // The terms exchange exactly their change of energy, and the kicks do not evaluate them: nothing
                    // remains to be booked.
                    return Ok(0.0);
                }
                let stored = self.stored_energy() - stored;
                Ok(drifted.kinetic + stored - done.work() - done.residual)
            }
        }
    }

    /// Projects q onto the constraint manifold (SHAKE) after a drift to time t, with the directions of the
    /// multipliers from its start. Returns the change of kinetic energy less the work of prescribed motion.
    pub(super) fn project_positions(
        &mut self,
        system: &System,
        t: f64,
        drift: f64,
        energy: &mut StepEnergy,
    ) -> Result<f64, SolverError> {
        let Some(manifold) = &mut self.manifold else { return Ok(0.0) };
        self.impulses.clear();
        self.impulses.resize(manifold.multiplier_count(), 0.0);
        let (q, p) = (&mut self.q, &mut self.p);
        let mut change = manifold.project_positions(system, q, p, t, drift, &mut self.impulses)?;
        let done = manifold.impulse_work(&self.impulses);
        energy.prescribed += done;
        change -= done;
        if self.nonconservative.is_some() {
            // The next evaluation depends on velocity, so make the velocity tangent to the manifold.
            let [projected, done] = manifold.project_momenta(system, q, p, t)?;
            energy.prescribed += done;
            change += projected - done;
        }
        Ok(change)
    }
}
