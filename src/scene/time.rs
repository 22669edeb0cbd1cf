//! How time is stepped and how implicit equations are solved, as a scene says it.

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
    /// The scheme with its default parameters; none for `auto`.
    pub fn method(self) -> Option<Method> {
        Self::ALL.iter().zip(Method::ALL).find(|(name, _)| **name == self).map(|(_, method)| method)
    }

    /// The name of a scheme, and its number of stages where it has some.
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

/// `[time]`: how long, in which steps, by which scheme.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Time {
    /// End of the run, s (> 0).
    pub end: f64,
    /// Step h, s (> 0). It is adjusted to end/round(end/step), so that a step lands on `end`.
    /// Scheme `auto` chooses it: there it may be left out, and is not used.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub step: Option<f64>,
    /// The time integrator. Only a scene with `[static]` can do without.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub scheme: Option<SchemeName>,
    /// Stages of `gauss`, 1 to 5 (default 2).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub stages: Option<usize>,
    /// Spectral radius at infinite frequency of `generalized-alpha`, 0 to 1 (default 0.8).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub spectral_radius: Option<f64>,
    /// Relative error wanted at `end`, 1e-9 to 0.5 (default 1e-4): what `auto` and `bench` aim at.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub tolerance: Option<f64>,
    /// Estimate the error of every probe by companion runs with other steps (5 to 10 times the cost).
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub estimate: bool,
    /// Cut a step that fails into halves, down to h/1024, and go back to h after it (default true); false
    /// ends the run at the first step that fails.
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

    /// From 0 to `end` (s) in steps of `step` (s).
    pub fn new(end: f64, step: f64, scheme: SchemeName) -> Self {
        let none = Self::auto(end, 1e-4);
        Self { step: Some(step), scheme: Some(scheme), tolerance: None, ..none }
    }

    /// From 0 to `end` (s) with a relative error of `tolerance` at the end, by a scheme and a step that the
    /// program chooses.
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

    /// Settles scheme and step: `steps` of them from 0 to `end`.
    pub fn choose(&mut self, scheme: SchemeName, stages: Option<usize>, steps: u64) {
        if Some(scheme) != self.scheme {
            self.spectral_radius = None;
        }
        self.scheme = Some(scheme);
        self.stages = stages;
        self.step = Some(self.end / steps as f64);
    }

    /// Number of steps, end/step rounded and at least one, and the step that lands on `end`, s.
    pub fn steps(&self) -> (u64, f64) {
        let count = (self.end / self.step.unwrap_or(self.end)).round().max(1.0);
        (count as u64, self.end / count)
    }

    /// The integrator asked for; `None` if it is yet to be chosen, or if `[static]` needs none.
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

/// Which linear solver serves implicit steps.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum LinearChoice {
    /// The cheaper one by the counted work.
    #[default]
    Auto,
    /// Sparse Cholesky factor, in single precision where Newton's method corrects what that leaves.
    Cholesky,
    /// Sparse Cholesky factor, in double precision in any case.
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
    /// The mass matrix of deformable bodies: "lumped" or "consistent" (implicit schemes only). By default motion
    /// takes it lumped, and `variational modes` consistent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub mass: Option<MassKind>,
}

/// Which mass matrix.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum MassKind {
    /// A mass a node: frequencies of linear elements are too low. All schemes take it.
    Lumped,
    /// ρ ∫ N_a N_b dV, which couples the nodes of an element: frequencies are bounds from above, and of the
    /// order of the element. Implicit schemes take it, on supports that do not move.
    Consistent,
}

impl Solver {
    fn default_tolerance() -> f64 {
        1e-6
    }

    /// As the solvers take it.
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
