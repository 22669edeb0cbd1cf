//! Implements `[time] estimate = true`: estimates the error of every probe from companion simulations. They solve the
//! same scene beside the run and do not affect the run.
//!
//! Every scheme is compared with a companion that is more accurate than the scheme itself:
//!
//! | scheme | reference s | error of s |
//! |---|---|---|
//! | explicit, order 1 and 2 | Blanes–Moan 4 with h, or 2h if that is stable | neglected |
//! | `blanes-moan-4` | Blanes–Moan 6 with h/2 | neglected |
//! | `blanes-moan-6`, and explicit schemes in scenes that Blanes–Moan 4 cannot step | the scheme with h/4 | 4^−p of its own |
//! | implicit, order p | the scheme with h/2 | 2^−p of its own, p as observed |
//!
//! If the error of the reference s is φ times the error e of the run, then e = (u_h − u_s)/(1 − φ). Explicit schemes
//! show their order by 2^p = |u_h − u_s| / |u_{h/2} − u_s|, implicit ones by 2^p = |u_{2h} − u_h| / |u_h − u_{h/2}|.
//! The order is limited to the formal order, and taken as 1 if the differences do not decrease. References of implicit
//! schemes solve their equations 100 times as accurately, so that the estimate includes the error of the run's own
//! solver.

use std::time::Instant;

use serde_json::json;
use vi_solvers::Interrupt;

use super::checkpoint::CheckpointError;
use super::error::RunError;
use super::observer::{Observer, Purpose, Sight};
use super::probe_estimate::ProbeEstimate;
use super::report::Report;
use crate::auto::trial::Choice;
use crate::record::{Bytes, record};
use crate::scene::{Problem, SchemeName};
use crate::simulation::stability::highest;
use crate::simulation::{ProbeValue, Simulation, Snapshot};

/// The estimator between two steps of the run; `None` for a companion that is not needed or has failed.
struct Companions {
    double: Option<Snapshot>,
    half: Option<Snapshot>,
    shadow: Option<Snapshot>,
    notes: Vec<String>,
    latest: Vec<ProbeEstimate>,
    /// `None` in a snapshot to go back to, because elapsed time is kept even if the run goes back.
    seconds: Option<f64>,
}

record!(Companions {
    double: Option<Snapshot>,
    half: Option<Snapshot>,
    shadow: Option<Snapshot>,
    notes: Vec<String>,
    latest: Vec<ProbeEstimate>,
    seconds: Option<f64>,
});

/// Ratio of the companions' solver tolerance to that of the run.
const TIGHTER: f64 = 1e-2;

/// The companions of a run.
pub struct Estimator {
    /// The scheme with twice the step, for implicit schemes.
    double: Option<Companion>,
    /// The scheme with half the step.
    half: Option<Companion>,
    /// The reference of explicit schemes.
    shadow: Option<Companion>,
    /// Ratio of the error of `shadow` to that of the run.
    share: f64,
    /// The companions meet the run every `stride` steps: 1 or 2.
    stride: u64,
    order: f64,
    notes: Vec<String>,
    /// The last estimate of each probe.
    latest: Vec<ProbeEstimate>,
    /// Time spent on companions, s.
    seconds: f64,
}

/// A simulation of the same scene with its own number of steps.
struct Companion {
    simulation: Simulation,
    /// Number of its steps per step of the run, as a fraction.
    steps: [u64; 2],
}

