//! `scheme = "auto"`: chooses scheme and step for a required relative error at the end of the run, before the
//! simulation is built.
//!
//! The choice is based on trials: runs of the scene itself with several schemes and steps. If trials of the whole run
//! fit into the budget, only a scheme and step with a measured error, relative to a more accurate run, are chosen. If
//! they do not fit, errors are measured on a part of the run and extrapolated, and the report says so.
//!
//! Trials may cost a fraction (`BUDGET`) of the run that they save, the cheapest stable explicit run. Short runs get
//! `LEAST_BUDGET`. Costs are counted for a reference machine and never measured with a clock: the same scene leads to
//! the same choice on any machine and with any number of threads.

mod activity;
mod candidate;
mod explicit;
mod implicit;
mod processor;
pub(crate) mod search;
pub mod trial;
mod wording;

use serde::Serialize;

use crate::auto::trial::{Choice, TrialWatch};
use crate::scene::{MassKind, Problem, Scene, SchemeName, Time};
use crate::simulation::Simulation;
use crate::simulation::stability::{rates, rotation};
pub use candidate::Candidate;
use search::{Search, Stopped, Verlet};

/// The target error, as a fraction of the required one.
const SAFETY: f64 = 0.6;
/// Budget of the trials, as a fraction of the run that they save.
const BUDGET: f64 = 0.05;
/// Smallest budget of the trials, s of one core of the reference machine.
const LEAST_BUDGET: f64 = 2.0;
/// Trials of implicit schemes cost at most this fraction of the explicit run that they could replace.
const IMPLICIT_SHARE: f64 = 0.5;
/// The choice and its reasons.
#[derive(Debug, Clone, Serialize)]
pub struct AutoReport {
    /// Required relative error at the end.
    pub tolerance: f64,
    /// ω_max of the scene at its start, rad/s.
    pub highest_frequency: f64,
    /// Candidates that should reach the tolerance, starting with the chosen one.
    pub candidates: Vec<Candidate>,
    /// The cheapest way to a tenth of the tolerance, by the orders that the trials show; `None` if they show none.
    pub tenth: Option<Candidate>,
    /// Cost of the trials, s of one core of the reference machine.
    pub trial_seconds: f64,
    /// Budget of the trials, s.
    pub budget_seconds: f64,
    /// Reason for the choice, one paragraph.
    pub reason: String,
    /// Reason why the tolerance may be missed; `None` if the error was measured at the end of a whole run.
    pub warning: Option<String>,
}

/// Error that prevents a choice.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SettleError {
    /// The scene is invalid, or no scheme completed its trials.
    #[error("the scene is invalid")]
    Scene(Vec<Problem>),
    /// The caller asked to stop.
    #[error("stopped during the trials of scheme \"auto\"")]
    Stopped,
}

impl From<Stopped> for SettleError {
    fn from(_: Stopped) -> Self {
        Self::Stopped
    }
}

/// Returns the scene with scheme and step in place of `auto`, and the reasons. A scene with a given scheme, or in
/// search of equilibria, is returned unchanged.
///
/// # Errors
/// Returns [`SettleError`] if no choice can be made.
pub fn settle(scene: Scene, watch: &mut dyn TrialWatch) -> Result<(Scene, Option<AutoReport>), SettleError> {
    if scene.time.scheme != Some(SchemeName::Auto) || scene.statics.is_some() {
        return Ok((scene, None));
    }
    let (choice, report) = choose(&scene, watch)?;
    let mut scene = scene;
    scene.time.choose(choice.scheme, choice.stages, choice.steps);
    Ok((scene, Some(report)))
}

/// Replaces `auto` by a fixed scheme, with the step of the scene or a single step, to compute what does not depend on
/// the choice: masses, modes, problems. Returns the scene.
pub fn stand_in(scene: &Scene) -> Scene {
    let mut scene = scene.clone();
    if scene.time.scheme == Some(SchemeName::Auto) {
        let steps = scene.time.steps().0;
        scene.time.choose(first_scheme(&scene), None, steps);
    }
    scene
}

