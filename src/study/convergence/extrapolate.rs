//! Richardson's extrapolation of a sequence with halved steps, with an error bar.
//!
//! With the last two differences Δ₁, Δ₂ and the formal order p_f, the observed order is p = log₂(Δ₁/Δ₂), capped at
//! p_f. The limit is q + Δ/(2^p − 1) with |Δ| = max(|Δ₂|, |Δ₁|/2^p_f), and the bar is F |Δ|/(2^p − 1). F follows
//! Roache (1994) and Eça & Hoekstra (2014): 1.25 if p is near p_f, 3 if it is below or the order changes between
//! levels. Other kinds of sequences have a different bar or none: see [`Verdict`]. `tests/laws/known_answers.rs`
//! counts how often the bars hold.

use serde::Serialize;

/// Behaviour of a sequence.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Verdict {
    /// Differences decrease with an order up to the formal one.
    Converges,
    /// Differences decrease and alternate in sign: the bar is the larger of the last two.
    Alternates,
    /// Differences decrease faster than theory allows, by chance: the bar is the larger of |Δ₂| and |Δ₁|/2.
    FallsByChance,
    /// All differences are at the level of round-off or of the solver's tolerance.
    IsExact,
    /// All values are at the level of round-off or of the solver's tolerance, relative to a larger quantity to which
    /// they belong: for example a component of a vector with another direction.
    IsZero,
    /// There are only two levels, which do not determine an order: the bar is three times their difference.
    TwoLevels,
    /// Differences do not decrease: there is no bar.
    NotYet,
    /// The elements lock, so that differences give little information about errors: there is no bar.
    MayLock,
}

/// Evaluation of a sequence: its limit, order and error bar.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Extrapolation {
    /// Behaviour of the sequence.
    pub verdict: Verdict,
    /// Observed order, log₂ of the ratio of the last two differences; `None` if they do not decrease steadily.
    pub observed_order: Option<f64>,
    /// The limit; the last value if no order is reliable.
    pub value: f64,
    /// Error bar; `None` if the sequence does not converge yet.
    pub error: Option<f64>,
}

/// Smallest order that counts as convergence.
const LEAST_ORDER: f64 = 0.5;
/// An order counts as near the formal one if it is at least this fraction of it.
const NEAR: f64 = 0.75;
/// An order that exceeds the formal one by more than this is attributed to chance.
const CHANCE: f64 = 0.5;
/// Orders of two pairs of levels that differ by more than this count as scattered.
const SCATTER: f64 = 0.5;
/// Alternating differences must decrease by at least this factor.
const LEAST_FALL: f64 = 0.75;
/// Safety factors of the bar: near the formal order, and otherwise.
const FACTORS: [f64; 2] = [1.25, 3.0];
/// Relative round-off of a value.
const ROUND_OFF: f64 = 1e-13;
/// Fraction of a correction in time, found on the coarsest mesh, by which that of the finest mesh may differ.
const CARRIED_OVER: f64 = 1.0;

/// Extrapolates values of levels with halved steps, starting with the coarsest. `formal_order` is the order of the
/// theory. `noise`, in the unit of the values, is the error of each value that does not depend on its level: the
/// round-off of the largest component of a vector, or the solver's tolerance for it.
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
            // The order is NaN if the sign changed.
            earlier.is_nan() || (earlier.min(formal_order) - capped).abs() > SCATTER
        }
        _ => false,
    };
    let is_near = capped >= NEAR * formal_order && !scatters;
    let factor = if is_near { FACTORS[0] } else { FACTORS[1] };
    found(Verdict::Converges, Some(order), correction, Some(factor * correction.abs()))
}

impl Extrapolation {
    /// Returns the limit in space combined with that in time: `at_step` is the value of the time study at the step of
    /// the space study. The correction in time was found on one mesh and is applied to the finest.
    pub fn with_time(&self, time: &Self, at_step: f64) -> Self {
        let correction = time.value - at_step;
        let error =
            self.error.zip(time.error).map(|(space, time)| space + time + CARRIED_OVER * correction.abs());
        let verdict = if self.error.is_some() && time.error.is_none() { time.verdict } else { self.verdict };
        Self { verdict, observed_order: self.observed_order, value: self.value + correction, error }
    }

    /// Returns the evaluation without an error bar, for elements that lock.
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
        // The error changes its sign between the levels: the differences decrease by a factor of 390.
        let found = extrapolate(&[1.04, 1.001, 1.0009], 2.0, 0.0);
        assert_eq!((found.verdict, found.observed_order), (Verdict::FallsByChance, None));
        assert!((found.value - 1.0).abs() < found.error.unwrap());
        // Slightly above the formal order: the formal order is used.
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
            // Without a larger quantity they are not zero.
            assert_ne!(extrapolate(values, 2.0, 0.0).verdict, Verdict::IsZero, "{values:?}");
        }
    }
}