impl Estimator {
    /// Makes the companions of a simulation at its start.
    pub fn new(simulation: &Simulation) -> Self {
        let scene = simulation.scene();
        let run = Choice::of(scene);
        let facts = run.method().facts();
        let order = facts.order as f64;
        let make = |scheme: Choice, steps: [u64; 2]| {
            let mut scene = Choice { steps: run.steps * steps[0] / steps[1], ..scheme }.apply(scene);
            // A companion follows the run or is lost.
            scene.solver.interrupt = Interrupt::NEVER;
            scene.solver.tolerance = (TIGHTER * scene.solver.tolerance).max(1e-14);
            Simulation::new(scene).map(|simulation| Companion { simulation, steps })
        };
        let can_double = run.steps.is_multiple_of(2);
        let mut estimator = Self {
            double: None,
            half: None,
            shadow: None,
            share: 0.0,
            stride: 1,
            order,
            notes: Vec::new(),
            latest: Vec::new(),
            seconds: 0.0,
        };
        estimator.half = estimator.accept(make(run, [2, 1]));
        if facts.is_explicit {
            let higher = |scheme| Choice { scheme, stages: None, steps: run.steps };
            let shadow = match run.scheme {
                SchemeName::BlanesMoan6 => None,
                SchemeName::BlanesMoan4 => make(higher(SchemeName::BlanesMoan6), [2, 1]).ok(),
                _ => {
                    let fourth = higher(SchemeName::BlanesMoan4);
                    let limit = fourth.method().facts().recommended_limit.unwrap_or(0.0);
                    // With twice the step this scheme costs 3 forces per step of the run. That step must be stable: it
                    // is not used if the highest frequency is not known, which the run reports.
                    let is_slow = matches!(highest(simulation),
                        Ok(Some(omega)) if 2.0 * simulation.step_size() * omega <= limit);
                    estimator.stride = if can_double && is_slow { 2 } else { 1 };
                    make(fourth, [1, estimator.stride]).ok()
                }
            };
            if shadow.is_none() {
                estimator.stride = 1;
                estimator.share = 4.0_f64.powf(-order);
            }
            estimator.shadow = match shadow {
                Some(shadow) => Some(shadow),
                None => estimator.accept(make(run, [4, 1])),
            };
        } else if can_double {
            estimator.stride = 2;
            estimator.double = estimator.accept(make(run, [1, 2]));
        }
        estimator
    }

    fn accept(&mut self, made: Result<Companion, Vec<Problem>>) -> Option<Companion> {
        let refused = |problem: &Problem| format!("no error estimate: {problem}");
        match made {
            Ok(companion) => Some(companion),
            Err(problems) => {
                self.notes.extend(problems.iter().map(refused));
                None
            }
        }
    }

    /// Returns why companions have failed.
    pub fn notes(&self) -> &[String] {
        &self.notes
    }

    /// Brings all companions to step `step` of the run and compares. Returns `None` if not all of them reach that time
    /// exactly. A companion that fails is dropped, with a note.
    pub fn compare(&mut self, step: u64, probes: &[ProbeValue]) -> Option<Vec<ProbeEstimate>> {
        if !step.is_multiple_of(self.stride) {
            return None;
        }
        let begin = Instant::now();
        let notes = &mut self.notes;
        let half = advance(&mut self.half, step, notes);
        let shadow = advance(&mut self.shadow, step, notes);
        let double = advance(&mut self.double, step, notes);
        let value = |index: usize| {
            let of = |others: &Option<Vec<ProbeValue>>| others.as_ref().map(|o| o[index].displacement);
            let own = probes[index].displacement;
            let mut found = match of(&shadow) {
                Some(shadow) => self.by_shadow(own, of(&half), shadow),
                None => self.by_pair(own, of(&double), of(&half)),
            };
            // Positions are rounded at every step, which adds to any error.
            let round_off = f64::EPSILON * (step as f64).sqrt();
            for (error, position) in found.error.iter_mut().zip(probes[index].position) {
                *error += round_off * position.abs();
            }
            found
        };
        let found: Vec<ProbeEstimate> = (0..probes.len()).map(value).collect();
        self.latest.clone_from(&found);
        self.seconds += begin.elapsed().as_secs_f64();
        Some(found)
    }

    fn by_shadow(&self, own: Vector, half: Option<Vector>, shadow: Vector) -> ProbeEstimate {
        let difference = minus(own, shadow);
        let observed_order = half.and_then(|half| {
            // A reference by the same scheme shares part of the error. Three steps show the order without it.
            let coarse = if self.share > 0.0 { minus(own, half) } else { difference };
            order_of(coarse, minus(half, shadow))
        });
        ProbeEstimate { error: difference.map(|value| value.abs() / (1.0 - self.share)), observed_order }
    }

