//! `scheme = "auto"`: chooses scheme and step for a wanted relative error at the end, from the highest
//! frequency of the scene, counted costs, and pilot runs of the scene itself. It must not know
//! what is written, nor how the command line asks.
//!
//! Explicit schemes take steps near their limit of stability, where they are cheapest; their error is found
//! on the first eighth of the run, Störmer–Verlet against Blanes–Moan 4, and taken to grow in
//! proportion to time. Implicit schemes are tried over the whole run on halved steps, while all trials
//! together cost less than half the explicit run that they could replace. Costs are counted on a reference
//! machine and never clocked: the same scene makes the same choice on any machine and number of threads.

use serde::Serialize;

use crate::scene::{MassKind, Problem, Scene, SchemeName};
use crate::simulation::Simulation;
use crate::trial::{Choice, Limit, Norm, Trial, TrialError, highest, run};

/// The error aimed at, as a share of the wanted one.
const SAFETY: f64 = 0.6;
/// The stretch of the run on which explicit schemes are compared.
const WINDOW: f64 = 0.125;
/// Trials of implicit schemes cost at most this share of the explicit run.
const TRIAL_SHARE: f64 = 0.5;
const COARSEST: u64 = 16;
const FINEST: u64 = COARSEST << 12;

/// One way to reach the wanted error.
#[derive(Debug, Clone, Serialize)]
pub struct Candidate {
    /// Scheme with its stages.
    pub scheme: String,
    /// The choice itself.
    #[serde(skip)]
    pub choice: Choice,
    /// Steps.
    pub steps: u64,
    /// Cost of a step, s of one core of the reference machine.
    pub seconds_per_step: f64,
    /// Cost of the run, s of one core of the reference machine.
    pub predicted_seconds: f64,
    /// Relative error expected at the end.
    pub predicted_error: f64,
}

/// What was chosen, and why.
#[derive(Debug, Clone, Serialize)]
pub struct AutoReport {
    /// Relative error wanted at the end.
    pub tolerance: f64,
    /// ω_max of the scene at its start, rad/s.
    pub highest_frequency: f64,
    /// What could reach the tolerance, the cheapest first.
    pub candidates: Vec<Candidate>,
    /// What the trials cost, s of one core of the reference machine.
    pub trial_seconds: f64,
    /// Why, in a paragraph.
    pub reason: String,
}

/// Settles scheme and step of a scene whose scheme is `auto`.
///
/// # Errors
/// The scene's problems, or none of the schemes got through its trials.
pub fn choose(scene: &Scene) -> Result<(Scene, Choice, AutoReport), Vec<Problem>> {
    let tolerance = scene.time.tolerance.unwrap_or(1e-4);
    // Consistent mass leaves implicit schemes.
    let is_implicit = scene.solver.mass == Some(MassKind::Consistent);
    let first = if is_implicit { SchemeName::ImplicitMidpoint } else { SchemeName::StormerVerlet };
    let start = Choice { scheme: first, stages: None, steps: 1 };
    let simulation = Simulation::new(start.apply(scene))?;
    let Some(omega) = highest(&simulation) else {
        let reason = "nothing in the scene moves freely: any scheme and step will do".to_owned();
        let report = AutoReport {
            tolerance,
            highest_frequency: 0.0,
            candidates: Vec::new(),
            trial_seconds: 0.0,
            reason,
        };
        let mut settled = scene.clone();
        settled.time.choose(start.scheme, None, 1);
        return Ok((settled, start, report));
    };
    let mut search =
        Search { scene, norm: Norm::new(&simulation), omega, aim: SAFETY * tolerance, spent: 0.0 };
    drop(simulation);
    let verlet = search.limit(SchemeName::StormerVerlet);
    let explicit_seconds = if is_implicit { None } else { search.cost(verlet) };
    let allowed = explicit_seconds.map_or(f64::INFINITY, |seconds| TRIAL_SHARE * seconds);
    let mut candidates = search.implicit(allowed);
    let cheapest = candidates.iter().map(|c| c.predicted_seconds).fold(f64::INFINITY, f64::min);
    if let Some(seconds) = explicit_seconds
        && WINDOW * seconds < cheapest
    {
        candidates.extend(search.explicit());
    }
    candidates.sort_by(|a, b| a.predicted_seconds.total_cmp(&b.predicted_seconds));
    let Some(best) = candidates.first() else {
        let message = format!(
            "no scheme reached the relative error {tolerance:.1e} in its trials; choose scheme and step yourself"
        );
        return Err(vec![Problem::new("time.scheme", message)]);
    };
    let mut settled = scene.clone();
    let choice = best.choice;
    settled.time.choose(choice.scheme, choice.stages, choice.steps);
    let verlet = (!is_implicit).then_some(verlet);
    let mut reason = explain(&candidates, tolerance, omega, verlet, explicit_seconds, search.spent);
    if let Some(step) = scene.time.step {
        reason.push_str(&format!(" The step of the scene, {step:e} s, is not used: `auto` chooses it."));
    }
    let trial_seconds = search.spent;
    let report = AutoReport { tolerance, highest_frequency: omega, candidates, trial_seconds, reason };
    Ok((settled, choice, report))
}

