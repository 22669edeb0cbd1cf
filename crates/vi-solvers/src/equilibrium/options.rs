//! Options of a search for equilibria, and its report.

use vi_core::StepEnergy;

use crate::error::SolverError;
use crate::interrupt::Interrupt;
use crate::options::LinearSolver;
use crate::work::Work;

/// Options of a search for equilibria.
#[derive(Debug, Clone, PartialEq)]
pub struct StaticOptions {
    /// Final load factor (time).
    pub end: f64,
    /// First increment of the load factor.
    pub increment: f64,
    /// Largest increment of the load factor.
    pub largest_increment: f64,
    /// Smallest increment; a solve that fails at this increment ends the search. It ends earlier at a thousandth of the span where bodies
    /// move away, and after three repeats where no load changes.
    pub smallest_increment: f64,
    /// Relative tolerance in the energy norm, √(rᵀK⁻¹r / largest first decrement).
    pub tolerance: f64,
    /// Number of Newton iterations after which an increment is halved.
    pub max_iterations: u32,
    /// Follows the path of equilibria by its arc length, through limit points, in at most this many steps. The first
    /// and the largest step correspond to `increment` and `largest_increment` with the response of the body at the
    /// start.
    pub arc_steps: Option<u32>,
    /// Whether to find the load factors at which an equilibrium becomes unstable. None are found, and no path is left, under forces
    /// without a potential other than damping.
    pub find_critical: bool,
    /// Linear solver of load steps. Conjugate gradients take little memory; a tangent counts as stable if they find no direction
    /// of negative curvature. Paths by arc length or control, and critical points, always use a factor.
    pub linear: LinearSolver,
    /// If the path becomes unstable, leave it along the critical mode with this amplitude, m.
    pub push: Option<f64>,
    /// The request that ends the search.
    pub interrupt: Interrupt,
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
            linear: LinearSolver::Auto,
            push: None,
            interrupt: Interrupt::NEVER,
        }
    }
}

/// An equilibrium on the path.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LoadStep {
    /// The load factor.
    pub load_factor: f64,
    /// Number of Newton iterations made for it.
    pub iterations: u32,
    /// Whether V has a minimum there, that is, the tangent has a Cholesky factor. With forces without a potential this is the
    /// symmetric part of the tangent, which does not decide about stability.
    pub is_stable: bool,
}

/// The kind of a critical point.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum CriticalKind {
    /// The load has a maximum or minimum along the path; the body snaps beyond it.
    Limit,
    /// Another path branches off; the body buckles.
    Bifurcation,
}

/// A load factor at which stability changes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CriticalPoint {
    /// The kind of the critical point.
    pub kind: CriticalKind,
    /// The load factor.
    pub load_factor: f64,
    /// The size of the error of the load factor: by how much it changed as the interval around it was last narrowed. Zero at a
    /// limit point on a path by arc length or control, which a cubic through both equilibria gives.
    pub error: f64,
    /// Lowest ω² = λ(K, M) of the equilibria before and after it, 1/s².
    pub eigenvalues: [f64; 2],
}

/// The report of a search.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct StaticReport {
    /// The equilibria, in order.
    pub steps: Vec<LoadStep>,
    /// The critical points that were passed, in order.
    pub critical: Vec<CriticalPoint>,
    /// Load factors of stable equilibria after which the next one could only be reached through unstable states:
    /// there the body snapped, and its path ended.
    pub jumps: Vec<f64>,
    /// Number of increments that failed and were halved.
    pub halvings: u32,
    /// Work of prescribed motion and of forces between the equilibria, J.
    pub energy: StepEnergy,
    /// The linear solver that was chosen, and the reason; `None` if nothing was solved.
    pub linear: Option<(LinearSolver, String)>,
    /// Work done.
    pub work: Work,
}

impl StaticReport {
    /// Returns the load factor that was reached.
    pub fn load_factor(&self) -> f64 {
        self.steps.last().map_or(0.0, |step| step.load_factor)
    }

    /// Returns whether the last equilibrium is stable.
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
