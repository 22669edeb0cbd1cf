//! The kernels of a law behind a trait object: an element is compiled once for all laws, and not once per pair of
//! element and law.
//!
//! One call processes many points, so the time of a dynamic call is negligible.

use std::ops::Range;

use pulp::Arch;
use vi_core::{PatchArray, binary_exponent};

use crate::lanes::pack::{GROUP, Pack};
use crate::small::tensor::{Mat3, packed_index};
use crate::solid::element::rest_shape::PointGeometry;
use crate::solid::element::simplex::{self, Shapes};
use crate::solid::material::Law;
use crate::solid::material::batch::{self, PackedMat3, PackedTangent};
use crate::solid::material::contract::{LawVisitor, Material, Outside};

/// The kernels of a law of any type.
pub(crate) trait LawKernels: Send + Sync {
    /// Returns [`Material::LINEAR`].
    fn is_linear(&self) -> bool;
    /// Calls [`Material::inside`].
    fn inside(&self, f: &Mat3<f64>) -> Result<(), Outside>;
    /// Calls [`batch::energies`].
    fn energies(&self, arch: Arch, points: &[PackedMat3], out: &mut [Pack]);
    /// Calls [`batch::stresses`].
    fn stresses(&self, arch: Arch, points: &mut [PackedMat3]);
    /// Calls [`batch::tangents`].
    fn tangents(&self, arch: Arch, points: &[PackedMat3], out: &mut [PackedTangent]);
    /// Calls [`batch::projected_tangents`].
    fn projected_tangents(&self, arch: Arch, points: &[PackedMat3], out: &mut [PackedTangent]);
    /// Calls [`simplex::add_forces`].
    fn add_simplex_forces(
        &self,
        arch: Arch,
        shapes: Shapes<'_>,
        places: &[u16],
        x: &PatchArray,
        sums: &mut PatchArray,
    );
    /// Calls [`simplex::hessians`].
    fn simplex_hessians(
        &self,
        arch: Arch,
        geometry: &[PointGeometry],
        nodes: &[u32],
        range: Range<usize>,
        x: &[f64],
        out: &mut [f64],
    );
}

impl<M: Material> LawKernels for M {
    fn is_linear(&self) -> bool {
        M::LINEAR
    }

    fn inside(&self, f: &Mat3<f64>) -> Result<(), Outside> {
        Material::inside(self, f)
    }

    fn energies(&self, arch: Arch, points: &[PackedMat3], out: &mut [Pack]) {
        batch::energies(arch, self, points, out);
    }

    fn stresses(&self, arch: Arch, points: &mut [PackedMat3]) {
        batch::stresses(arch, self, points);
    }

    fn tangents(&self, arch: Arch, points: &[PackedMat3], out: &mut [PackedTangent]) {
        batch::tangents(arch, self, points, out);
    }

    fn projected_tangents(&self, arch: Arch, points: &[PackedMat3], out: &mut [PackedTangent]) {
        batch::projected_tangents(arch, self, points, out);
    }

    fn add_simplex_forces(
        &self,
        arch: Arch,
        shapes: Shapes<'_>,
        places: &[u16],
        x: &PatchArray,
        sums: &mut PatchArray,
    ) {
        simplex::add_forces(arch, self, shapes, places, x, sums);
    }

    fn simplex_hessians(
        &self,
        arch: Arch,
        geometry: &[PointGeometry],
        nodes: &[u32],
        range: Range<usize>,
        x: &[f64],
        out: &mut [f64],
    ) {
        simplex::hessians(arch, self, geometry, nodes, range, x, out);
    }
}

/// Returns the power of two at or below the sum of the moduli ∂²Ψ/∂F_ij² at rest, Pa.
pub(crate) fn stiffness_weight(law: &dyn LawKernels) -> f64 {
    let rest: PackedMat3 = std::array::from_fn(|k| Pack([if k % 4 == 0 { 1.0 } else { 0.0 }; GROUP]));
    let mut tangent: [PackedTangent; 1] = [std::array::from_fn(|_| Pack::default())];
    law.tangents(Arch::new(), &[rest], &mut tangent);
    let moduli: f64 = (0..9).map(|i| tangent[0][packed_index(i, i)].0[0]).sum();
    2.0_f64.powi(binary_exponent(moduli))
}

/// Returns the kernels of a law.
pub(crate) fn kernels_of(law: &Law) -> Box<dyn LawKernels> {
    struct Boxed;
    impl LawVisitor for Boxed {
        type Output = Box<dyn LawKernels>;
        fn visit<M: Material>(self, material: M) -> Self::Output {
            Box::new(material)
        }
    }
    law.visit(Boxed)
}
