//! Richardson's extrapolation of a sequence whose step is halved, with an error bar.
//!
//! With the last two differences Δ₁, Δ₂ and the formal order p_f, the observed order is p = log₂(Δ₁/Δ₂), capped at
//! p_f, the limit q + Δ/(2^p − 1) with |Δ| = max(|Δ₂|, |Δ₁|/2^p_f), and the bar F |Δ|/(2^p − 1). F follows Roache (1994)
//! and Eça & Hoekstra (2014): 1.25 where p is near p_f, 3 where it is below or the order changes from level to level.
//! Three kinds of sequences have another bar or none: see [`Verdict`]. How often bars hold is counted by
//! `tests/laws/known_answers.rs`.

use serde::Serialize;

/// Behaviour of a sequence.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Verdict {
    /// Differences fall with an order up to the formal one.
    Converges,
    /// Differences change their sign and fall: the bar is the larger of the last two.
    Alternates,
    /// Differences fall faster than theory allows, which is chance: the bar is what order 1 leaves of the larger one.
    FallsByChance,
    /// All differences are round-off, or what the solver leaves.
    IsExact,
    /// All values are round-off, or what the solver leaves, of a larger quantity that they belong to: the component of
    /// a vector that points elsewhere.
    IsZero,
    /// Two levels show no order: the bar is three times their difference.
    TwoLevels,
    /// Differences do not fall: there is no bar.
    NotYet,
    /// The elements lock, so that differences say little about errors: there is no bar.
    MayLock,
}

/// Evaluation of a sequence: its limit, order and error bar.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Extrapolation {
    /// Behaviour of the sequence.
    pub verdict: Verdict,
    /// log₂ of the ratio of the last two differences, as observed; `None` where they do not fall steadily.
    pub observed_order: Option<f64>,
    /// The limit; the last value where no order can be relied on.
    pub value: f64,
    /// Error bar; `None` if the sequence does not converge yet.
    pub error: Option<f64>,
}

/// The least order that is taken for convergence.
const LEAST_ORDER: f64 = 0.5;
/// An order is near the formal one from this share of it on.
const NEAR: f64 = 0.75;
/// An order that is above the formal one by more than this is chance.
const CHANCE: f64 = 0.5;
/// Orders of two pairs of levels that differ by more than this scatter.
const SCATTER: f64 = 0.5;
/// Differences with changing sign must fall to this.
const LEAST_FALL: f64 = 0.75;
/// Safety factors of the bar: near the formal order, and else.
const FACTORS: [f64; 2] = [1.25, 3.0];
/// Round-off of a value, relative.
const ROUND_OFF: f64 = 1e-13;
/// Share of a correction in time, found on the coarsest mesh, by which that of the finest mesh may differ.
const CARRIED_OVER: f64 = 1.0;

/// Extrapolates values of levels with halved steps, the coarsest first. `formal_order` is what theory allows;
/// `noise`, in the unit of the values, is the error of each value that has nothing to do with its level: the round-off
/// of the largest component of a vector, or a solver's tolerance of it.
pub fn extrapolate(values: &[f64], formal_order: f64, noise: f64) -> Extrapolation {
    let last = values.last().copied().unwrap_or(f64::NAN);
    let largest = values.iter().fold(0.0_f64, |most, value| most.max(value.abs()));
    let is_zero = noise > 0.0 && largest <= noise;
    let noise = noise.max(ROUND_OFF * largest);
    let differences: Vec<f64> = values.windows(2).map(|pair| pair[1] - pair[0]).collect();
    let found = |verdict, observed_order, correction: f64, error: Option<f64>| Extrapolation {
        verdict,
        observed_order,
        value: last + correction,
        error: error.map(|error| error.max(noise)),
    };
    if is_zero {
        return found(Verdict::IsZero, None, 0.0, Some(noise));
    }
    let (before, now) = match differences[..] {
        [] => return found(Verdict::NotYet, None, 0.0, None),
        [only] => return found(Verdict::TwoLevels, None, 0.0, Some(3.0 * only.abs())),
        [.., before, now] => (before, now),
    };
    if !(before.is_finite() && now.is_finite()) {
        return found(Verdict::NotYet, None, 0.0, None);
    }
    let largest = before.abs().max(now.abs());
    if largest <= noise {
        return found(Verdict::IsExact, None, 0.0, Some(largest));
    }
    if before * now < 0.0 {
        return match now.abs() <= LEAST_FALL * before.abs() {
            true => found(Verdict::Alternates, None, 0.0, Some(largest)),
            false => found(Verdict::NotYet, None, 0.0, None),
        };
    }
    let order = (before / now).log2();
    if order.is_nan() || order < LEAST_ORDER {
        return found(Verdict::NotYet, None, 0.0, None);
    }
    let formal = 2.0_f64.powf(formal_order);
    if order > formal_order + CHANCE {
        let bar = (0.5 * before.abs()).max(now.abs());
        return found(Verdict::FallsByChance, None, now / (formal - 1.0), Some(bar));
    }
    let capped = order.min(formal_order);
    let difference = now.abs().max(before.abs() / formal);
    let correction = difference.copysign(now) / (2.0_f64.powf(capped) - 1.0);
    let scatters = match differences[..] {
        [.., earlier, _, _] => {
            let earlier = (earlier / before).log2();
            // NaN where the sign changed.
            earlier.is_nan() || (earlier.min(formal_order) - capped).abs() > SCATTER
        }
        _ => false,
    };
    let is_near = capped >= NEAR * formal_order && !scatters;
    let factor = if is_near { FACTORS[0] } else { FACTORS[1] };
    found(Verdict::Converges, Some(order), correction, Some(factor * correction.abs()))
}

