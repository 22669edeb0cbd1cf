//! Tests the first two systems of the theory pages: the free particle, and masses and springs formulated in two ways.

use vi_core::discrete::DiscreteLagrangian;
use vi_core::problems::SpringChain;
use vi_core::{Scheme, State, lagrangian, reference};

#[test]
fn every_scheme_moves_a_free_particle_exactly() {
    let free = lagrangian!(2; |_t, _q, v| (v[0] * v[0] + v[1] * v[1]) * 0.5);
    for scheme in [
        Scheme::symplectic_euler_a(),
        Scheme::stormer_verlet(),
        Scheme::implicit_midpoint(),
        Scheme::gauss(3).unwrap(),
    ] {
        let discrete = DiscreteLagrangian::new(&free, &scheme, 0.37).unwrap();
        let mut state = State { t: 0.0, q: vec![1.0, -2.0], p: vec![0.5, 0.25] };
        for _ in 0..100 {
            state = discrete.step(&state).unwrap();
        }
        assert!((state.q[0] - (1.0 + 0.5 * 37.0)).abs() < 1e-12, "{scheme:?}");
        assert!((state.q[1] - (-2.0 + 0.25 * 37.0)).abs() < 1e-12);
        assert!((state.p[0] - 0.5).abs() < 1e-14 && (state.p[1] - 0.25).abs() < 1e-14);
    }
}

#[test]
fn the_rule_of_the_action_is_newtons_rule() {
    // Compares M (q_{k+1} − 2 q_k + q_{k−1})/h² = −∇V(q_k) with the discrete Euler–Lagrange equations of
    // linear × trapezoid, for masses and springs in space.
    let chain = SpringChain::unit(4);
    let system = chain.system().unwrap();
    let h = 0.05;
    let scheme = Scheme::stormer_verlet();
    let mut states = vec![chain.disturbed_state()];
    for k in 0..200 {
        states.push(reference::step(&system, &scheme, &states[k], h).unwrap());
    }
    let (mut before, mut now) = (states[0].q.clone(), states[1].q.clone());
    for state in &states[1..200] {
        assert!(now.iter().zip(&state.q).all(|(a, b)| (a - b).abs() < 1e-11));
        let force = reference::gradient(&system, &now, 0.0);
        let next = (0..now.len())
            .map(|i| 2.0 * now[i] - before[i] - h * h * force[i] / system.free_mass()[i])
            .collect();
        (before, now) = (now, next);
    }
    // A single step satisfies this equation to round-off.
    let force = reference::gradient(&system, &states[7].q, 0.0);
    for i in 0..now.len() {
        let newton = 2.0 * states[7].q[i] - states[6].q[i] - h * h * force[i] / system.free_mass()[i];
        assert!((states[8].q[i] - newton).abs() < 5e-15);
    }
}
