//! One bristle over one step.

/// Change of a bristle over a step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Bristle {
    /// Stretch e₁ at the end, m.
    pub(super) end: [f64; 2],
    /// Traction T, N.
    pub(super) traction: [f64; 2],
    /// |T| relative to the trial traction; 1 if the bristle sticks.
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

/// The traction of a bristle as a function of its slip, with a fixed limit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Cone {
    /// Components of the traction along both tangents if the bristle sticks, N.
    pub(crate) trial: [f64; 2],
    /// Change of `trial` with the slip, N/m.
    pub(crate) stiffness: f64,
    /// Largest size μλ of the traction, N.
    pub(crate) limit: f64,
}

/// The data that, together with the slip, give the traction of a pair at an iterate of Newton's method.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Prediction {
    /// The traction that the last linear system predicts, N; `None` if there was none.
    pub(super) traction: Option<[f64; 2]>,
    /// The force that moves both parts of the pair by a unit slip, N/m.
    pub(super) resistance: f64,
    /// A bound on the stiffness of a bristle that sticks, as a multiple of the resistance.
    pub(super) penalty: f64,
}

/// The traction of a bristle at an iterate of Newton's method, and its change with the slip and the limit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Linearised {
    /// Traction T, N.
    pub(super) traction: [f64; 2],
    /// Change of T with the slip, N/m: in all directions if the pair sticks, and otherwise across the direction of sliding.
    pub(super) stiffness: f64,
    /// Direction d of the traction if the pair slides, in which T also changes with the limit; `None` if it sticks.
    pub(super) sliding: Option<[f64; 2]>,
    /// The traction as a function of slip, T̂ + K' (u − s) shortened to the limit.
    pub(super) cone: Cone,
}

/// The largest part of the stiffness of a bristle by which its slip decides whether it sticks. If inertia resists more than the
/// bristle, slips alone decide without this bound, and pairs slide to and fro. Of the 100 scenes of `stress --contact --seed 1` with
/// masses of 1 : 1000, four fail by name with 1, and none with 0.1, 0.03 and 0.01; 50 scenes of stacks take 74 000 iterations with
/// 0.1, and 103 000 with 0.01. Both were measured while tied nodes had no compliance.
const LARGEST_PART: f64 = 0.1;

/// Linearises the law of [`stretch`] at the slip u and a predicted traction T̂, both of which may be far from a solution. With the
/// stiffness K = `response` · k of the trial and the slip s = (T̂ − k e₀)/K for which a bristle that sticks has the traction T̂,
/// ```text
/// y = T̂ + r (u − s);   |y| ≤ μλ: T = T̂ + K' (u − s),   else T = μλ y/|y|,
/// ```
/// for any r in (0, K] and K' = K. At a solution T = T̂, and this is the law of [`stretch`]. With r = K the slip alone decides
/// whether the pair sticks. That is a range of slip of about μλ/K, which Newton's method jumps over without end. With an r of
/// the order of the force that moves the pair by a unit slip, this range is as wide as slips are. The second law is
/// linearised in both T and u, and solved for T: with d = y/|y|, β = μλ/|y| and P = I − d dᵀ,
/// ```text
/// T = μλ d + S P (u + k e₀/K),   S = β r/(1 − β (1 − r/K')).
/// ```
/// Without a prediction, T̂ is k e₀, so that y = k e₀ + r u. Far from a solution K' is a multiple of r: slips of second order in the
/// corrections, times K, would be forces much greater than μλ (the method of multipliers: M. R. Hestenes, J. Optim. Theory
/// Appl. 4 (1969) 303–320).
pub(super) fn linearise(
    start: [f64; 2],
    slip: [f64; 2],
    k: f64,
    response: f64,
    limit: f64,
    prediction: Prediction,
) -> Linearised {
    let full = response * k;
    let r = prediction.resistance.min(LARGEST_PART * full);
    let stick = full.min(prediction.penalty * r);
    let held = start.map(|e| k * e);
    let predicted = prediction.traction.unwrap_or(held);
    let total = [0, 1].map(|a: usize| slip[a] + held[a] / full);
    let trial = |by: f64| [0, 1].map(|a: usize| (1.0 - by / full) * predicted[a] + by * total[a]);
    let y = trial(r);
    let size = y[0].hypot(y[1]);
    let cone = Cone { trial: trial(stick), stiffness: stick, limit };
    if size <= limit {
        return Linearised { traction: cone.trial, stiffness: stick, sliding: None, cone };
    }
    let d = y.map(|y| y / size);
    let beta = limit / size;
    let stiffness = beta * r / (1.0 - beta * (1.0 - r / stick));
    let across = d[0] * total[1] - d[1] * total[0];
    let traction = [limit * d[0] - stiffness * across * d[1], limit * d[1] + stiffness * across * d[0]];
    Linearised { traction, stiffness, sliding: Some(d), cone }
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

    /// The traction of the law, taken as prediction, is the traction of its linearisation, whatever the resistance and the
    /// penalty are; and the linearisation has its change with the slip.
    #[test]
    fn a_linearised_law_has_the_solutions_of_the_law() {
        let mut numbers = Numbers::new(7);
        let mut counts = [0, 0];
        for _ in 0..10_000 {
            let (start, slip) = (numbers.vector(), numbers.vector() * 3.0);
            let (start, slip) = ([start.x, start.y], [slip.x, slip.y]);
            let (k, response, limit) =
                (1.0 + numbers.unit(), 0.5 + numbers.unit(), 0.1 + 2.0 * numbers.unit());
            let law = |slip: [f64; 2]| stretch(start, slip, k, response, limit).traction;
            let traction = law(slip);
            let penalty = if numbers.unit() < 0.5 { 3.0 } else { f64::INFINITY };
            let prediction =
                Prediction { traction: Some(traction), resistance: 0.2 * numbers.unit(), penalty };
            let found = linearise(start, slip, k, response, limit, prediction);
            counts[usize::from(found.sliding.is_some())] += 1;
            assert!((0..2).all(|a| (found.traction[a] - traction[a]).abs() <= 1e-12), "{found:?}");
            if penalty == f64::INFINITY {
                let shift = [1e-6, -2e-6];
                let changed = law([slip[0] + shift[0], slip[1] + shift[1]]);
                let along = found.sliding.map_or(0.0, |d| d[0] * shift[0] + d[1] * shift[1]);
                let across = [0, 1].map(|a: usize| shift[a] - along * found.sliding.map_or(0.0, |d| d[a]));
                for a in 0..2 {
                    let expected = changed[a] - traction[a];
                    assert!((found.stiffness * across[a] - expected).abs() <= 1e-9, "{found:?}");
                }
            }
        }
        assert!(counts.iter().all(|&count| count > 500), "{counts:?}");
    }
}
