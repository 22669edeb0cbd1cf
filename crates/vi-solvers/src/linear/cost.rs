//! The costs of the parts of a step in fixed units: seconds of one reference core, from counts of flops and bytes.
//! They are never measured with a clock, so that equal runs give bitwise equal results.

use vi_core::{HessianKind, SolverFacts, System, packed_len};

use crate::linear::factor::FactorFacts;
use crate::work::Work;

/// Seconds of the reference core for one entry of a local gradient, and of a local Hessian.
const GRADIENT_ENTRY: f64 = 2.0e-9;
const HESSIAN_ENTRY: f64 = 1.8e-9;
/// Flops per second of a factorisation, and bytes per second of a solve.
const FACTOR_RATE: f64 = 25e9;
const SOLVE_RATE: f64 = 8e9;
/// Bytes per second of conjugate gradients (P1 n16, one thread: 14 GB/s, and 16 GB/s for a solve with a factor).
const GRADIENTS_RATE: f64 = SOLVE_RATE / 1.1;

/// Seconds of the reference core for the force of a pair of live terms with its share of the equations of the pairs, and for a check
/// of the path of a candidate. Explicit steps with contact, one thread (EPYC, 2026): dominoes 2.6 s for 621 903 forces and 563 421
/// checks, 40 × 40 cloth on a sphere 5.4 s for 472 175 and 3 576 590, folding flag 12.4 s for 1 858 684 and 5 510 834.
const PAIR_FORCE: f64 = 4e-6;
const PATH_CHECK: f64 = 0.6e-6;
/// Seconds of the reference core for a search of stencils, per triangle of the surfaces: 2.7 µs with the cloth on the sphere, 9 µs with
/// the slender cells of `scenes/contact/bar-drop.toml`.
const SEARCH_PART: f64 = 4e-6;
/// Seconds of the reference core for one call, however small the system.
const CALL: f64 = 1e-6;

/// Returns the seconds that the reference core needs for a solve with a factor.
pub(crate) fn substitution(facts: &FactorFacts) -> f64 {
    facts.solve_bytes / SOLVE_RATE
}

/// Returns the seconds that the reference core needs for an iteration of conjugate gradients.
pub(crate) fn iteration(facts: &SolverFacts) -> f64 {
    facts.iteration_bytes / GRADIENTS_RATE
}

/// Returns the seconds that the reference core needs for a factorisation.
pub(crate) fn factorization(facts: &FactorFacts) -> f64 {
    facts.flops / FACTOR_RATE
}

/// Returns the seconds that the reference core needs to prepare conjugate gradients for a matrix.
pub(crate) fn preparation(facts: &SolverFacts) -> f64 {
    facts.prepare_bytes / GRADIENTS_RATE + facts.coarse_flops / FACTOR_RATE
}

/// Costs of the parts of a step in seconds of one core of the reference machine. They are counted and are the same on
/// every machine.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct UnitCosts {
    /// Cost of ∂V/∂x of the system.
    pub gradient: f64,
    /// Cost of ∂²V/∂x² of the system.
    pub hessian: f64,
    /// Cost of a factor of M + cK, or of its preconditioner.
    pub factor: f64,
    /// Cost of a solve.
    pub solve: f64,
}

impl UnitCosts {
    /// Returns the costs of schemes that solve no equations.
    pub fn explicit(system: &System) -> Self {
        Self::new(system, &FactorFacts::default())
    }

    /// Returns the cost of `work` in seconds of the reference core. An energy counts as a gradient.
    pub fn seconds(&self, work: &Work) -> f64 {
        CALL * (work.gradients + work.energies + work.solves) as f64
            + self.gradient * (work.gradients + work.energies) as f64
            + self.hessian * work.hessians as f64
            + self.factor * work.factorizations as f64
            + self.solve * work.solves as f64
    }

    /// Returns the cost of the live terms in `work`, in seconds of the reference core, if their surfaces have this number of
    /// triangles. [`UnitCosts::seconds`] does not contain it.
    pub fn live_seconds(work: &Work, triangle_count: usize) -> f64 {
        PAIR_FORCE * work.pair_forces as f64
            + PATH_CHECK * work.path_checks as f64
            + SEARCH_PART * (work.searches * triangle_count as u64) as f64
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
        let (factor, solve) = (factorization(facts), substitution(facts));
        Self { gradient, hessian, factor, solve }
    }

    /// Returns the cost of a new factor, as a number of iterations with the old one.
    pub(crate) fn refactor(&self) -> f64 {
        let iteration = self.gradient + self.solve;
        if iteration > 0.0 { (self.hessian + self.factor) / iteration } else { 1.0 }
    }
}
