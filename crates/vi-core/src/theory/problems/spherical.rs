//! The spherical pendulum: in two angles, and as a particle on a sphere.

use crate::contract::coordinates::Coordinates;
use crate::contract::potential::HessianKind;
use crate::contract::system::System;
use crate::error::CoreError;
use crate::theory::constraints::constraint::Constraint;
use crate::theory::lagrange::lagrangian::{Lagrangian, Scalar};
use crate::theory::lagrange::noether::Symmetry;
use crate::theory::problems::elliptic::complete_elliptic_k;
use crate::theory::problems::term::{Jet, Term};

/// A unit point mass at distance `length` from a fixed point, q = (θ, φ), θ measured from the downward vertical.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SphericalPendulum {
    /// Distance l of the mass from the fixed point, m.
    pub length: f64,
    /// Gravitational acceleration g, m/s².
    pub gravity: f64,
}

impl Lagrangian for SphericalPendulum {
    fn dof_count(&self) -> usize {
        2
    }
    fn value<D: Scalar>(&self, _t: D, q: &[D], v: &[D]) -> D {
        let (sin, cos) = q[0].sin_cos();
        let around = sin * v[1];
        (v[0] * v[0] + around * around) * (0.5 * self.length * self.length)
            + cos * (self.gravity * self.length)
    }
}

impl SphericalPendulum {
    /// Returns the period (s) of the nutation in θ for energy E (J) and vertical angular momentum J (kg m²/s):
    /// 4 l K(k)/√(2g (z₃ − z₁)), k² = (z₂ − z₁)/(z₃ − z₁), where z_i are the roots of 2 (E − g z)(l² − z²) = J².
    pub fn nutation_period(&self, energy: f64, momentum: f64) -> f64 {
        let (l, g) = (self.length, self.gravity);
        let cubic = |z: f64| 2.0 * (energy - g * z) * (l * l - z * z) - momentum * momentum;
        // The cubic is negative at ±l, positive between its two roots inside, and increases beyond l.
        let top = golden_maximum(cubic, -l, l);
        let mut far = 2.0 * l;
        while cubic(far) < 0.0 {
            far *= 2.0;
        }
        let roots = [bisect(cubic, -l, top), bisect(cubic, top, l), bisect(cubic, l, far)];
        let k = ((roots[1] - roots[0]) / (roots[2] - roots[0])).sqrt();
        4.0 * l * complete_elliptic_k(k) / (2.0 * g * (roots[2] - roots[0])).sqrt()
    }

    /// Returns a unit mass in the same field in Cartesian coordinates, to be constrained to a [`Sphere`].
    ///
    /// # Errors
    /// Returns the errors of [`System::new`].
    pub fn particle(&self) -> Result<System, CoreError> {
        let g = self.gravity;
        let weight = Term {
            name: "weight",
            block: 3,
            nodes: vec![0],
            hessian: HessianKind::Zero,
            jet: move |_, x: &[f64; 3]| Jet {
                energy: g * x[2],
                gradient: [0.0, 0.0, g],
                hessian: [[0.0; 3]; 3],
            },
        };
        System::new(vec![1.0; 3], vec![Box::new(weight)], Coordinates::all_free(3))
    }
}

/// The rotation about the vertical.
impl Symmetry for SphericalPendulum {
    fn generator<D: Scalar>(&self, _q: &[D]) -> Vec<D> {
        vec![D::from(0.0), D::from(1.0)]
    }
}

/// The sphere (|x|² − l²)/(2l) = 0 about the origin; l is its radius, m.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sphere(pub f64);

impl Constraint for Sphere {
    fn count(&self) -> usize {
        1
    }
    fn value<D: Scalar>(&self, q: &[D]) -> Vec<D> {
        vec![(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] - self.0 * self.0) * (0.5 / self.0)]
    }
}

fn bisect(f: impl Fn(f64) -> f64, mut low: f64, mut high: f64) -> f64 {
    let rising = f(high) > f(low);
    for _ in 0..200 {
        let middle = 0.5 * (low + high);
        if (f(middle) > 0.0) == rising {
            high = middle;
        } else {
            low = middle;
        }
    }
    0.5 * (low + high)
}

/// Returns the position of the only maximum of f on an interval, by golden-section search.
fn golden_maximum(f: impl Fn(f64) -> f64, mut low: f64, mut high: f64) -> f64 {
    let ratio = 0.5 * (5.0_f64.sqrt() - 1.0);
    for _ in 0..80 {
        let (a, b) = (high - ratio * (high - low), low + ratio * (high - low));
        if f(a) < f(b) {
            low = a;
        } else {
            high = b;
        }
    }
    0.5 * (low + high)
}
