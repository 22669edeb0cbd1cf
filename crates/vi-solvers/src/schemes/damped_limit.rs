//! The stability limits of the explicit schemes that take forces of velocity.
//!
//! A mode q̈ = −ω² q − d q̇ with z = hω and δ = hd is multiplied by a 2 × 2 matrix per step. It is stable while |det| ≤ 1 and
//! |trace| ≤ 1 + det. The symplectic Euler schemes evaluate the damping force at the velocity before the kick: det = 1
//! − δ and trace = 2 − δ − z², so that
//! ```text
//! z² + 2δ ≤ 4.
//! ```
//! Störmer–Verlet evaluates it at that velocity in its first kick, and at the predicted velocity in its last kick. With
//! x = δ/2, a = 1 − x and b = 1 − x + x² it has det = ab and trace = 1 + ab − ½z²(1 + a²), so that
//! ```text
//! z² ≤ 4 F(x),   F = (1 + ab)/(1 + a²).
//! ```
//! F is not below 1 up to x = 1, and zero at x = 1.544. Modes of a body differ in ω and in d. A limit holds for all of them if it holds
//! for every ω and d up to the highest ones, and so z² ≤ 4 min(1, F).

use crate::schemes::method::Method;

/// Number of bisections, which leave one rounding.
const BISECTIONS: u32 = 60;
/// A damping x = hd/2 beyond the limit of Störmer–Verlet without stiffness.
const BEYOND: f64 = 1.6;

/// Returns F(x).
fn bound(x: f64) -> f64 {
    let (a, b) = (1.0 - x, 1.0 - x + x * x);
    (1.0 + a * b) / (1.0 + a * a)
}

impl Method {
    /// Returns the frequency ω_lim (rad/s) that limits the step of modes with frequencies up to `omega` (rad/s) whose
    /// velocities decay by damping at rates up to `rate` (1/s): an undamped oscillator of frequency ω_lim has the same
    /// limit. The largest stable step is h = [`stability_limit`](crate::MethodFacts::stability_limit)/ω_lim.
    pub fn limiting_frequency(&self, omega: f64, rate: f64) -> f64 {
        match self {
            // h = 4/(d + √(d² + 4ω²)).
            Self::SymplecticEulerA | Self::SymplecticEulerB if rate > 0.0 => {
                0.5 * (rate + rate.hypot(2.0 * omega))
            }
            // Up to d = ω, the limit without damping has x ≤ 1.
            Self::StormerVerlet if rate > omega => {
                let ratio = omega / rate;
                let [mut stable, mut unstable] = [1.0, BEYOND];
                for _ in 0..BISECTIONS {
                    let x = 0.5 * (stable + unstable);
                    // z = 2xω/d.
                    if (x * ratio).powi(2) <= bound(x) { stable = x } else { unstable = x }
                }
                rate / stable
            }
            _ => omega,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::schemes::kick_drift::splitting::Splitting;

    /// Returns the spectral radius of a step of a mode, as the schemes make it: each kick evaluates the damping force
    /// at the velocity before it; the last kick of a scheme that also begins with a kick, at the velocity that it
    /// predicts.
    fn radius(scheme: &Splitting, z: f64, delta: f64) -> f64 {
        let column = |mut q: f64, mut v: f64| {
            for i in 0..scheme.kicks.len() {
                let kick = scheme.kicks[i];
                let closes = i == scheme.drifts.len() && scheme.kicks[0] != 0.0;
                let force = |v: f64| -z * z * q - delta * v;
                let predicted = if closes { v + kick * force(v) } else { v };
                v += kick * force(predicted);
                q += scheme.drifts.get(i).unwrap_or(&0.0) * v;
            }
            [q, v]
        };
        let [[a, c], [b, d]] = [column(1.0, 0.0), column(0.0, 1.0)];
        let (half, det) = (0.5 * (a + d), a * d - b * c);
        let square = half * half - det;
        if square < 0.0 { det.sqrt() } else { half.abs() + square.sqrt() }
    }

    const DAMPED: [Method; 3] = [Method::SymplecticEulerA, Method::SymplecticEulerB, Method::StormerVerlet];

    /// Below the limit no mode grows, and just above it one does.
    #[test]
    fn the_limits_are_those_of_the_recurrence() {
        for method in DAMPED {
            let (scheme, limit) = (method.splitting().unwrap(), method.facts().stability_limit.unwrap());
            for ratio in [0.0, 0.01, 0.3, 0.9, 1.0, 1.1, 1.5, 3.0, 10.0, 1e3] {
                let (omega, rate) = (7.0, 7.0 * ratio);
                let h = limit / method.limiting_frequency(omega, rate);
                let largest = |h: f64| {
                    let of = |k: u32, l: u32| {
                        let [omega, rate] =
                            [(k, omega), (l, rate)].map(|(n, most)| f64::from(n) / 40.0 * most);
                        radius(&scheme, h * omega, h * rate)
                    };
                    (0..=40)
                        .flat_map(|k| (0..=40).map(move |l| (k, l)))
                        .map(|(k, l)| of(k, l))
                        .fold(0.0, f64::max)
                };
                let (below, above) = (largest(0.999 * h), largest(1.001 * h));
                assert!(
                    below <= 1.0 + 1e-7 && above > 1.0 + 1e-4,
                    "{}, {ratio}: {below} {above}",
                    method.name()
                );
            }
        }
    }

    #[test]
    fn without_damping_nothing_changes() {
        for method in Method::ALL {
            for omega in [0.0, 0.3, 7.0, 1.234e9] {
                assert_eq!(method.limiting_frequency(omega, 0.0), omega, "{}", method.name());
            }
        }
    }

    #[test]
    fn damping_alone_limits_the_step() {
        for (method, most) in DAMPED.into_iter().zip([2.0, 2.0, 3.087]) {
            let h = method.facts().stability_limit.unwrap() / method.limiting_frequency(0.0, 5.0);
            assert!((h * 5.0 - most).abs() < 1e-3, "{}: {}", method.name(), h * 5.0);
        }
    }
}
