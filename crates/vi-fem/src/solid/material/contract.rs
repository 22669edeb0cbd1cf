//! What a hyperelastic law is: energy, stress, tangent and domain.

use super::parameters::Parameters;
use crate::lanes::real::Real;
use crate::small::tensor::{Mat3, Tangent, determinant};

/// A hyperelastic law: the energy density Ψ(F) (J/m³ of the body at rest) of the deformation
/// gradient F = ∂x/∂X, and its derivatives. Written once, over any [`Real`].
pub trait Material: Send + Sync + 'static {
    /// What the scene file says of it.
    type Parameters: Parameters;

    /// Is ∂²Ψ/∂F∂F the same for all F? Such a law is objective only to first order in ∂u/∂X.
    const LINEAR: bool = false;

    /// The law with these parameters, which have passed [`Parameters::check`].
    fn new(parameters: &Self::Parameters) -> Self;
    /// Ψ(F), J/m³; Ψ(I) = 0; +∞ outside the domain.
    fn energy<R: Real>(&self, f: &Mat3<R>) -> R;
    /// First Piola–Kirchhoff stress P = ∂Ψ/∂F, Pa; NaN outside the domain.
    fn stress<R: Real>(&self, f: &Mat3<R>) -> Mat3<R>;
    /// Tangent ∂²Ψ/∂F∂F, Pa.
    fn tangent<R: Real>(&self, f: &Mat3<R>) -> Tangent<R>;
    /// Is Ψ defined at F? A law that is defined everywhere, for inverted F too, need not say so.
    ///
    /// # Errors
    /// The quantity that left its domain, for the message of a failed step.
    fn inside(&self, f: &Mat3<f64>) -> Result<(), Outside> {
        let _ = f;
        Ok(())
    }
}

/// A quantity that has left the domain of a law.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Outside {
    /// Its name, "det F" for example.
    pub quantity: &'static str,
    /// Its value.
    pub value: f64,
    /// What it must be, "must be positive" for example.
    pub domain: &'static str,
    /// How far it is beyond its domain, not negative. Of several points the farthest is reported.
    pub excess: f64,
}

/// Ok where J = det F > 0: the domain of laws in ln J or powers of J.
///
/// # Errors
/// J where it is not positive; −∞ where it is not a number.
pub fn positive_determinant(f: &Mat3<f64>) -> Result<(), Outside> {
    let j = determinant(f);
    let value = if j.is_nan() { f64::NEG_INFINITY } else { j };
    let outside = Outside { quantity: "det F", value, domain: "must be positive", excess: -value };
    if value > 0.0 { Ok(()) } else { Err(outside) }
}

/// Work to do with a law whose type is known only at run time.
pub(crate) trait LawVisitor {
    type Output;
    fn visit<M: Material>(self, material: M) -> Self::Output;
}