fn explain(
    candidates: &[Candidate],
    tolerance: f64,
    omega: f64,
    verlet: Option<Choice>,
    explicit_seconds: Option<f64>,
    spent: f64,
) -> String {
    let best = &candidates[0];
    let mut text = format!(
        "{} in {} steps is expected to end with a relative error of {:.1e} (wanted: {tolerance:.0e}) after {:.2} s of one \
         core of the reference machine.",
        best.scheme, best.steps, best.predicted_error, best.predicted_seconds
    );
    if let Some(verlet) = verlet {
        let steps = verlet.steps;
        text.push_str(&format!(
            " The highest frequency of the scene is {omega:.3e} rad/s, so that Störmer–Verlet needs {steps} steps"
        ));
        match explicit_seconds {
            Some(seconds) => text.push_str(&format!(", {seconds:.2} s, to be stable.")),
            None => text.push_str("; it failed even so."),
        }
    } else {
        text.push_str(" The mass is consistent, which leaves implicit schemes.");
    }
    for other in &candidates[1..] {
        text.push_str(&format!(
            " {} would need {} steps and {:.2} s.",
            other.scheme, other.steps, other.predicted_seconds
        ));
    }
    if candidates.iter().all(|c| c.choice.method().facts().is_explicit) {
        text.push_str(" Implicit schemes did not reach the error at half the cost of explicit steps.");
    } else if best.choice.method().facts().is_explicit {
        text.push_str(" Its steps are cheap enough to outweigh their number.");
    } else if verlet.is_some() {
        text.push_str(" Its steps are dearer, but so much longer that they cost less.");
    }
    text.push_str(&format!(" The trials took {spent:.2} s."));
    text
}

struct Search<'a> {
    scene: &'a Scene,
    norm: Norm,
    omega: f64,
    aim: f64,
    spent: f64,
}

/// Trials of one implicit scheme on halved steps.
struct Ladder {
    choice: Choice,
    ends: Vec<Vec<Vec<f64>>>,
    differences: Vec<f64>,
    seconds: f64,
    over: bool,
}

