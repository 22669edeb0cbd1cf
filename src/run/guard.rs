//! The energy guard detects growth of energy that no work accounts for.
//!
//! Growth is H − H₀ − W: the total energy beyond its start and the work W of loads, prescribed motion and damping.
//! Damping can only remove energy. Therefore work of damping above its least value so far is growth too. It is judged
//! relative to the exchange, the largest energy that motion and deformation were given: max over time of H₀ + W⁺ −
//! V_weight − V_load, with the work W⁺ of loads and prescribed motion.

use serde::Serialize;
use serde_json::{Value, json};
use vi_core::EnergyLedger;

use super::error::RunError;
use super::observer::{Observer, Purpose, Sight};
use super::report::Report;
use crate::record::{Bytes, record};
use crate::scene::{Guard, GuardAction};
use crate::simulation::{Observation, Simulation, Stepped};

/// Relative round-off of an energy.
const NOISE: f64 = 1e-11;

/// An action of the guard.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct GuardEvent {
    /// The step after which the growth was found, or the last one before a step that failed.
    pub step: u64,
    /// Time of the action, s.
    pub t: f64,
    /// Growth, J.
    pub joules: f64,
    /// Growth relative to the exchange.
    pub relative: f64,
    /// Why a step failed, if that is the reason for the action; the growth is then that of the last observation before it.
    pub failure: Option<String>,
    /// The action, and the time from which it holds.
    pub action: String,
}

record!(GuardEvent { step: u64, t: f64, joules: f64, relative: f64, failure: Option<String>, action: String });

/// Growth of energy.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct Growth {
    /// Current growth, J.
    pub(crate) now: f64,
    /// Largest growth, J.
    largest: f64,
    /// The exchange, J.
    pub(crate) exchange: f64,
    /// Growth that is accepted because the run cannot go back to before it, J.
    accepted: f64,
    /// Least work of damping so far, J.
    damped: f64,
}

record!(Growth { now: f64, largest: f64, exchange: f64, accepted: f64, damped: f64 });

/// Snapshot of the guard.
struct Watched {
    growth: Growth,
    /// `None` in a snapshot to go back to, because events are reported even if the run goes back.
    events: Option<Vec<GuardEvent>>,
}

record!(Watched { growth: Growth, events: Option<Vec<GuardEvent>> });

/// Kinetic energy relative to the exchange above which a guard that watches the motion observes. A body that falls from rest is
/// observed some thirty times, because its exchange grows.
const SUSPICIOUS: f64 = 1.1;
/// Number of steps between states that a guard can go back to.
pub(super) const STRIDE: u64 = 16;
/// Part of the bound that the growth of a state to go back to may take. The rest is left for what follows, so that the bound holds for the
/// whole run, however often the guard acts.
const KEPT_BELOW: f64 = 0.5;

/// When and how a guard acts.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Watching {
    pub(crate) rule: Guard,
    /// Whether the scene states the bound, which is then kept from the third step on.
    pub(crate) is_stated: bool,
    /// Steps between observations, or between looks at the kinetic energy, if it may act.
    pub(crate) stride: u64,
    /// Relative growth of which it warns.
    pub(crate) warns_above: f64,
    /// Whether it examines the kinetic energy first, and observes only if that is suspicious.
    pub(crate) watches_motion: bool,
    /// The longest step that is advised, s: safely below the stability limit at the start; infinite if there is none.
    pub(crate) longest_advised: f64,
}

/// Monitors the energy of a run.
pub(crate) struct EnergyGuard {
    watching: Watching,
    pub(crate) growth: Growth,
    events: Vec<GuardEvent>,
    /// Energy below which round-off dominates, J.
    resolution: f64,
    /// Order of the scheme.
    order: usize,
}

impl EnergyGuard {
    /// Makes the guard of a scheme of order `order` at the first observation. Below the energy `resolution` (J)
    /// round-off dominates.
    pub(crate) fn new(watching: Watching, order: usize, first: &Observation, resolution: f64) -> Self {
        let exchange = (first.kinetic + first.elastic).max(resolution);
        let growth = Growth { exchange, ..Growth::default() };
        Self { watching, growth, events: Vec::new(), resolution, order }
    }

