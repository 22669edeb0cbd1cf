//! Tests rigid and articulated bodies: momenta, the periods of the flip and of nutation, orders.

use vi_core::discrete::DiscreteLagrangian;
use vi_core::lagrange::{Expand, Lagrangian, energy, velocities};
use vi_core::problems::{
    SphericalPendulum, double_pendulum, flip_period, free_body, heavy_top, principal_inertia,
};
use vi_core::rotations::{RigidBody, RigidState, Weight, cayley, identity, product, rotate, transpose};
use vi_core::{Scheme, State, lagrangian};

const MOMENTS: [f64; 3] = [1.0, 2.0, 3.0];

fn spinning(spin: [f64; 3]) -> RigidState {
    RigidState { t: 0.0, place: [0.0; 3], turn: cayley(&[0.3, -0.2, 0.5]), momentum: [0.0; 3], spin }
}

#[test]
fn a_free_body_keeps_its_spatial_momentum_and_its_orthogonality() {
    let body = free_body(MOMENTS);
    for scheme in [Scheme::implicit_midpoint(), Scheme::stormer_verlet(), Scheme::gauss(2).unwrap()] {
        let mut state = spinning([0.4, 1.0, -0.3]);
        let (initial, e) = (state.spatial_spin(), body.energy(&state).unwrap());
        for _ in 0..1000 {
            state = body.step(&scheme, &state, 0.1).unwrap();
        }
        let now = state.spatial_spin();
        for k in 0..3 {
            assert!((now[k] - initial[k]).abs() < 1e-13, "{scheme:?} {now:?} {initial:?}");
        }
        let unit = product(&transpose(&state.turn), &state.turn);
        let one = identity::<f64>();
        assert!((0..9).all(|k| (unit[k / 3][k % 3] - one[k / 3][k % 3]).abs() < 1e-13));
        assert!((body.energy(&state).unwrap() - e).abs() < 2e-3 * e, "{scheme:?}");
    }
}

#[test]
fn the_intermediate_axis_flips_with_its_period() {
    let body = free_body(MOMENTS);
    let start = spinning([0.02, 1.0, 0.01]);
    let period = flip_period(MOMENTS, start.spin);
    let steps = 100;
    let mut state = start.clone();
    let mut turned = 1.0_f64;
    for _ in 0..steps {
        state = body.step(&Scheme::gauss(4).unwrap(), &state, period / steps as f64).unwrap();
        turned = turned.min(state.spin[1]);
    }
    assert!(turned < -0.99, "it did flip");
    // The period is met to 8 digits: the difference in Π divided by its rate dΠ/dt = Π × ω.
    let omega = [0, 1, 2].map(|i| start.spin[i] / MOMENTS[i]);
    let slope = start.spin[1] * omega[2] - start.spin[2] * omega[1];
    let miss = (state.spin[0] - start.spin[0]) / slope;
    assert!((miss / period).abs() < 1e-8, "{:e}", miss / period);
}

#[test]
fn orders_of_a_body_in_flight_and_of_the_heavy_top() {
    let thrown = RigidBody {
        mass: 2.0,
        inertia: principal_inertia([0.5, 1.0, 1.2]),
        is_pivoted: false,
        potential: Weight { force: 3.0, centre: [0.1, 0.2, -0.1] },
    };
    let top = heavy_top(1.0, 0.4, 2.0, 0.7);
    let start = RigidState { momentum: [1.0, 0.3, 4.0], ..spinning([0.3, 0.2, 1.5]) };
    type Run<'a> = &'a dyn Fn(&Scheme, usize) -> RigidState;
    let fly = |scheme: &Scheme, steps: usize| {
        (0..steps).fold(start.clone(), |s, _| thrown.step(scheme, &s, 1.5 / steps as f64).unwrap())
    };
    let turn = |scheme: &Scheme, steps: usize| {
        (0..steps).fold(start.clone(), |s, _| top.step(scheme, &s, 1.5 / steps as f64).unwrap())
    };
    for run in [&fly as Run, &turn] {
        let exact = run(&Scheme::gauss(4).unwrap(), 24);
        for (scheme, order, steps) in [
            (Scheme::symplectic_euler_a(), 1.0, 160),
            (Scheme::stormer_verlet(), 2.0, 40),
            (Scheme::implicit_midpoint(), 2.0, 40),
            (Scheme::gauss(2).unwrap(), 4.0, 12),
            (Scheme::gauss(3).unwrap(), 6.0, 6),
        ] {
            let error = |steps| {
                let found = run(&scheme, steps);
                (0..3).map(|k| (found.spin[k] - exact.spin[k]).abs()).fold(0.0, f64::max)
            };
            let observed = (error(steps) / error(2 * steps)).log2();
            assert!((observed - order).abs() < 0.45, "{scheme:?}: {observed}");
        }
    }
}

#[test]
fn the_heavy_top_keeps_its_three_integrals() {
    let top = heavy_top(1.0, 0.4, 2.0, 0.7);
    let mut state = spinning([0.1, 0.2, 2.5]);
    let initial = (top.energy(&state).unwrap(), state.spatial_spin()[2], state.spin[2]);
    for _ in 0..500 {
        state = top.step(&Scheme::gauss(2).unwrap(), &state, 0.05).unwrap();
        // Vertical momentum is conserved exactly, by invariance under rotations in space. So is axial momentum, by the
        // symmetry of the body, which the chart does not break. Energy is conserved to the order of the scheme.
        assert!((state.spatial_spin()[2] - initial.1).abs() < 1e-12);
        assert!((state.spin[2] - initial.2).abs() < 1e-12);
        assert!((top.energy(&state).unwrap() - initial.0).abs() < 1e-5);
    }
    // A tilted top does not fall: its axis stays near its initial height.
    assert!(rotate(&state.turn, &[0.0, 0.0, 1.0])[2] > 0.0);
}

