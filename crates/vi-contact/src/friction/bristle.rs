//! One bristle over one step.

/// Change of a bristle over a step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Bristle {
    /// Stretch e₁ at the end, m.
    pub(super) end: [f64; 2],
    /// Traction T, N.
    pub(super) traction: [f64; 2],
    /// |T| relative to the trial traction: 1 while it sticks.
    pub(super) held: f64,
}

/// Stretches a bristle of stiffness k from e₀ by the slip u, with |T| ≤ `limit` = μλ. `response` is
/// ½ + τ/h with the time constant τ of contact damping; without damping a sticking bristle would oscillate for ever. It is
/// 1 between equilibria, where T is the force at the end; then sticking dissipates ½k|u|².
///
/// The trial is T = k (e₀ + u/2) + k (τ/h) u and e₁ = e₀ + u, for which T·u = ½k(|e₁|² − |e₀|²) + k (τ/h) |u|².
/// Beyond the cone T is shortened by a factor θ < 1, and e₁ = T/k is the stretch that T can hold. If that stored more
/// energy than the work T·u = θ (E_trial − E₀) provides, e₁ is shortened until nothing is dissipated. This is
/// possible because E₀ + T·u ≥ (1−θ) E₀ + θ E_trial ≥ 0.
pub(super) fn stretch(start: [f64; 2], slip: [f64; 2], k: f64, response: f64, limit: f64) -> Bristle {
    let trial = [0, 1].map(|a: usize| k * (start[a] + response * slip[a]));
    let size = trial[0].hypot(trial[1]);
    if size <= limit {
        let end = [start[0] + slip[0], start[1] + slip[1]];
        return Bristle { end, traction: trial, held: 1.0 };
    }
    let held = limit / size;
    let traction = trial.map(|t| held * t);
    let energy = |e: [f64; 2]| 0.5 * k * (e[0] * e[0] + e[1] * e[1]);
    let mut end = traction.map(|t| t / k);
    let available = energy(start) + traction[0] * slip[0] + traction[1] * slip[1];
    if energy(end) > available {
        let shorter = (available.max(0.0) / energy(end)).sqrt();
        end = end.map(|e| shorter * e);
    }
    Bristle { end, traction, held }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::Numbers;

    #[test]
    fn it_never_gives_energy_and_keeps_to_the_cone() {
        let mut numbers = Numbers::new(4);
        for _ in 0..100_000 {
            let (start, slip) = (numbers.vector(), numbers.vector() * 3.0);
            let (start, slip) = ([start.x, start.y], [slip.x, slip.y]);
            let (k, limit) = (1.0 + numbers.unit(), 2.0 * numbers.unit());
            let rate = (2.0 * numbers.unit() - 1.0).max(0.0);
            let found = stretch(start, slip, k, 0.5 + rate, limit);
            let energy = |e: [f64; 2]| 0.5 * k * (e[0] * e[0] + e[1] * e[1]);
            let work = found.traction[0] * slip[0] + found.traction[1] * slip[1];
            let dissipated = work - (energy(found.end) - energy(start));
            assert!(dissipated >= -1e-14, "{dissipated:e}");
            assert!(found.traction[0].hypot(found.traction[1]) <= limit * (1.0 + 1e-15));
            if found.held == 1.0 && rate == 0.0 {
                assert!(dissipated.abs() <= 1e-14);
            }
        }
    }
}
