//! The Euler–Lagrange equations d/dt ∂L/∂q̇ = ∂L/∂q: their residual on a path, the accelerations that they give, and
//! the two Legendre transforms.

use nalgebra::DVector;
use num_dual::HyperDual64;

use crate::error::CoreError;
use crate::theory::lagrange::expansion::Expand;
use crate::theory::lagrange::lagrangian::Lagrangian;
use crate::theory::lagrange::trajectory::{Trajectory, motion};

/// Returns ∂²L/∂t∂v, n entries; non-zero only for a Lagrangian that depends on time.
fn explicit_rate(lagrangian: &impl Lagrangian, t: f64, q: &[f64], v: &[f64]) -> DVector<f64> {
    let time = HyperDual64::from_re(t).derivative1();
    let q: Vec<HyperDual64> = q.iter().map(|&q| HyperDual64::from_re(q)).collect();
    let mut v: Vec<HyperDual64> = v.iter().map(|&v| HyperDual64::from_re(v)).collect();
    DVector::from_fn(v.len(), |i, _| {
        v[i].eps2 = 1.0;
        let mixed = lagrangian.value(time, &q, &v).eps1eps2;
        v[i].eps2 = 0.0;
        mixed
    })
}

/// Returns the Euler–Lagrange residual d/dt ∂L/∂q̇ − ∂L/∂q = L_vt + L_vq q̇ + L_vv q̈ − L_q (N, generalised) of any
/// path at time t. It vanishes for all times only if the path is a motion.
pub fn residual(lagrangian: &impl Lagrangian, path: &impl Trajectory, t: f64) -> DVector<f64> {
    let (q, v, a) = motion(path, t);
    let at = lagrangian.expansion(t, &q, &v);
    explicit_rate(lagrangian, t, &q, &v) + at.vq * DVector::from_vec(v) + at.vv * DVector::from_vec(a)
        - at.d_q
}

/// Returns the accelerations q̈ that make the residual vanish: L_vv q̈ = L_q − L_vt − L_vq q̇.
///
/// # Errors
/// Returns [`CoreError::SingularMass`] if ∂²L/∂q̇² has no inverse.
pub fn accelerations(
    lagrangian: &impl Lagrangian,
    t: f64,
    q: &[f64],
    v: &[f64],
) -> Result<DVector<f64>, CoreError> {
    let at = lagrangian.expansion(t, q, v);
    let rate = explicit_rate(lagrangian, t, q, v) + at.vq * DVector::from_column_slice(v);
    at.vv.lu().solve(&(at.d_q - rate)).ok_or(CoreError::SingularMass { t })
}

/// Returns the Legendre transform p = ∂L/∂q̇.
pub fn momenta(lagrangian: &impl Expand, t: f64, q: &[f64], v: &[f64]) -> DVector<f64> {
    lagrangian.gradient(t, q, v).1
}

/// Inverts the Legendre transform: returns the velocities with the momenta p, by Newton's method from rest.
///
/// # Errors
/// Returns [`CoreError::SingularMass`] if ∂²L/∂q̇² has no inverse, [`CoreError::Convergence`] if Newton's method fails.
pub fn velocities(lagrangian: &impl Expand, t: f64, q: &[f64], p: &[f64]) -> Result<DVector<f64>, CoreError> {
    const MAX_ITERATIONS: usize = 50;
    let p = DVector::from_column_slice(p);
    let mut v = DVector::zeros(p.len());
    let mut previous = f64::INFINITY;
    for _ in 0..MAX_ITERATIONS {
        let at = lagrangian.expansion(t, q, v.as_slice());
        let defect = &p - at.d_v;
        let update = at.vv.lu().solve(&defect).ok_or(CoreError::SingularMass { t })?;
        v += &update;
        // Stop at round-off: the update is small relative to the velocities (or to 1 near rest) and no longer
        // decreases.
        let size = update.amax();
        if size <= 1e-14 * v.amax() || (size <= 1e-12 * (1.0 + v.amax()) && size >= 0.5 * previous) {
            return Ok(v);
        }
        previous = size;
    }
    let residual = (momenta(lagrangian, t, q, v.as_slice()) - p).norm();
    Err(CoreError::Convergence { iterations: MAX_ITERATIONS, residual })
}

/// Returns the energy function E = q̇ · ∂L/∂q̇ − L, J: conserved if L does not depend on time.
pub fn energy(lagrangian: &impl Expand, t: f64, q: &[f64], v: &[f64]) -> f64 {
    let p = momenta(lagrangian, t, q, v);
    p.iter().zip(v).map(|(p, v)| p * v).sum::<f64>() - lagrangian.lagrangian(t, q, v)
}
