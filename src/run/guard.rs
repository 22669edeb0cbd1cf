//! The energy guard: has a run more energy than anything has put into it?
//!
//! Growth is H − H₀ − W, total energy beyond its start and the work W of loads, prescribed motion and
//! damping. It is judged by the exchange, the largest energy that motion and deformation were given:
//! max over time of H₀ + W⁺ − V_weight − V_load, with the work W⁺ of loads and prescribed motion.

use serde::Serialize;
use serde_json::{Value, json};
use vi_core::EnergyLedger;

use super::error::RunError;
use super::observer::{Observer, Purpose, Sight};
use super::report::Report;
use crate::record::{Bytes, record};
use crate::scene::{Guard, GuardAction};
use crate::simulation::{Observation, Simulation};

/// Round-off of an energy, relative to the largest part of it.
const NOISE: f64 = 1e-11;

/// An intervention of the guard.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct GuardEvent {
    /// The step after which energy was found to have grown.
    pub step: u64,
    /// Time of the intervention, s.
    pub t: f64,
    /// Growth, J.
    pub joules: f64,
    /// Growth relative to the exchange.
    pub relative: f64,
    /// Action taken, and the time from which it holds.
    pub action: String,
}

record!(GuardEvent { step: u64, t: f64, joules: f64, relative: f64, action: String });

/// Growth that was seen.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct Growth {
    /// Now, J.
    pub(crate) now: f64,
    /// The largest, J.
    largest: f64,
    /// The exchange, J.
    pub(crate) exchange: f64,
    /// Growth that the guard has come to terms with when it acted, J.
    accepted: f64,
}

record!(Growth { now: f64, largest: f64, exchange: f64, accepted: f64 });

/// Observations and interventions of the guard.
struct Watched {
    growth: Growth,
    /// `None` where the events are those that the guard holds: they are told even if the run goes back.
    events: Option<Vec<GuardEvent>>,
}

record!(Watched { growth: Growth, events: Option<Vec<GuardEvent>> });

/// Watches the energy of a run.
pub(crate) struct EnergyGuard {
    pub(crate) rule: Guard,
    pub(crate) growth: Growth,
    events: Vec<GuardEvent>,
    /// Energy below which round-off rules, J.
    resolution: f64,
    /// Steps before it judges: a body that starts from rest has exchanged next to nothing at first, and the
    /// energy of a scheme of order 1 is off by 1/n of that in step n.
    grace: u64,
    /// Steps between its looks.
    stride: u64,
}

impl EnergyGuard {
    /// For a scheme of this order, from the first observation on, every `stride` steps where it is to act;
    /// `resolution` is the energy below which round-off rules, J.
    pub(crate) fn new(rule: Guard, stride: u64, order: usize, first: &Observation, resolution: f64) -> Self {
        let grace = if order < 2 { (4.0 / rule.bound).ceil() as u64 } else { 2 };
        let exchange = (first.kinetic + first.elastic).max(resolution);
        let growth = Growth { exchange, ..Growth::default() };
        Self { rule, growth, events: Vec::new(), resolution, grace, stride }
    }

    /// Must it look after this step, so that it can act?
    pub(crate) fn is_due(&self, step: u64) -> bool {
        self.rule.acts() && step.is_multiple_of(self.stride)
    }

    /// Enters an observation and the account of the run until then.
    fn enter(&mut self, seen: &Observation, ledger: &EnergyLedger) {
        let parts = &ledger.parts;
        let given = ledger.initial + parts.prescribed + parts.force - seen.gravity - seen.load;
        let growth = &mut self.growth;
        growth.exchange = growth.exchange.max(given);
        let scale = [seen.kinetic, seen.elastic, seen.gravity, seen.load, ledger.initial, parts.force]
            .into_iter()
            .chain([parts.prescribed, parts.damping])
            .fold(0.0, |scale: f64, part| scale.max(part.abs()));
        growth.now = seen.total() - ledger.initial - parts.work() - NOISE * scale - self.resolution;
        growth.largest = growth.largest.max(growth.now);
    }

    /// Is growth now, after `steps` steps, beyond the bound?
    pub(crate) fn is_exceeded(&self, steps: u64) -> bool {
        let Growth { now, exchange, accepted, .. } = self.growth;
        steps > self.grace && now > accepted + self.rule.bound * exchange
    }

    /// Notes what was done about the growth that was `seen` after `step` (at t, s). The run has gone back to
    /// a good point, and further growth counts from there.
    pub(crate) fn act(&mut self, step: u64, t: f64, action: String, seen: Growth) {
        let event = GuardEvent { step, t, joules: seen.now, relative: seen.now / seen.exchange, action };
        self.events.push(event);
        self.growth.accepted = self.growth.accepted.max(self.growth.now);
    }

    /// The largest growth over the exchange; zero where there was none.
    pub(crate) fn relative(&self) -> f64 {
        let Growth { largest, exchange, .. } = self.growth;
        if largest > 0.0 { largest / exchange } else { 0.0 }
    }

    /// Returns a warning if energy exceeded the bound although the run went on.
    pub(crate) fn warning(&self) -> Option<String> {
        let relative = self.relative();
        if self.rule.action == GuardAction::Off || relative <= self.rule.bound {
            return None;
        }
        let Growth { largest, exchange, .. } = self.growth;
        Some(format!(
            "energy was gained that nothing put in: {largest:.3e} J, {relative:.1e} of the {exchange:.3e} J that \
             motion and deformation were given; take a smaller step, or let [guard] act on it"
        ))
    }

    /// For report.json.
    fn account(&self) -> Value {
        json!({
            "action": self.rule.action, "bound": self.rule.bound, "growth": self.growth.largest,
            "exchange": self.growth.exchange, "relative_growth": self.relative(),
            "resolution": self.resolution, "exceeded": self.warning().is_some(), "events": self.events,
        })
    }
}

impl Observer for EnergyGuard {
    fn name(&self) -> &'static str {
        "energy guard"
    }

    fn see(&mut self, sight: &Sight<'_>) -> Result<(), RunError> {
        if let Sight::Energies(seen, account) = sight {
            self.enter(seen, account);
        }
        Ok(())
    }

    fn snapshot(&self, purpose: Purpose) -> Bytes {
        let events = (purpose == Purpose::Resume).then(|| self.events.clone());
        Bytes::of(&Watched { growth: self.growth, events })
    }

    fn restore(&mut self, snapshot: &Bytes) -> Result<(), RunError> {
        let Watched { growth, events } = snapshot.value()?;
        self.growth = growth;
        self.events = events.unwrap_or_else(|| std::mem::take(&mut self.events));
        Ok(())
    }

    fn report(&self, _: &Simulation, report: &mut Report) {
        report.guard = self.account();
        report.warning = self.warning();
        report.notes.extend(self.warning());
    }
}
