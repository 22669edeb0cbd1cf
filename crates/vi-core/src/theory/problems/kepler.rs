//! A mass in the gravitational field of a fixed centre, L = ½ |q̇|² + μ/|q|, in D = 2 or 3 dimensions.

use std::f64::consts::TAU;

use crate::contract::coordinates::Coordinates;
use crate::contract::potential::HessianKind;
use crate::contract::system::{State, System};
use crate::error::CoreError;
use crate::theory::problems::term::{Jet, Term};

/// The Kepler problem of a unit mass; energies and momenta are per kilogram.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Kepler<const D: usize> {
    /// Standard gravitational parameter μ = G M of the centre, m³/s².
    pub mu: f64,
}

impl<const D: usize> Kepler<D> {
    /// Returns the system, D coordinates.
    ///
    /// # Errors
    /// Never returns an error, as the mass is 1; the type is that of [`System::new`].
    pub fn system(&self) -> Result<System, CoreError> {
        let mu = self.mu;
        let attraction = Term {
            name: "kepler",
            block: D,
            nodes: vec![0],
            hessian: HessianKind::Varying,
            jet: move |_, x: &[f64; D]| {
                let r = x.iter().map(|x| x * x).sum::<f64>().sqrt();
                let cube = mu / (r * r * r);
                let mut hessian = [[0.0; D]; D];
                for i in 0..D {
                    for j in 0..D {
                        let unit = if i == j { 1.0 } else { 0.0 };
                        hessian[i][j] = cube * (unit - 3.0 * x[i] * x[j] / (r * r));
                    }
                }
                Jet { energy: -mu / r, gradient: x.map(|x| cube * x), hessian }
            },
        };
        System::new(vec![1.0; D], vec![Box::new(attraction)], Coordinates::all_free(D))
    }

    /// Returns the state at the pericentre of the ellipse of semi-major axis a = 1 and eccentricity 0 ≤ e < 1, at
    /// t = 0: q = (1 − e, 0), p = (0, √(μ (1+e)/(1−e))).
    pub fn pericentre(&self, eccentricity: f64) -> State {
        let mut state = State { t: 0.0, q: vec![0.0; D], p: vec![0.0; D] };
        state.q[0] = 1.0 - eccentricity;
        state.p[1] = (self.mu * (1.0 + eccentricity) / (1.0 - eccentricity)).sqrt();
        state
    }

    /// Returns H = |p|²/2 − μ/|q|, J/kg.
    pub fn energy(&self, state: &State) -> f64 {
        let square = |a: &[f64]| a.iter().map(|a| a * a).sum::<f64>();
        0.5 * square(&state.p) - self.mu / square(&state.q).sqrt()
    }

    /// Returns q₁p₂ − q₂p₁, m²/s: the component of q × p normal to the plane of the first two axes.
    pub fn angular_momentum(&self, state: &State) -> f64 {
        state.q[0] * state.p[1] - state.q[1] * state.p[0]
    }

    /// Returns the period of the ellipse with a = 1: T = 2π/√μ, s.
    pub fn period(&self) -> f64 {
        TAU / self.mu.sqrt()
    }

    /// Returns the exact motion on the ellipse of [`Kepler::pericentre`] at time t, from Kepler's equation
    /// E − e sin E = √μ t.
    pub fn exact(&self, eccentricity: f64, t: f64) -> State {
        let e = eccentricity;
        let mean = self.mu.sqrt() * t;
        let mut anomaly = mean + e * mean.sin();
        for _ in 0..50 {
            let update = (anomaly - e * anomaly.sin() - mean) / (1.0 - e * anomaly.cos());
            anomaly -= update;
            if update.abs() <= 1e-16 * anomaly.abs() {
                break;
            }
        }
        let (sin, cos) = anomaly.sin_cos();
        let minor = ((1.0 - e) * (1.0 + e)).sqrt();
        let rate = self.mu.sqrt() / (1.0 - e * cos);
        let mut state = State { t, q: vec![0.0; D], p: vec![0.0; D] };
        (state.q[0], state.q[1]) = (cos - e, minor * sin);
        (state.p[0], state.p[1]) = (-sin * rate, minor * cos * rate);
        state
    }
}
