//! The logarithm near 1, for energies that vanish to second order at rest.

use crate::lanes::real::Real;

/// Returns x − ln(1 + x) for x > −1, with an error of ε_m x (for the logarithm: Higham, Accuracy and Stability of Numerical
/// Algorithms, 2002, §1.14.1).
#[inline(always)]
pub(crate) fn minus_logarithm<R: Real>(x: R) -> R {
    let sum = x + 1.0;
    let rounded = sum - 1.0;
    let quotient = x * sum.ln() / rounded;
    x - rounded.abs().if_positive(quotient, x)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Compares with the series x²/2 − x³/3 + …, which converges for |x| < 1.
    #[test]
    fn the_error_is_round_off_of_the_argument() {
        for exponent in 0..60 {
            for x in [0.5_f64, -0.5, 0.371, -0.629].map(|x| x * 0.5_f64.powi(exponent)) {
                let term = |n: i32| (-x).powi(n) / f64::from(n);
                let series: f64 = (2..400).rev().map(term).sum();
                let error = (minus_logarithm(x) - series).abs();
                assert!(error <= 4.0 * f64::EPSILON * x.abs(), "{x:e}: off by {error:e}");
            }
        }
        assert_eq!(minus_logarithm(0.0), 0.0);
        assert!(minus_logarithm(-1.5_f64).is_nan());
    }
}
