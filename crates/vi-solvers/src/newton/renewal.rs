//! Decides when a new factor costs less than it saves, from the iterations made with a factor and the cost of a new
//! one.

use crate::error::SolverError;
use crate::linear::cost::UnitCosts;
use crate::memory::StepperMemory;
use crate::newton::start::Start;

/// Smallest contraction that is assumed before it has been observed in the step itself.
pub(super) const LEAST_CONTRACTION: f64 = 0.05;

/// Number of iterations per step above which steps count as hard.
const HARD: f64 = 4.0;

/// Weight of the past in the mean of recent iterations.
const FADING: f64 = 0.7;

/// The iterations made with a factor.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Renewal {
    /// Number of steps with this factor.
    age: u64,
    /// Total number of iterations with it.
    total: u64,
    /// Recent mean of iterations per step, in which each step has `FADING` times the weight of the next, so that a
    /// single expensive step does not decide.
    recent: f64,
    /// Number of iterations of a step with a new factor.
    fresh: u64,
    /// Mean contraction of the last step.
    contraction: f64,
    /// The kind of initial guess for a step: the best one in the last comparison.
    pub(crate) start: Start,
    /// Whether the last step needed full Newton steps.
    pub(crate) has_descended: bool,
    /// Whether the last step near pairs was solved by way of lagged friction.
    pub(crate) has_lagged: bool,
}

impl Default for Renewal {
    fn default() -> Self {
        Self {
            age: 0,
            total: 0,
            recent: 0.0,
            fresh: 0,
            contraction: 0.0,
            start: Start::Predicted,
            has_descended: false,
            has_lagged: false,
        }
    }
}

impl Renewal {
    /// Returns whether to make a new factor before the next step, by the classic rule of replacement: the next step
    /// would cost more than the average over the factor's life, including the cost of a new one.
    pub(crate) fn is_stale(&self, costs: &UnitCosts) -> bool {
        self.age > 0 && self.recent > (costs.refactor() + self.total as f64) / self.age as f64
    }

    /// Returns whether to make a new factor inside a step that has made `iterations` and expects `remaining` more.
    pub(crate) fn is_slow(&self, costs: &UnitCosts, iterations: u64, remaining: f64) -> bool {
        iterations as f64 + remaining > self.fresh.max(2) as f64 + costs.refactor() + 2.0
    }

    /// Returns whether recent steps took many iterations. Then a comparison of starts costs less than it saves.
    pub(crate) fn is_hard(&self) -> bool {
        self.has_descended || self.recent > HARD
    }

    /// Returns the contraction to expect of the first iteration of a step: that of the last step, if its factor was
    /// already an old one. The contraction near the configuration of a factor does not predict the one elsewhere.
    pub(crate) fn expected_contraction(&self) -> Option<f64> {
        (self.age > 1 && self.contraction > 0.0).then(|| self.contraction.max(LEAST_CONTRACTION))
    }

    /// Records that a factor was made.
    pub(crate) fn renew(&mut self) {
        *self = Self { fresh: self.fresh, start: self.start, has_lagged: self.has_lagged, ..Self::default() };
    }

    /// Records the end of a step that made `iterations` with the current factor.
    pub(crate) fn record(&mut self, iterations: u64, contraction: Option<f64>) {
        self.has_descended = false;
        if self.age == 0 {
            self.fresh = iterations;
        }
        self.age += 1;
        self.total += iterations;
        self.recent = match self.age {
            1 => iterations as f64,
            _ => FADING * self.recent + (1.0 - FADING) * iterations as f64,
        };
        if let Some(contraction) = contraction {
            self.contraction = contraction;
        }
    }

    pub(crate) fn save(&self, memory: &mut StepperMemory) {
        let Self { age, total, recent, fresh, contraction, start, has_descended, has_lagged } = *self;
        let contraction = contraction.to_bits();
        let recent = recent.to_bits();
        let counts = [
            age,
            total,
            recent,
            fresh,
            contraction,
            start.number(),
            u64::from(has_descended),
            u64::from(has_lagged),
        ];
        for (name, value) in NAMES.into_iter().zip(counts) {
            memory.counts.push((name.to_owned(), value));
        }
    }

    pub(crate) fn restore(memory: &StepperMemory) -> Result<Self, SolverError> {
        let [age, total, recent, fresh, contraction, start, descended, lagged] =
            NAMES.map(|name| memory.count(name));
        let contraction = f64::from_bits(contraction?);
        let start = Start::from_number(start?).ok_or(SolverError::Memory { missing: "policy.start" })?;
        let recent = f64::from_bits(recent?);
        let has_descended = descended? == 1;
        Ok(Self {
            age: age?,
            total: total?,
            recent,
            fresh: fresh?,
            contraction,
            start,
            has_descended,
            has_lagged: lagged? == 1,
        })
    }
}

const NAMES: [&str; 8] = [
    "policy.age",
    "policy.total",
    "policy.recent_bits",
    "policy.fresh",
    "policy.contraction_bits",
    "policy.start",
    "policy.descended",
    "policy.lagged",
];
