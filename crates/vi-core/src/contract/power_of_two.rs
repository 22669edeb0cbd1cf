//! Units that are powers of two: they make numbers of different dimensions comparable without rounding.

/// Returns e with 2^e ≤ |x| < 2^(e+1); 0 for zero and for non-finite numbers.
pub fn binary_exponent(x: f64) -> i32 {
    let biased = (x.to_bits() >> 52 & 0x7ff) as i32;
    match biased {
        // Subnormal or zero.
        0 if x != 0.0 => binary_exponent(x * 2.0_f64.powi(64)) - 64,
        0 | 0x7ff => 0,
        _ => biased - 1023,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exponents_are_those_of_the_binary_form() {
        for e in [-1074, -1023, -1022, -3, 0, 1, 900, 1023] {
            let low = 2.0_f64.powi(e / 2) * 2.0_f64.powi(e - e / 2);
            assert_eq!((binary_exponent(low), binary_exponent(-low)), (e, e));
            if (-1000..1000).contains(&e) {
                assert_eq!(binary_exponent(1.99 * low), e);
            }
        }
        assert_eq!([0.0, f64::NAN, f64::INFINITY].map(binary_exponent), [0; 3]);
    }
}
