//! Hyperelastic laws Ψ(F): the contract, and the registry that makes a law a scene's word.
//!
//! To add a law: one file in `material/` with a [`Material`], one line in `materials!` below. The
//! line gives the scene name, the schema entry, the batch kernels and the law tests.
//! This room must not know elements or meshes.

mod batch;
mod corotated;
mod eigensystem;
#[cfg(test)]
mod laws;
mod linear;
mod mooney_rivlin;
mod neo_hookean;
mod parameters;
#[cfg(test)]
pub(crate) mod properties;
mod st_venant_kirchhoff;
mod stable_neo_hookean;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

pub use corotated::Corotated;
pub use linear::Linear;
pub use mooney_rivlin::{MooneyRivlin, MooneyRivlinParameters};
pub use neo_hookean::NeoHookean;
pub use parameters::{Isotropic, Parameters};
pub use st_venant_kirchhoff::StVenantKirchhoff;
pub use stable_neo_hookean::StableNeoHookean;

pub(crate) use batch::{
    PackedMat3, PackedTangent, energies, load_mat3, projected_tangents, store_mat3, stresses, tangents,
};

use crate::tensor::{Mat3, Tangent};
use crate::{FemError, Real};

/// A hyperelastic law: the energy density Ψ(F) (J/m³ of the body at rest) of the deformation
/// gradient F = ∂x/∂X, and its derivatives. Written once, over any [`Real`].
pub trait Material: Send + Sync + 'static {
    /// What the scene file says of it.
    type Parameters: Parameters;

    /// Where Ψ is defined.
    const DOMAIN: Domain = Domain::Everywhere;
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
}

/// The deformation gradients that a law is defined for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Domain {
    /// All of them, inverted ones too.
    Everywhere,
    /// J = det F > 0.
    PositiveJ,
}

/// Work to do with a law whose type is known only at run time.
pub(crate) trait LawVisitor {
    type Output;
    fn visit<M: Material>(self, material: M) -> Self::Output;
}

macro_rules! materials {
    ($($(#[$doc:meta])* $variant:ident = $name:literal;)*) => {
        /// A law and its parameters as the scene file says them:
        /// `{ law = "neo-hookean", young = 1e6, poisson = 0.3, density = 1000.0 }`.
        #[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
        #[serde(tag = "law", rename_all = "kebab-case")]
        #[non_exhaustive]
        pub enum Law {
            $($(#[$doc])* #[serde(rename = $name)] $variant(<$variant as Material>::Parameters),)*
        }

        impl Law {
            /// The scene names of all laws.
            pub const NAMES: &'static [&'static str] = &[$($name),*];

            /// One of each law with sound parameters, for tests and first steps.
            pub fn examples() -> Vec<Self> {
                vec![$(Self::$variant(Parameters::example())),*]
            }

            /// The scene name of this law.
            pub fn name(&self) -> &'static str {
                match self { $(Self::$variant(_) => $name,)* }
            }

            /// Its parameters.
            pub fn parameters(&self) -> &dyn Parameters {
                match self { $(Self::$variant(parameters) => parameters,)* }
            }

            pub(crate) fn visit<V: LawVisitor>(&self, visitor: V) -> V::Output {
                match self { $(Self::$variant(parameters) => visitor.visit($variant::new(parameters)),)* }
            }
        }

        #[cfg(test)]
        mod registered {
            $(
                #[allow(non_snake_case)]
                mod $variant {
                    #[test]
                    fn keeps_the_laws() {
                        super::super::laws::check::<super::super::$variant>($name);
                    }
                }
            )*
        }
    };
}

materials! {
    /// Small-strain linear elasticity, Ψ = μ ε:ε + λ/2 (tr ε)²: constant Hessian, not objective.
    Linear = "linear";
    /// St. Venant–Kirchhoff, Ψ = μ E:E + λ/2 (tr E)²: large rotations, small strains.
    StVenantKirchhoff = "st-venant-kirchhoff";
    /// Neo-Hookean, Ψ = μ/2 (I₁ − 3 − 2 ln J) + λ/2 ln²J: large strains, J > 0.
    NeoHookean = "neo-hookean";
    /// Stable neo-Hookean of Smith, de Goes and Kim (2018): large strains, defined for inverted F too.
    StableNeoHookean = "stable-neo-hookean";
    /// Corotated linear elasticity, Ψ = μ ‖F − R‖² + λ/2 (tr(RᵀF) − 3)².
    Corotated = "corotated";
    /// Mooney–Rivlin, Ψ = c₁₀ (J^(−2/3) I₁ − 3) + c₀₁ (J^(−4/3) I₂ − 3) + κ/2 (J − 1)²: rubber.
    MooneyRivlin = "mooney-rivlin";
}

impl Law {
    /// Density of the body at rest, kg/m³.
    pub fn density(&self) -> f64 {
        self.parameters().density()
    }

    /// Everything that is wrong with the parameters.
    ///
    /// # Errors
    /// All [`FemError::Parameter`] problems at once.
    pub fn check(&self) -> Result<(), Vec<FemError>> {
        let problems = self.parameters().check();
        if problems.is_empty() { Ok(()) } else { Err(problems) }
    }
}
