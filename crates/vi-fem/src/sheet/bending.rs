//! How a sheet resists bending: the models a scene can name.
//!
//! To add a model: one file in `bending/` with `potentials(&BentSheet)`, one line in `bendings!`.

mod hinge;
mod hinges;
mod patches;
mod quadratic;
mod reconstruction;
mod sheet;
mod shell;
mod turn;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use vi_core::Potential;

use crate::error::FemError;
pub(crate) use sheet::BentSheet;

macro_rules! bendings {
    ($($(#[$doc:meta])* $variant:ident($room:ident) = $name:literal;)*) => {
        /// How a sheet resists bending.
        #[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
        #[serde(rename_all = "kebab-case")]
        #[non_exhaustive]
        pub enum Bending {
            /// Not at all.
            None,
            $($(#[$doc])* #[serde(rename = $name)] $variant,)*
        }

        impl Bending {
            /// All models that resist.
            pub const ALL: &'static [Self] = &[$(Self::$variant),*];

            /// The scene name.
            pub fn name(self) -> &'static str {
                match self { Self::None => "none", $(Self::$variant => $name,)* }
            }

            pub(crate) fn potentials(self, sheet: &BentSheet) -> Result<Vec<Box<dyn Potential>>, FemError> {
                match self { Self::None => Ok(Vec::new()), $(Self::$variant => $room::potentials(sheet),)* }
            }
        }
    };
}

bendings! {
    /// Discrete Shells: a spring in the angle at every edge. Cheap, any rest shape; right for bending
    /// along the edges of a regular mesh, dependent on the mesh otherwise.
    Hinge(hinge) = "hinge";
    /// Isometric bending of flat sheets with a constant Hessian: the cheapest.
    Quadratic(quadratic) = "quadratic";
    /// Kirchhoff–Love plates and shells on any mesh, with Poisson's and orthotropic coupling.
    Shell(shell) = "shell";
}

// The default is a bending stiffness that is right on every mesh.
#[allow(clippy::derivable_impls)]
impl Default for Bending {
    fn default() -> Self {
        Self::Shell
    }
}
