//! The search among explicit schemes: a chain of trials, each more accurate than the previous one, over the whole run
//! or the part of it that the budget allows. The difference of two neighbours is the error of the first.

use std::ops::Range;

use super::Candidate;
use super::activity::first_event;
use super::search::{HIGHER, NoTrial, Search, Stopped, TENTH, seconds_per_step};
use crate::auto::trial::{Choice, Trial};
use crate::scene::SchemeName;

/// Cost of Störmer–Verlet and Blanes–Moan 4 at their limits, relative to Störmer–Verlet alone (1.8/2.8 · 6 forces).
const FIRST_TWO: f64 = 5.0;
/// Cost with Blanes–Moan 6 added, relative to Störmer–Verlet alone.
const FIRST_THREE: f64 = 12.0;
/// The smallest part of a run for trials: 2^−8.
const SMALLEST: u32 = 8;
/// Relative error below which schemes of high order are tried with contact, which they must resolve. They pay below about 2e-5
/// (docs/performance.md, "High order through contact").
const PAYS_IN_CONTACT: f64 = 1e-4;
/// Smallest number of Störmer–Verlet steps in a part.
const LEAST_STEPS: u64 = 16;
/// Largest number of trials of a chain: up to Blanes–Moan 6 with 1/64 of the step at its limit.
const LONGEST: u32 = 9;
/// Ratio of an error to its difference from a solution with at most a quarter of this error.
const FROM_DIFFERENCE: f64 = 4.0 / 3.0;
/// Errors below this decrease with the order of the scheme; larger errors are not extrapolated.
const SMALL: f64 = 0.1;
/// Errors that grow by more than this factor when the time doubles grow faster than t^2.5.
const FAST: f64 = 5.7;
/// A scheme that fails at its limit is tried this often with half the step, because bodies stiffen as they deform. Later trials of the
/// chain then start from as many halvings, so that no two of them are the same run.
const RETRIES: u32 = 3;

struct Solution {
    choice: Choice,
    trial: Trial,
}

