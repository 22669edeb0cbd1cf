//! Forces without a potential as they are linearised at one configuration, with the symmetric part of their tangent. These have a
//! potential, so that a step minimises a function.

use vi_core::System;

use crate::assemble::force_sum::ForceSum;
use crate::linear::matrix::SymmetricMatrix;
use crate::linear::matrix_sum::MatrixSum;
use crate::vectors;

/// The forces f̂ − S (q − q̂).
pub(super) struct HeldForces {
    /// q̂.
    q: Vec<f64>,
    /// f̂ on the free coordinates, N.
    force: Vec<f64>,
    /// S, N/m; `None` if it is zero.
    tangent: Option<SymmetricMatrix>,
    change: Vec<f64>,
    product: Vec<f64>,
}

impl HeldForces {
    /// Returns the forces at the positions x and velocities ẋ of all coordinates, with ∂ẋ/∂q = `rate` (1/s).
    pub(super) fn new(
        system: &System,
        sum: &mut ForceSum,
        x: &[f64],
        x_dot: &[f64],
        t: f64,
        rate: f64,
    ) -> Self {
        sum.evaluate(x, x_dot, t);
        let free = system.coordinates().free();
        let force = free.iter().map(|&dof| sum.total(dof as usize)).collect();
        let zero = || vec![0.0; free.len()];
        let mut q = zero();
        system.coordinates().coordinates_of(x, &mut q);
        let parts: Vec<(f64, &SymmetricMatrix)> = sum.tangents(system, rate).collect();
        let tangent = if parts.is_empty() { None } else { MatrixSum::of(&mut None, &parts).ok().cloned() };
        Self { q, force, tangent, change: zero(), product: zero() }
    }

    /// Sets `change` to q − q̂ and `product` to S (q − q̂) at positions x.
    fn go_to(&mut self, system: &System, x: &[f64]) {
        let Self { q, tangent, change, product, .. } = self;
        system.coordinates().coordinates_of(x, change);
        vectors::update(change, |k, value| *value -= q[k]);
        match tangent {
            Some(tangent) => tangent.multiply(change, product),
            None => product.fill(0.0),
        }
    }

    /// Subtracts the forces from the gradient of all coordinates.
    pub(super) fn subtract(&mut self, system: &System, x: &[f64], gradient: &mut [f64]) {
        self.go_to(system, x);
        for (k, &dof) in system.coordinates().free().iter().enumerate() {
            gradient[dof as usize] -= self.force[k] - self.product[k];
        }
    }

    /// Returns minus the work of the forces from q̂ to the positions x, J.
    pub(super) fn energy(&mut self, system: &System, x: &[f64]) -> f64 {
        self.go_to(system, x);
        let Self { force, change, product, .. } = self;
        vectors::sum(change.len(), |k| (0.5 * product[k] - force[k]) * change[k])
    }

    /// Returns S.
    pub(super) fn tangent(&self) -> Option<&SymmetricMatrix> {
        self.tangent.as_ref()
    }
}
