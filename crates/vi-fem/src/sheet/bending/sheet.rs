//! A sheet as bending models see it.

use vi_core::binary_exponent;
use vi_mesh::Triangulation;

use crate::sheet::triangle::{Frame, flatten, frame};

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
    pub(super) fn unit(&self) -> f64 {
        2.0_f64.powi(binary_exponent(self.moduli[0][0]))
    }

    pub(super) fn frame(&self, triangle: usize) -> Frame {
        frame(&self.surface.corners(triangle), self.directions.map(|all| all[triangle]))
    }

    /// A triangle's corners in its own plane, m.
    pub(super) fn plane(&self, triangle: usize) -> [[f64; 2]; 3] {
        flatten(&self.surface.corners(triangle), &self.frame(triangle))
    }
}
