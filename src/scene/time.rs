//! The keys of a scene for time steps and for the solution of implicit equations.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use vi_solvers::{Interrupt, LinearSolver, Method, SolverOptions};

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

/// The step of a run.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, JsonSchema)]
#[serde(untagged)]
pub enum TimeStep {
    /// Equal steps of this length, s.
    Fixed(f64),
    /// Steps that follow the motion.
    Adaptive(AdaptiveWord),
}

/// The word `adaptive`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum AdaptiveWord {
    /// Steps that follow the motion by a symmetric rule.
    Adaptive,
}

impl TimeStep {
    /// Steps that follow the motion.
    pub const ADAPTIVE: Self = Self::Adaptive(AdaptiveWord::Adaptive);

    /// Returns the length of equal steps, s; `None` for adaptive ones.
    pub fn fixed(self) -> Option<f64> {
        match self {
            Self::Fixed(step) => Some(step),
            Self::Adaptive(_) => None,
        }
    }
}

impl<'de> Deserialize<'de> for TimeStep {
    fn deserialize<D: serde::Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct NumberOrWord;
        impl serde::de::Visitor<'_> for NumberOrWord {
            type Value = TimeStep;
            fn expecting(&self, formatter: &mut std::fmt::Formatter) -> std::fmt::Result {
                formatter.write_str("a step in s, or \"adaptive\"")
            }
            fn visit_f64<E>(self, step: f64) -> Result<TimeStep, E> {
                Ok(TimeStep::Fixed(step))
            }
            fn visit_i64<E>(self, step: i64) -> Result<TimeStep, E> {
                Ok(TimeStep::Fixed(step as f64))
            }
            fn visit_u64<E>(self, step: u64) -> Result<TimeStep, E> {
                Ok(TimeStep::Fixed(step as f64))
            }
            fn visit_str<E: serde::de::Error>(self, word: &str) -> Result<TimeStep, E> {
                match word {
                    "adaptive" => Ok(TimeStep::ADAPTIVE),
                    _ => Err(E::invalid_value(serde::de::Unexpected::Str(word), &self)),
                }
            }
        }
        deserializer.deserialize_any(NumberOrWord)
    }
}