/// Returns the scheme that stands in for `auto`: an implicit one if the mass is consistent.
fn first_scheme(scene: &Scene) -> SchemeName {
    match scene.solver.mass {
        Some(MassKind::Consistent) => SchemeName::ImplicitMidpoint,
        _ => SchemeName::StormerVerlet,
    }
}

fn choose(scene: &Scene, watch: &mut dyn TrialWatch) -> Result<(Choice, AutoReport), SettleError> {
    let tolerance = scene.time.tolerance.unwrap_or(Time::DEFAULT_TOLERANCE);
    let start = Choice { scheme: first_scheme(scene), stages: None, steps: 1 };
    let is_explicit = start.method().facts().is_explicit;
    let simulation = Simulation::new(start.apply(scene)).map_err(SettleError::Scene)?;
    if simulation.components().iter().all(|component| component.stepper().is_none()) {
        return Ok((start, AutoReport::of_rest(tolerance)));
    }
    let rates = rates(&simulation).map_err(|error| {
        let message =
            format!("\"auto\" needs the highest frequency of the scene: {error}; or name scheme and step");
        SettleError::Scene(vec![Problem::new("time.scheme", message)])
    })?;
    // If no force changes with position and nothing turns, as in free flight, the trials alone decide.
    let turning = rotation(&simulation);
    let omega = rates.iter().map(|rates| rates.omega).fold(turning, f64::max);
    let mut search = Search::new(scene, watch, &simulation, (rates, turning), SAFETY * tolerance);
    drop(simulation);
    let verlet = search.limit(SchemeName::StormerVerlet, 1);
    let stable = search.stable_steps(SchemeName::StormerVerlet);
    let explicit_seconds = if is_explicit { search.cost(verlet)? } else { None };
    search.budget = match explicit_seconds {
        Some(seconds) => BUDGET * seconds,
        None => BUDGET * search.finest_implicit_cost()?.unwrap_or(0.0),
    }
    .max(LEAST_BUDGET);
    let allowed = explicit_seconds.map_or(f64::INFINITY, |seconds| IMPLICIT_SHARE * seconds);
    let mut candidates = match scene.solver.mass {
        // The scene requires explicit steps.
        Some(MassKind::Filtered) => Vec::new(),
        _ => search.implicit(allowed.min(search.left()))?,
    };
    let measured = candidates.iter().filter(|candidate| candidate.measured);
    let cheapest = measured.map(|candidate| candidate.predicted_seconds).fold(f64::INFINITY, f64::min);
    if let Some(seconds) = explicit_seconds.filter(|seconds| *seconds < cheapest) {
        candidates.extend(search.explicit(seconds)?);
    }
    if candidates.is_empty() {
        candidates.extend(search.nearest.take());
    }
    // If a candidate was measured, extrapolated ones are not needed.
    if candidates.iter().any(|candidate| candidate.measured) {
        candidates.retain(|candidate| candidate.measured);
    }
    candidates.sort_by(|a, b| a.cost_with_doubt().total_cmp(&b.cost_with_doubt()));
    let Some(best) = candidates.first() else {
        let message = format!(
            "no scheme reached the relative error {tolerance:.1e} in its trials; choose scheme and step yourself"
        );
        return Err(SettleError::Scene(vec![Problem::new("time.scheme", message)]));
    };
    let choice = best.choice;
    search.tenth.sort_by(|a, b| a.predicted_seconds.total_cmp(&b.predicted_seconds));
    let mut report = AutoReport {
        tolerance,
        highest_frequency: omega,
        trial_seconds: search.spent(),
        budget_seconds: search.budget,
        warning: search.warning(best, tolerance),
        reason: String::new(),
        tenth: search.tenth.first().cloned(),
        candidates,
    };
    let verlet = explicit_seconds.map(|seconds| Verlet { stable, steps: verlet.steps, seconds });
    report.reason = report.explain(scene, verlet);
    Ok((choice, report))
}
