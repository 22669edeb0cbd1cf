//! The table of time integrators: names, orders, what each conserves. One line a scheme.
//! It must not know how a step is made.

use vi_core::System;

use crate::comparison::{BackwardEuler, Bdf2, ForwardEuler, GeneralizedAlpha, Newmark};
use crate::energy_momentum::EnergyMomentum;
use crate::gauss::Gauss;
use crate::kick_drift::{Coefficients, KickDrift};
use crate::stages::{Midpoint, OneStage};
use crate::{SolverError, SolverOptions, Stepper, force_sum, inertia, surface};

/// A time integrator with its parameters.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Method {
    /// Linear × left point: kick h, drift h.
    SymplecticEulerA,
    /// Linear × right point: drift h, kick h.
    SymplecticEulerB,
    /// Linear × trapezoid: kick h/2, drift h, kick h/2.
    StormerVerlet,
    /// Symmetric symplectic Runge–Kutta–Nyström, 6 forces (Blanes & Moan 2002, SRKN₆ᵇ).
    BlanesMoan4,
    /// Symmetric symplectic Runge–Kutta–Nyström, 11 forces (Blanes & Moan 2002, SRKN₁₁ᵇ).
    BlanesMoan6,
    /// Linear × midpoint.
    ImplicitMidpoint,
    /// Degree s × Gauss–Legendre with s points.
    Gauss {
        /// s = 1 … 5.
        stages: usize,
    },
    /// Discrete gradient on the midpoint stage (Gonzalez 1996): exact energy and momenta.
    EnergyMomentum,
    /// Explicit Euler, for comparison: gains energy.
    ForwardEuler,
    /// Implicit Euler, for comparison: loses energy.
    BackwardEuler,
    /// Backward differences of order 2, for comparison: loses energy.
    Bdf2,
    /// Newmark's family, for comparison.
    Newmark {
        /// β; ¼ is the average acceleration.
        beta: f64,
        /// γ; ½ has no numerical damping.
        gamma: f64,
    },
    /// Generalised-α (Chung & Hulbert 1993), for comparison: damps high frequencies.
    GeneralizedAlpha {
        /// Spectral radius at infinite frequency, 0 … 1.
        spectral_radius: f64,
    },
}

/// What is known of a scheme before it runs.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MethodFacts {
    /// Name in a scene file.
    pub name: &'static str,
    /// Classical order of accuracy.
    pub order: usize,
    /// Makes a step without solving equations?
    pub is_explicit: bool,
    /// Follows from a discrete Hamilton's principle (is symplectic)?
    pub is_variational: bool,
    /// Is it its own adjoint (reverses in time)?
    pub is_symmetric: bool,
    /// Evaluations of ∂V/∂x a step (explicit schemes; 0 where the solver decides).
    pub forces_per_step: usize,
    /// hω below which an explicit scheme is stable on the oscillator.
    pub stability_limit: Option<f64>,
    /// hω up to which we recommend it for long nonlinear runs.
    pub recommended_limit: Option<f64>,
    /// What it conserves, in words.
    pub conserves: &'static str,
    /// When to use it, in words.
    pub use_when: &'static str,
}

const SYMPLECTIC: &str = "symplectic form, momenta; energy up to a bounded oscillation";
const COMPARISON: &str = "for comparison only";

impl Method {
    /// All schemes with their default parameters, in the order of the documentation's table.
    pub const ALL: [Self; 13] = [
        Self::SymplecticEulerA,
        Self::SymplecticEulerB,
        Self::StormerVerlet,
        Self::BlanesMoan4,
        Self::BlanesMoan6,
        Self::ImplicitMidpoint,
        Self::Gauss { stages: 2 },
        Self::EnergyMomentum,
        Self::ForwardEuler,
        Self::BackwardEuler,
        Self::Bdf2,
        Self::Newmark { beta: 0.25, gamma: 0.5 },
        Self::GeneralizedAlpha { spectral_radius: 0.9 },
    ];

