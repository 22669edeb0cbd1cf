//! Tests the laws that every registered element must obey. The registration line adds a new element.

use vi_mesh::CellKind;

use super::contract::Element;

/// Checks all laws for one element.
pub(super) fn check<E: Element<N, Q>, const N: usize, const Q: usize>(kind: CellKind) {
    assert_eq!((E::KIND, kind.node_count()), (kind, N));
    shapes_interpolate::<E, N, Q>();
    gradients_are_those_of_the_values::<E, N, Q>();
    rules_are_exact_to_their_degree::<E, N, Q>(kind);
    nodes_carry_positive_mass::<E, N, Q>(kind);
}

/// Returns ∫ x^a y^b z^c over the reference cell.
fn moment(kind: CellKind, [a, b, c]: [i32; 3]) -> f64 {
    let factorial = |n: i32| (1..=n).map(f64::from).product::<f64>();
    let symmetric = |n: i32| if n % 2 == 0 { 2.0 / f64::from(n + 1) } else { 0.0 };
    match kind.linear() {
        CellKind::Tet4 => factorial(a) * factorial(b) * factorial(c) / factorial(a + b + c + 3),
        CellKind::Wedge6 => factorial(a) * factorial(b) / factorial(a + b + 2) / f64::from(c + 1),
        CellKind::Pyramid5 => {
            symmetric(a) * symmetric(b) * factorial(a + b + 2) * factorial(c) / factorial(a + b + c + 3)
        }
        _ => [a, b, c].map(symmetric).iter().product(),
    }
}

fn rules_are_exact_to_their_degree<E: Element<N, Q>, const N: usize, const Q: usize>(kind: CellKind) {
    let check = |rule: &[([f64; 3], f64)], degree: i32| {
        for a in 0..=degree {
            for b in 0..=degree - a {
                for c in 0..=degree - a - b {
                    let term = |xi: &[f64; 3]| xi[0].powi(a) * xi[1].powi(b) * xi[2].powi(c);
                    let sum: f64 = rule.iter().map(|(xi, weight)| weight * term(xi)).sum();
                    let expected = moment(kind, [a, b, c]);
                    assert!((sum - expected).abs() < 1e-14, "{kind}: x^{a} y^{b} z^{c}: {sum} {expected}");
                }
            }
        }
    };
    check(&E::rule(), E::DEGREE as i32);
    check(&E::mass_rule(), E::DEGREE as i32);
    if kind == CellKind::Tet10 {
        check(&E::mass_rule(), 5);
    }
}

fn nodes_carry_positive_mass<E: Element<N, Q>, const N: usize, const Q: usize>(kind: CellKind) {
    let shares = crate::solid::mass::mass_shares::<E, N, Q>(&E::nodes());
    assert!(shares.iter().all(|&share| share > 0.0), "{kind}: {shares:?}");
    assert!((shares.iter().sum::<f64>() - moment(kind, [0; 3])).abs() < 1e-14);
    if kind == CellKind::Tet10 {
        // With straight sides the shares are 1/36 and 4/27 of the whole.
        assert!((6.0 * shares[0] - 1.0 / 36.0).abs() < 1e-14 && (6.0 * shares[9] - 4.0 / 27.0).abs() < 1e-14);
    }
}

/// Returns points inside the reference cell: those of the rule, and one near each node. At a node itself shape
/// functions may have no gradient, as at the apex of a pyramid.
fn samples<E: Element<N, Q>, const N: usize, const Q: usize>() -> Vec<[f64; 3]> {
    let inside = E::rule().map(|(xi, _)| xi);
    let middle = [0, 1, 2].map(|i| E::nodes().iter().map(|node| node[i]).sum::<f64>() / N as f64);
    let near = E::nodes().map(|node| [0, 1, 2].map(|i| 0.9 * node[i] + 0.1 * middle[i]));
    inside.into_iter().chain(near).chain([[0.21, 0.13, 0.37]]).collect()
}

fn shapes_interpolate<E: Element<N, Q>, const N: usize, const Q: usize>() {
    for (a, xi) in E::nodes().into_iter().enumerate() {
        for (b, value) in E::values(xi).into_iter().enumerate() {
            assert!((value - if a == b { 1.0 } else { 0.0 }).abs() < 1e-14, "N_{b} at node {a}");
        }
    }
    for xi in samples::<E, N, Q>() {
        // Check the partition of unity, and that linear functions are reproduced.
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
