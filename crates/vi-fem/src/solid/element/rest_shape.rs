//! The shape of elements at rest. For linear tetrahedra it can also be rotated, such that a third of its entries
//! vanish.
//!
//! A law that is isotropic and objective has Ψ(F Q) = Ψ(F) and P(F Q) = P(F) Q for every rotation Q. Hence each
//! element may be rotated at rest by itself, and the forces stay the same. Let the edges be J = Q R with an upper
//! triangular R: the first edge lies along the first axis, the second in the plane of the first two. With B = R⁻¹, F
//! Q = (x₁ − x₀, x₂ − x₀, x₃ − x₀) B, and the forces on nodes 1, 2, 3 are the columns of V P Bᵀ.

use pulp::Simd;

use crate::lanes::pack::{GROUP, Pack};
use crate::lanes::real::{Lane, Real};
use crate::small::tensor::{Mat3, cross, determinant, dot, mat3, product, product_transposed, vec3};
use crate::solid::material::batch::{PackedMat3, load_mat3};

/// The geometry at rest of one quadrature point of a group of elements.
#[derive(Debug, Clone, Copy)]
pub(crate) struct PointGeometry {
    /// (∂X/∂ξ)⁻¹ by rows, 1/m.
    pub(super) inverse: PackedMat3,
    /// w det(∂X/∂ξ), m³.
    pub(super) volume: Pack,
}

/// The rest shape of a group of linear tetrahedra, as far as forces depend on it.
pub(super) trait RestShape {
    /// Returns F of a part of the group, given the edges x₁ − x₀, x₂ − x₀, x₃ − x₀ as columns; F Q if the shape is
    /// rotated.
    fn deformation<S: Simd>(&self, simd: S, part: usize, edges: &Mat3<Lane<S>>) -> Mat3<Lane<S>>;
    /// Returns the forces on nodes 1, 2, 3 (N) as columns from P at that F.
    fn forces<S: Simd>(&self, simd: S, part: usize, stress: &Mat3<Lane<S>>) -> Mat3<Lane<S>>;
}

impl RestShape for PointGeometry {
    #[inline(always)]
    fn deformation<S: Simd>(&self, simd: S, part: usize, edges: &Mat3<Lane<S>>) -> Mat3<Lane<S>> {
        product(edges, &load_mat3(simd, &self.inverse, part))
    }

    #[inline(always)]
    fn forces<S: Simd>(&self, simd: S, part: usize, stress: &Mat3<Lane<S>>) -> Mat3<Lane<S>> {
        let p = product_transposed(stress, &load_mat3(simd, &self.inverse, part));
        let volume = self.volume.load(simd, part);
        mat3!(i j => p[i][j] * volume)
    }
}

/// The matrices B of a group of tetrahedra, and their volumes.
#[derive(Debug, Clone, Copy)]
pub(crate) struct RotatedGeometry {
    /// B₀₀ B₀₁ B₀₂ B₁₁ B₁₂ B₂₂, 1/m.
    inverse: [Pack; 6],
    /// V, m³.
    volume: Pack,
}

impl RestShape for RotatedGeometry {
    #[inline(always)]
    fn deformation<S: Simd>(&self, simd: S, part: usize, edges: &Mat3<Lane<S>>) -> Mat3<Lane<S>> {
        let [b00, b01, b02] = vec3!(k => self.inverse[k].load(simd, part));
        let [b11, b12, b22] = vec3!(k => self.inverse[3 + k].load(simd, part));
        let first = vec3!(i => edges[i][0] * b00);
        let second = vec3!(i => edges[i][1].mul_add(b11, edges[i][0] * b01));
        let third = vec3!(i => edges[i][2].mul_add(b22, edges[i][1].mul_add(b12, edges[i][0] * b02)));
        vec3!(i => [first[i], second[i], third[i]])
    }

    #[inline(always)]
    fn forces<S: Simd>(&self, simd: S, part: usize, stress: &Mat3<Lane<S>>) -> Mat3<Lane<S>> {
        let volume = self.volume.load(simd, part);
        let [b00, b01, b02] = vec3!(k => self.inverse[k].load(simd, part) * volume);
        let [b11, b12, b22] = vec3!(k => self.inverse[3 + k].load(simd, part) * volume);
        let first = vec3!(i => stress[i][2].mul_add(b02, stress[i][1].mul_add(b01, stress[i][0] * b00)));
        let second = vec3!(i => stress[i][2].mul_add(b12, stress[i][1] * b11));
        vec3!(i => [first[i], second[i], stress[i][2] * b22])
    }
}

impl RotatedGeometry {
    /// Returns the rotated shape of a group of linear tetrahedra.
    pub(super) fn of(geometry: &PointGeometry) -> Self {
        let mut rotated = Self { inverse: [Pack::default(); 6], volume: geometry.volume };
        for lane in 0..GROUP {
            let inverse = rotated_inverse(&mat3!(i j => geometry.inverse[3 * i + j].0[lane]));
            for (pack, value) in rotated.inverse.iter_mut().zip(inverse) {
                pack.0[lane] = value;
            }
        }
        rotated
    }
}

/// Returns the upper triangle of B in J⁻¹ = B Qᵀ: orthogonalises the rows of J⁻¹ from the last to the first. Cross
/// products keep it accurate if the rows are nearly parallel.
fn rotated_inverse(inverse: &Mat3<f64>) -> [f64; 6] {
    let [a, b, c] = *inverse;
    // q₂ lies along c, q₀ along n = b × c, and q₁ = q₂ × q₀.
    let n = cross(b, c);
    let (length, area) = (dot(c, c).sqrt(), dot(n, n).sqrt());
    let middle = cross(c, n).map(|value| value / (length * area));
    [
        determinant(inverse) / area,
        dot(a, middle),
        dot(a, c) / length,
        area / length,
        dot(b, c) / length,
        length,
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rotating_keeps_the_metric() {
        // Check B Bᵀ = J⁻¹ J⁻ᵀ, also for a sliver.
        for thickness in [1.0, 1e-3, 1e-6] {
            let inverse = [[1.2, 0.3, -0.4], [-0.7, 2.0, 0.1], [0.3, 0.2, 1.0 / thickness]];
            let [b00, b01, b02, b11, b12, b22] = rotated_inverse(&inverse);
            let rotated = [[b00, b01, b02], [0.0, b11, b12], [0.0, 0.0, b22]];
            let (found, expected) =
                (product_transposed(&rotated, &rotated), product_transposed(&inverse, &inverse));
            for i in 0..3 {
                for j in 0..3 {
                    let scale = (expected[i][i] * expected[j][j]).sqrt();
                    assert!((found[i][j] - expected[i][j]).abs() <= 4e-15 * scale, "{thickness} {i} {j}");
                }
            }
            assert!((determinant(&rotated) / determinant(&inverse) - 1.0).abs() < 1e-14);
        }
    }
}
