//! The barrier B(s) of a gap s = g/d̂ relative to the activation distance d̂.
//!
//! B = (1−s)ᵏ/s with k = 3 or 4 for 0 < s < 1, and zero beyond. It becomes infinite at touch in floating point too,
//! whereas a logarithm does not: for the smallest gap that coordinates of 1 m resolve, ln is −37 and 1/s is 1e16. B
//! needs no function of the C library, so its bits are the same on every machine.

/// B(s) = (1−s)ᵏ/s for 0 < s < 1, zero for s ≥ 1, infinite for s ≤ 0.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Barrier {
    /// k = 3: twice continuously differentiable at s = 1.
    #[default]
    Cubic,
    /// k = 4: three times continuously differentiable at s = 1, for schemes of order four and more.
    Quartic,
}

impl Barrier {
    /// Returns B(s).
    pub fn value(self, s: f64) -> f64 {
        if s >= 1.0 {
            return 0.0;
        }
        if s <= 0.0 {
            return f64::INFINITY;
        }
        let q = 1.0 - s;
        match self {
            Self::Cubic => q * q * q / s,
            Self::Quartic => q * q * q * q / s,
        }
    }

    /// Returns B'(s) ≤ 0.
    pub fn slope(self, s: f64) -> f64 {
        if s >= 1.0 {
            return 0.0;
        }
        if s <= 0.0 {
            return f64::NEG_INFINITY;
        }
        let q = 1.0 - s;
        match self {
            Self::Cubic => -q * q * (3.0 * s + q) / (s * s),
            Self::Quartic => -q * q * q * (4.0 * s + q) / (s * s),
        }
    }

    /// Returns B''(s) ≥ 0.
    pub fn curvature(self, s: f64) -> f64 {
        if s >= 1.0 {
            return 0.0;
        }
        if s <= 0.0 {
            return f64::INFINITY;
        }
        let (q, s2) = (1.0 - s, s * s);
        match self {
            Self::Cubic => 6.0 * q / s + 6.0 * q * q / s2 + 2.0 * q * q * q / (s2 * s),
            Self::Quartic => q * q * (12.0 / s + 8.0 * q / s2 + 2.0 * q * q / (s2 * s)),
        }
    }

    /// Returns B'''(s) ≤ 0.
    pub fn third(self, s: f64) -> f64 {
        if s >= 1.0 {
            return 0.0;
        }
        if s <= 0.0 {
            return f64::NEG_INFINITY;
        }
        let steep = -6.0 / (s * s * s * s);
        match self {
            Self::Cubic => steep,
            // B is 1/s − 4 + 6s − 4s² + s³.
            Self::Quartic => steep + 6.0,
        }
    }

    /// Returns the difference quotient (B(b) − B(a))/(b − a) ≤ 0, without cancellation if a is near b. For a, b < 1,
    /// with p = 1−a and q = 1−b, it is −(P_k − p q P_{k−1})/(a b), where P_k = Σ pⁱ q^{k−1−i}.
    pub fn quotient(self, a: f64, b: f64) -> f64 {
        if a >= 1.0 && b >= 1.0 {
            return 0.0;
        }
        if a <= 0.0 || b <= 0.0 {
            return f64::NEG_INFINITY;
        }
        if a >= 1.0 || b >= 1.0 {
            return (self.value(b) - self.value(a)) / (b - a);
        }
        let (p, q) = (1.0 - a, 1.0 - b);
        let squares = p * p + p * q + q * q;
        let sum = match self {
            Self::Cubic => squares - p * q * (p + q),
            Self::Quartic => (p + q) * (p * p + q * q) - p * q * squares,
        };
        -sum / (a * b)
    }

