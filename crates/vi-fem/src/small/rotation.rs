//! Computes the rotation nearest to a 3 × 3 matrix in lanes, without its singular values.
//!
//! For F = U diag(σ) Vᵀ with rotations U and V (σ₃ < 0 if F is inverted) the nearest rotation is R = U Vᵀ, and tr RᵀF
//! = λ = σ₁ + σ₂ + σ₃. This λ is the largest root of
//! p(λ) = λ⁴ − 2 I λ² − 8 J λ + I² − 4 II, where I = ‖F‖², J = det F, II = ‖cof F‖².
//! The other roots are the sums in which two of the σ change sign (N.J. Higham, V. Noferini, "An algorithm to compute
//! the polar decomposition of a 3 × 3 matrix", Numer. Algorithms 73 (2016) 349–369, §3). As R = ∂λ/∂F,
//! R = ((λ² + I) F + 2λ cof F − 2 F FᵀF)/(λ³ − I λ − 2J).
//! The denominator equals 2 (σ₁ + σ₂)(σ₂ + σ₃)(σ₃ + σ₁).

use crate::lanes::real::Real;
use crate::small::svd::{normalised, svd};
use crate::small::tensor::{
    Mat3, cofactor, contract, dot, mat3, product, product_transposed, right_cauchy_green,
};

/// Number of steps of Laguerre's method. As all roots are real it converges from above with order three; four steps
/// suffice for strains of order one.
const STEPS: usize = 4;

/// Smallest denominator of F/‖F‖ for which R is exact to about 1e-14. For a rotation the denominator is 16/(3√3) ≈
/// 3.1.
const REGULAR: f64 = 0.1;

/// Largest last step that counts as converged: the next step would be of the size of round-off.
const CONVERGED: f64 = 1e-6;