#[test]
fn the_spherical_pendulum_nutates_with_its_period() {
    let pendulum = SphericalPendulum { length: 0.7, gravity: 9.81 };
    let (theta, momentum) = (1.0, 0.5);
    let start = State { t: 0.0, q: vec![theta, 0.0], p: vec![0.0, momentum] };
    let sphere = 0.7 * 0.7;
    let e = momentum * momentum / (2.0 * sphere * theta.sin().powi(2)) - 9.81 * 0.7 * theta.cos();
    let period = pendulum.nutation_period(e, momentum);
    let steps = 100;
    let discrete =
        DiscreteLagrangian::new(&pendulum, &Scheme::gauss(4).unwrap(), period / steps as f64).unwrap();
    let mut state = start.clone();
    for _ in 0..steps {
        state = discrete.step(&state).unwrap();
        assert!((state.p[1] - momentum).abs() < 1e-13, "the angular momentum");
    }
    // At the start θ̇ = 0, so that ṗ_θ = ∂L/∂θ.
    let v = velocities(&pendulum, 0.0, &start.q, &start.p).unwrap();
    let rate = pendulum.gradient(0.0, &start.q, v.as_slice()).0[0];
    assert!((state.p[0] / rate / period).abs() < 1e-8, "{:e}", state.p[0] / rate / period);
    assert!((state.q[0] - theta).abs() < 1e-8);
}

#[test]
fn joints_give_the_double_pendulum_of_the_textbook() {
    let (m, l, g) = ([1.5, 0.8], [1.0, 0.6], 9.81);
    let linkage = double_pendulum(m, l, g).unwrap();
    let (m1, m2, l1, l2): (f64, f64, f64, f64) = (m[0], m[1], l[0], l[1]);
    let textbook = lagrangian!(2; [m1, m2, l1, l2, g] |_t, q, v| {
        // Here a and b are the absolute angles of the rods.
        let (a, b) = (q[0], q[0] + q[1]);
        let (da, db) = (v[0], v[0] + v[1]);
        da * da * (0.5 * (m1 + m2) * l1 * l1) + db * db * (0.5 * m2 * l2 * l2)
            + da * db * (a - b).cos() * (m2 * l1 * l2)
            + a.cos() * ((m1 + m2) * g * l1) + b.cos() * (m2 * g * l2)
    });
    for (q, v) in [([0.3, -0.7], [1.1, 0.4]), ([2.0, 1.0], [-0.3, 2.2])] {
        let (by_joints, by_hand): (f64, f64) = (linkage.value(0.0, &q, &v), textbook.value(0.0, &q, &v));
        assert!((by_joints - by_hand).abs() < 1e-13);
        let (a, b) = (linkage.expansion(0.0, &q, &v), textbook.expansion(0.0, &q, &v));
        assert!((a.vv - b.vv).amax() < 1e-13 && (a.d_q - b.d_q).amax() < 1e-12);
    }
    let discrete = DiscreteLagrangian::new(&linkage, &Scheme::gauss(2).unwrap(), 0.01).unwrap();
    let mut state = State { t: 0.0, q: vec![2.0, 0.5], p: vec![0.0, 0.0] };
    let total = |s: &State| {
        let v = velocities(&linkage, s.t, &s.q, &s.p).unwrap();
        energy(&linkage, s.t, &s.q, v.as_slice())
    };
    let initial = total(&state);
    for _ in 0..500 {
        state = discrete.step(&state).unwrap();
    }
    assert!((total(&state) - initial).abs() < 1e-4);
}

/// A single link on a ball joint moves as the heavy top does on the rotation group.
#[test]
fn a_link_on_a_ball_joint_is_a_pivoted_body() {
    use vi_core::discrete::DiscreteLagrangian;
    use vi_core::rotations::{Articulated, Joint, Link};

    let (mass, height, inertia) = (1.0, 0.4, [0.1, 0.12, 0.05]);
    let link = Link {
        parent: None,
        anchor: [0.0; 3],
        joint: Joint::Ball,
        mass,
        centre: [0.0, 0.0, height],
        inertia: vi_core::problems::principal_inertia(inertia),
    };
    let tree = Articulated::new(vec![link], [0.0, 0.0, -9.81]).unwrap();
    let shift = mass * height * height;
    let pivoted = vi_core::rotations::RigidBody {
        mass,
        inertia: vi_core::problems::principal_inertia([inertia[0] + shift, inertia[1] + shift, inertia[2]]),
        is_pivoted: true,
        potential: vi_core::rotations::Weight { force: mass * 9.81, centre: [0.0, 0.0, height] },
    };
    // At q = 0 the momentum in the chart is the body's angular momentum.
    let spin = [0.1, -0.05, 0.3];
    let scheme = Scheme::gauss(4).unwrap();
    let discrete = DiscreteLagrangian::new(&tree, &scheme, 0.01).unwrap();
    let mut state = State { t: 0.0, q: vec![0.0; 3], p: spin.to_vec() };
    let mut body = vi_core::rotations::RigidState {
        t: 0.0,
        place: [0.0; 3],
        turn: vi_core::rotations::identity(),
        momentum: [0.0; 3],
        spin,
    };
    for _ in 0..40 {
        state = discrete.step(&state).unwrap();
        body = pivoted.step(&scheme, &body, 0.01).unwrap();
    }
    let turn = tree.poses(&state.q)[0].1;
    for i in 0..3 {
        for j in 0..3 {
            assert!((turn[i][j] - body.turn[i][j]).abs() < 1e-10, "{turn:?} {:?}", body.turn);
        }
    }
}
