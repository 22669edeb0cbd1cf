//! The search among implicit schemes: ladders of whole runs with halved steps. The difference of two rungs is the
//! measured error of the coarser one.

use super::Candidate;
use super::search::{COARSEST, FINEST, IMPLICIT, NoTrial, Search, Stopped, TENTH};
use crate::auto::trial::{Choice, Norm, Trial};

/// Smallest order that counts as convergence.
const LEAST_ORDER: f64 = 0.8;
/// Order assumed beyond the finest rung. For stiff and suddenly loaded bodies, the order decreases to about this
/// value, whatever the order of the scheme (measured: 1.6 to 2.6 for Gauss with 2 and 3 stages).
const RELIABLE_ORDER: f64 = 2.0;
/// Largest factor by which an extrapolated step may be finer than the finest measured one.
const REACH: f64 = 16.0;

/// Trials of one scheme with halved steps.
struct Ladder {
    /// The next choice.
    choice: Choice,
    rungs: Vec<Rung>,
    over: bool,
}

struct Rung {
    choice: Choice,
    end: Vec<Vec<f64>>,
    seconds: f64,
    /// Relative difference from the previous rung.
    difference: f64,
    /// Relative error at kinks of functions of time.
    missed: f64,
}

impl Search<'_> {
    /// Returns the implicit schemes that reach the target error, from trials of at most `allowed` seconds.
    pub(super) fn implicit(&mut self, allowed: f64) -> Result<Vec<Candidate>, Stopped> {
        let ladder = |(scheme, stages)| Ladder {
            choice: Choice { scheme, stages, steps: self.coarsest },
            rungs: Vec::new(),
            over: false,
        };
        let schemes = IMPLICIT.into_iter().filter(|&(scheme, stages)| self.accepts(scheme, stages));
        let mut ladders: Vec<Ladder> = schemes.map(ladder).collect();
        if ladders.is_empty() {
            return Ok(Vec::new());
        }
        let begin = self.spent();
        // Two steps show whether a ladder could fit into the budget.
        let probe = self.trial(ladders[0].choice, 0.0..2.0 / COARSEST as f64, 0.1 * allowed)?;
        if matches!(&probe, Err(NoTrial::OutOfBudget)) {
            return Ok(Vec::new());
        }
        let mut found: Vec<Candidate> = Vec::new();
        loop {
            let cheapest = found.iter().map(|c| c.predicted_seconds).fold(f64::INFINITY, f64::min);
            let left = allowed - (self.spent() - begin);
            let first = ladders[0].rungs.first().map_or(0.0, |rung| rung.seconds);
            let next = ladders
                .iter_mut()
                .filter(|ladder| !ladder.over && ladder.next_seconds(first) < left.min(cheapest))
                .min_by(|a, b| a.next_seconds(first).total_cmp(&b.next_seconds(first)));
            let Some(ladder) = next else { break };
            match self.trial(ladder.choice, 0.0..1.0, left.min(2.0 * cheapest))? {
                Ok(trial) => {
                    ladder.enter(trial, self);
                    if let Some(candidate) = ladder.measured(self.aim) {
                        found.push(candidate);
                        ladder.over = true;
                    }
                }
                // A finer step may succeed after a coarse one failed.
                Err(NoTrial::Failed) if ladder.rungs.is_empty() => {}
                Err(_) => ladder.over = true,
            }
            ladder.choice.steps *= 2;
            ladder.over |= ladder.choice.steps > FINEST;
        }
        let finest: Vec<&Rung> = ladders.iter().filter_map(|ladder| ladder.rungs.last()).collect();
        found.retain(|candidate| is_confirmed(candidate, &finest, &self.norm, &ladders, self.aim));
        for ladder in &ladders {
            let own = ladder.measured(self.aim);
            if own.is_none_or(|own| found.iter().any(|confirmed| confirmed.choice == own.choice)) {
                self.tenth.extend(ladder.predicted(TENTH * self.aim));
            }
        }
        if found.is_empty() {
            found.extend(ladders.iter().filter_map(|ladder| ladder.extrapolated(self.aim)));
            let rungs = ladders.iter().flat_map(|ladder| &ladder.rungs);
            let nearest = rungs.min_by(|a, b| a.difference.total_cmp(&b.difference));
            self.nearest = nearest.map(|rung| {
                Candidate::new(rung.choice, rung.seconds / rung.choice.steps as f64, f64::NAN, false)
            });
        }
        Ok(found)
    }
}

