//! The oscillator of Pais & Uhlenbeck (1950), the simplest Lagrangian with accelerations.

use crate::theory::lagrange::higher::HigherLagrangian;
use crate::theory::lagrange::lagrangian::Scalar;

/// L = ½ (q̈² − (a² + b²) q̇² + a²b² q²): q⁗ + (a² + b²) q̈ + a²b² q = 0, frequencies a and b, rad/s.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PaisUhlenbeck(pub f64, pub f64);

impl HigherLagrangian for PaisUhlenbeck {
    fn dof_count(&self) -> usize {
        1
    }
    fn value<D: Scalar>(&self, _t: D, q: &[D], v: &[D], a: &[D]) -> D {
        let (first, second) = (self.0 * self.0, self.1 * self.1);
        (a[0] * a[0] - v[0] * v[0] * (first + second) + q[0] * q[0] * (first * second)) * 0.5
    }
}
