//! Richardson's extrapolation of a sequence whose step is halved. It must not know what the values are.

use serde::Serialize;

/// What a sequence of values tells about its limit.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Extrapolation {
    /// p = log₂ of the ratio of the last two differences; none where they do not fall steadily, or are round-off.
    pub observed_order: Option<f64>,
    /// The limit, q + Δ/(2^p − 1) of the last value q and difference Δ; q where no order is seen.
    pub value: f64,
    /// Its error bar: the size of the correction; where no order is seen, the largest of the last two differences.
    pub error: f64,
}

/// The least ratio of differences that is taken for convergence: order .26.
const LEAST_RATIO: f64 = 1.2;

/// Extrapolates values of levels with halved steps, the coarsest first (Richardson 1911; Roache 1994).
pub fn extrapolate(values: &[f64]) -> Extrapolation {
    let Some(&last) = values.last() else {
        return Extrapolation { observed_order: None, value: f64::NAN, error: f64::NAN };
    };
    let differences: Vec<f64> = values.windows(2).map(|pair| pair[1] - pair[0]).collect();
    let recent = &differences[differences.len().saturating_sub(2)..];
    let largest = recent.iter().fold(0.0_f64, |most, difference| most.max(difference.abs()));
    let nothing = Extrapolation {
        observed_order: None,
        value: last,
        error: if recent.is_empty() { f64::NAN } else { largest },
    };
    let &[before, now] = recent else { return nothing };
    let ratio = before / now;
    // Differences at round-off have no order.
    if !(ratio > LEAST_RATIO && ratio.is_finite()) || now.abs() < 1e-13 * last.abs() {
        return nothing;
    }
    let correction = now / (ratio - 1.0);
    Extrapolation { observed_order: Some(ratio.log2()), value: last + correction, error: correction.abs() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_power_law_is_extrapolated_to_its_limit() {
        for order in [1.0, 2.0, 4.0] {
            let values: Vec<f64> = (0..4).map(|k| 3.0 + 0.1 * 0.5_f64.powf(order * f64::from(k))).collect();
            let found = extrapolate(&values);
            assert!((found.observed_order.unwrap() - order).abs() < 1e-6);
            assert!((found.value - 3.0).abs() < 1e-9 && found.error > 0.0);
        }
    }

    #[test]
    fn sequences_without_an_order_keep_a_wide_bar() {
        let found = extrapolate(&[1.0, 1.2, 1.1]);
        assert_eq!((found.observed_order, found.value), (None, 1.1));
        assert!((found.error - 0.2).abs() < 1e-15);
        assert!((extrapolate(&[1.0, 1.5]).error - 0.5).abs() < 1e-15);
        assert!(extrapolate(&[1.0]).error.is_nan() && extrapolate(&[]).value.is_nan());
        assert_eq!(extrapolate(&[2.0, 2.0, 2.0]).error, 0.0);
    }
}