/// Returns the rotation nearest to F, for every F whose squares do not underflow. If σ₂ + σ₃ = 0 it is not unique;
/// returns one of the nearest.
#[inline(always)]
pub(crate) fn nearest_rotation<R: Real>(f: &Mat3<R>) -> Mat3<R> {
    let (g, norm) = normalised(f);
    let one = norm.constant(1.0);
    let cofactors = cofactor(&g);
    let j = dot(g[0], cofactors[0]);
    let constant = contract(&cofactors, &cofactors).mul_add(norm.constant(-4.0), one);
    let mut lambda = norm.constant(3.0_f64.sqrt());
    let mut step = one;
    for _ in 0..STEPS {
        let squared = lambda * lambda;
        let p = ((squared - 2.0) * lambda - j * 8.0).mul_add(lambda, constant);
        let slope = ((squared - 1.0) * lambda - j * 2.0) * 4.0;
        let curvature = squared * 12.0 - 4.0;
        let discriminant = (slope * slope * 3.0 - p * curvature * 4.0) * 3.0;
        let root = discriminant.if_positive(discriminant, one * 0.0).sqrt();
        step = p * 4.0 / (slope + root);
        lambda = lambda - step;
    }
    let denominator = (lambda * lambda - 1.0) * lambda - j * 2.0;
    let share = one / denominator;
    let (first, second) = (lambda.mul_add(lambda, one) * share, lambda * share * 2.0);
    let third = share * -2.0;
    let cubed = product(&g, &right_cauchy_green(&g));
    let regular = mat3!(i k => first.mul_add(
        g[i][k],
        second.mul_add(cofactors[i][k], third * cubed[i][k]),
    ));
    // The margin is positive if both conditions hold; it is not positive if one of them is NaN.
    let margin = (denominator - REGULAR).if_positive(norm.constant(CONVERGED) - step.abs(), -one);
    if margin.is_positive() {
        return regular;
    }
    let (u, _, v) = svd(f);
    let r = product_transposed(&u, &v);
    mat3!(i k => margin.if_positive(regular[i][k], r[i][k]))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lanes::pack::Pack;
    use crate::lanes::real::Lane;
    use crate::small::tensor::{determinant, transpose};

    /// Returns numbers in (−1, 1) that are the same in every run.
    fn noise(seed: &mut u64) -> f64 {
        *seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (*seed >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
    }

    fn samples() -> Vec<Mat3<f64>> {
        let mut seed = 7;
        let mut samples: Vec<Mat3<f64>> = Vec::new();
        for stretch in [1e-9, 1e-4, 0.1, 0.5, 3.0, 1e3] {
            for sign in [1.0, -1.0] {
                for _ in 0..200 {
                    let mut random = || [0; 3].map(|_| [0; 3].map(|_| noise(&mut seed)));
                    let (u, _, _) = svd(&random());
                    let aside = random();
                    let mut near = mat3!(i j => f64::from(u8::from(i == j)) + stretch * aside[i][j]);
                    near[2] = near[2].map(|value| sign * value);
                    samples.push(product(&u, &near));
                }
            }
        }
        let diagonal = |d: [f64; 3]| mat3!(i j => if i == j { d[i] } else { 0.0 });
        samples.extend(
            [
                [0.0; 3],
                [1.0, 0.0, 0.0],
                [1.0, 1.0, 0.0],
                [1.0, 1.0, -1.0],
                [1e-8, 1.0, 1e-8],
                [2.0, -1.0, -1.0],
            ]
            .map(diagonal),
        );
        samples.push([[1e-100; 3]; 3]);
        samples
    }

    #[test]
    fn it_is_the_rotation_of_the_singular_vectors() {
        let identity = mat3!(i j => f64::from(u8::from(i == j)));
        for f in samples() {
            let r = nearest_rotation(&f);
            let norm = contract(&f, &f).sqrt();
            let (u, sigma, v) = svd(&f);
            let (expected, metric) = (product_transposed(&u, &v), product(&transpose(&r), &r));
            // Allow an error in inverse proportion to σ₂ + σ₃: R is ill-conditioned if the gap is small.
            let gap = ((sigma[1] + sigma[2]) / norm).max(1e-300);
            for i in 0..3 {
                for j in 0..3 {
                    assert!((metric[i][j] - identity[i][j]).abs() < 2e-13, "{f:?}: {metric:?}");
                    let error = (r[i][j] - expected[i][j]).abs();
                    assert!(error < 2e-14 / gap || gap < 1e-12, "{f:?}: {error:e}, {gap:e}");
                }
            }
            assert!((determinant(&r) - 1.0).abs() < 2e-13, "{f:?}");
            // R Fᵀ is symmetric, so that the stress of a corotated law has no moment.
            let rotated = product_transposed(&r, &f);
            let skew =
                (0..3).map(|i| (rotated[i][(i + 1) % 3] - rotated[(i + 1) % 3][i]).abs()).fold(0.0, f64::max);
            assert!(skew <= 1e-13 * norm, "{f:?} {sigma:?}: {skew:e}");
        }
    }

    /// If the nearest rotation is not unique, round-off decides. A law whose tangent uses singular values must find
    /// the same rotation.
    #[test]
    fn at_a_jump_it_is_that_of_the_singular_vectors_to_the_bit() {
        let mut seed = 3;
        for sign in [[-1.0, 1.0, 1.0], [1.0, -1.0, 1.0], [-1.0, -1.0, -1.0], [-2.0, 1.0, 1.0]] {
            for _ in 0..100 {
                let f = mat3!(i j => if i == j { sign[i] } else { 0.0 } + 1e-15 * noise(&mut seed));
                let (u, _, v) = svd(&f);
                assert_eq!(nearest_rotation(&f), product_transposed(&u, &v), "{f:?}");
            }
        }
    }

    struct InLanes<'a>(&'a [Mat3<f64>]);
    impl pulp::WithSimd for InLanes<'_> {
        type Output = Vec<Mat3<f64>>;
        fn with_simd<S: pulp::Simd>(self, simd: S) -> Self::Output {
            let mut found = Vec::new();
            for group in self.0.chunks(S::F64_LANES) {
                let mut packs = [Pack::default(); 9];
                for (lane, f) in group.iter().enumerate() {
                    for k in 0..9 {
                        packs[k].0[lane] = f[k / 3][k % 3];
                    }
                }
                let f: Mat3<Lane<S>> = mat3!(i j => packs[3 * i + j].load(simd, 0));
                let r = nearest_rotation(&f);
                for k in 0..9 {
                    packs[k].store(0, r[k / 3][k % 3]);
                }
                found.extend((0..group.len()).map(|lane| mat3!(i j => packs[3 * i + j].0[lane])));
            }
            found
        }
    }

    #[test]
    fn a_lane_does_not_know_its_neighbours() {
        let samples = samples();
        let mut rotated = samples.clone();
        rotated.rotate_left(3);
        let arch = pulp::Arch::new();
        let (found, mut other) = (arch.dispatch(InLanes(&samples)), arch.dispatch(InLanes(&rotated)));
        other.rotate_right(3);
        assert!(found == other);
    }
}
