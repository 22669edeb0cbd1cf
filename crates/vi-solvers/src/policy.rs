//! When a new factor pays. Costs are counted in fixed units (seconds of one reference core, from
//! counts of flops and bytes), never measured with a clock, so that equal runs are equal to the bit.
//! It must not know how factors are made.

use vi_core::{HessianKind, System, packed_len};

use crate::newton::Start;
use crate::{FactorFacts, SolverError, StepperMemory, Work};

/// Seconds of the reference core for one entry of a local gradient, and of a local Hessian.
const GRADIENT_ENTRY: f64 = 2.0e-9;
const HESSIAN_ENTRY: f64 = 1.8e-9;
/// Flops a second of a factorisation, bytes a second of a solve.
const FACTOR_RATE: f64 = 25e9;
const SOLVE_RATE: f64 = 8e9;

/// Seconds of the reference core for a call, however small its system.
const CALL: f64 = 1e-6;

/// A better contraction than this is not relied on before it has been seen in the step itself.
const LEAST_CONTRACTION: f64 = 0.05;

/// Seconds of the reference core to move so many bytes through sparse or triangular products.
pub(crate) fn bytes(count: f64) -> f64 {
    count / SOLVE_RATE
}

/// Costs of the pieces of a step, s of one core of the reference machine: counted, the same everywhere.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct UnitCosts {
    /// ∂V/∂x of the system.
    pub gradient: f64,
    /// ∂²V/∂x² of the system.
    pub hessian: f64,
    /// A factor of M + cK, or its preconditioner.
    pub factor: f64,
    /// A solve.
    pub solve: f64,
}

impl UnitCosts {
    /// The costs of schemes that solve nothing.
    pub fn explicit(system: &System) -> Self {
        Self::new(system, &FactorFacts::default())
    }

    /// What `work` costs, s of the reference core. An energy counts as a gradient.
    pub fn seconds(&self, work: &Work) -> f64 {
        CALL * (work.gradients + work.energies + work.solves) as f64
            + self.gradient * (work.gradients + work.energies) as f64
            + self.hessian * work.hessians as f64
            + self.factor * work.factorizations as f64
            + self.solve * work.solves as f64
    }

    pub(crate) fn new(system: &System, facts: &FactorFacts) -> Self {
        let (mut gradient, mut hessian) = (0.0, 0.0);
        for term in system.potentials() {
            let stencils = term.stencils();
            let (count, size) = (stencils.count() as f64, stencils.size());
            let kind = term.traits().hessian;
            if kind != HessianKind::Zero {
                gradient += GRADIENT_ENTRY * count * size as f64;
            }
            if kind == HessianKind::Varying {
                hessian += HESSIAN_ENTRY * count * packed_len(size) as f64;
            }
        }
        let (factor, solve) = (facts.flops / FACTOR_RATE, facts.solve_bytes / SOLVE_RATE);
        Self { gradient, hessian, factor, solve }
    }

    /// Cost of a new factor in iterations with the old one.
    fn refactor(&self) -> f64 {
        let iteration = self.gradient + self.solve;
        if iteration > 0.0 { (self.hessian + self.factor) / iteration } else { 1.0 }
    }
}

/// Iterations a step above which steps are hard.
const HARD: f64 = 4.0;

/// Weight of the past in the mean of recent iterations.
const FADING: f64 = 0.7;

/// The history of a factor in iterations.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Policy {
    /// Steps with this factor.
    age: u64,
    /// Iterations with it in all.
    total: u64,
    /// Iterations a step of late: a mean in which a step counts `FADING` times the one after it, so that
    /// one dear step is no verdict.
    recent: f64,
    /// Iterations of a step with a new factor.
    fresh: u64,
    /// Mean contraction of the last step.
    contraction: f64,
    /// Where a step begins: where the last doubtful one began best.
    pub(crate) start: Start,
    /// Did the last step need full Newton steps?
    pub(crate) has_descended: bool,
}

impl Default for Policy {
    fn default() -> Self {
        Self {
            age: 0,
            total: 0,
            recent: 0.0,
            fresh: 0,
            contraction: 0.0,
            start: Start::Predicted,
            has_descended: false,
        }
    }
}

impl Policy {
    /// A new factor before the next step, as the classic rule of replacement: its next step costs
    /// more than the average of its life, the price of a new one included.
    pub(crate) fn is_stale(&self, costs: &UnitCosts) -> bool {
        self.age > 0 && self.recent > (costs.refactor() + self.total as f64) / self.age as f64
    }

    /// A new factor inside a step that has made `iterations` and foresees `remaining` more?
    pub(crate) fn is_slow(&self, costs: &UnitCosts, iterations: u64, remaining: f64) -> bool {
        iterations as f64 + remaining > self.fresh.max(2) as f64 + costs.refactor() + 2.0
    }

    /// Did steps take many iterations of late? Then it pays to compare where they begin.
    pub(crate) fn is_hard(&self) -> bool {
        self.has_descended || self.recent > HARD
    }

    /// The contraction to expect of the first iteration of a step: that of the last step, if its factor
    /// was already an old one; what a factor does where it was made says nothing of where it will be used.
    pub(crate) fn expected_contraction(&self) -> Option<f64> {
        (self.age > 1 && self.contraction > 0.0).then(|| self.contraction.max(LEAST_CONTRACTION))
    }

    /// A factor was made.
    pub(crate) fn renew(&mut self) {
        *self = Self { fresh: self.fresh, start: self.start, ..Self::default() };
    }

    /// A step has ended that made `iterations` with the current factor.
    pub(crate) fn enter(&mut self, iterations: u64, contraction: Option<f64>) {
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

    pub(crate) fn remember(&self, memory: &mut StepperMemory) {
        let Self { age, total, recent, fresh, contraction, start, has_descended } = *self;
        let contraction = contraction.to_bits();
        let recent = recent.to_bits();
        let counts = [age, total, recent, fresh, contraction, start.number(), u64::from(has_descended)];
        for (name, value) in NAMES.into_iter().zip(counts) {
            memory.counts.push((name.to_owned(), value));
        }
    }

    pub(crate) fn from_memory(memory: &StepperMemory) -> Result<Self, SolverError> {
        let [age, total, recent, fresh, contraction, start, descended] = NAMES.map(|name| memory.count(name));
        let contraction = f64::from_bits(contraction?);
        let start = Start::from_number(start?).ok_or(SolverError::Memory { missing: "policy.start" })?;
        let recent = f64::from_bits(recent?);
        let has_descended = descended? == 1;
        Ok(Self { age: age?, total: total?, recent, fresh: fresh?, contraction, start, has_descended })
    }
}

const NAMES: [&str; 7] = [
    "policy.age",
    "policy.total",
    "policy.recent_bits",
    "policy.fresh",
    "policy.contraction_bits",
    "policy.start",
    "policy.descended",
];
