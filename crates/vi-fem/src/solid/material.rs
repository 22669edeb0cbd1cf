//! The registry of hyperelastic laws Ψ(F) that a scene can name.
//!
//! To add a law, write one file in `material/` with a [`Material`] and add one line to `materials!` below. The line
//! gives the scene name, the schema entry, the batch kernels and the tests that every law must pass.

pub(crate) mod batch;
pub(crate) mod contract;
pub(crate) mod eigensystem;
pub(crate) mod formula;
mod jet;
#[cfg(test)]
mod laws;
mod near_rest;
pub(crate) mod own;
pub(crate) mod parameters;
mod program;
#[cfg(test)]
pub(crate) mod properties;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::error::FemError;
use contract::{LawVisitor, Material};
use formula::{Formula, FormulaParameters};
use own::{Own, OwnLaw};
use parameters::Parameters;

macro_rules! materials {
    ($($(#[$doc:meta])* $file:ident: $variant:ident = $name:literal;)*) => {
        $(mod $file;)*

        /// The laws with their parameters.
        pub(crate) mod registered {
            $(pub use super::$file::*;)*
        }
        use registered::*;

        /// A law with its parameters, as a scene file writes them: `{ law = "neo-hookean", young = 1e6, poisson =
        /// 0.3, density = 1000.0 }`.
        #[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
        #[serde(tag = "law", rename_all = "kebab-case")]
        #[non_exhaustive]
        pub enum Law {
            $($(#[$doc])* #[serde(rename = $name)] $variant(<$variant as Material>::Parameters),)*
            /// A law given by a formula for Ψ(I₁, I₂, J), which is differentiated exactly.
            #[serde(rename = "formula")] Formula(FormulaParameters),
            /// A law that a program defines itself; a scene file cannot name it.
            #[serde(skip_deserializing, rename = "own")]
            #[schemars(skip)]
            Own(OwnLaw),
        }

        impl Law {
            /// The scene names of all registered laws.
            pub const NAMES: &'static [&'static str] = &[$($name),*];

            /// Returns one example of each registered law with valid parameters, for tests and first steps.
            pub fn examples() -> Vec<Self> {
                vec![$(Self::$variant(Parameters::example())),*]
            }

            /// Returns the scene name of this law.
            pub fn name(&self) -> &'static str {
                match self { $(Self::$variant(_) => $name,)* Self::Formula(_) => "formula", Self::Own(_) => "own" }
            }

            /// Returns the parameters.
            pub fn parameters(&self) -> &dyn Parameters {
                match self {
                    $(Self::$variant(parameters) => parameters,)*
                    Self::Formula(parameters) => parameters,
                    Self::Own(law) => law,
                }
            }

            pub(crate) fn visit<V: LawVisitor>(&self, visitor: V) -> V::Output {
                match self {
                    $(Self::$variant(parameters) => visitor.visit($variant::new(parameters)),)*
                    Self::Formula(parameters) => visitor.visit(Formula::new(parameters)),
                    Self::Own(law) => visitor.visit(Own::new(law)),
                }
            }
        }

        #[cfg(test)]
        mod keeps_the_laws {
            $(
                #[test]
                fn $file() {
                    super::laws::check::<super::$variant>($name);
                }
            )*

            #[test]
            fn formula() {
                super::laws::check::<super::Formula>("formula");
            }
        }
    };
}

materials! {
    /// Small-strain linear elasticity, Ψ = μ ε:ε + λ/2 (tr ε)²: constant Hessian, not objective.
    linear: Linear = "linear";
    /// St. Venant–Kirchhoff, Ψ = μ E:E + λ/2 (tr E)²: large rotations, small strains.
    st_venant_kirchhoff: StVenantKirchhoff = "st-venant-kirchhoff";
    /// Neo-Hookean, Ψ = μ/2 (I₁ − 3 − 2 ln J) + λ/2 ln²J: large strains, J > 0.
    neo_hookean: NeoHookean = "neo-hookean";
    /// Stable neo-Hookean of Smith, de Goes and Kim (2018): large strains, defined for inverted F too.
    stable_neo_hookean: StableNeoHookean = "stable-neo-hookean";
    /// Corotated linear elasticity, Ψ = μ ‖F − R‖² + λ/2 (tr(RᵀF) − 3)².
    corotated: Corotated = "corotated";
    /// Mooney–Rivlin, Ψ = c₁₀ (J^(−2/3) I₁ − 3) + c₀₁ (J^(−4/3) I₂ − 3) + κ/2 (J − 1)²: rubber.
    mooney_rivlin: MooneyRivlin = "mooney-rivlin";
}

impl From<OwnLaw> for Law {
    fn from(law: OwnLaw) -> Self {
        Self::Own(law)
    }
}

impl Law {
    /// Returns the density of the body at rest, kg/m³.
    pub fn density(&self) -> f64 {
        self.parameters().density()
    }

    /// Checks the parameters.
    ///
    /// # Errors
    /// Returns all [`FemError::Parameter`] problems at once.
    pub fn check(&self) -> Result<(), Vec<FemError>> {
        let problems = self.parameters().check();
        if problems.is_empty() { Ok(()) } else { Err(problems) }
    }
}
