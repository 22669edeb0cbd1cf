//! Trials within a budget, shared by the searches among implicit and explicit schemes.

use std::cell::Cell;
use std::ops::Range;

use super::activity;
use super::candidate::Candidate;
use crate::auto::trial::{Choice, Limit, Norm, Trial, TrialError, TrialWatch, run};
use crate::scene::{Scene, SchemeName};
use crate::simulation::stability::{Rates, limiting};
use crate::simulation::{Component, Simulation};

/// The implicit schemes that are tried, with their numbers of stages.
pub(super) const IMPLICIT: [(SchemeName, Option<usize>); 3] =
    [(SchemeName::ImplicitMidpoint, None), (SchemeName::Gauss, Some(2)), (SchemeName::Gauss, Some(3))];
/// The explicit schemes of higher order that are tried.
pub(super) const HIGHER: [SchemeName; 2] = [SchemeName::BlanesMoan4, SchemeName::BlanesMoan6];
/// Fraction of the recommended limit of an explicit scheme for bodies that meet: near the limit, impacts put energy
/// into the shortest waves of the mesh, which stay excited (docs/contact.md). At the limit, the cloth of
/// `scenes/contact/cloth-on-sphere.toml` gains more than 1 % of its exchanged energy.
const IN_CONTACT: f64 = 0.5;
/// Number of steps of the coarsest trial of an implicit scheme.
pub(super) const COARSEST: u64 = 16;
/// Number of steps of the finest trial.
pub(super) const FINEST: u64 = COARSEST << 12;
/// `auto` also predicts the cost of this fraction of the target error.
pub(super) const TENTH: f64 = 0.1;
/// Number of first steps from which the cost of a run is estimated: one in 64, within these bounds.
const SAMPLE: [u64; 2] = [4, 64];

/// The caller requested a stop.
pub(super) struct Stopped;

/// Error of a trial.
pub(super) enum NoTrial {
    /// A step failed, or the scheme does not accept the scene.
    Failed,
    /// The trial would exceed its budget.
    OutOfBudget,
}

pub(super) struct Search<'a> {
    pub(super) scene: &'a Scene,
    watch: &'a mut dyn TrialWatch,
    pub(super) norm: Norm,
    rates: Vec<Rates>,
    /// Highest frequency of the motion with which rigid bodies start, rad/s.
    turning: f64,
    /// Schemes that do not accept the scene: they are not tried.
    refused: Vec<Choice>,
    /// The target relative error.
    pub(super) aim: f64,
    /// Budget of all trials, s of the reference machine.
    pub(super) budget: f64,
    /// Smallest number of steps that resolves the events of the scene.
    pub(super) coarsest: u64,
    spent: Cell<f64>,
    trials: u32,
    /// The part of the run of the explicit trials; `None` before them, or if no part fits into the budget.
    pub(super) window: Option<Range<f64>>,
    /// Whether a trial was omitted or ended because of the budget.
    pub(super) is_exhausted: bool,
    /// The implicit scheme and step with the smallest difference from a coarser step, if none showed an order.
    pub(super) nearest: Option<Candidate>,
    /// Ways to a tenth of the target error that the trials show.
    pub(super) tenth: Vec<Candidate>,
    /// Factor by which errors grew in the second half of a window, if faster than t².
    pub(super) growth: Option<f64>,
}

/// Störmer–Verlet at its limit of stability, or in smaller steps that resolve the scene.
pub(super) struct Verlet {
    /// Number of steps at its limit.
    pub(super) stable: u64,
    /// Number of steps that it takes.
    pub(super) steps: u64,
    /// Cost of these steps, s.
    pub(super) seconds: f64,
}

impl<'a> Search<'a> {
    pub(super) fn new(
        scene: &'a Scene,
        watch: &'a mut dyn TrialWatch,
        simulation: &Simulation,
        (rates, turning): (Vec<Rates>, f64),
        aim: f64,
    ) -> Self {
        let norm = Norm::new(simulation);
        let schemes = IMPLICIT.into_iter().chain(HIGHER.map(|scheme| (scheme, None)));
        let choices = schemes.map(|(scheme, stages)| Choice { scheme, stages, steps: 1 });
        Self {
            refused: choices.filter(|choice| !accepts(simulation, scene, choice)).collect(),
            scene,
            watch,
            norm,
            rates,
            turning,
            aim,
            budget: f64::INFINITY,
            coarsest: activity::resolving_steps(scene, COARSEST),
            spent: Cell::new(0.0),
            trials: 0,
            window: None,
            is_exhausted: false,
            nearest: None,
            tenth: Vec::new(),
            growth: None,
        }
    }

