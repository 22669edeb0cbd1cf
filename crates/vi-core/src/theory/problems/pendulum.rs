//! The planar pendulum, L = ½ m l² θ̇² + m g l cos θ.

use crate::contract::coordinates::Coordinates;
use crate::contract::potential::HessianKind;
use crate::contract::system::{State, System};
use crate::error::CoreError;
use crate::theory::problems::elliptic::{complete_elliptic_k, jacobi};
use crate::theory::problems::term::{Jet, Term};

/// A point mass on a massless rod; θ is measured from the downward vertical.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pendulum {
    /// Mass m, kg.
    pub mass: f64,
    /// Length l of the rod, m.
    pub length: f64,
    /// Gravitational acceleration g, m/s².
    pub gravity: f64,
}

impl Pendulum {
    /// Returns a pendulum of unit mass, length and gravity: ω₀ = 1, H = p²/2 − cos θ.
    pub fn unit() -> Self {
        Self { mass: 1.0, length: 1.0, gravity: 1.0 }
    }

    /// Returns ω₀ = √(g/l), rad/s, the frequency of small oscillations.
    pub fn frequency(&self) -> f64 {
        (self.gravity / self.length).sqrt()
    }

    /// Returns the system, one coordinate θ with inertia m l².
    ///
    /// # Errors
    /// Returns [`CoreError::Mass`] for an inertia that is not positive.
    pub fn system(&self) -> Result<System, CoreError> {
        let moment = self.mass * self.gravity * self.length;
        let weight = Term {
            name: "pendulum weight",
            block: 1,
            nodes: vec![0],
            hessian: HessianKind::Varying,
            jet: move |_, &[angle]: &[f64; 1]| Jet {
                energy: -moment * angle.cos(),
                gradient: [moment * angle.sin()],
                hessian: [[moment * angle.cos()]],
            },
        };
        System::new(vec![self.inertia()], vec![Box::new(weight)], Coordinates::all_free(1))
    }

    /// Returns m l², kg m².
    pub fn inertia(&self) -> f64 {
        self.mass * self.length * self.length
    }

    /// Returns H = p²/(2 m l²) − m g l cos θ, J.
    pub fn energy(&self, state: &State) -> f64 {
        0.5 * state.p[0] * state.p[0] / self.inertia()
            - self.mass * self.gravity * self.length * state.q[0].cos()
    }

    /// Returns the period (s) of a swing of amplitude 0 < θ₀ < π: T = 4 K(sin θ₀/2)/ω₀.
    pub fn period(&self, amplitude: f64) -> f64 {
        4.0 * complete_elliptic_k((0.5 * amplitude).sin()) / self.frequency()
    }

    /// Returns the exact motion, released from rest at amplitude |θ₀| < π at t = 0: sin(θ/2) = k sn(K + ω₀t, k),
    /// k = sin(θ₀/2).
    pub fn exact(&self, amplitude: f64, t: f64) -> State {
        let k = (0.5 * amplitude).sin();
        let omega = self.frequency();
        let at = jacobi(complete_elliptic_k(k.abs()) + omega * t, k.abs());
        State { t, q: vec![2.0 * (k * at.sn).asin()], p: vec![self.inertia() * 2.0 * k * omega * at.cn] }
    }
}
