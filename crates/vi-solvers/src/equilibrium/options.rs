//! How equilibria are searched for, and what a search reports.

use crate::error::SolverError;
use crate::work::Work;

/// How equilibria are searched for.
#[derive(Debug, Clone, PartialEq)]
pub struct StaticOptions {
    /// Load factor (time) to end at.
    pub end: f64,
    /// First increment of the load factor.
    pub increment: f64,
    /// Increments grow to this at most.
    pub largest_increment: f64,
    /// A solve that fails at increments this small has failed.
    pub smallest_increment: f64,
    /// Relative tolerance in the energy norm, √(rᵀK⁻¹r / largest first decrement).
    pub tolerance: f64,
    /// Newton iterations after which an increment is halved.
    pub max_iterations: u32,
    /// Follow the path of equilibria by its arc length, through limit points, in at most so many steps. The first
    /// and the longest of them are those of `increment` and `largest_increment` where the body responds as at the
    /// start.
    pub arc_steps: Option<u32>,
    /// Find the load factors at which an equilibrium becomes unstable.
    pub find_critical: bool,
    /// Where the path becomes unstable, leave it along the critical mode: amplitude of the push, m.
    pub push: Option<f64>,
}

impl Default for StaticOptions {
    fn default() -> Self {
        Self {
            end: 1.0,
            increment: 1.0,
            largest_increment: 1.0,
            smallest_increment: 1e-6,
            tolerance: 1e-8,
            max_iterations: 25,
            arc_steps: None,
            find_critical: true,
            push: None,
        }
    }
}

/// An equilibrium on the way.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LoadStep {
    /// Its load factor.
    pub load_factor: f64,
    /// Newton iterations that it took.
    pub iterations: u32,
    /// Is V at a minimum there (has the tangent a Cholesky factor)?
    pub is_stable: bool,
}

/// What happens at a critical point.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum CriticalKind {
    /// The load has a maximum or minimum along the path: beyond it the body snaps.
    Limit,
    /// Another path branches off: the body buckles.
    Bifurcation,
}

/// A load factor at which stability is lost or won.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CriticalPoint {
    /// What happens.
    pub kind: CriticalKind,
    /// Load factor.
    pub load_factor: f64,
    /// Lowest ω² = λ(K, M) of the equilibria before and after it, 1/s².
    pub eigenvalues: [f64; 2],
}

/// What a search did.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct StaticReport {
    /// The equilibria, in order.
    pub steps: Vec<LoadStep>,
    /// Critical points passed, in order.
    pub critical: Vec<CriticalPoint>,
    /// Load factors of stable equilibria from which the next one could only be reached across states
    /// without stability: there the body snapped, and the path that it was on has ended.
    pub jumps: Vec<f64>,
    /// Increments that failed and were halved.
    pub halvings: u32,
    /// Work done.
    pub work: Work,
}

impl StaticReport {
    /// Load factor reached.
    pub fn load_factor(&self) -> f64 {
        self.steps.last().map_or(0.0, |step| step.load_factor)
    }

    /// Is the last equilibrium stable?
    pub fn is_stable(&self) -> bool {
        self.steps.last().is_some_and(|step| step.is_stable)
    }
}

impl StaticOptions {
    /// Checks that every option is inside its domain.
    pub(crate) fn check(&self) -> Result<(), SolverError> {
        for (option, value) in [
            ("static.increment", self.increment),
            ("static.largest_increment", self.largest_increment),
            ("static.smallest_increment", self.smallest_increment),
        ] {
            if !(value > 0.0 && value.is_finite()) {
                return Err(SolverError::Option { option, value, allowed: "must be positive and finite" });
            }
        }
        if !(1e-14..=0.1).contains(&self.tolerance) {
            let allowed = "must be 1e-14 (to round-off) to 0.1";
            return Err(SolverError::Option { option: "static.tolerance", value: self.tolerance, allowed });
        }
        Ok(())
    }
}