impl Extrapolation {
    /// The limit in space with that in time: `at_step` is the value of the study in time at the step of the one in
    /// space. The correction in time was found on one mesh and is carried over to the finest.
    pub fn with_time(&self, time: &Self, at_step: f64) -> Self {
        let correction = time.value - at_step;
        let error =
            self.error.zip(time.error).map(|(space, time)| space + time + CARRIED_OVER * correction.abs());
        let verdict = if self.error.is_some() && time.error.is_none() { time.verdict } else { self.verdict };
        Self { verdict, observed_order: self.observed_order, value: self.value + correction, error }
    }

    /// Evaluates the sequence without an error bar, for elements that lock.
    pub(super) fn locked(self) -> Self {
        match self.verdict {
            Verdict::IsExact | Verdict::IsZero => self,
            _ => Self { verdict: Verdict::MayLock, error: None, ..self },
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_power_law_is_extrapolated_to_its_limit() {
        for order in [1.0, 2.0, 4.0] {
            let values: Vec<f64> = (0..4).map(|k| 3.0 + 0.1 * 0.5_f64.powf(order * f64::from(k))).collect();
            let found = extrapolate(&values, order, 0.0);
            assert!((found.observed_order.unwrap() - order).abs() < 1e-6);
            assert!((found.value - 3.0).abs() < 1e-9 && found.error.unwrap() > 0.0);
        }
    }

    #[test]
    fn orders_by_chance_do_not_narrow_a_bar() {
        // The error changes its sign between the levels: the differences fall by a factor of 390.
        let found = extrapolate(&[1.04, 1.001, 1.0009], 2.0, 0.0);
        assert_eq!((found.verdict, found.observed_order), (Verdict::FallsByChance, None));
        assert!((found.value - 1.0).abs() < found.error.unwrap());
        // A little above the formal order: no more than that is relied on.
        let above = extrapolate(&[1.008, 0.12, 0.02], 3.0, 0.0);
        assert!((above.observed_order.unwrap() - 3.15).abs() < 0.1);
        assert!((above.value - (0.02 - 0.888 / 8.0 / 7.0)).abs() < 1e-12, "{above:?}");
    }

    #[test]
    fn what_does_not_converge_has_no_bar() {
        for values in [&[1.0, 1.2, 1.5][..], &[1.0, 1.1, 1.19], &[1.0, 2.0, 1.1], &[1.0], &[]] {
            let found = extrapolate(values, 2.0, 0.0);
            assert_eq!((found.verdict, found.error), (Verdict::NotYet, None), "{values:?}");
        }
        assert_eq!(extrapolate(&[1.0, 1.5], 2.0, 0.0).error, Some(1.5));
        let exact = extrapolate(&[2.0, 2.0, 2.0], 2.0, 0.0);
        assert!(exact.verdict == Verdict::IsExact && exact.error.unwrap() < 1e-12);
        let noisy = extrapolate(&[2.0, 2.000_000_1, 2.0], 2.0, 1e-6);
        assert!(noisy.verdict == Verdict::IsExact && noisy.error.unwrap() > 5e-7);
    }

    #[test]
    fn round_off_of_a_larger_component_is_zero() {
        for values in [&[1e-16, -3e-16, 4e-16][..], &[8e-16, 4e-16, 2e-16], &[1e-16, 2e-16]] {
            let found = extrapolate(values, 2.0, 1e-15);
            assert_eq!((found.verdict, found.error), (Verdict::IsZero, Some(1e-15)), "{values:?}");
            // Without anything larger beside them they are what they are.
            assert_ne!(extrapolate(values, 2.0, 0.0).verdict, Verdict::IsZero, "{values:?}");
        }
    }
}