/// Checks that the most accurate rung of all ladders agrees with a candidate.
fn is_confirmed(candidate: &Candidate, finest: &[&Rung], norm: &Norm, ladders: &[Ladder], aim: f64) -> bool {
    let own = ladders.iter().flat_map(|ladder| &ladder.rungs).find(|rung| rung.choice == candidate.choice);
    let best = finest.iter().min_by(|a, b| a.difference.total_cmp(&b.difference));
    let (Some(own), Some(best)) = (own, best) else { return false };
    norm.error(&own.end, &best.end) <= aim + best.difference.min(aim)
}

impl Ladder {
    /// Returns the expected cost of the next trial, s, if the first one of implicit midpoint cost `first`. The first trial of
    /// Gauss with 2 stages costs 6.5 to 7.5 times as much on a steel bracket of 11 632 tetrahedra.
    fn next_seconds(&self, first: f64) -> f64 {
        match (self.rungs.last(), self.choice.stages) {
            (Some(rung), _) => 2.0 * rung.seconds,
            (None, Some(stages)) => first * (stages as f64).powi(3),
            (None, None) => 0.0,
        }
    }

    fn enter(&mut self, trial: Trial, search: &Search<'_>) {
        let norm = &search.norm;
        let coarser = self.rungs.last();
        let difference = coarser.map_or(f64::INFINITY, |coarser| norm.error(&coarser.end, &trial.end));
        let (choice, seconds, missed) = (self.choice, trial.counted_seconds, search.missed(&self.choice));
        self.rungs.push(Rung { choice, end: trial.end, seconds, difference, missed });
    }

    /// Returns the order of the last two differences, at most that of the scheme.
    fn order(&self) -> Option<f64> {
        let [.., coarse, fine] = &self.rungs[..] else { return None };
        if fine.difference == 0.0 {
            return Some(RELIABLE_ORDER);
        }
        let order = (coarse.difference / fine.difference).log2();
        let is_shown = order.is_finite() && order >= LEAST_ORDER;
        is_shown.then(|| order.min(self.choice.method().facts().order as f64))
    }

    /// Returns the coarsest of the last two rungs that reaches `aim`, once three rungs show an order. Only measured
    /// steps are considered: steps between them may resolve the events of the scene less well.
    fn measured(&self, aim: f64) -> Option<Candidate> {
        let order = self.order()?;
        let [.., coarse, fine] = &self.rungs[..] else { return None };
        let gain = 2.0_f64.powf(order);
        let reliable = 2.0_f64.powf(order.min(RELIABLE_ORDER));
        let errors =
            [(coarse, fine.difference * gain / (gain - 1.0)), (fine, fine.difference / (reliable - 1.0))];
        let errors = errors.map(|(rung, error)| (rung, error + rung.missed));
        let (rung, error) = errors.into_iter().find(|(_, error)| *error <= aim)?;
        Some(Candidate::new(rung.choice, rung.seconds / rung.choice.steps as f64, error, true))
    }

    /// Returns the first rung, also beyond the measured ones, that reaches `aim` if the order of the last rungs
    /// continues.
    fn predicted(&self, aim: f64) -> Option<Candidate> {
        if let Some(candidate) = self.measured(aim) {
            return Some(candidate);
        }
        let order = self.order()?;
        let fine = self.rungs.last()?;
        let error = fine.difference / (2.0_f64.powf(order.min(RELIABLE_ORDER)) - 1.0);
        let halvings = ((error / aim).log2() / order).ceil().max(0.0);
        if halvings.is_nan() || halvings > REACH.log2() {
            return None;
        }
        let choice = Choice { steps: fine.choice.steps << halvings as u32, ..fine.choice };
        let error = error / 2.0_f64.powf(halvings * order);
        Some(Candidate::new(choice, fine.seconds / fine.choice.steps as f64, error, false))
    }

    /// Returns finer steps that reach `aim` if the order of three rungs continues.
    fn extrapolated(&self, aim: f64) -> Option<Candidate> {
        let order = self.order()?.min(RELIABLE_ORDER);
        let fine = self.rungs.last()?;
        let error = fine.difference / (2.0_f64.powf(order) - 1.0);
        let finer = (error / aim).powf(1.0 / order).max(1.0);
        if finer.is_nan() || finer > REACH {
            return None;
        }
        let steps = (fine.choice.steps as f64 * finer).ceil() as u64;
        let choice = Choice { steps, ..fine.choice };
        let error = error / finer.powf(order);
        Some(Candidate::new(choice, fine.seconds / fine.choice.steps as f64, error, false))
    }
}
