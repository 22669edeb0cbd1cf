//! `scheme = "auto"`: chooses scheme and step for a wanted relative error at the end of the run, before a simulation
//! is made.
//!
//! The choice rests on trials: runs of the scene itself, by several schemes and steps. Where trials of the whole run
//! fit into the budget, a scheme and step is chosen only if it was run and its error was measured against a more
//! accurate run. Where they do not fit, errors are measured on a part of the run and extrapolated, and the report
//! says so.
//!
//! Trials may cost a share (`BUDGET`) of the run that they save: of the cheapest stable explicit run. Short runs get
//! `LEAST_BUDGET`. Costs are counted on a reference machine and never clocked: the same scene makes the same
//! choice on any machine and on any number of threads.

mod activity;
mod candidate;
mod explicit;
mod implicit;
mod processor;
mod search;
pub mod trial;
mod wording;

use serde::Serialize;

use crate::auto::trial::{Choice, Norm, TrialWatch};
use crate::scene::{MassKind, Problem, Scene, SchemeName};
use crate::simulation::Simulation;
use crate::simulation::stability::highest;
pub use candidate::Candidate;
use search::{Search, Stopped};

/// The error aimed at, as a share of the wanted one.
const SAFETY: f64 = 0.6;
/// Budget of the trials, as a share of the run that they save.
const BUDGET: f64 = 0.05;
/// Least budget of the trials, s of one core of the reference machine.
const LEAST_BUDGET: f64 = 2.0;
/// Trials of implicit schemes cost at most this share of the explicit run that they could replace.
const IMPLICIT_SHARE: f64 = 0.5;
/// The choice, and the reasons for it.
#[derive(Debug, Clone, Serialize)]
pub struct AutoReport {
    /// Relative error wanted at the end.
    pub tolerance: f64,
    /// ω_max of the scene at its start, rad/s.
    pub highest_frequency: f64,
    /// Candidates that are expected to reach the tolerance, the chosen one first.
    pub candidates: Vec<Candidate>,
    /// Cost of the trials, s of one core of the reference machine.
    pub trial_seconds: f64,
    /// Budget of the trials, s.
    pub budget_seconds: f64,
    /// Why, in a paragraph.
    pub reason: String,
    /// Why the tolerance may be missed; `None` where the error was measured at the end of a whole run.
    pub warning: Option<String>,
}

/// Why a scene is not settled.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SettleError {
    /// The scene is wrong, or no scheme got through its trials.
    #[error("the scene is wrong")]
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

/// The scene with scheme and step in the place of `auto`, and why these. A scene that names its scheme or
/// looks for equilibria is returned as it is.
///
/// # Errors
/// [`SettleError`].
pub fn settle(scene: Scene, watch: &mut dyn TrialWatch) -> Result<(Scene, Option<AutoReport>), SettleError> {
    if scene.time.scheme != Some(SchemeName::Auto) || scene.statics.is_some() {
        return Ok((scene, None));
    }
    let (choice, report) = choose(&scene, watch)?;
    let mut scene = scene;
    scene.time.choose(choice.scheme, choice.stages, choice.steps);
    Ok((scene, Some(report)))
}

/// The scene with some scheme in the place of `auto`, and its own step or a single one: for all that does not
/// depend on it, such as masses, modes and problems.
pub fn stand_in(scene: &Scene) -> Scene {
    let mut scene = scene.clone();
    if scene.time.scheme == Some(SchemeName::Auto) {
        let steps = scene.time.steps().0;
        scene.time.choose(first_scheme(&scene), None, steps);
    }
    scene
}

/// Consistent mass leaves implicit schemes.
fn first_scheme(scene: &Scene) -> SchemeName {
    match scene.solver.mass {
        Some(MassKind::Consistent) => SchemeName::ImplicitMidpoint,
        _ => SchemeName::StormerVerlet,
    }
}

fn choose(scene: &Scene, watch: &mut dyn TrialWatch) -> Result<(Choice, AutoReport), SettleError> {
    let tolerance = scene.time.tolerance.unwrap_or(1e-4);
    let start = Choice { scheme: first_scheme(scene), stages: None, steps: 1 };
    let is_explicit = start.method().facts().is_explicit;
    let simulation = Simulation::new(start.apply(scene)).map_err(SettleError::Scene)?;
    if simulation.components().iter().all(|component| component.stepper().is_none()) {
        return Ok((start, AutoReport::of_rest(tolerance)));
    }
    let found = highest(&simulation).map_err(|error| {
        let message =
            format!("\"auto\" needs the highest frequency of the scene: {error}; or name scheme and step");
        SettleError::Scene(vec![Problem::new("time.scheme", message)])
    })?;
    // Where no force changes with position, as in free flight, the trials alone decide.
    let omega = found.unwrap_or(0.0);
    let mut search = Search::new(scene, watch, Norm::new(&simulation), omega, SAFETY * tolerance);
    drop(simulation);
    let verlet = search.limit(SchemeName::StormerVerlet, 1);
    let explicit_seconds = if is_explicit { search.cost(verlet)? } else { None };
    search.budget = match explicit_seconds {
        Some(seconds) => BUDGET * seconds,
        None => BUDGET * search.finest_implicit_cost()?.unwrap_or(0.0),
    }
    .max(LEAST_BUDGET);
    let allowed = explicit_seconds.map_or(f64::INFINITY, |seconds| IMPLICIT_SHARE * seconds);
    let mut candidates = search.implicit(allowed.min(search.left()))?;
    let measured = candidates.iter().filter(|candidate| candidate.measured);
    let cheapest = measured.map(|candidate| candidate.predicted_seconds).fold(f64::INFINITY, f64::min);
    if let Some(seconds) = explicit_seconds.filter(|seconds| *seconds < cheapest) {
        candidates.extend(search.explicit(seconds)?);
    }
    if candidates.is_empty() {
        candidates.extend(search.nearest.take());
    }
    // What was measured was cheap enough to measure: nothing is gained by doubt.
    if candidates.iter().any(|candidate| candidate.measured) {
        candidates.retain(|candidate| candidate.measured);
    }
    candidates.sort_by(|a, b| a.price().total_cmp(&b.price()));
    let Some(best) = candidates.first() else {
        let message = format!(
            "no scheme reached the relative error {tolerance:.1e} in its trials; choose scheme and step yourself"
        );
        return Err(SettleError::Scene(vec![Problem::new("time.scheme", message)]));
    };
    let choice = best.choice;
    let mut report = AutoReport {
        tolerance,
        highest_frequency: omega,
        trial_seconds: search.spent(),
        budget_seconds: search.budget,
        warning: search.warning(best, tolerance),
        reason: String::new(),
        candidates,
    };
    report.reason = report.explain(scene, explicit_seconds.map(|seconds| (verlet.steps, seconds)));
    Ok((choice, report))
}
