//! The lever: n masses on a rigid beam that rotates about a fulcrum. Its law follows from the principle of virtual
//! work.

use crate::theory::generalised::Embedding;
use crate::theory::lagrange::lagrangian::Scalar;

/// Point masses m_i at signed arms r_i along a massless beam; q is the angle of the beam from the horizontal.
#[derive(Debug, Clone, PartialEq)]
pub struct Lever {
    /// Pairs of a mass m_i, kg, and its arm r_i, m.
    pub loads: Vec<(f64, f64)>,
    /// Gravitational acceleration g, m/s².
    pub gravity: f64,
}

impl Embedding for Lever {
    fn dof_count(&self) -> usize {
        1
    }
    fn mass(&self) -> Vec<f64> {
        self.loads.iter().flat_map(|&(mass, _)| [mass, mass]).collect()
    }
    fn positions<D: Scalar>(&self, q: &[D], _tau: &[D]) -> Vec<D> {
        let (sin, cos) = q[0].sin_cos();
        self.loads.iter().flat_map(|&(_, arm)| [cos * arm, sin * arm]).collect()
    }
    fn potential<D: Scalar>(&self, x: &[D], _t: D) -> D {
        self.loads.iter().enumerate().map(|(i, &(mass, _))| x[2 * i + 1] * (mass * self.gravity)).sum()
    }
}

impl Lever {
    /// Returns Σ m_i g r_i, N m. The law of the lever states that it is zero.
    pub fn moment(&self) -> f64 {
        self.loads.iter().map(|(mass, arm)| mass * self.gravity * arm).sum()
    }
}
