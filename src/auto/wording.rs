//! The choice of `auto` in words.

use std::fmt::Write as _;

use super::search::{COARSEST, Search, Verlet};
use super::{AutoReport, Candidate, LEAST_BUDGET, activity};
use crate::scene::{MassKind, Scene, TimeStep};

impl Verlet {
    /// Says how many steps it takes, and why.
    fn words(&self) -> String {
        let Self { stable, steps, seconds } = self;
        if steps <= stable {
            return format!("needs {steps} steps, {seconds:.2} s, to be stable.");
        }
        let why = if *steps == COARSEST {
            "the fewest that are tried"
        } else {
            "to follow its loads, supports and rigid bodies"
        };
        format!("is stable in {stable} steps; it takes {steps}, {seconds:.2} s, {why}.")
    }
}

impl AutoReport {
    /// Returns the report for a scene without free motion.
    pub(super) fn of_rest(tolerance: f64) -> Self {
        Self {
            tolerance,
            highest_frequency: 0.0,
            candidates: Vec::new(),
            tenth: None,
            trial_seconds: 0.0,
            budget_seconds: 0.0,
            reason: "no coordinate of the scene is free: any scheme and step will do".to_owned(),
            warning: None,
        }
    }

    /// Explains why the first candidate was chosen.
    pub(super) fn explain(&self, scene: &Scene, explicit: Option<Verlet>) -> String {
        let Some(best) = self.candidates.first() else { return String::new() };
        let is_explicit = |candidate: &Candidate| candidate.choice.method().facts().is_explicit;
        let error = match (best.measured, best.predicted_error) {
            (_, error) if error.is_nan() => "no estimate of the error".to_owned(),
            (true, error) => format!("measured relative error at the end {error:.1e}"),
            (false, error) => format!("expected relative error at the end {error:.1e}"),
        };
        let mut text = format!(
            "{} in {} steps: {error} (wanted: {:.0e}), {:.2} s of one core of the reference machine.",
            best.scheme, best.steps, self.tolerance, best.predicted_seconds
        );
        // Writing to a string cannot fail.
        let _ = match &explicit {
            Some(verlet) => write!(
                text,
                " The highest frequency of the scene is {:.3e} rad/s, so that Störmer–Verlet {}",
                self.highest_frequency,
                verlet.words()
            ),
            None if scene.solver.mass == Some(MassKind::Consistent) => {
                write!(text, " The mass is consistent, which leaves implicit schemes.")
            }
            None => write!(text, " Störmer–Verlet failed below its limit of stability."),
        };
        for other in &self.candidates[1..] {
            let _ = write!(
                text,
                " {} would need {} steps and {:.2} s.",
                other.scheme, other.steps, other.predicted_seconds
            );
        }
        if self.candidates.iter().all(is_explicit) {
            text.push_str(" Implicit schemes did not reach the error at half the cost of explicit steps.");
        } else if is_explicit(best) {
            text.push_str(" Its steps are cheap enough to outweigh their number.");
        } else if explicit.is_some() {
            text.push_str(" Its steps are more expensive, but so much longer that they cost less.");
        }
        if let Some(tenth) = &self.tenth {
            let _ = write!(
                text,
                " A tenth of the error would cost about {:.2} s, {} in {} steps.",
                tenth.predicted_seconds, tenth.scheme, tenth.steps
            );
        }
        let _ = write!(
            text,
            " The trials took {:.2} s of {:.2} s allowed.",
            self.trial_seconds, self.budget_seconds
        );
        if let Some(step) = scene.time.step.and_then(TimeStep::fixed) {
            let _ = write!(text, " The step of the scene, {step:e} s, is not used: `auto` chooses it.");
        }
        text
    }
}

impl Search<'_> {
    /// Returns why `best` may miss the tolerance.
    pub(super) fn warning(&self, best: &Candidate, tolerance: f64) -> Option<String> {
        if best.measured {
            return None;
        }
        let budget = if self.is_exhausted || self.window.as_ref().is_none_or(|window| *window != (0.0..1.0)) {
            format!(
                " Trials may cost {:.3} s of the reference machine, 5 % of the run that they save or {} s.",
                self.budget, LEAST_BUDGET
            )
        } else {
            String::new()
        };
        let end = self.scene.time.end;
        let how = match &self.window {
            _ if best.predicted_error.is_nan() => None,
            _ if !best.choice.method().facts().is_explicit => {
                Some("by the trend of coarser steps".to_owned())
            }
            Some(window) if *window == (0.0..1.0) => Some("by the trend of other steps".to_owned()),
            Some(window) => {
                Some(format!("from t = {:.3e} to {:.3e} s", window.start * end, window.end * end))
            }
            None => None,
        };
        let mut text = match how {
            None => format!(
                "`auto` could not estimate the error of any step, so the error at the end may exceed {tolerance:.0e}."
            ),
            Some(how) => format!(
                "`auto` did not measure the error at the end but extrapolated it {how}, so {tolerance:.0e} may be \
                 missed."
            ),
        };
        text.push_str(&budget);
        if let Some(growth) = self.growth {
            text.push_str(&format!(
                " Errors grew {growth:.1} times in the second half of that time: faster than a step can be chosen for."
            ));
        }
        if let Some(window) = self.window.as_ref().filter(|window| window.end < 1.0)
            && activity::has_event_after(self.scene, window.end * end)
        {
            text.push_str(" Loads or supports of the scene change later than that.");
        }
        Some(text)
    }
}
