//! The action of a path and its variation δ in a direction η. Here any function f(t, q, q̇) is a [`Lagrangian`]. Its
//! value along a path is a function of time, and δ is the derivative with respect to ε on the varied path q + ε η.

use num_dual::{Dual, Dual64};

use crate::contract::quadrature::Quadrature;
use crate::error::CoreError;
use crate::theory::lagrange::lagrangian::{Lagrangian, Scalar};
use crate::theory::lagrange::trajectory::Trajectory;

/// Evaluates f(t, q(t), q̇(t)) along a path.
pub fn along<D: Scalar>(f: &impl Lagrangian, path: &impl Trajectory, t: D) -> D
where
    Dual<D>: Scalar,
{
    along_varied(f, path, path, t, D::zero())
}

/// Evaluates f along the varied path q + ε η, for numbers t and ε that may carry derivatives.
pub fn along_varied<D: Scalar>(
    f: &impl Lagrangian,
    path: &impl Trajectory,
    eta: &impl Trajectory,
    t: D,
    epsilon: D,
) -> D
where
    Dual<D>: Scalar,
{
    let time = Dual::new(t, D::one());
    let varied: Vec<(D, D)> = path
        .at(time)
        .into_iter()
        .zip(eta.at(time))
        .map(|(q, eta)| (q.re + epsilon * eta.re, q.eps + epsilon * eta.eps))
        .collect();
    let q: Vec<D> = varied.iter().map(|pair| pair.0).collect();
    let v: Vec<D> = varied.iter().map(|pair| pair.1).collect();
    f.value(t, &q, &v)
}

/// Returns the total derivative df/dt along a path.
pub fn total_derivative(f: &impl Lagrangian, path: &impl Trajectory, t: f64) -> f64 {
    along(f, path, Dual64::new(t, 1.0)).eps
}

/// Returns the variation δf = d/dε f(t, q + ε η, q̇ + ε η̇) at ε = 0 and time t.
pub fn variation(f: &impl Lagrangian, path: &impl Trajectory, eta: &impl Trajectory, t: f64) -> f64 {
    along_varied(f, path, eta, Dual64::from_re(t), Dual64::new(0.0, 1.0)).eps
}

/// Returns ∫ f dt over [start, end] along a path, by `panels` panels of 10-point Gauss–Legendre quadrature (exact for
/// polynomials of degree 19 on each panel). For f = L it is the action, J s.
///
/// # Errors
/// Returns [`CoreError::Points`] if `panels` is zero.
pub fn action(
    f: &impl Lagrangian,
    path: &impl Trajectory,
    start: f64,
    end: f64,
    panels: usize,
) -> Result<f64, CoreError> {
    if panels == 0 {
        return Err(CoreError::Points {
            what: "composite quadrature",
            count: 0,
            allowed: "it needs at least 1 panel",
        });
    }
    let rule = Quadrature::gauss_legendre(10)?;
    let h = (end - start) / panels as f64;
    let mut sum = 0.0;
    for panel in 0..panels {
        for (c, b) in rule.nodes().iter().zip(rule.weights()) {
            sum += h * b * along(f, path, start + h * (panel as f64 + c));
        }
    }
    Ok(sum)
}
