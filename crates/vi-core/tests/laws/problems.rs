//! Tests the library of problems: derivatives of potentials, and exact motions against the equations of motion.

use vi_core::problems::{HenonHeiles, Kepler, Oscillator, Pendulum, SphericalPendulum, SpringChain};
use vi_core::{State, System, reference};

/// Compares the gradient with differences of the energy, and the Hessian with differences of the gradient.
fn derivatives_are_right(system: &System, x: &[f64]) {
    let delta = 1e-3;
    let shifted = |i: usize, steps: f64| {
        let mut x = x.to_vec();
        x[i] += steps * delta;
        x
    };
    let slope = reference::gradient(system, x, 0.0);
    let curvature = reference::hessian(system, x, 0.0);
    for i in 0..x.len() {
        let energy = |steps| reference::energy(system, &shifted(i, steps), 0.0);
        let expected = (8.0 * (energy(1.0) - energy(-1.0)) - energy(2.0) + energy(-2.0)) / (12.0 * delta);
        assert!((slope[i] - expected).abs() < 1e-9 * (1.0 + expected.abs()), "{i}: {} {expected}", slope[i]);
        let gradient = |steps| reference::gradient(system, &shifted(i, steps), 0.0);
        let (a, b, c, d) = (gradient(-2.0), gradient(-1.0), gradient(1.0), gradient(2.0));
        for j in 0..x.len() {
            let expected = (8.0 * (c[j] - b[j]) - d[j] + a[j]) / (12.0 * delta);
            assert!((curvature[(i, j)] - expected).abs() < 1e-8 * (1.0 + expected.abs()), "{i} {j}");
        }
    }
}

#[test]
fn gradients_and_hessians_are_derivatives() {
    derivatives_are_right(&Oscillator { mass: 0.3, stiffness: 2.0 }.system().unwrap(), &[0.7]);
    derivatives_are_right(&Pendulum { mass: 0.3, length: 2.0, gravity: 5.0 }.system().unwrap(), &[1.9]);
    derivatives_are_right(&Kepler::<2> { mu: 1.7 }.system().unwrap(), &[0.9, -1.2]);
    derivatives_are_right(&Kepler::<3> { mu: 1.7 }.system().unwrap(), &[0.9, -1.2, 0.4]);
    derivatives_are_right(&HenonHeiles.system().unwrap(), &[0.3, -0.2]);
    let particle = SphericalPendulum { length: 1.0, gravity: 3.0 }.particle().unwrap();
    derivatives_are_right(&particle, &[0.3, -0.2, 0.9]);
    let chain = SpringChain::unit(4);
    derivatives_are_right(&chain.system().unwrap(), &chain.disturbed_state().q);
}

#[test]
fn exact_motions_keep_their_energy_and_obey_their_equation() {
    let oscillator = Oscillator { mass: 0.7, stiffness: 3.0 };
    let start = State { t: 0.0, q: vec![0.4], p: vec![-0.9] };
    let pendulum = Pendulum { mass: 2.0, length: 1.5, gravity: 9.81 };
    let kepler = Kepler::<2> { mu: 1.3 };
    type Motion<'a> = Box<dyn Fn(f64) -> State + 'a>;
    let cases: [(System, Motion); 3] = [
        (oscillator.system().unwrap(), Box::new(|t| oscillator.exact(&start, t))),
        (pendulum.system().unwrap(), Box::new(|t| pendulum.exact(2.2, t))),
        (kepler.system().unwrap(), Box::new(|t| kepler.exact(0.5, t))),
    ];
    let d = 1e-3;
    for (system, motion) in cases {
        let total = |s: &State| vi_core::kinetic_energy(&system, s) + reference::energy(&system, &s.q, s.t);
        let initial = total(&motion(0.0));
        for t in [0.1, 0.8, 2.3, 7.1] {
            let state = motion(t);
            assert!((total(&state) - initial).abs() < 1e-12 * (1.0 + initial.abs()));
            // Checks ṗ = −∇V and q̇ = M⁻¹p.
            let (a, b, c, e) = (motion(t - 2.0 * d), motion(t - d), motion(t + d), motion(t + 2.0 * d));
            let slope = reference::gradient(&system, &state.q, t);
            for i in 0..state.q.len() {
                let rate = |x: [f64; 4]| (8.0 * (x[2] - x[1]) - x[3] + x[0]) / (12.0 * d);
                let q_dot = rate([a.q[i], b.q[i], c.q[i], e.q[i]]);
                let p_dot = rate([a.p[i], b.p[i], c.p[i], e.p[i]]);
                assert!((q_dot - state.p[i] / system.free_mass()[i]).abs() < 1e-8);
                assert!((p_dot + slope[i]).abs() < 1e-8 * (1.0 + slope[i].abs()));
            }
        }
    }
}