    /// Returns when and how the guard acts.
    pub(crate) fn rule(&self) -> &Guard {
        &self.watching.rule
    }

    /// Returns whether the guard looks at the state after this step in order to act.
    pub(crate) fn is_due(&self, step: u64) -> bool {
        self.watching.rule.acts() && step.is_multiple_of(self.watching.stride)
    }

    /// Returns whether the guard must observe after a step at which it is due, given the `kinetic` energy (J).
    ///
    /// Kinetic energy that exceeds what was exchanged until the last observation is suspicious. It costs far less than an observation,
    /// and grows with all energy if a step is unstable.
    pub(crate) fn suspects(&self, kinetic: impl FnOnce() -> f64) -> bool {
        if !self.watching.watches_motion {
            return true;
        }
        let kinetic = kinetic();
        kinetic.is_nan() || kinetic > SUSPICIOUS * self.growth.exchange
    }

    /// Returns whether the guard must observe after this step because it was divided: then energy may grow by many
    /// times the exchange within a few steps, which are the most expensive ones.
    pub(crate) fn doubts(&self, stepped: &Stepped) -> bool {
        self.watching.rule.acts() && stepped.substeps > 0
    }

    /// Returns whether a state to go back to is kept after this step.
    pub(crate) fn keeps(&self, step: u64) -> bool {
        step.is_multiple_of(self.watching.stride.max(STRIDE)) && self.growth.now <= self.kept_below()
    }

    /// Returns the growth beyond which no state is kept, J.
    fn kept_below(&self) -> f64 {
        KEPT_BELOW * self.watching.rule.bound * self.growth.exchange
    }

    /// Records an observation and the energy ledger up to it.
    fn enter(&mut self, seen: &Observation, ledger: &EnergyLedger) {
        let parts = &ledger.parts;
        let given = ledger.initial + parts.prescribed + parts.force - seen.gravity - seen.load;
        let growth = &mut self.growth;
        growth.exchange = growth.exchange.max(given);
        let scale = [seen.kinetic, seen.elastic, seen.gravity, seen.load, ledger.initial, parts.force]
            .into_iter()
            .chain([parts.prescribed, parts.damping])
            .fold(0.0, |scale: f64, part| scale.max(part.abs()));
        growth.damped = growth.damped.min(parts.damping);
        let brought = parts.damping - growth.damped;
        growth.now = seen.total() - ledger.initial - parts.work() + brought - NOISE * scale - self.resolution;
        growth.largest = growth.largest.max(growth.now);
    }

    /// Returns whether the current growth, after `steps` steps, exceeds the bound.
    pub(crate) fn is_exceeded(&self, steps: u64) -> bool {
        let Growth { now, exchange, accepted, .. } = self.growth;
        self.allowed(steps).is_some_and(|allowed| now > accepted + allowed * exchange)
    }

    /// Returns the growth relative to the exchange that is allowed after n steps; `None` if it is not judged yet.
    ///
    /// The exchange of a body that starts from rest grows as t² at first, but the error of its energy is of the order
    /// h^p from the first step on. Relative to the exchange, the error is about 1/n^p after n steps of a scheme of
    /// order p. Unstable steps multiply the energy by a factor each, so they soon exceed this allowance too. If the
    /// scene states the bound, schemes of order 2 and higher get no allowance.
    fn allowed(&self, steps: u64) -> Option<f64> {
        let bound = self.watching.rule.bound;
        let is_kept = self.watching.is_stated && self.order > 1;
        let error = if is_kept { 0.0 } else { 4.0 / (steps as f64).powi(self.order.max(1) as i32) };
        (steps > 2).then_some(bound.max(error))
    }

    /// Records the action against the growth that was `seen` after `step` (at t, s), or against the `failure` of the step after it. The
    /// run has gone back to a good state before. The growth at that state counts towards the bound, except for the part above
    /// `kept_below`, which is accepted: a run that continues from a checkpoint cannot go back further.
    pub(crate) fn act(
        &mut self,
        (step, t): (u64, f64),
        action: String,
        failure: Option<String>,
        seen: Growth,
    ) {
        let (joules, relative) = (seen.now, seen.now / seen.exchange);
        let event = GuardEvent { step, t, joules, relative, failure, action };
        self.events.push(event);
        self.growth.accepted = self.growth.accepted.max(self.growth.now - self.kept_below());
    }

