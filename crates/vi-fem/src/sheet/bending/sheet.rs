//! The data of a sheet that bending models read.

use vi_core::binary_exponent;
use vi_mesh::Triangulation;

use crate::sheet::triangle::{Frame, flatten, frame};

/// The data of a sheet that bending models read.
pub(crate) struct BentSheet<'a> {
    pub(crate) surface: &'a Triangulation,
    /// Whether the rest angles are zero whatever the shape of the mesh.
    pub(crate) flat: bool,
    /// Bending moduli h³/12 Q, N m, for (κ₁₁, κ₂₂, 2κ₁₂) in the frame of `directions`.
    pub(crate) moduli: [[f64; 3]; 3],
    /// The first axis of the law in each triangle, if the law has axes.
    pub(crate) directions: Option<&'a [[f64; 3]]>,
    /// Boundary edges whose normal is fixed in space.
    pub(crate) clamped: &'a [[u32; 2]],
    /// Boundary edges in a mirror plane, with the normal of the plane.
    pub(crate) mirrored: &'a [([u32; 2], [f64; 3])],
    pub(crate) node_offset: usize,
    pub(crate) name: String,
}

impl BentSheet<'_> {
    /// Returns a unit of energy, J: the power of two below the first modulus. Roots of energies are taken in this
    /// unit, so that a change of the unit of mass by a power of two does not change their bits.
    pub(super) fn unit(&self) -> f64 {
        2.0_f64.powi(binary_exponent(self.moduli[0][0]))
    }

    pub(super) fn frame(&self, triangle: usize) -> Frame {
        frame(&self.surface.corners(triangle), self.directions.map(|all| all[triangle]))
    }

    /// Returns the corners of a triangle in its own plane, m.
    pub(super) fn plane(&self, triangle: usize) -> [[f64; 2]; 3] {
        flatten(&self.surface.corners(triangle), &self.frame(triangle))
    }
}
