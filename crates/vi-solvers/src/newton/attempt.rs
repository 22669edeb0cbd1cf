//! The course of one attempt to solve the equations of a step: what has been tried, and how fast it converged.

use crate::newton::inverse::Reason;
use crate::newton::start::Start;

/// Smaller tolerances mean "to round-off".
pub(super) const ROUND_OFF: f64 = 1e-12;

/// Returns the error of a correction with this energy (J), relative to `scale` (J). An energy may be negative: if the factor is older
/// than the iterate, so are parts of the model, such as the directions of constraints.
pub(crate) fn relative_error(energy: f64, scale: f64) -> f64 {
    if energy == 0.0 { 0.0 } else { (energy.abs() / scale).sqrt() }
}

/// If the first estimate of the error is below this fraction of the tolerance, no second iteration is made.
const FIRST: f64 = 0.1;

/// Returns whether the error after a correction of size `eta` is within the tolerance. For a linear contraction θ, the
/// remaining corrections sum to at most θ/(1 − θ) · `eta`.
pub(crate) fn is_within(tolerance: f64, eta: f64, contraction: Option<f64>) -> bool {
    match contraction {
        Some(theta) if theta < 1.0 => theta / (1.0 - theta) * eta <= tolerance,
        _ => eta <= FIRST * tolerance,
    }
}

/// Ratio of errors below which the last factor was worth its cost. In a stiff band by Gauss collocation (h = 20 ms)
/// each factor reduces the error to a sixtieth. The run took 9.3 instead of 2.7 s while the third factor of a step was
/// replaced by a descent from the start.
const GAIN: f64 = 0.1;

/// A converged solve.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Solved {
    pub(crate) iterations: u32,
}

/// The result of the cheap iteration.
pub(super) enum Course {
    Solved(Solved),
    /// No convergence after this number of iterations.
    Stuck(u32),
}

/// The course of one solve.
pub(super) struct Attempt {
    pub(super) to_round_off: bool,
    pub(super) wanted: Option<Reason>,
    /// Number of requests for a new factor without such a gain since the one before.
    pub(super) troubles: u32,
    /// Smallest error at which a new factor was requested.
    least_at_trouble: Option<f64>,
    pub(super) restarts: u32,
    /// Whether the current factor was made in this solve.
    pub(super) is_renewed: bool,
    /// Number of iterations with the current factor.
    pub(super) with_factor: u64,
    pub(super) first_eta: f64,
    pub(super) last_eta: Option<f64>,
    /// The iteration with the current factor from which the mean contraction counts, and its error.
    settled: (u64, f64),
}

impl Attempt {
    pub(super) fn new(to_round_off: bool) -> Self {
        Self {
            to_round_off,
            wanted: None,
            troubles: 0,
            least_at_trouble: None,
            restarts: 0,
            is_renewed: false,
            with_factor: 0,
            first_eta: 0.0,
            last_eta: None,
            settled: (0, 0.0),
        }
    }

    /// Returns an attempt that begins with a factor made at its start.
    pub(super) fn with_new_factor(tolerance: f64) -> Self {
        Self { wanted: Some(Reason::Newton), ..Self::new(tolerance <= ROUND_OFF) }
    }

    pub(super) fn renew(&mut self) {
        self.is_renewed = true;
        self.restart();
    }

    /// Forgets the contraction so far.
    pub(super) fn restart(&mut self) {
        self.with_factor = 0;
        self.last_eta = None;
    }

    /// Asks for a new factor. This counts as a trouble unless the error has become much smaller since the last one.
    pub(super) fn escalate(&mut self, reason: Reason) {
        let now = self.last_eta.unwrap_or(f64::INFINITY);
        let gains = self.least_at_trouble.is_some_and(|least| now < GAIN * least);
        self.troubles += u32::from(!gains);
        self.least_at_trouble = Some(self.least_at_trouble.map_or(now, |least| least.min(now)));
        self.wanted = Some(reason);
        self.last_eta = None;
    }

    pub(super) fn safer_start(&mut self) -> Start {
        self.restarts += 1;
        match self.restarts {
            1 => Start::Stiff,
            2 => Start::Inertial,
            _ => Start::Still,
        }
    }

    /// Records the error of an iteration; returns its ratio to the previous one. The ratios of the first `transient` iterations with a
    /// factor say little about it.
    pub(super) fn record(&mut self, eta: f64, transient: u64) -> Option<f64> {
        let contraction = self.last_eta.map(|last| eta / last);
        if self.last_eta.is_none() {
            self.first_eta = eta;
        }
        if self.with_factor <= 1 + transient {
            self.settled = (self.with_factor, eta);
        }
        self.last_eta = Some(eta);
        contraction
    }

    /// Returns the mean ratio of errors since the factor was made or the step began, without the first ones if they say little.
    pub(super) fn mean_contraction(&self) -> Option<f64> {
        let (since, eta) = self.settled;
        let steps = self.with_factor.checked_sub(since).filter(|&steps| steps > 0)?;
        let ratio = self.last_eta? / eta;
        (ratio > 0.0).then(|| ratio.powf(1.0 / steps as f64))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Factors that reduce the error to less than a tenth are no trouble, however many there are; others are.
    #[test]
    fn only_factors_without_a_gain_count_as_troubles() {
        let mut attempt = Attempt::new(false);
        let mut troubles = |eta: f64| {
            attempt.record(eta, 0);
            attempt.escalate(Reason::Slow);
            attempt.troubles
        };
        let counts = [16.0, 1.0, 0.05, 4e-3, 1e-3, 2.0, 3e-4, 2e-5].map(&mut troubles);
        assert_eq!(counts, [1, 1, 1, 1, 2, 3, 4, 4]);
    }
}
