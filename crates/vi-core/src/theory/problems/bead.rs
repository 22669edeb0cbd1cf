//! A bead on a hoop that rotates about its vertical diameter with angular velocity ω: one generalised coordinate and
//! one prescribed control τ = ωt.

use crate::theory::generalised::Embedding;
use crate::theory::lagrange::lagrangian::Scalar;
use crate::theory::statics::Energy;

/// x = r (sin q cos τ, sin q sin τ, cos q), q measured from the upward vertical (+z), V = m g z with unit mass m.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BeadOnHoop {
    /// Radius r of the hoop, m.
    pub radius: f64,
    /// Gravitational acceleration g, m/s².
    pub gravity: f64,
    /// Angular velocity ω of the hoop, rad/s.
    pub omega: f64,
}

impl Embedding for BeadOnHoop {
    fn dof_count(&self) -> usize {
        1
    }
    fn mass(&self) -> Vec<f64> {
        vec![1.0; 3]
    }
    fn controls<D: Scalar>(&self, t: D) -> Vec<D> {
        vec![t * self.omega]
    }
    fn positions<D: Scalar>(&self, q: &[D], tau: &[D]) -> Vec<D> {
        let (sin, cos) = q[0].sin_cos();
        vec![sin * tau[0].cos() * self.radius, sin * tau[0].sin() * self.radius, cos * self.radius]
    }
    fn potential<D: Scalar>(&self, x: &[D], _t: D) -> D {
        x[2] * self.gravity
    }
}

/// The amended potential g r cos q − ½ μ² r² sin² q, with the angular velocity μ as parameter.
impl Energy for BeadOnHoop {
    fn dof_count(&self) -> usize {
        1
    }
    fn value<D: Scalar>(&self, omega: D, q: &[D]) -> D {
        let (sin, cos) = q[0].sin_cos();
        let speed = omega * sin * self.radius;
        cos * (self.gravity * self.radius) - speed * speed * 0.5
    }
}

impl BeadOnHoop {
    /// Returns the stable equilibrium: arccos(−g/(rω²)) for ω above √(g/r), straight down (π) below.
    pub fn equilibrium(&self) -> f64 {
        (-(self.gravity / (self.radius * self.omega * self.omega)).min(1.0)).acos()
    }

    /// Returns the angular frequency of small oscillations about it: ω √(1 − (g/rω²)²), or √(g/r − ω²), rad/s.
    pub fn frequency(&self) -> f64 {
        let ratio = self.gravity / (self.radius * self.omega * self.omega);
        if ratio < 1.0 {
            self.omega * (1.0 - ratio * ratio).sqrt()
        } else {
            (self.gravity / self.radius - self.omega * self.omega).sqrt()
        }
    }
}