/// `[time]`: duration, steps and scheme.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Time {
    /// End of the run, s (> 0).
    pub end: f64,
    /// Step h, s (> 0), or "adaptive". A number is adjusted to end/round(end/step), so that a step lands on `end`. Scheme
    /// `auto` chooses the step; there the key is optional and not used. Adaptive steps follow the motion by a symmetric
    /// rule; `tolerance` and `largest_step` limit them.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub step: Option<TimeStep>,
    /// With `step = "adaptive"`: largest length of the intervals in which a body makes equal steps, s (> 0, default
    /// end/100). It is adjusted so that frames fall on the ends of intervals.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub largest_step: Option<f64>,
    /// The time integrator. It is optional only in a scene with `[static]`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub scheme: Option<SchemeName>,
    /// Stages of `gauss`, 1 to 5 (default 2).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub stages: Option<usize>,
    /// Spectral radius at infinite frequency of `generalized-alpha`, 0 to 1 (default 0.8).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub spectral_radius: Option<f64>,
    /// Linear solves per step of `truncated-euler`, 1 to 1000 (default 8).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 1, max = 1000))]
    pub solves: Option<u32>,
    /// Required relative error at `end`, 1e-9 to 0.5 (default 1e-2), for `auto` and `bench`. With `step = "adaptive"`:
    /// the relative error per radian of the mean frequency of the motion.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub tolerance: Option<f64>,
    /// Estimate the error of every probe by companion runs with other steps (5 to 10 times the cost).
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub estimate: bool,
    /// Cut a step that fails into halves, down to h/1024 (with contact h/16384), and return to h after it (default true);
    /// false ends the run at the first step that fails.
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
        Self { step: Some(TimeStep::Fixed(step)), scheme: Some(scheme), tolerance: None, ..none }
    }

    /// Returns a run from 0 to `end` (s) in steps that follow the motion, with this relative error per radian of its mean
    /// frequency.
    pub fn adaptive(end: f64, tolerance: f64, scheme: SchemeName) -> Self {
        Self { step: Some(TimeStep::ADAPTIVE), scheme: Some(scheme), ..Self::auto(end, tolerance) }
    }

    /// Default tolerance.
    pub const DEFAULT_TOLERANCE: f64 = 1e-2;

    /// Returns whether steps follow the motion.
    pub fn is_adaptive(&self) -> bool {
        self.step == Some(TimeStep::ADAPTIVE)
    }

    /// Returns a run from 0 to `end` (s) with a relative error of `tolerance` at the end. The program chooses scheme
    /// and step.
    pub fn auto(end: f64, tolerance: f64) -> Self {
        Self {
            end,
            step: None,
            largest_step: None,
            scheme: Some(SchemeName::Auto),
            stages: None,
            spectral_radius: None,
            solves: None,
            tolerance: Some(tolerance),
            estimate: false,
            substeps: true,
        }
    }

    /// Sets scheme and step: `steps` of them from 0 to `end`.
    pub fn choose(&mut self, scheme: SchemeName, stages: Option<usize>, steps: u64) {
        if Some(scheme) != self.scheme {
            self.spectral_radius = None;
            self.solves = None;
        }
        self.scheme = Some(scheme);
        self.stages = stages;
        self.step = Some(TimeStep::Fixed(self.end / steps as f64));
        self.largest_step = None;
    }

    /// Returns the number of steps, end/step rounded and at least one, and the step that lands on `end`, s. Adaptive steps
    /// are counted by their intervals.
    pub fn steps(&self) -> (u64, f64) {
        let count = match self.step {
            Some(TimeStep::Fixed(step)) => (self.end / step).round(),
            // A ratio that is an integer up to round-off counts as one.
            Some(TimeStep::Adaptive(_)) => (self.end / self.longest_interval() * (1.0 - 1e-12)).ceil(),
            None => 1.0,
        };
        (count.max(1.0) as u64, self.end / count.max(1.0))
    }

    fn longest_interval(&self) -> f64 {
        self.largest_step.unwrap_or(self.end / 100.0)
    }

    /// Returns the number and length (s) of the intervals of adaptive steps, such that frames every `frames` (s) fall on
    /// their ends if they fall on the end of the run.
    pub(crate) fn intervals(&self, frames: f64) -> (u64, f64) {
        let per_frame = (frames / self.longest_interval() * (1.0 - 1e-12)).ceil().max(1.0);
        let count = (self.end * per_frame / frames).round().max(1.0);
        (count as u64, self.end / count)
    }

    /// Returns the integrator of the scene; `None` if it is not chosen yet, or if `[static]` needs none.
    pub fn method(&self) -> Option<Method> {
        Some(match self.scheme?.method()? {
            Method::Gauss { stages } => Method::Gauss { stages: self.stages.unwrap_or(stages) },
            Method::GeneralizedAlpha { spectral_radius } => {
                Method::GeneralizedAlpha { spectral_radius: self.spectral_radius.unwrap_or(spectral_radius) }
            }
            Method::TruncatedEuler { solves } => {
                Method::TruncatedEuler { solves: self.solves.unwrap_or(solves) }
            }
            other => other,
        })
    }
}

/// The linear solver of implicit steps and of equilibria.
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
    /// Conjugate gradients with algebraic multigrid of PETSc; only `variational-mpi`, built with its feature `petsc`.
    Petsc,
}

impl LinearChoice {
    /// Returns the linear solver of this name.
    pub fn solver(self) -> LinearSolver {
        match self {
            Self::Auto => LinearSolver::Auto,
            Self::Cholesky => LinearSolver::Cholesky,
            Self::CholeskyDouble => LinearSolver::CholeskyDouble,
            Self::Pcg => LinearSolver::Pcg,
            Self::Petsc => LinearSolver::Petsc,
        }
    }
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
    /// The mass matrix of deformable bodies: "lumped", "consistent" (implicit schemes only) or "filtered" (explicit
    /// schemes only). The default is lumped for motion and consistent for `variational modes`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub mass: Option<MassKind>,
    /// The request that abandons a step, or another solve, in progress. Programs set it; it is no key of scene files.
    #[serde(skip)]
    pub interrupt: Interrupt,
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
    /// Lumped, with an inverse that lowers the highest frequencies: explicit steps may be twice as long, for an error of
    /// waves that falls with the square of the size of elements.
    Filtered,
}

impl Solver {
    fn default_tolerance() -> f64 {
        1e-6
    }

    /// Returns the options for the solvers.
    pub fn options(&self) -> SolverOptions {
        SolverOptions {
            tolerance: self.tolerance,
            linear: self.linear.solver(),
            interrupt: self.interrupt.clone(),
            ..SolverOptions::default()
        }
    }
}

impl Default for Solver {
    fn default() -> Self {
        let (tolerance, linear) = (Self::default_tolerance(), LinearChoice::Auto);
        Self { tolerance, linear, mass: None, interrupt: Interrupt::NEVER }
    }
}
