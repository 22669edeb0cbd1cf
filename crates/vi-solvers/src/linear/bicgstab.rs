//! BiCGSTAB (H. A. van der Vorst, SIAM J. Sci. Stat. Comput. 13 (1992) 631–644) with a right preconditioner, for systems
//! that are small, well conditioned and not symmetric.

use crate::vectors::{dot, norm};

/// Solves A x = b to ‖b − Ax‖ ≤ `tolerance` ‖b‖ from x = 0. `apply` multiplies by A, and `precondition` by an approximate
/// inverse, in place. Returns the number of products with A, or `None` if the tolerance is not reached with `most`
/// products, or if the recurrence breaks down; x is then the last iterate, which is finite.
pub(crate) fn solve(
    apply: impl Fn(&[f64], &mut [f64]),
    precondition: impl Fn(&mut [f64]),
    b: &[f64],
    x: &mut Vec<f64>,
    tolerance: f64,
    most: usize,
) -> Option<usize> {
    let n = b.len();
    x.clear();
    x.resize(n, 0.0);
    let goal = tolerance * norm(b);
    let mut r = b.to_vec();
    let shadow = r.clone();
    let mut p = vec![0.0; n];
    let (mut v, mut t) = (vec![0.0; n], vec![0.0; n]);
    let (mut p_hat, mut s_hat) = (vec![0.0; n], vec![0.0; n]);
    let (mut rho, mut alpha, mut omega) = (1.0, 1.0, 1.0);
    let mut products = 0;
    while norm(&r) > goal {
        if products >= most {
            return None;
        }
        let next = dot(&shadow, &r);
        let beta = next / rho * (alpha / omega);
        rho = next;
        for k in 0..n {
            p[k] = r[k] + beta * (p[k] - omega * v[k]);
        }
        p_hat.copy_from_slice(&p);
        precondition(&mut p_hat);
        apply(&p_hat, &mut v);
        alpha = rho / dot(&shadow, &v);
        if !alpha.is_finite() {
            return None;
        }
        for k in 0..n {
            r[k] -= alpha * v[k];
            x[k] += alpha * p_hat[k];
        }
        products += 1;
        if norm(&r) <= goal {
            break;
        }
        s_hat.copy_from_slice(&r);
        precondition(&mut s_hat);
        apply(&s_hat, &mut t);
        omega = dot(&t, &r) / dot(&t, &t);
        if !omega.is_finite() || omega == 0.0 {
            return None;
        }
        for k in 0..n {
            x[k] += omega * s_hat[k];
            r[k] -= omega * t[k];
        }
        products += 1;
    }
    Some(products)
}

#[cfg(test)]
mod tests {
    /// A skew-symmetric matrix makes the first quotient infinite.
    #[test]
    fn a_breakdown_leaves_a_finite_iterate() {
        let apply = |x: &[f64], out: &mut [f64]| (out[0], out[1]) = (x[1], -x[0]);
        let mut x = Vec::new();
        assert_eq!(super::solve(apply, |_| (), &[1.0, 0.0], &mut x, 1e-12, 50), None);
        assert!(x.iter().all(|value| value.is_finite()), "{x:?}");
    }

    #[test]
    fn it_solves_a_system_that_is_not_symmetric() {
        let n = 40;
        let entry = |i: usize, j: usize| match j.wrapping_sub(i) {
            0 => 4.0 + (i % 7) as f64,
            1 => -1.0,
            usize::MAX => 2.0,
            _ => 0.0,
        };
        let apply = |x: &[f64], out: &mut [f64]| {
            (0..n).for_each(|i| out[i] = (0..n).map(|j| entry(i, j) * x[j]).sum());
        };
        let precondition = |r: &mut [f64]| (0..n).for_each(|i| r[i] /= entry(i, i));
        let b: Vec<f64> = (0..n).map(|k| (k as f64).sin()).collect();
        let mut x = Vec::new();
        let products = super::solve(apply, precondition, &b, &mut x, 1e-12, 200).unwrap();
        let mut image = vec![0.0; n];
        apply(&x, &mut image);
        let error: f64 = image.iter().zip(&b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(error < 1e-11 && products < 60, "{error:e} {products}");
    }
}