impl Search<'_> {
    /// Returns the explicit schemes that reach the target error. `seconds` is the cost of Störmer–Verlet at its
    /// limit.
    pub(super) fn explicit(&mut self, seconds: f64) -> Result<Vec<Candidate>, Stopped> {
        let steps = self.limit(SchemeName::StormerVerlet, 1).steps;
        let Some(size) = self.affordable(seconds, steps) else { return Ok(vec![self.blind(seconds)]) };
        // On a part of the run, errors are also compared at its middle.
        let parts = if size < 1.0 { (2.0 / size) as u64 } else { 1 };
        let mut stretch = 0.0..size;
        let mut chain: Vec<Solution> = Vec::new();
        let pays = self.scene.contact.is_none() || self.aim < PAYS_IN_CONTACT;
        let mut takes_higher = pays && HIGHER.iter().all(|&scheme| self.accepts(scheme, None));
        let mut found = None;
        // Halvings that failed trials required.
        let mut halved = 0;
        for number in 0..LONGEST {
            let mut choice = self.link(number, halved, parts, takes_higher);
            let per_force = chain.last().map(cost_per_force);
            let forces = choice.method().facts().forces_per_step.max(1) as f64;
            let expected = per_force.map_or(0.0, |cost| cost * forces * choice.steps as f64 * size);
            // The size was chosen for the first two, so they fit into the budget.
            if number > 1 && expected > self.left() {
                self.is_exhausted = true;
                break;
            }
            let mut tried = self.trial(choice, stretch.clone(), f64::INFINITY)?;
            if number == 1 && tried.is_err() && choice.scheme == SchemeName::BlanesMoan4 {
                takes_higher = self.cost(choice)?.is_some();
                if !takes_higher {
                    choice = self.link(number, halved, parts, false);
                    tried = self.trial(choice, stretch.clone(), f64::INFINITY)?;
                }
            }
            for _ in 0..RETRIES {
                if !matches!(tried, Err(NoTrial::Failed)) {
                    break;
                }
                choice.steps *= 2;
                halved += 1;
                tried = self.trial(choice, stretch.clone(), f64::INFINITY)?;
            }
            let Ok(trial) = tried else { break };
            if number == 0 && size < 1.0 && self.norm.error(&trial.middle, &trial.end) == 0.0 {
                // Nothing moves before the first event, so the trial starts there.
                if let Some(begin) = first_event(self.scene).map(|t| t / self.scene.time.end) {
                    let begin = ((begin / size * 2.0).floor() / 2.0 * size).min(1.0 - size);
                    stretch = begin..begin + size;
                    let Ok(trial) = self.trial(choice, stretch.clone(), f64::INFINITY)? else { break };
                    chain.push(Solution { choice, trial });
                    continue;
                }
            }
            chain.push(Solution { choice, trial });
            if let [.., before, last] = &chain[..] {
                let error =
                    FROM_DIFFERENCE * self.error(before, last, &stretch) + self.missed(&before.choice);
                if error <= self.aim {
                    found = Some((chain.len() - 2, error));
                    break;
                }
            }
        }
        self.window = Some(stretch.clone());
        self.predict(&chain, &stretch);
        match found {
            Some((number, error)) => self.cheapest(&chain, number, error, &stretch),
            None => Ok(self.unreached(&chain, seconds, &stretch)),
        }
    }

    /// Returns the part of the run on which the schemes can be compared: 1 or a power of ½.
    fn affordable(&self, seconds: f64, steps: u64) -> Option<f64> {
        if FIRST_TWO * seconds <= self.left() {
            return Some(1.0);
        }
        let sizes = (1..=SMALLEST).map(|halved| 0.5_f64.powi(halved as i32));
        let mut sizes = sizes.filter(|size| (steps as f64 * size) as u64 >= LEAST_STEPS);
        sizes.find(|size| FIRST_THREE * seconds * size <= self.left())
    }

    /// Returns trial number 0, 1, … of the chain, with its step halved `halved` times.
    fn link(&self, number: u32, halved: u32, parts: u64, takes_higher: bool) -> Choice {
        let (scheme, more) = match number {
            0 => (SchemeName::StormerVerlet, 0),
            number if !takes_higher => (SchemeName::StormerVerlet, number),
            1 => (SchemeName::BlanesMoan4, 0),
            number => (SchemeName::BlanesMoan6, number - 2),
        };
        let choice = self.limit(scheme, parts);
        Choice { steps: choice.steps << (halved + more), ..choice }
    }

    /// Returns the relative error of a solution at the end of the run, compared with a much more accurate one.
    fn error(&mut self, solution: &Solution, exact: &Solution, stretch: &Range<f64>) -> f64 {
        let end = self.norm.error(&solution.trial.end, &exact.trial.end);
        if *stretch == (0.0..1.0) {
            return end;
        }
        let growth = end / self.norm.error(&solution.trial.middle, &exact.trial.middle);
        self.growth = (growth > FAST).then_some(growth);
        // With symplectic schemes errors grow as t; from rest, or in a fall, at most as t².
        let power = if growth.is_finite() { growth.log2().clamp(1.0, 2.0) } else { 1.0 };
        let longer = (1.0 - stretch.start) / (stretch.end - stretch.start);
        end * longer.powf(power)
    }

    /// Returns the solution that reaches the target error, and all cheaper ones that also reach it.
    fn cheapest(
        &mut self,
        chain: &[Solution],
        number: usize,
        error: f64,
        stretch: &Range<f64>,
    ) -> Result<Vec<Candidate>, Stopped> {
        let is_whole = *stretch == (0.0..1.0);
        let candidate = |solution: &Solution, error| {
            Candidate::new(solution.choice, seconds_per_step(&solution.trial), error, is_whole)
        };
        let mut found = vec![candidate(&chain[number], error)];
        let Some(exact) = chain.last() else { return Ok(found) };
        for coarse in &chain[..number] {
            let cheapest = found.iter().map(|c| c.predicted_seconds).fold(f64::INFINITY, f64::min);
            let error = self.error(coarse, exact, stretch);
            let finer = finer(coarse.choice, error, self.aim);
            let seconds = seconds_per_step(&coarse.trial) * finer.steps as f64;
            let tried = seconds * (stretch.end - stretch.start);
            // A trial that costs more than it saves is omitted.
            if seconds + tried > cheapest || tried > self.left() {
                continue;
            }
            if let Ok(trial) = self.trial(finer, stretch.clone(), f64::INFINITY)? {
                let solution = Solution { choice: finer, trial };
                let error = self.error(&solution, exact, stretch) + self.missed(&finer);
                if error <= self.aim {
                    found.push(candidate(&solution, error));
                }
            }
        }
        Ok(found)
    }

    /// Predicts the steps with which the schemes of a chain would reach a tenth of the target error.
    fn predict(&mut self, chain: &[Solution], stretch: &Range<f64>) {
        let [coarser @ .., exact] = chain else { return };
        for solution in coarser {
            let error = FROM_DIFFERENCE * self.error(solution, exact, stretch);
            if error.is_nan() || error > SMALL {
                continue;
            }
            let choice = finer(solution.choice, error, TENTH * self.aim);
            let halved = choice.steps as f64 / solution.choice.steps as f64;
            let error = error / halved.powf(choice.method().facts().order as f64);
            if error <= TENTH * self.aim {
                self.tenth.push(Candidate::new(choice, seconds_per_step(&solution.trial), error, false));
            }
        }
    }

    /// Returns candidates when no trial reached the target within the budget, extrapolated by the orders of the
    /// schemes.
    fn unreached(&mut self, chain: &[Solution], seconds: f64, stretch: &Range<f64>) -> Vec<Candidate> {
        let [coarser @ .., exact] = chain else { return vec![self.blind(seconds)] };
        if coarser.is_empty() {
            return vec![self.blind(seconds)];
        }
        let mut found = Vec::new();
        for solution in coarser {
            let error = FROM_DIFFERENCE * self.error(solution, exact, stretch);
            if error.is_nan() || error > SMALL {
                continue;
            }
            let choice = finer(solution.choice, error, self.aim);
            let finer = choice.steps as f64 / solution.choice.steps as f64;
            let error = error / finer.powf(choice.method().facts().order as f64);
            found.push(Candidate::new(choice, seconds_per_step(&solution.trial), error, false));
        }
        if found.is_empty() {
            // The most accurate solution is added; its error is unknown.
            found.push(Candidate::new(exact.choice, seconds_per_step(&exact.trial), f64::NAN, false));
        }
        found
    }

    /// Returns Störmer–Verlet at its limit, with an unknown error.
    fn blind(&mut self, seconds: f64) -> Candidate {
        self.is_exhausted = true;
        let choice = self.limit(SchemeName::StormerVerlet, 1);
        Candidate::new(choice, seconds / choice.steps as f64, f64::NAN, false)
    }
}

/// Returns the step with which a scheme with this error should reach the error `aim`, by its order.
fn finer(choice: Choice, error: f64, aim: f64) -> Choice {
    let order = choice.method().facts().order as f64;
    let finer = (error / (0.8 * aim)).powf(1.0 / order).clamp(1.0, 1e3);
    let parts = choice.steps & choice.steps.wrapping_neg();
    let steps = (choice.steps as f64 * finer).ceil() as u64;
    Choice { steps: steps.next_multiple_of(parts.min(512)), ..choice }
}

fn cost_per_force(solution: &Solution) -> f64 {
    let forces = solution.choice.method().facts().forces_per_step.max(1) as f64;
    seconds_per_step(&solution.trial) / forces
}
