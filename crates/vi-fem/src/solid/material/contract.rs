//! The contract of a hyperelastic law: energy, stress, tangent and domain.

use super::parameters::Parameters;
use crate::lanes::real::Real;
use crate::small::tensor::{Mat3, Tangent, determinant};

/// A hyperelastic law: the energy density Ψ(F) (J/m³ of the body at rest) as a function of the deformation gradient F
/// = ∂x/∂X, with its derivatives. It is written once, over any [`Real`].
pub trait Material: Send + Sync + 'static {
    /// The parameters in a scene file.
    type Parameters: Parameters;

    /// Whether ∂²Ψ/∂F∂F is the same for all F. Such a law is objective only to first order in ∂u/∂X.
    const LINEAR: bool = false;

    /// Returns the law with these parameters, which have passed [`Parameters::check`].
    fn new(parameters: &Self::Parameters) -> Self;
    /// Returns Ψ(F), J/m³; Ψ(I) = 0, and +∞ outside the domain.
    fn energy<R: Real>(&self, f: &Mat3<R>) -> R;
    /// Returns the first Piola–Kirchhoff stress P = ∂Ψ/∂F, Pa; NaN outside the domain.
    fn stress<R: Real>(&self, f: &Mat3<R>) -> Mat3<R>;
    /// Returns the tangent ∂²Ψ/∂F∂F, Pa.
    fn tangent<R: Real>(&self, f: &Mat3<R>) -> Tangent<R>;
    /// Checks that Ψ is defined at F. A law that is defined for every F, including inverted ones, keeps this default.
    ///
    /// # Errors
    /// Returns the quantity that left its domain, for the message of a failed step.
    fn inside(&self, f: &Mat3<f64>) -> Result<(), Outside> {
        let _ = f;
        Ok(())
    }
}

/// A quantity that has left the domain of a law.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Outside {
    /// The name, for example "det F".
    pub quantity: &'static str,
    /// The value.
    pub value: f64,
    /// The condition that it violates, for example "must be positive".
    pub domain: &'static str,
    /// The distance to the domain, not negative. Of several points the one with the largest is reported.
    pub excess: f64,
}

/// Checks J = det F > 0, the domain of laws in ln J or in powers of J.
///
/// # Errors
/// Returns J if it is not positive; −∞ if it is NaN.
pub fn positive_determinant(f: &Mat3<f64>) -> Result<(), Outside> {
    let j = determinant(f);
    let value = if j.is_nan() { f64::NEG_INFINITY } else { j };
    let outside = Outside { quantity: "det F", value, domain: "must be positive", excess: -value };
    if value > 0.0 { Ok(()) } else { Err(outside) }
}

/// An operation on a law whose type is known only at run time.
pub(crate) trait LawVisitor {
    type Output;
    fn visit<M: Material>(self, material: M) -> Self::Output;
}
