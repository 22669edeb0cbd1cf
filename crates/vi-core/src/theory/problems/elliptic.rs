//! Elliptic integrals and functions by the arithmetic–geometric mean (Abramowitz & Stegun 1964, §§16.4, 17.6).

use std::f64::consts::FRAC_PI_2;

/// Returns the complete elliptic integral K(k) = ∫₀^{π/2} dφ/√(1 − k² sin²φ), modulus 0 ≤ k < 1.
pub fn complete_elliptic_k(k: f64) -> f64 {
    let (mut a, mut b) = (1.0, ((1.0 - k) * (1.0 + k)).sqrt());
    while a - b > 1e-15 * a {
        (a, b) = (0.5 * (a + b), (a * b).sqrt());
    }
    FRAC_PI_2 / (0.5 * (a + b))
}

/// Jacobi's elliptic functions at one argument.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Jacobi {
    /// Sine of the amplitude, sn(u, k).
    pub sn: f64,
    /// Cosine of the amplitude, cn(u, k).
    pub cn: f64,
    /// Delta of the amplitude, dn(u, k) = √(1 − k² sn²(u, k)).
    pub dn: f64,
}

/// Returns sn, cn, dn of argument u and modulus 0 ≤ k < 1, by descending Landen steps.
pub fn jacobi(u: f64, k: f64) -> Jacobi {
    let (mut a, mut b, mut c) = (1.0, ((1.0 - k) * (1.0 + k)).sqrt(), k);
    let mut steps = Vec::new();
    while c.abs() > 1e-17 && steps.len() < 60 {
        let mean = 0.5 * (a + b);
        c = 0.5 * (a - b);
        (a, b) = (mean, (a * b).sqrt());
        steps.push(c / a);
    }
    let mut phase = u * a * (1u64 << steps.len()) as f64;
    let mut previous = phase;
    for ratio in steps.iter().rev() {
        previous = phase;
        phase = 0.5 * (phase + (ratio * phase.sin()).asin());
    }
    let (sn, cn) = phase.sin_cos();
    let dn = if cn.abs() > 0.1 && !steps.is_empty() {
        cn / (previous - phase).cos()
    } else {
        (1.0 - k * k * sn * sn).sqrt()
    };
    Jacobi { sn, cn, dn }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn limits_and_identities() {
        assert_eq!(complete_elliptic_k(0.0), FRAC_PI_2);
        assert!((complete_elliptic_k(0.5_f64.sqrt()) - 1.854_074_677_301_371_9).abs() < 1e-15);
        for k in [0.0, 0.3, 0.9, 0.999] {
            let quarter = complete_elliptic_k(k);
            assert!((jacobi(quarter, k).sn - 1.0).abs() < 1e-13);
            for u in [-3.0, 0.1, 0.7, 2.0, 11.0] {
                let Jacobi { sn, cn, dn } = jacobi(u, k);
                assert!((sn * sn + cn * cn - 1.0).abs() < 1e-14);
                assert!((dn * dn + k * k * sn * sn - 1.0).abs() < 1e-12);
                let e = 1e-6;
                let slope = (jacobi(u + e, k).sn - jacobi(u - e, k).sn) / (2.0 * e);
                assert!((slope - cn * dn).abs() < 1e-8);
            }
        }
    }
}
