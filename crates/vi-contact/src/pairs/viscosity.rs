//! The damping of the pairs of a group over a step.
//!
//! Damping with the time constant τ adds the force b Δd/h along N, with b = n τ C''(s̄) and the number n of inclusion and exclusion. It
//! dissipates D = b Δd²/h. It does not pull: where a share a of the damping acts on velocities at the end of the step
//! ([`AT_END`](super::AT_END)), a pair that opens keeps the part a n Q of its push, which that share may take.
//!
//! Damping must not be summed by inclusion and exclusion as energies are: a pair that is subtracted may change its distance more than those
//! that it cancels, and D would be negative. Nor may it only leave the subtracted pairs out: it would be doubled, in one jump, where a
//! point passes from one cell to the next. So only pairs with n > 0 are damped, and their b are multiplied by
//! ```text
//! φ = max(0, Σ b / Σ_{n>0} b) ≤ 1
//! ```
//! of their group. If all distances change alike, D is that of inclusion and exclusion. The pushes that bound damping are reduced in
//! the same way.

use super::energy::Strength;

/// What is known of the damping of one pair before its group is known.
#[derive(Debug, Clone, Copy)]
pub(super) struct Viscosity {
    /// n C''(s̄), N/m.
    curvature: f64,
    /// Its derivative with respect to d₁, N/m².
    curvature_slope: f64,
    /// d₁ − d₀, m.
    change: f64,
    /// n Q, N.
    slope: f64,
    /// The part of the pair: ½ for each part of a chord between two cells, which have one distance.
    share: f64,
}

impl Viscosity {
    /// Computes the viscosity of a pair between the distances at both `ends` (m), with their `change` d₁ − d₀; `slope` is n Q.
    pub(super) fn new(strength: &Strength, ends: [f64; 2], change: f64, slope: f64) -> Self {
        let Strength { gauge, blend, multiplicity: n } = *strength;
        let [s0, s1] = ends.map(|distance| gauge.relative(distance));
        let per_square = n * (gauge.energy / (gauge.distance * gauge.distance));
        let middle = 0.5 * (s0 + s1);
        Self {
            curvature: per_square * blend.curvature(middle),
            curvature_slope: 0.5 * per_square * blend.third(middle) / gauge.distance,
            change,
            slope,
            share: 1.0,
        }
    }

    /// Returns the viscosity of one of two parts into which a pair is divided.
    pub(super) fn half(self) -> Self {
        Self { share: 0.5, ..self }
    }
}

/// What damping at the end of a step needs to know of a pair.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct Damped {
    /// φ n C''(s̄), N/m.
    pub(crate) curvature: f64,
    /// The push of which damping may take a part, N.
    pub(crate) push: f64,
}

impl Damped {
    pub(super) fn scale(&mut self, factor: f64) {
        self.curvature *= factor;
        self.push *= factor;
    }
}

/// The damping between two bodies over a step.
#[derive(Debug, Clone, Copy)]
pub(super) struct Damping {
    /// τ/h.
    pub(super) rate: f64,
    /// The part of a push that damping over the step leaves.
    pub(super) kept: f64,
}

/// Returns Σ v / Σ_{v>0} v, or zero if that is negative. It is exactly one if no v is negative.
fn positive_part(values: impl Iterator<Item = f64>) -> f64 {
    let (mut positive, mut negative) = (0.0, 0.0);
    for value in values {
        *(if value > 0.0 { &mut positive } else { &mut negative }) += value;
    }
    if positive > 0.0 { (1.0 + negative / positive).max(0.0) } else { 0.0 }
}

/// How damping changes a pair.
#[derive(Debug, Clone, Copy)]
pub(super) struct Resistance {
    /// Force along N that damping adds, N.
    pub(super) force: f64,
    /// The part of the stiffness of the layer that remains: less than one where the push bounds damping.
    pub(super) kept: f64,
    /// What damping adds to the stiffness and to dQ/dd₁, N/m.
    pub(super) stiffness: f64,
    pub(super) tangent: f64,
    /// Energy that it dissipates, J.
    pub(super) dissipated: f64,
    pub(super) damped: Damped,
    /// Whether the pair is not a part of a chord between two cells.
    pub(super) is_whole: bool,
}

impl Damping {
    /// Returns how damping changes each pair of a group; `None` for pairs that are not damped.
    pub(super) fn resist(&self, group: &[Viscosity]) -> impl Iterator<Item = Option<Resistance>> {
        let of_curvature = positive_part(group.iter().map(|pair| pair.share * pair.curvature));
        let of_push = positive_part(group.iter().map(|pair| -pair.share * pair.slope));
        let Self { rate, kept } = *self;
        group.iter().map(move |viscosity| {
            let Viscosity { curvature, curvature_slope, change, slope, share } = *viscosity;
            if curvature <= 0.0 {
                return None;
            }
            let (push, coefficient) = (-of_push * slope, rate * of_curvature);
            let (free, most) = (coefficient * curvature * change, (1.0 - kept) * push);
            let is_bounded = free > most;
            let force = if is_bounded { most } else { free };
            let factor = if is_bounded { 0.0 } else { coefficient };
            Some(Resistance {
                force,
                kept: if is_bounded { kept } else { 1.0 },
                stiffness: share * factor * curvature,
                tangent: factor * (curvature + curvature_slope * change),
                dissipated: share * force * change,
                damped: Damped { curvature: of_curvature * curvature, push },
                is_whole: share == 1.0,
            })
        })
    }
}
