//! Checks that a step resolves live terms, such as contact, that act by their gradient at the stages of a scheme. Discrete
//! gradients bound gaps from below at any step, but have order 2. A scheme of higher order evaluates the gradient instead, and its
//! steps must be short enough for it:
//! - nothing meets on the straight paths between the configurations that the scheme evaluates;
//! - hω is below a limit at each of them, where ω² is the largest eigenvalue of M⁻¹ ∂²C/∂q² of the live terms C alone.

use vi_core::System;

use crate::assemble::evaluator::Evaluator;
use crate::error::SolverError;
use crate::linear::matrix::SymmetricMatrix;
use crate::schemes::lanczos::{self, SymmetricOperator};
use crate::unit_of_mass::per_unit_of_mass;
use crate::vectors;

/// Largest hω of a step that resolves live terms. Errors of energy, relative to the kinetic energy, of the bar of
/// `scenes/contact/bar-impact.toml` with impacts at 1 and 4 m/s, by the largest hω of the run:
///
/// | hω | `blanes-moan-4` | `blanes-moan-6` | `gauss` 2 | `gauss` 3 |
/// |--:|--:|--:|--:|--:|
/// | .28 | 7e-10 | 1e-10 | 4e-8 | 2e-8 |
/// | .55 | 4e-9 | 8e-10 | 4e-6 | 1e-6 |
/// | .8 | 6e-8 | 5e-9 | 3e-5 | 9e-6 |
/// | 1.1 | 1e-7 | 3e-9 | 5e-5 | 2e-5 |
/// | 1.6 | 8e-5 | 7e-7 | 2e-4 | 1e-5 |
/// | 2.2 | 1e-5 | 2e-7 | 6e-5 | 2e-5 |
/// | 3.3 | | 6e-5 | 9e-4 | 2e-4 |
/// | 4.5 | 3e-4 | 2e-5 | 4e-4 | 5e-4 |
/// | 11 | | 4e-4 | 2e-2 | 4e-2 |
const LIMIT: f64 = 2.0;
/// Relative error of ω² with which a step is judged.
const ACCURACY: f64 = 0.1;

/// The checks of one step.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Resolution {
    /// Name of the scheme.
    pub(crate) scheme: &'static str,
    /// The step, s.
    pub(crate) h: f64,
}

impl Resolution {
    /// Prepares for the step from (q, t), whose velocity of the free coordinates is v (m/s).
    pub(crate) fn open(
        self,
        system: &System,
        evaluator: &mut Evaluator,
        (q, t): (&[f64], f64),
        v: impl Fn(usize) -> f64,
    ) {
        let end: Vec<f64> = q.iter().enumerate().map(|(k, q)| q + self.h * v(k)).collect();
        evaluator.follow_flight(system, (q, t), (&end, t + self.h));
    }

    /// Checks the forces at the configuration (q, t).
    ///
    /// # Errors
    /// Returns [`SolverError::UnresolvedContact`] if the step is too long for them.
    pub(crate) fn check_forces(
        self,
        system: &System,
        evaluator: &mut Evaluator,
        (q, t): (&[f64], f64),
    ) -> Result<(), SolverError> {
        evaluator.go_to(system, q, t);
        let Some(stiffness) = evaluator.live_hessian().filter(|stiffness| !stiffness.is_zero()) else {
            return Ok(());
        };
        let per_unit = per_unit_of_mass(system.free_mass());
        let inverse_root_mass =
            system.free_mass().iter().map(|mass| 1.0 / (per_unit * mass).sqrt()).collect();
        let mut operator = Scaled { stiffness, per_unit, inverse_root_mass, scaled: Vec::new() };
        let frequency = lanczos::highest(&mut operator, system.free_mass().len(), ACCURACY)?.omega;
        let Self { scheme, h } = self;
        if h * frequency <= LIMIT {
            return Ok(());
        }
        Err(SolverError::UnresolvedContact {
            scheme,
            limit: LIMIT,
            product: h * frequency,
            longest: LIMIT / frequency,
            schemes: match system.kinetic() {
                Some(_) => "implicit-midpoint or energy-momentum",
                None => "stormer-verlet, implicit-midpoint or energy-momentum",
            },
        })
    }

    /// Checks the straight path of the free coordinates between two configurations, (q, t) each.
    ///
    /// # Errors
    /// Returns [`SolverError::Crossing`] if something meets on it.
    pub(crate) fn check_path(
        self,
        system: &System,
        evaluator: &mut Evaluator,
        start: (&[f64], f64),
        end: (&[f64], f64),
    ) -> Result<(), SolverError> {
        match evaluator.obstacle(system, start, end) {
            Some(nodes) => Err(SolverError::Crossing { nodes }),
            None => Ok(()),
        }
    }
}

/// M^(−½) K M^(−½) with the lumped mass.
struct Scaled<'a> {
    stiffness: &'a SymmetricMatrix,
    /// The inverse of the unit of mass of the roots.
    per_unit: f64,
    inverse_root_mass: Vec<f64>,
    scaled: Vec<f64>,
}

impl SymmetricOperator for Scaled<'_> {
    fn apply(&mut self, v: &[f64], out: &mut [f64]) -> Result<(), SolverError> {
        let Self { stiffness, per_unit, inverse_root_mass, scaled } = self;
        scaled.clear();
        scaled.extend(v.iter().zip(&*inverse_root_mass).map(|(v, root)| v * root));
        stiffness.multiply(scaled, out);
        vectors::update(out, |k, out| *out *= inverse_root_mass[k] * *per_unit);
        Ok(())
    }

    fn product(&self, a: &[f64], v: &[f64]) -> f64 {
        vectors::dot(a, v)
    }

    fn normalize(&mut self, v: &mut [f64]) -> f64 {
        lanczos::normalize(v)
    }
}
