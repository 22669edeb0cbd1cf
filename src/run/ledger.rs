//! Observes the energy ledger: work and dissipation step by step, and the remaining drift.

use serde_json::json;
use vi_core::{EnergyLedger, StepEnergy};

use super::error::RunError;
use super::observer::{Observer, Purpose, Sight};
use super::report::Report;
use crate::record::Bytes;
use crate::simulation::{Observation, Simulation};

/// Records the energy of a run.
pub(crate) struct LedgerKeeper {
    pub(crate) account: EnergyLedger,
    /// Energy below which round-off dominates, J.
    resolution: f64,
}

/// A drift below this multiple of the round-off of the energies counts as none.
const ROUND_OFF: f64 = 8.0;
/// The kinetic energy of a vibration whose amplitude is a thousand round-offs of positions, relative to the energy that forces of one
/// round-off exchange over the size of the body (1e-16 of its stiffness times its squared extent). Less is no motion.
const STILL: f64 = 5e-10;

impl LedgerKeeper {
    /// Opens at the first observation. Forces have round-off with which bodies at rest exchange up to the energy `resolution` (J).
    pub(crate) fn new(first: &Observation, resolution: f64) -> Self {
        Self { account: EnergyLedger::new(first.total(), first.kinetic), resolution }
    }

    /// Returns whether the drift is round-off of the energies, so that its ratio to the kinetic energy has no meaning.
    fn is_round_off(&self, simulation: &Simulation) -> bool {
        let EnergyLedger { drift, kinetic_max, initial, current, .. } = self.account;
        let of_sums = f64::EPSILON * initial.abs().max(current.abs());
        let is_still = || kinetic_max <= STILL * self.resolution;
        drift <= ROUND_OFF * of_sums
            || drift <= self.resolution && (is_still() || drift <= ROUND_OFF * simulation.energy_round_off())
    }
}

impl Observer for LedgerKeeper {
    fn name(&self) -> &'static str {
        "ledger"
    }

    fn see(&mut self, sight: &Sight<'_>) -> Result<(), RunError> {
        match sight {
            Sight::Steps(stepped) => self.account.parts += stepped.energy,
            Sight::Row(row) => self.account.enter(StepEnergy::default(), row.seen.total(), row.seen.kinetic),
            _ => {}
        }
        Ok(())
    }

    fn snapshot(&self, _: Purpose) -> Bytes {
        Bytes::of(&self.account)
    }

    fn restore(&mut self, snapshot: &Bytes) -> Result<(), RunError> {
        self.account = snapshot.value()?;
        Ok(())
    }

    fn report(&self, simulation: &Simulation, report: &mut Report) {
        let (energy, parts) = (&self.account, &self.account.parts);
        report.energy_drift =
            if self.is_round_off(simulation) { 0.0 } else { energy.drift / energy.kinetic_max };
        report.energy = json!({
            "initial": energy.initial, "final": energy.current,
            "prescribed_work": parts.prescribed, "force_work": parts.force, "damping_work": parts.damping,
        });
        if simulation.scene().contact.is_some() {
            report.energy["friction_work"] = parts.friction.into();
            report.energy["contact_damping_work"] = parts.contact_damping.into();
        }
        // In statics nothing moves, and the work of loads is not drift.
        if simulation.scene().statics.is_none() {
            report.energy["drift"] = energy.drift.into();
            report.energy["largest_kinetic"] = energy.kinetic_max.into();
            report.energy["relative_drift"] = report.energy_drift.into();
        }
        if simulation.has_ledger() {
            report.energy["scheme_error"] = parts.scheme.into();
            report.energy["residual_work"] = parts.residual.into();
            report.energy["unexplained"] = energy.unexplained().into();
        }
        report.assert_at_most("energy_drift", simulation.scene().assert.energy_drift, report.energy_drift);
    }
}
