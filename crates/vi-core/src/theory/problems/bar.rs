//! An elastic bar of linear finite elements, as a Lagrangian written by hand.

use crate::theory::lagrange::lagrangian::{Lagrangian, Scalar};

/// A bar along x, fixed at its left end, of equal two-node elements with lumped mass:
/// L = Σ ½ m_a u̇_a² − Σ_e ½ (E A/l)(u_{e+1} − u_e)², q = the axial displacements u_1 … u_n, m.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bar {
    /// Number of elements n.
    pub element_count: usize,
    /// Total length, m.
    pub length: f64,
    /// Cross-section A, m².
    pub area: f64,
    /// Young's modulus E, Pa.
    pub young: f64,
    /// Density ρ, kg/m³.
    pub density: f64,
}

impl Lagrangian for Bar {
    fn dof_count(&self) -> usize {
        self.element_count
    }
    fn value<D: Scalar>(&self, _t: D, q: &[D], v: &[D]) -> D {
        let l = self.length / self.element_count as f64;
        let (stiffness, mass) = (self.young * self.area / l, self.density * self.area * l);
        let mut sum = D::from(0.0);
        let mut left = D::from(0.0);
        for e in 0..self.element_count {
            let stretch = q[e] - left;
            left = q[e];
            // The last node has half the mass of its only element.
            let share = if e + 1 == self.element_count { 0.5 } else { 1.0 };
            sum += v[e] * v[e] * (0.5 * mass * share) - stretch * stretch * (0.5 * stiffness);
        }
        sum
    }
}
