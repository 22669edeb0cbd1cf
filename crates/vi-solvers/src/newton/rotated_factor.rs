//! Rotations of the material at the nodes, by which a factor made at one configuration is used at another: A⁻¹ ≈ R A₀⁻¹
//! Rᵀ. R is block diagonal over the nodes with the blocks polar(F̄_now) polar(F̄_then)ᵀ; F̄ is the deformation gradient
//! around the node, averaged over the elements with weights of volume times stiffness. If a node of a stiff part
//! rotated with its soft neighbours, the rotated A would resist rigid motions of the stiff part. A lumped mass commutes
//! with R.

use nalgebra::Matrix3;
use vi_core::System;

use crate::assemble::assembler::Assembler;
use crate::index::NONE;

pub(crate) struct RotatedFactor {
    /// For each node, the free coordinate of its first axis (the two others follow). It is [`NONE`] if not all three
    /// are free; such a node is not rotated.
    first_free: Vec<u32>,
    means: Vec<[f64; 9]>,
    then: Vec<Matrix3<f64>>,
    /// polar(F̄_now) polar(F̄_then)ᵀ of each node.
    rotation: Vec<Matrix3<f64>>,
    is_rotated: bool,
}

impl RotatedFactor {
    /// Returns `None` if the coordinates are not points in space with one mass per node.
    pub(crate) fn new(system: &System) -> Option<Self> {
        let coordinates = system.coordinates();
        let (count, mass) = (coordinates.dof_count(), system.mass());
        if !count.is_multiple_of(3) || system.potentials().iter().any(|term| term.stencils().block != 3) {
            return None;
        }
        let mut first_free = vec![NONE; count / 3];
        let free = coordinates.free();
        for k in 0..free.len().saturating_sub(2) {
            let dof = free[k] as usize;
            let follows = free[k + 1] as usize == dof + 1 && free[k + 2] as usize == dof + 2;
            if dof.is_multiple_of(3) && follows {
                first_free[dof / 3] = k as u32;
            }
        }
        let isotropic =
            |node: usize| mass[3 * node] == mass[3 * node + 1] && mass[3 * node] == mass[3 * node + 2];
        if !(0..count / 3).all(|node| first_free[node] == NONE || isotropic(node)) {
            return None;
        }
        let nodes = count / 3;
        let identity = vec![Matrix3::identity(); nodes];
        let (then, rotation) = (identity.clone(), identity);
        Some(Self { first_free, means: vec![[0.0; 9]; nodes], then, rotation, is_rotated: false })
    }

    /// Sets the configuration x at which the factor is made.
    pub(crate) fn set_origin(&mut self, assembler: &mut Assembler, x: &[f64]) {
        self.is_rotated = false;
        if assembler.mean_deformations(x, &mut self.means) {
            for (then, mean) in self.then.iter_mut().zip(&self.means) {
                *then = rotation_of(mean);
            }
        }
    }

    /// Sets the configuration x at which the factor is used.
    pub(crate) fn rotate_to(&mut self, assembler: &mut Assembler, x: &[f64]) {
        self.is_rotated = assembler.mean_deformations(x, &mut self.means);
        if self.is_rotated {
            for (node, mean) in self.means.iter().enumerate() {
                self.rotation[node] = rotation_of(mean) * self.then[node].transpose();
            }
        }
    }

    /// Computes v ← Rᵀv.
    pub(crate) fn to_origin(&self, v: &mut [f64]) {
        self.rotate(v, |r| r.transpose());
    }

    /// Computes v ← R v.
    pub(crate) fn to_now(&self, v: &mut [f64]) {
        self.rotate(v, |r| *r);
    }

    fn rotate(&self, v: &mut [f64], side: impl Fn(&Matrix3<f64>) -> Matrix3<f64>) {
        if !self.is_rotated {
            return;
        }
        for (&first, rotation) in self.first_free.iter().zip(&self.rotation) {
            if first != NONE {
                let k = first as usize;
                let image = side(rotation) * nalgebra::Vector3::new(v[k], v[k + 1], v[k + 2]);
                v[k..k + 3].copy_from_slice(image.as_slice());
            }
        }
    }
}

/// Returns the rotation of the polar decomposition F = R U by Newton's iteration R ← ½(R + R⁻ᵀ) (Higham 1986).
/// Returns the identity if F is inverted or flat, because then no rotation is meaningful.
fn rotation_of(mean: &[f64; 9]) -> Matrix3<f64> {
    let f = Matrix3::from_row_slice(mean);
    let size = f.norm();
    // With F scaled to the norm √3, the determinant of a rotation is 1.
    let mut r = f * (3.0_f64.sqrt() / size);
    if !(size > 0.0 && size.is_finite() && r.determinant() > 1e-3) {
        return Matrix3::identity();
    }
    for _ in 0..30 {
        let Some(inverse) = r.try_inverse() else { return Matrix3::identity() };
        let next = (r + inverse.transpose()) * 0.5;
        let change = (next - r).norm();
        r = next;
        if change < 1e-12 {
            break;
        }
    }
    r
}

#[cfg(test)]
mod tests {
    use nalgebra::{Rotation3, Vector3};

    use super::*;

    #[test]
    fn polar_rotation_is_found_and_scale_does_not_matter() {
        let r = Rotation3::new(Vector3::new(2.0, -0.7, 0.4)).into_inner();
        let stretch = Matrix3::new(1.3, 0.2, 0.1, 0.2, 0.8, -0.1, 0.1, -0.1, 1.1);
        let f = r * stretch * 1e-6;
        let mean: [f64; 9] = f.transpose().as_slice().try_into().unwrap();
        assert!((rotation_of(&mean) - r).norm() < 1e-12);
    }

    #[test]
    fn inverted_and_empty_nodes_are_not_rotated() {
        assert_eq!(rotation_of(&[0.0; 9]), Matrix3::identity());
        assert_eq!(rotation_of(&[-1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]), Matrix3::identity());
    }
}
