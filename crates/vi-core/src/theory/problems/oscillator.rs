//! The harmonic oscillator, L = ½ m q̇² − ½ k q².

use crate::contract::coordinates::Coordinates;
use crate::contract::potential::HessianKind;
use crate::contract::system::{State, System};
use crate::error::CoreError;
use crate::theory::problems::term::{Jet, Term};

/// A mass on a linear spring.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Oscillator {
    /// Mass m, kg.
    pub mass: f64,
    /// Stiffness k of the spring, N/m.
    pub stiffness: f64,
}

impl Oscillator {
    /// Returns an oscillator of unit mass and angular frequency ω (rad/s): H = p²/2 + ω²q²/2.
    pub fn with_frequency(omega: f64) -> Self {
        Self { mass: 1.0, stiffness: omega * omega }
    }

    /// Returns ω = √(k/m), rad/s.
    pub fn frequency(&self) -> f64 {
        (self.stiffness / self.mass).sqrt()
    }

    /// Returns the system, one coordinate.
    ///
    /// # Errors
    /// Returns [`CoreError::Mass`] for a mass that is not positive.
    pub fn system(&self) -> Result<System, CoreError> {
        let k = self.stiffness;
        let spring = Term {
            name: "spring",
            block: 1,
            nodes: vec![0],
            hessian: HessianKind::Constant,
            jet: move |_, &[x]: &[f64; 1]| Jet { energy: 0.5 * k * x * x, gradient: [k * x], hessian: [[k]] },
        };
        System::new(vec![self.mass], vec![Box::new(spring)], Coordinates::all_free(1))
    }

    /// Returns H = p²/2m + k q²/2, J.
    pub fn energy(&self, state: &State) -> f64 {
        0.5 * state.p[0] * state.p[0] / self.mass + 0.5 * self.stiffness * state.q[0] * state.q[0]
    }

    /// Returns the exact motion: (q, p) after a time (s) from `state`, a rotation in phase space.
    pub fn exact(&self, state: &State, time: f64) -> State {
        let impedance = self.mass * self.frequency();
        let (sin, cos) = (self.frequency() * time).sin_cos();
        let (q, p) = (state.q[0], state.p[0]);
        State {
            t: state.t + time,
            q: vec![q * cos + p / impedance * sin],
            p: vec![p * cos - q * impedance * sin],
        }
    }
}