    /// Returns whether a scheme, with its number of stages, accepts the scene.
    pub(super) fn accepts(&self, scheme: SchemeName, stages: Option<usize>) -> bool {
        !self.refused.iter().any(|choice| choice.scheme == scheme && choice.stages == stages)
    }

    /// Returns the relative error of a choice at kinks of functions of time ([`activity::missed_at_kinks`]), which differences of
    /// trials do not always show.
    pub(super) fn missed(&self, choice: &Choice) -> f64 {
        activity::missed_at_kinks(self.scene, choice)
    }

    pub(super) fn spent(&self) -> f64 {
        self.spent.get()
    }

    pub(super) fn left(&self) -> f64 {
        (self.budget - self.spent()).max(0.0)
    }

    /// Returns an explicit scheme at its recommended limit, or in the steps that resolve the scene if these are more; the number
    /// of steps is a multiple of `parts`.
    pub(super) fn limit(&self, scheme: SchemeName, parts: u64) -> Choice {
        let steps = self.stable_steps(scheme).max(self.coarsest.min(FINEST)).next_multiple_of(parts);
        Choice { scheme, stages: None, steps }
    }

    /// Returns the number of steps of an explicit scheme at its recommended limit.
    pub(super) fn stable_steps(&self, scheme: SchemeName) -> u64 {
        let choice = Choice { scheme, stages: None, steps: 1 };
        let method = choice.method();
        let limit = method.facts().recommended_limit.unwrap_or(1.0);
        let limit = if self.scene.contact.is_some() { IN_CONTACT * limit } else { limit };
        let omega = limiting(&self.rates, method).max(self.turning);
        (self.scene.time.end * omega / limit).ceil() as u64
    }

    /// Runs a trial over a part of the run, for at most `seconds` of the reference machine and the remaining budget.
    pub(super) fn trial(
        &mut self,
        choice: Choice,
        stretch: Range<f64>,
        seconds: f64,
    ) -> Result<Result<Trial, NoTrial>, Stopped> {
        self.trials += 1;
        let until = match stretch.end {
            end if end < 1.0 => format!(" until t = {:.3e} s", end * self.scene.time.end),
            _ => String::new(),
        };
        let what =
            format!("auto: trial {}, {} in {} steps{until}", self.trials, choice.label(), choice.steps);
        self.watch.next(&what);
        let limit = Limit::Counted { seconds: seconds.min(self.left()), spent: &self.spent };
        let watch = &mut *self.watch;
        match run(choice.apply(self.scene), stretch, limit, &mut || watch.go_on()) {
            Ok(trial) => Ok(Ok(trial)),
            Err(TrialError::Stopped) => Err(Stopped),
            Err(TrialError::OutOfTime { .. }) => {
                self.is_exhausted |= self.left() <= 0.0;
                Ok(Err(NoTrial::OutOfBudget))
            }
            Err(TrialError::Failed(_) | TrialError::Refused(_)) => Ok(Err(NoTrial::Failed)),
        }
    }

    /// Returns the cost of a whole run, estimated from its first steps, s; `None` if they fail.
    pub(super) fn cost(&mut self, choice: Choice) -> Result<Option<f64>, Stopped> {
        let sample = (choice.steps / SAMPLE[1]).clamp(SAMPLE[0], SAMPLE[1]);
        let fraction = (sample as f64 / choice.steps as f64).min(1.0);
        let trial = self.trial(choice, 0.0..fraction, f64::INFINITY)?;
        Ok(trial.ok().map(|trial| seconds_per_step(&trial) * choice.steps as f64))
    }

    /// Returns the cost of implicit midpoint with the finest step of all trials, estimated from two steps, s.
    pub(super) fn finest_implicit_cost(&mut self) -> Result<Option<f64>, Stopped> {
        let choice = Choice { scheme: SchemeName::ImplicitMidpoint, stages: None, steps: FINEST };
        let trial = self.trial(choice, 0.0..2.0 / FINEST as f64, f64::INFINITY)?;
        Ok(trial.ok().map(|trial| seconds_per_step(&trial) * FINEST as f64))
    }
}

/// Returns whether the scheme of a choice accepts the scene with the systems of `simulation`.
pub(crate) fn accepts(simulation: &Simulation, scene: &Scene, choice: &Choice) -> bool {
    let method = choice.method();
    let mut systems = simulation.components().iter().map(Component::system);
    choice.apply(scene).problems().is_empty() && systems.all(|system| method.check(system).is_ok())
}

pub(super) fn seconds_per_step(trial: &Trial) -> f64 {
    trial.counted_seconds / trial.work.steps.max(1) as f64
}
