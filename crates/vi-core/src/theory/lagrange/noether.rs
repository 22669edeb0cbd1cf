//! Noether's theorem: if L does not change along a direction ξ(q), then the momentum p · ξ(q) is conserved.

use num_dual::Dual64;

use crate::theory::lagrange::lagrangian::{Lagrangian, Scalar};

/// The infinitesimal generator ξ(q) = d/ds of a one-parameter group acting on the coordinates.
pub trait Symmetry {
    /// Returns ξ at q, one entry per coordinate.
    fn generator<D: Scalar>(&self, q: &[D]) -> Vec<D>;
}

/// Returns δL along the symmetry, L_q · ξ + L_v · (∂ξ/∂q q̇). It is zero if L has the symmetry.
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

/// Returns the momentum map J = p · ξ(q). A variational integrator conserves it exactly if its discrete Lagrangian
/// has the symmetry (Marsden & West 2001, §1.3.3).
pub fn momentum_map(symmetry: &impl Symmetry, q: &[f64], p: &[f64]) -> f64 {
    symmetry.generator(q).iter().zip(p).map(|(xi, p)| xi * p).sum()
}