impl Search<'_> {
    /// A scheme at its recommended limit; the number of steps divides into windows.
    fn limit(&self, scheme: SchemeName) -> Choice {
        let choice = Choice { scheme, stages: None, steps: 1 };
        let limit = choice.method().facts().recommended_limit.unwrap_or(1.0);
        let windows = (self.scene.time.end * self.omega / limit * WINDOW).ceil();
        Choice { steps: ((windows / WINDOW) as u64).max(8), ..choice }
    }

    fn trial(&mut self, choice: Choice, fraction: f64, limit: f64) -> Result<Trial, TrialError> {
        let trial = run(choice.apply(self.scene), fraction, Limit::Counted(limit), &mut || true);
        if let Ok(trial) = &trial {
            self.spent += trial.counted_seconds;
        }
        trial
    }

    /// Seconds of a whole run, by its first steps; none where they fail.
    fn cost(&mut self, choice: Choice) -> Option<f64> {
        let fraction = (64.0 / choice.steps as f64).min(1.0);
        let trial = self.trial(choice, fraction, f64::INFINITY).ok()?;
        Some(trial.counted_seconds / trial.work.steps.max(1) as f64 * choice.steps as f64)
    }

    /// Explicit schemes that reach the error aimed at.
    fn explicit(&mut self) -> Vec<Candidate> {
        let [verlet, fourth] = [SchemeName::StormerVerlet, SchemeName::BlanesMoan4].map(|s| self.limit(s));
        let sixth = self.limit(SchemeName::BlanesMoan6);
        let windows: Vec<Option<Trial>> =
            [verlet, fourth].into_iter().map(|c| self.trial(c, WINDOW, f64::INFINITY).ok()).collect();
        let [Some(of_verlet), Some(of_fourth)] = &windows[..] else { return Vec::new() };
        let error = |trial: &Trial, exact: &Trial| self.norm.error(&trial.end, &exact.end) / WINDOW;
        let mut found = Vec::new();
        let mut add = |choice: Choice, trial: &Trial, error: f64, aim: f64| {
            let order = choice.method().facts().order as f64;
            let refined = (error / aim).powf(1.0 / order).max(1.0);
            let steps = (choice.steps as f64 * refined).ceil() as u64;
            let seconds_per_step = trial.counted_seconds / trial.work.steps.max(1) as f64;
            found.push(Candidate {
                scheme: choice.label(),
                choice: Choice { steps, ..choice },
                steps,
                seconds_per_step,
                predicted_seconds: seconds_per_step * steps as f64,
                predicted_error: error / refined.powf(order),
            });
        };
        let verlet_error = error(of_verlet, of_fourth);
        if verlet_error < self.aim {
            add(verlet, of_verlet, verlet_error, self.aim);
            return found;
        }
        // What costs more than a run of order 4 is not worth asking; its own error needs order 6.
        let of_sixth = {
            let trial =
                run(sixth.apply(self.scene), WINDOW, Limit::Counted(f64::INFINITY), &mut || true).ok();
            trial.inspect(|trial| self.spent += trial.counted_seconds)
        };
        add(verlet, of_verlet, verlet_error, self.aim);
        if let Some(of_sixth) = of_sixth {
            let fourth_error = error(of_fourth, &of_sixth);
            add(fourth, of_fourth, fourth_error, self.aim);
            // At the same hω an order of 6 is at least as accurate: its error is bounded by that of order 4.
            add(sixth, &of_sixth, fourth_error.min(self.aim), self.aim);
        }
        found
    }

    /// Implicit schemes that reach the error aimed at, within `allowed` seconds of trials.
    fn implicit(&mut self, allowed: f64) -> Vec<Candidate> {
        let scheme = |scheme, stages| Ladder {
            choice: Choice { scheme, stages, steps: COARSEST },
            ends: Vec::new(),
            differences: Vec::new(),
            seconds: 0.0,
            over: false,
        };
        let mut ladders = [
            scheme(SchemeName::ImplicitMidpoint, None),
            scheme(SchemeName::Gauss, Some(2)),
            scheme(SchemeName::Gauss, Some(3)),
        ];
        let mut found: Vec<Candidate> = Vec::new();
        let mut left = allowed;
        // Two steps tell whether a ladder could fit at all.
        let probe = self.trial(ladders[0].choice, 2.0 / COARSEST as f64, 0.1 * allowed);
        if matches!(&probe, Err(TrialError::OutOfTime { .. })) {
            return found;
        }
        loop {
            let cheapest = found.iter().map(|c| c.predicted_seconds).fold(f64::INFINITY, f64::min);
            let next = ladders
                .iter_mut()
                .filter(|ladder| !ladder.over && 2.0 * ladder.seconds < left.min(cheapest))
                .min_by(|a, b| a.seconds.total_cmp(&b.seconds));
            let Some(ladder) = next else { return found };
            let trial = self.trial(ladder.choice, 1.0, left.min(2.0 * cheapest));
            match trial {
                Ok(trial) => {
                    left -= trial.counted_seconds;
                    ladder.enter(trial, &self.norm);
                    if let Some(candidate) = ladder.candidate(self.aim) {
                        found.push(candidate);
                        ladder.over = true;
                    }
                }
                // A coarse step may fail where a finer one does not.
                Err(TrialError::Failed(_)) if ladder.ends.is_empty() => {}
                Err(_) => (ladder.over, left) = (true, 0.5 * left),
            }
            ladder.choice.steps *= 2;
            ladder.over |= ladder.choice.steps > FINEST;
        }
    }
}

impl Ladder {
    fn enter(&mut self, trial: Trial, norm: &Norm) {
        if let Some(coarser) = self.ends.last() {
            self.differences.push(norm.error(coarser, &trial.end));
        }
        self.seconds = trial.counted_seconds;
        self.ends.push(trial.end);
    }

    /// The step that reaches `aim`, once the last two differences of three solutions show an order.
    fn candidate(&self, aim: f64) -> Option<Candidate> {
        let [.., coarse, fine] = self.differences[..] else { return None };
        let order = (coarse / fine).log2().min(self.choice.method().facts().order as f64);
        if order.is_nan() || order < 0.8 {
            return None;
        }
        let error = fine / (2.0_f64.powf(order) - 1.0);
        if error.is_nan() || error > aim {
            return None;
        }
        // Back to the step that just reaches it, but not beyond those that showed the order.
        let coarsened = (error / aim).powf(1.0 / order).max(0.5);
        let steps = (self.choice.steps as f64 * coarsened).ceil() as u64;
        let seconds_per_step = self.seconds / self.choice.steps as f64;
        Some(Candidate {
            scheme: self.choice.label(),
            choice: Choice { steps, ..self.choice },
            steps,
            seconds_per_step,
            predicted_seconds: seconds_per_step * steps as f64,
            predicted_error: error / coarsened.powf(order),
        })
    }
}