    /// The scheme of this name in a scene file, with default parameters.
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|method| method.name() == name)
    }

    /// Name in a scene file.
    pub fn name(&self) -> &'static str {
        self.facts().name
    }

    /// What is known of it before it runs.
    #[rustfmt::skip]
    pub fn facts(&self) -> MethodFacts {
        match *self {
            Self::SymplecticEulerA => explicit("symplectic-euler-a", 1, false, 1, 2.0, 1.8, "teaching; as cheap as Störmer–Verlet and less accurate"),
            Self::SymplecticEulerB => explicit("symplectic-euler-b", 1, false, 1, 2.0, 1.8, "teaching; as cheap as Störmer–Verlet and less accurate"),
            Self::StormerVerlet => explicit("stormer-verlet", 2, true, 1, 2.0, 1.8, "soft bodies, many steps, 1e-2 to 1e-4"),
            Self::BlanesMoan4 => explicit("blanes-moan-4", 4, true, 6, 3.1634, 2.8, "soft bodies at 1e-4 to 1e-7"),
            Self::BlanesMoan6 => explicit("blanes-moan-6", 6, true, 11, 3.1414, 2.8, "soft bodies beyond 1e-7; reference solutions"),
            Self::ImplicitMidpoint => implicit("implicit-midpoint", 2, true, SYMPLECTIC, "stiff bodies, steps far beyond the explicit limit"),
            Self::Gauss { stages } => implicit("gauss", 2 * stages, true, SYMPLECTIC, "stiff bodies where accuracy matters"),
            Self::EnergyMomentum => MethodFacts { is_variational: false, ..implicit("energy-momentum", 2, true, "energy and momenta, exactly", "long stiff runs") },
            Self::ForwardEuler => MethodFacts { is_variational: false, conserves: "linear momentum", stability_limit: Some(0.0), recommended_limit: Some(0.0), ..explicit("forward-euler", 1, false, 1, 0.0, 0.0, COMPARISON) },
            Self::BackwardEuler => dissipative("backward-euler", 1, false),
            Self::Bdf2 => dissipative("bdf2", 2, false),
            Self::Newmark { beta, gamma } => {
                let order = if gamma == 0.5 { 2 } else { 1 };
                dissipative("newmark", order, gamma == 0.5 && beta == 0.25)
            }
            Self::GeneralizedAlpha { spectral_radius } => dissipative("generalized-alpha", 2, spectral_radius == 1.0),
        }
    }
}

fn explicit(
    name: &'static str,
    order: usize,
    is_symmetric: bool,
    forces_per_step: usize,
    limit: f64,
    recommended: f64,
    use_when: &'static str,
) -> MethodFacts {
    MethodFacts {
        name,
        order,
        is_explicit: true,
        is_variational: true,
        is_symmetric,
        forces_per_step,
        stability_limit: Some(limit),
        recommended_limit: Some(recommended),
        conserves: SYMPLECTIC,
        use_when,
    }
}

fn implicit(
    name: &'static str,
    order: usize,
    is_symmetric: bool,
    conserves: &'static str,
    use_when: &'static str,
) -> MethodFacts {
    MethodFacts {
        name,
        order,
        is_explicit: false,
        is_variational: true,
        is_symmetric,
        forces_per_step: 0,
        stability_limit: None,
        recommended_limit: None,
        conserves,
        use_when,
    }
}

fn dissipative(name: &'static str, order: usize, is_symmetric: bool) -> MethodFacts {
    let facts = implicit(name, order, is_symmetric, "linear momentum", COMPARISON);
    MethodFacts { is_variational: false, ..facts }
}

/// The integrator `method` for `system`.
///
/// # Errors
/// [`SolverError::Option`] where a parameter of the method or an option is outside its domain;
/// [`SolverError::Force`], [`SolverError::Constrained`] and [`SolverError::ConsistentMass`] for what the method
/// has no place for.
pub fn stepper(
    method: &Method,
    system: &System,
    options: &SolverOptions,
) -> Result<Box<dyn Stepper>, SolverError> {
    force_sum::check(method, system)?;
    surface::check(method, system)?;
    inertia::check(method, system)?;
    let explicit = |coefficients: Coefficients| -> Box<dyn Stepper> {
        Box::new(KickDrift::new(method.name(), coefficients, system, options))
    };
    Ok(match *method {
        Method::SymplecticEulerA => explicit(Coefficients::symplectic_euler_a()),
        Method::SymplecticEulerB => explicit(Coefficients::symplectic_euler_b()),
        Method::StormerVerlet => explicit(Coefficients::stormer_verlet()),
        Method::BlanesMoan4 => explicit(Coefficients::blanes_moan_4()),
        Method::BlanesMoan6 => explicit(Coefficients::blanes_moan_6()),
        Method::ForwardEuler => Box::new(ForwardEuler::new(system, options)),
        Method::ImplicitMidpoint => Box::new(OneStage::new(Midpoint, system, options)?),
        Method::Gauss { stages: 1 } => Box::new(OneStage::new(Midpoint, system, options)?),
        Method::Gauss { stages } => Box::new(Gauss::new(stages, system, options)?),
        Method::BackwardEuler => Box::new(OneStage::new(BackwardEuler, system, options)?),
        Method::Bdf2 => Box::new(OneStage::new(Bdf2::default(), system, options)?),
        Method::Newmark { beta, gamma } => {
            Box::new(OneStage::new(Newmark::new(beta, gamma)?, system, options)?)
        }
        Method::GeneralizedAlpha { spectral_radius } => {
            Box::new(OneStage::new(GeneralizedAlpha::new(spectral_radius)?, system, options)?)
        }
        Method::EnergyMomentum => Box::new(OneStage::new(EnergyMomentum::new(system), system, options)?),
    })
}
