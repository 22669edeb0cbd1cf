//! A simulation at a time between two steps, for observation only: no step is made or changed.
//!
//! Within a step of h from (q₀, p₀) to (q₁, p₁), with θ from 0 to 1:
//! - Schemes of order 1 and 2, and statics: q(θ) = q₀ + θ (q₁ − q₀), the linear path of their discrete Lagrangian; p
//!   is also linear.
//! - Schemes of order 3 and higher (Gauss with two or more stages, Blanes–Moan): the Hermite cubic with positions and
//!   velocities at both ends, q(θ) = q₀ + θ²(3 − 2θ)(q₁ − q₀) + h θ(1 − θ)² q̇₀ − h θ²(1 − θ) q̇₁, with an error of
//!   order h⁴; p = M q̇(θ).
//!
//! Prescribed coordinates follow their path.

use vi_core::{State, System};

use super::Simulation;

impl Simulation {
    /// Returns the states of all components.
    pub(crate) fn states(&self) -> Vec<State> {
        self.components.iter().map(|component| component.state.clone()).collect()
    }

    /// Calls `see` with the simulation at time t (s), interpolated between the states `before` and the current ones.
    /// Afterwards all values are bitwise as before. The number of steps is the current one.
    pub(crate) fn between<T>(&mut self, before: &[State], t: f64, see: impl FnOnce(&Self) -> T) -> T {
        let is_linear = self.scene.statics.is_some() || self.is_switched() || self.method.facts().order <= 2;
        let path = if is_linear { linear } else { hermite };
        // The fraction uses the time of the run, because on a path of equilibria the time of a state is its load
        // factor.
        let part = (t / self.h - (self.steps as f64 - 1.0)).clamp(0.0, 1.0);
        let mut now = Vec::with_capacity(before.len());
        for (component, before) in self.components.iter_mut().zip(before) {
            let state = path(&component.system, before, &component.state, part);
            now.push(std::mem::replace(&mut component.state, state));
        }
        let seen = see(self);
        for (component, now) in self.components.iter_mut().zip(now) {
            component.state = now;
        }
        seen
    }
}

/// Computed as a mean of both ends, so that the ends are reproduced bitwise.
fn mean(part: f64, before: f64, after: f64) -> f64 {
    (1.0 - part) * before + part * after
}

fn linear(_: &System, before: &State, after: &State, part: f64) -> State {
    let means = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(&a, &b)| mean(part, a, b)).collect();
    let (q, p) = (means(&before.q, &after.q), means(&before.p, &after.p));
    State { t: mean(part, before.t, after.t), q, p }
}

fn hermite(system: &System, before: &State, after: &State, part: f64) -> State {
    let (s, h) = (part, after.t - before.t);
    let (v0, v1) = (system.velocity(&before.p), system.velocity(&after.p));
    let r = 1.0 - s;
    let way = s * s * (3.0 - 2.0 * s);
    let q = |k: usize| mean(way, before.q[k], after.q[k]) + h * s * r * (r * v0[k] - s * v1[k]);
    let speed = |k: usize| {
        6.0 * s * r * (after.q[k] - before.q[k]) / h
            + r * (1.0 - 3.0 * s) * v0[k]
            + s * (3.0 * s - 2.0) * v1[k]
    };
    let velocity: Vec<f64> = (0..v0.len()).map(speed).collect();
    State { t: mean(s, before.t, after.t), q: (0..v0.len()).map(q).collect(), p: system.momentum(&velocity) }
}