    fn by_pair(&self, own: Vector, double: Option<Vector>, half: Option<Vector>) -> ProbeEstimate {
        let Some(half) = half else { return ProbeEstimate { error: [f64::NAN; 3], observed_order: None } };
        let difference = minus(own, half);
        let observed_order = double.and_then(|double| order_of(minus(double, own), difference));
        // If no order is observed, order 1 is assumed.
        let share = 2.0_f64.powf(-observed_order.map_or(1.0, |observed| observed.min(self.order)));
        ProbeEstimate { error: difference.map(|value| value.abs() / (1.0 - share)), observed_order }
    }
}

impl Observer for Estimator {
    fn name(&self) -> &'static str {
        "error estimate"
    }

    /// Does nothing: [`Estimator::compare`] advances the companions, and its result is part of the row.
    fn see(&mut self, _: &Sight<'_>) -> Result<(), RunError> {
        Ok(())
    }

    fn snapshot(&self, purpose: Purpose) -> Bytes {
        let of = |companion: &Option<Companion>| companion.as_ref().map(|c| c.simulation.snapshot());
        Bytes::of(&Companions {
            double: of(&self.double),
            half: of(&self.half),
            shadow: of(&self.shadow),
            notes: self.notes.clone(),
            latest: self.latest.clone(),
            seconds: (purpose == Purpose::Resume).then_some(self.seconds),
        })
    }

    fn restore(&mut self, snapshot: &Bytes) -> Result<(), RunError> {
        let was: Companions = snapshot.value()?;
        let pairs =
            [(&mut self.double, was.double), (&mut self.half, was.half), (&mut self.shadow, was.shadow)];
        for (companion, was) in pairs {
            match (companion.as_mut(), was) {
                (Some(companion), Some(was)) => {
                    let restored = companion.simulation.restore(&was);
                    restored.map_err(|error| CheckpointError::Unfit(error.to_string()))?;
                }
                _ => *companion = None,
            }
        }
        (self.notes, self.latest) = (was.notes, was.latest);
        self.seconds = was.seconds.unwrap_or(self.seconds);
        Ok(())
    }

    fn report(&self, simulation: &Simulation, report: &mut Report) {
        report.estimating_seconds = self.seconds;
        report.notes.extend(self.notes.iter().cloned());
        for (probe, estimate) in simulation.scene().node_probes().zip(&self.latest) {
            report.estimate.insert(probe.name.clone(), json!(estimate));
        }
    }
}

/// Advances a companion to the time of step `step` of the run.
fn advance(companion: &mut Option<Companion>, step: u64, notes: &mut Vec<String>) -> Option<Vec<ProbeValue>> {
    let Companion { simulation, steps } = companion.as_mut()?;
    let target = step * steps[0] / steps[1];
    while simulation.steps() < target {
        if let Err(error) = simulation.advance(target - simulation.steps()) {
            notes.push(format!("the error estimate lost a companion: {error}"));
            *companion = None;
            return None;
        }
    }
    Some(simulation.observe().probes)
}

type Vector = [f64; 3];

fn minus(a: Vector, b: Vector) -> Vector {
    std::array::from_fn(|k| a[k] - b[k])
}

/// Returns the order shown by the errors at a step and at half of it; `None` if they do not decrease.
fn order_of(coarse: Vector, fine: Vector) -> Option<f64> {
    let size = |a: Vector| a.iter().map(|v| v * v).sum::<f64>().sqrt();
    let ratio = size(coarse) / size(fine);
    // Orders below 1/4 are rejected, because 1/(1 - 2^-p) is then arbitrary.
    (ratio.is_finite() && ratio > 2.0_f64.powf(0.25)).then(|| ratio.log2())
}
