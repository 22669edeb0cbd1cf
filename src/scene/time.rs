//! The keys of a scene for time steps and for the solution of implicit equations.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use vi_solvers::{LinearSolver, Method, SolverOptions};

macro_rules! scheme_names {
    ($(
        $(#[doc = $doc:literal])+
        $variant:ident $({ $($parameters:tt)+ })? = $name:literal { $($row:tt)+ }
    )+) => {
        /// The name of a time integrator.
        #[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
        pub enum SchemeName {
            $($(#[doc = $doc])+ #[serde(rename = $name)] $variant,)+
            /// Scheme and step chosen for `tolerance` by trial runs, whose costs are counted.
            #[serde(rename = "auto")]
            Auto,
        }

        impl SchemeName {
            /// The schemes, without `auto`, in the order of [`Method::ALL`].
            pub const ALL: [Self; [$($name),+].len()] = [$(Self::$variant),+];
        }
    };
}

vi_solvers::schemes!(scheme_names);

impl SchemeName {
    /// Returns the scheme with its default parameters; `None` for `auto`.
    pub fn method(self) -> Option<Method> {
        Self::ALL.iter().zip(Method::ALL).find(|(name, _)| **name == self).map(|(_, method)| method)
    }

    /// Returns the name of a scheme, and its number of stages if it has some.
    pub fn of(method: Method) -> (Self, Option<usize>) {
        let named = |(_, other): &(_, Method)| other.name() == method.name();
        let name = Self::ALL.into_iter().zip(Method::ALL).find(named).map_or(Self::Auto, |(name, _)| name);
        let stages = match method {
            Method::Gauss { stages } => Some(stages),
            _ => None,
        };
        (name, stages)
    }
}

/// `[time]`: duration, steps and scheme.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Time {
    /// End of the run, s (> 0).
    pub end: f64,
    /// Step h, s (> 0). It is adjusted to end/round(end/step), so that a step lands on `end`. Scheme `auto` chooses
    /// it; there the key is optional and not used.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub step: Option<f64>,
    /// The time integrator. It is optional only in a scene with `[static]`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub scheme: Option<SchemeName>,
    /// Stages of `gauss`, 1 to 5 (default 2).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub stages: Option<usize>,
    /// Spectral radius at infinite frequency of `generalized-alpha`, 0 to 1 (default 0.8).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub spectral_radius: Option<f64>,
    /// Required relative error at `end`, 1e-9 to 0.5 (default 1e-4), for `auto` and `bench`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub tolerance: Option<f64>,
    /// Estimate the error of every probe by companion runs with other steps (5 to 10 times the cost).
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub estimate: bool,
    /// Cut a step that fails into halves, down to h/1024, and return to h after it (default true); false ends the run
    /// at the first step that fails.
    #[serde(default = "Time::default_substeps", skip_serializing_if = "Time::has_default_substeps")]
    pub substeps: bool,
}

impl Time {
    fn default_substeps() -> bool {
        true
    }

    fn has_default_substeps(substeps: &bool) -> bool {
        *substeps
    }

    /// Returns a run from 0 to `end` (s) in steps of `step` (s).
    pub fn new(end: f64, step: f64, scheme: SchemeName) -> Self {
        let none = Self::auto(end, 1e-4);
        Self { step: Some(step), scheme: Some(scheme), tolerance: None, ..none }
    }

    /// Returns a run from 0 to `end` (s) with a relative error of `tolerance` at the end. The program chooses scheme
    /// and step.
    pub fn auto(end: f64, tolerance: f64) -> Self {
        Self {
            end,
            step: None,
            scheme: Some(SchemeName::Auto),
            stages: None,
            spectral_radius: None,
            tolerance: Some(tolerance),
            estimate: false,
            substeps: true,
        }
    }

    /// Sets scheme and step: `steps` of them from 0 to `end`.
    pub fn choose(&mut self, scheme: SchemeName, stages: Option<usize>, steps: u64) {
        if Some(scheme) != self.scheme {
            self.spectral_radius = None;
        }
        self.scheme = Some(scheme);
        self.stages = stages;
        self.step = Some(self.end / steps as f64);
    }

    /// Returns the number of steps, end/step rounded and at least one, and the step that lands on `end`, s.
    pub fn steps(&self) -> (u64, f64) {
        let count = (self.end / self.step.unwrap_or(self.end)).round().max(1.0);
        (count as u64, self.end / count)
    }

    /// Returns the integrator of the scene; `None` if it is not chosen yet, or if `[static]` needs none.
    pub fn method(&self) -> Option<Method> {
        Some(match self.scheme?.method()? {
            Method::Gauss { stages } => Method::Gauss { stages: self.stages.unwrap_or(stages) },
            Method::GeneralizedAlpha { spectral_radius } => {
                Method::GeneralizedAlpha { spectral_radius: self.spectral_radius.unwrap_or(spectral_radius) }
            }
            other => other,
        })
    }
}

/// The linear solver of implicit steps.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum LinearChoice {
    /// The cheaper one by counted work.
    #[default]
    Auto,
    /// Sparse Cholesky factor, in single precision if Newton's method corrects the difference.
    Cholesky,
    /// Sparse Cholesky factor, always in double precision.
    CholeskyDouble,
    /// Preconditioned conjugate gradients.
    Pcg,
}

/// `[solver]`: how implicit equations are solved.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Solver {
    /// Relative tolerance of every implicit solve in the energy norm, 1e-14 to 1e-1 (default 1e-6);
    /// 1e-14 means: to round-off.
    #[serde(default = "Solver::default_tolerance")]
    pub tolerance: f64,
    /// The linear solver.
    #[serde(default)]
    pub linear: LinearChoice,
    /// The mass matrix of deformable bodies: "lumped" or "consistent" (implicit schemes only). The default is lumped
    /// for motion and consistent for `variational modes`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub mass: Option<MassKind>,
}

/// The mass matrix.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum MassKind {
    /// One mass per node: frequencies of linear elements are too low. All schemes accept it.
    Lumped,
    /// ρ ∫ N_a N_b dV, which couples the nodes of an element: frequencies are upper bounds, with the order of the
    /// element. Implicit schemes accept it if supports do not move.
    Consistent,
}

impl Solver {
    fn default_tolerance() -> f64 {
        1e-6
    }

    /// Returns the options for the solvers.
    pub fn options(&self) -> SolverOptions {
        let linear = match self.linear {
            LinearChoice::Auto => LinearSolver::Auto,
            LinearChoice::Cholesky => LinearSolver::Cholesky,
            LinearChoice::CholeskyDouble => LinearSolver::CholeskyDouble,
            LinearChoice::Pcg => LinearSolver::Pcg,
        };
        SolverOptions { tolerance: self.tolerance, linear, ..SolverOptions::default() }
    }
}

impl Default for Solver {
    fn default() -> Self {
        Self { tolerance: Self::default_tolerance(), linear: LinearChoice::Auto, mass: None }
    }
}
