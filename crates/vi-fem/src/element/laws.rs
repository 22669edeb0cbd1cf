//! What every registered element must keep. New elements enter by their registration line.

use super::{Element, ElementKind};

/// All laws of an element.
pub(super) fn check<E: Element<N, Q>, const N: usize, const Q: usize>(kind: ElementKind) {
    assert_eq!(kind.node_count(), N);
    shapes_interpolate::<E, N, Q>();
    gradients_are_those_of_the_values::<E, N, Q>();
}

fn samples<E: Element<N, Q>, const N: usize, const Q: usize>() -> Vec<[f64; 3]> {
    let inside = E::rule().map(|(xi, _)| xi);
    inside.into_iter().chain(E::nodes()).chain([[0.21, 0.13, 0.37]]).collect()
}

fn shapes_interpolate<E: Element<N, Q>, const N: usize, const Q: usize>() {
    for (a, xi) in E::nodes().into_iter().enumerate() {
        for (b, value) in E::values(xi).into_iter().enumerate() {
            assert!((value - if a == b { 1.0 } else { 0.0 }).abs() < 1e-14, "N_{b} at node {a}");
        }
    }
    for xi in samples::<E, N, Q>() {
        // Partition of unity, and linear functions are reproduced.
        let (values, gradients) = (E::values(xi), E::gradients(xi));
        assert!((values.iter().sum::<f64>() - 1.0).abs() < 1e-14);
        for i in 0..3 {
            let position: f64 = values.iter().zip(E::nodes()).map(|(value, node)| value * node[i]).sum();
            assert!((position - xi[i]).abs() < 1e-14);
            for j in 0..3 {
                let slope: f64 = gradients.iter().zip(E::nodes()).map(|(g, node)| g[j] * node[i]).sum();
                assert!((slope - if i == j { 1.0 } else { 0.0 }).abs() < 1e-13);
            }
        }
    }
}

fn gradients_are_those_of_the_values<E: Element<N, Q>, const N: usize, const Q: usize>() {
    let e = 1e-4;
    for xi in samples::<E, N, Q>() {
        let gradients = E::gradients(xi);
        for j in 0..3 {
            let shifted = |by: f64| {
                let mut xi = xi;
                xi[j] += by;
                E::values(xi)
            };
            let ([a, b], [c, d]) = ([shifted(e), shifted(-e)], [shifted(2.0 * e), shifted(-2.0 * e)]);
            for k in 0..N {
                let expected = (8.0 * (a[k] - b[k]) - (c[k] - d[k])) / (12.0 * e);
                assert!((gradients[k][j] - expected).abs() < 1e-9);
            }
        }
    }
}
