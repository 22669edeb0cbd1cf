//! Noether's theorem: a direction ξ(q) in which L does not change gives a momentum p · ξ(q) that does not change.

use num_dual::Dual64;

use crate::theory::lagrange::lagrangian::{Lagrangian, Scalar};

/// The infinitesimal generator ξ(q) = d/ds of a one-parameter group acting on the coordinates.
pub trait Symmetry {
    /// ξ at q, one entry a coordinate.
    fn generator<D: Scalar>(&self, q: &[D]) -> Vec<D>;
}

/// δL along the symmetry, L_q · ξ + L_v · (∂ξ/∂q q̇): zero where L has it.
pub fn symmetry_defect(
    lagrangian: &impl Lagrangian,
    symmetry: &impl Symmetry,
    t: f64,
    q: &[f64],
    v: &[f64],
) -> f64 {
    let moving: Vec<Dual64> = q.iter().zip(v).map(|(&q, &v)| Dual64::new(q, v)).collect();
    let xi = symmetry.generator(&moving);
    let varied_q: Vec<Dual64> = q.iter().zip(&xi).map(|(&q, xi)| Dual64::new(q, xi.re)).collect();
    let varied_v: Vec<Dual64> = v.iter().zip(&xi).map(|(&v, xi)| Dual64::new(v, xi.eps)).collect();
    lagrangian.value(Dual64::from_re(t), &varied_q, &varied_v).eps
}

/// The momentum map J = p · ξ(q). A variational integrator whose discrete Lagrangian has the
/// symmetry keeps it exactly (Marsden & West 2001, §1.3.3).
pub fn momentum_map(symmetry: &impl Symmetry, q: &[f64], p: &[f64]) -> f64 {
    symmetry.generator(q).iter().zip(p).map(|(xi, p)| xi * p).sum()
}
