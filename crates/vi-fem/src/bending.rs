//! How a sheet resists bending: the models a scene can name. It must not know stretching, nor how
//! blocks are summed.
//!
//! To add a model: one file in `bending/` with `potentials(&BentSheet)`, one line in `bendings!`.

mod hinge;
mod hinges;
mod patches;
mod quadratic;
mod reconstruction;
mod shell;
mod turn;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use vi_core::{Potential, binary_exponent};

use crate::FemError;
use crate::membrane::{Frame, flatten, frame};
use vi_mesh::Triangulation;

/// A sheet as bending models see it.
pub(crate) struct BentSheet<'a> {
    pub(crate) surface: &'a Triangulation,
    /// Is the sheet at rest when flat, whatever its shape?
    pub(crate) flat: bool,
    /// Bending moduli h³/12 Q, N m, in the frame that follows `directions`; on (κ₁₁, κ₂₂, 2κ₁₂).
    pub(crate) moduli: [[f64; 3]; 3],
    /// The first axis of the law in each triangle, if it has axes.
    pub(crate) directions: Option<&'a [[f64; 3]]>,
    /// Boundary edges whose normal is held in space.
    pub(crate) clamped: &'a [[u32; 2]],
    /// Boundary edges in a mirror plane, with its normal.
    pub(crate) mirrored: &'a [([u32; 2], [f64; 3])],
    pub(crate) node_offset: usize,
    pub(crate) name: String,
}

impl BentSheet<'_> {
    /// A unit of energy, J: the power of two below the first modulus. Roots of energies are taken in it, so that
    /// they have the same bits in units of mass that are powers of two.
    fn unit(&self) -> f64 {
        2.0_f64.powi(binary_exponent(self.moduli[0][0]))
    }

    fn frame(&self, triangle: usize) -> Frame {
        frame(&self.surface.corners(triangle), self.directions.map(|all| all[triangle]))
    }

    /// A triangle's corners in its own plane, m.
    fn plane(&self, triangle: usize) -> [[f64; 2]; 3] {
        flatten(&self.surface.corners(triangle), &self.frame(triangle))
    }
}

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
