//! Lagrangians L(t, q, q̇, q̈) that depend on accelerations (an elastic rod as a function of arc length, a trajectory
//! of minimum jerk). Their equation is ∂L/∂q − d/dt ∂L/∂q̇ + d²/dt² ∂L/∂q̈ = 0 (Ostrogradsky).

use nalgebra::DVector;
use num_dual::{Dual, Dual2, Dual2_64};

use crate::theory::lagrange::lagrangian::{Lagrangian, Scalar};
use crate::theory::lagrange::trajectory::Trajectory;

/// A Lagrangian of coordinates, velocities and accelerations, n each.
pub trait HigherLagrangian {
    /// Returns the number n of coordinates.
    fn dof_count(&self) -> usize;
    /// Returns L(t, q, v, a) with v = q̇ and a = q̈.
    fn value<D: Scalar>(&self, t: D, q: &[D], v: &[D], a: &[D]) -> D;
}

/// An ordinary Lagrangian, considered as one that does not depend on accelerations.
#[derive(Debug, Clone, Copy)]
pub struct FirstOrder<L>(pub L);

impl<L: Lagrangian> HigherLagrangian for FirstOrder<L> {
    fn dof_count(&self) -> usize {
        self.0.dof_count()
    }
    fn value<D: Scalar>(&self, t: D, q: &[D], v: &[D], _a: &[D]) -> D {
        self.0.value(t, q, v)
    }
}

/// Returns the residual ∂L/∂q − d/dt ∂L/∂q̇ + d²/dt² ∂L/∂q̈ of a path at time t, one entry per coordinate.
///
/// Time is a second-order dual number, so that ∂L/∂q̇ and ∂L/∂q̈ are functions of time with derivatives. One more
/// dual number around it gives the partial derivatives.
pub fn higher_residual(lagrangian: &impl HigherLagrangian, path: &impl Trajectory, t: f64) -> DVector<f64> {
    let time = Dual2_64::from_re(t).derivative();
    let jets = path.at(Dual2::from_re(time).derivative());
    let n = jets.len();
    let constant = |x: Dual2_64| Dual::new(x, Dual2_64::from_re(0.0));
    let mut arguments: [Vec<Dual<Dual2_64>>; 3] = [
        jets.iter().map(|jet| constant(jet.re)).collect(),
        jets.iter().map(|jet| constant(jet.v1)).collect(),
        jets.iter().map(|jet| constant(jet.v2)).collect(),
    ];
    let mut partial = |slot: usize, i: usize| -> Dual2_64 {
        arguments[slot][i].eps = Dual2_64::from_re(1.0);
        let [q, v, a] = &arguments;
        let slope = lagrangian.value(constant(time), q, v, a).eps;
        arguments[slot][i].eps = Dual2_64::from_re(0.0);
        slope
    };
    DVector::from_fn(n, |i, _| partial(0, i).re - partial(1, i).v1 + partial(2, i).v2)
}