    /// Returns the derivative of [`Barrier::quotient`] by its second argument, (B'(b)(b−a) − B(b) + B(a))/(b−a)² ≥ 0;
    /// it is half of B'' if a = b.
    pub fn quotient_slope(self, a: f64, b: f64) -> f64 {
        if a >= 1.0 && b >= 1.0 {
            return 0.0;
        }
        if a <= 0.0 || b <= 0.0 {
            return f64::INFINITY;
        }
        if a >= 1.0 || b >= 1.0 {
            let step = b - a;
            return (self.slope(b) * step - self.value(b) + self.value(a)) / (step * step);
        }
        let (p, q) = (1.0 - a, 1.0 - b);
        // 1 − a b², without cancellation near a = b = 1.
        let complement = p + (1.0 - p) * q * (2.0 - q);
        match self {
            Self::Cubic => complement / (a * b * b),
            // B[a,b,b] of 1/s − 4 + 6s − 4s² + s³ is 1/(ab²) − 4 + a + 2b.
            Self::Quartic => (complement / (a * b * b) - p - 2.0 * q).max(0.0),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const BOTH: [Barrier; 2] = [Barrier::Cubic, Barrier::Quartic];

    #[test]
    fn derivatives_agree_with_central_differences() {
        for barrier in BOTH {
            for k in 1..60 {
                let s = f64::from(k) / 60.0;
                let h = 1e-5 * s;
                let slope = (barrier.value(s + h) - barrier.value(s - h)) / (2.0 * h);
                let curvature = (barrier.slope(s + h) - barrier.slope(s - h)) / (2.0 * h);
                assert!((slope - barrier.slope(s)).abs() <= 1e-8 * (1.0 + slope.abs()), "{barrier:?} {s}");
                assert!((curvature - barrier.curvature(s)).abs() <= 1e-8 * (1.0 + curvature.abs()));
                let third = (barrier.curvature(s + h) - barrier.curvature(s - h)) / (2.0 * h);
                assert!((third - barrier.third(s)).abs() <= 1e-8 * (1.0 + third.abs()));
            }
        }
    }

    #[test]
    fn the_quotient_times_the_change_is_the_difference_at_any_distance() {
        for barrier in BOTH {
            for (a, b) in [(0.3, 0.31), (1e-12, 0.7), (0.99, 0.2), (0.5, 1.7), (1.2, 0.4), (0.999, 0.9999)] {
                let difference = barrier.value(b) - barrier.value(a);
                let size = barrier.value(a).max(barrier.value(b));
                assert!((barrier.quotient(a, b) * (b - a) - difference).abs() <= 1e-15 * size, "{a} {b}");
                assert_eq!(barrier.quotient(a, b), barrier.quotient(b, a));
            }
        }
    }

    #[test]
    fn the_quotient_of_equal_gaps_is_the_slope_and_its_slope_half_the_curvature() {
        for barrier in BOTH {
            for s in [1e-9, 1e-3, 0.2, 0.5, 0.9, 0.999] {
                let (quotient, slope) = (barrier.quotient(s, s), barrier.slope(s));
                assert!(
                    (quotient - slope).abs() <= 4e-15 * slope.abs(),
                    "{barrier:?} {s}: {quotient} {slope}"
                );
                let (half, curvature) = (barrier.quotient_slope(s, s), barrier.curvature(s));
                // The curvature of the quartic vanishes as (1 − s)², and the round-off of 1 remains.
                assert!((half - 0.5 * curvature).abs() <= 1e-14 * curvature + 1e-15, "{barrier:?} {s}");
            }
        }
    }

    #[test]
    fn the_slope_of_the_quotient_agrees_with_differences_across_the_onset() {
        for barrier in BOTH {
            for (a, b) in [(0.2, 0.6), (0.7, 0.1), (0.4, 1.5), (1.4, 0.3)] {
                let h = 1e-6;
                let difference = (barrier.quotient(a, b + h) - barrier.quotient(a, b - h)) / (2.0 * h);
                let slope = barrier.quotient_slope(a, b);
                assert!((difference - slope).abs() <= 1e-7 * (1.0 + slope), "{barrier:?} {a} {b}");
            }
        }
    }

    #[test]
    fn it_is_convex_decreasing_and_infinite_at_touch() {
        for barrier in BOTH {
            assert_eq!(barrier.value(0.0), f64::INFINITY);
            assert!(barrier.value(1e-300) > 1e299);
            assert_eq!([barrier.value(1.0), barrier.slope(1.0), barrier.curvature(1.0)], [0.0, -0.0, 0.0]);
            for k in 1..100 {
                let s = f64::from(k) / 100.0;
                assert!(barrier.slope(s) < 0.0 && barrier.curvature(s) > 0.0);
                assert!(barrier.quotient(s, 0.5) < 0.0 && barrier.quotient_slope(0.5, s) > 0.0);
            }
        }
    }
}