    /// Returns the largest growth relative to the exchange; zero if there was none.
    pub(crate) fn relative(&self) -> f64 {
        let Growth { largest, exchange, .. } = self.growth;
        if largest > 0.0 { largest / exchange } else { 0.0 }
    }

    /// Returns a warning if growth exceeded the bound and the run was not ended.
    pub(crate) fn warning(&self) -> Option<String> {
        let remedy = match self.events.is_empty() {
            true => "use a smaller step, or let [guard] act on it",
            false => "use a smaller step than the guard did",
        };
        self.has_grown().then(|| format!("the energy grew without a source by {}; {remedy}", self.gain()))
    }

    /// Returns whether growth exceeded the bound and the run was not ended.
    fn has_grown(&self) -> bool {
        self.watching.rule.action != GuardAction::Off && self.relative() > self.watching.warns_above
    }

    /// Describes the largest growth.
    fn gain(&self) -> String {
        let (Growth { largest, exchange, .. }, relative) = (self.growth, self.relative());
        format!(
            "{largest:.3e} J, {relative:.1e} of the {exchange:.3e} J that motion and deformation received"
        )
    }

    /// Returns the events that growth caused, and those that failed steps caused.
    fn causes(&self) -> [Vec<&GuardEvent>; 2] {
        let (failed, grown) = self.events.iter().partition(|event| event.failure.is_some());
        [grown, failed]
    }

    /// Returns what the guard did last and which steps would be right, if it acted. The run ends with steps of `part` (s).
    fn advice(&self, part: f64, is_switched: bool) -> Option<String> {
        let GuardEvent { action, .. } = self.events.last()?;
        let [grown, failed] = self.causes();
        let mut found = Vec::new();
        if let Some(GuardEvent { t, relative, .. }) = grown.last() {
            let times = match grown.len() {
                1 => String::new(),
                count => format!(" {count} times, the last time"),
            };
            found.push(format!(
                "the energy had grown without a source{times} by {relative:.1e} of what motion and deformation received at \
                 t = {t:e} s"
            ));
        }
        if let Some(GuardEvent { t, failure, .. }) = failed.last() {
            let steps = match failed.len() {
                1 => "a step failed".to_owned(),
                count => format!("{count} steps failed, the last one"),
            };
            found.push(format!("{steps} at t = {t:e} s: {}", failure.as_deref().unwrap_or_default()));
        }
        let longest = self.watching.longest_advised;
        let step = match (is_switched, longest < part) {
            (false, false) if self.has_grown() => format!("a step below {part:.3e} s"),
            (true, _) if longest.is_infinite() => "a smaller step".to_owned(),
            (true, _) | (false, true) => format!("a step of {longest:.3e} s"),
            (false, false) => format!("a step of {part:.3e} s"),
        };
        let still = match self.has_grown() {
            true => format!("; in all the energy still grew by {}", self.gain()),
            false => String::new(),
        };
        Some(format!(
            "{}; the run went back and continued {action}{still}. Use {step} from the start, or scheme = \
             \"energy-momentum\"",
            found.join("; ")
        ))
    }

    /// Returns the entry of report.json.
    fn account(&self) -> Value {
        json!({
            "action": self.watching.rule.action, "bound": self.watching.rule.bound, "growth": self.growth.largest,
            "exchange": self.growth.exchange, "relative_growth": self.relative(),
            "resolution": self.resolution, "exceeded": self.has_grown(), "failed_steps": self.causes()[1].len(), "events": self.events,
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

    fn report(&self, simulation: &Simulation, report: &mut Report) {
        report.guard = self.account();
        report.warning = self.warning();
        // The advice after an action includes the warning, so that there is one statement about the step.
        let advice = self.advice(simulation.part(), simulation.is_switched());
        report.notes.extend(advice.or_else(|| self.warning()));
    }
}
