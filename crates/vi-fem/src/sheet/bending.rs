//! The registry of bending models that a scene can name.
//!
//! To add a model, write one file in `bending/` with `potentials(&BentSheet)` and add one line to `bendings!`.

mod hinge;
mod hinges;
mod patches;
mod quadratic;
mod reconstruction;
mod runs;
mod sheet;
mod shell;
mod stencil;
mod turn;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use vi_core::Potential;

use crate::error::FemError;
pub(crate) use sheet::BentSheet;

macro_rules! bendings {
    ($($(#[$doc:meta])* $variant:ident($file:ident) = $name:literal;)*) => {
        /// The model of a sheet's resistance to bending.
        #[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
        #[serde(rename_all = "kebab-case")]
        #[non_exhaustive]
        pub enum Bending {
            /// No resistance to bending.
            None,
            $($(#[$doc])* #[serde(rename = $name)] $variant,)*
        }

        impl Bending {
            /// All models that resist bending.
            pub const ALL: &'static [Self] = &[$(Self::$variant),*];

            /// Returns the name in scene files.
            pub fn name(self) -> &'static str {
                match self { Self::None => "none", $(Self::$variant => $name,)* }
            }

            pub(crate) fn potentials(self, sheet: &BentSheet) -> Result<Vec<Box<dyn Potential>>, FemError> {
                match self { Self::None => Ok(Vec::new()), $(Self::$variant => $file::potentials(sheet),)* }
            }
        }
    };
}

bendings! {
    /// Discrete Shells: one angular spring per edge. It is cheap and accepts any rest shape. It is accurate for
    /// bending along the edges of a regular mesh; otherwise the result depends on the mesh.
    Hinge(hinge) = "hinge";
    /// Isometric bending of flat sheets with a constant Hessian: the cheapest model.
    Quadratic(quadratic) = "quadratic";
    /// Kirchhoff–Love plates and shells on any mesh, with the coupling by Poisson's ratio and with orthotropy.
    Shell(shell) = "shell";
}

// The default is the model whose bending stiffness is right on every mesh.
#[allow(clippy::derivable_impls)]
impl Default for Bending {
    fn default() -> Self {
        Self::Shell
    }
}
