//! Tests discrete Lagrangians: arbitrary Lagrangians, boundary value problems, Hermite cubics.

use nalgebra::DVector;
use vi_core::discrete::{
    DiscreteLagrangian, HermiteLagrangian, HermiteState, stationary_hermite_path, stationary_path,
};
use vi_core::lagrange::{FirstOrder, Scalar, Symmetry, energy, momentum_map, velocities};
use vi_core::problems::{Kepler, PaisUhlenbeck, Pendulum};
use vi_core::{CoreError, Interpolation, Quadrature, Scheme, State, lagrangian, reference};

fn schemes() -> Vec<Scheme> {
    vec![
        Scheme::symplectic_euler_a(),
        Scheme::stormer_verlet(),
        Scheme::implicit_midpoint(),
        Scheme::gauss(2).unwrap(),
        Scheme::gauss(3).unwrap(),
        Scheme { interpolation: Interpolation::Polynomial(3), quadrature: Quadrature::lobatto(4).unwrap() },
    ]
}

#[test]
fn a_lagrangian_by_hand_and_a_system_of_potentials_step_alike() {
    let kepler = Kepler::<2> { mu: 1.0 };
    let system = kepler.system().unwrap();
    let by_hand = lagrangian!(2; |_t, q, v| {
        (v[0] * v[0] + v[1] * v[1]) * 0.5 + (q[0] * q[0] + q[1] * q[1]).sqrt().recip()
    });
    let start = kepler.pericentre(0.3);
    for scheme in schemes() {
        let a = reference::step(&system, &scheme, &start, 0.1).unwrap();
        let b = DiscreteLagrangian::new(&by_hand, &scheme, 0.1).unwrap().step(&start).unwrap();
        for (a, b) in a.q.iter().chain(&a.p).zip(b.q.iter().chain(&b.p)) {
            assert!((a - b).abs() < 1e-14, "{scheme:?}");
        }
    }
}

#[test]
fn generalised_mass_and_time_dependence_keep_the_order() {
    // A pendulum in polar form would be too simple: this Lagrangian has a mass matrix M(q), gyroscopic and
    // time-dependent terms.
    let odd = lagrangian!(2; |t, q, v| {
        (v[0] * v[0] * (q[1] * q[1] + 1.0) + v[1] * v[1]) * 0.5 + q[0] * v[1] * 0.3
            - (q[0] * q[0] + q[1] * q[1]) * 0.5 + q[0] * (t * 2.0).sin() * 0.2
    });
    let end = |scheme: &Scheme, steps: usize| {
        let discrete = DiscreteLagrangian::new(&odd, scheme, 1.5 / steps as f64).unwrap();
        let mut state = State { t: 0.0, q: vec![0.5, 0.7], p: vec![0.2, -0.4] };
        for _ in 0..steps {
            state = discrete.step(&state).unwrap();
        }
        state
    };
    let exact = end(&Scheme::gauss(5).unwrap(), 30);
    for (scheme, order) in [
        (Scheme::symplectic_euler_a(), 1.0),
        (Scheme::stormer_verlet(), 2.0),
        (Scheme::implicit_midpoint(), 2.0),
        (Scheme::gauss(2).unwrap(), 4.0),
        (Scheme::gauss(3).unwrap(), 6.0),
    ] {
        let error = |steps| {
            let found = end(&scheme, steps);
            (found.q[0] - exact.q[0]).hypot(found.p[1] - exact.p[1])
        };
        let steps = if order < 1.5 { 200 } else { 10 };
        let observed = (error(steps) / error(2 * steps)).log2();
        assert!((observed - order).abs() < 0.3, "{scheme:?}: {observed}");
    }
}

#[test]
fn legendre_transforms_of_a_step_are_its_momenta() {
    let pendulum = Pendulum::unit().system().unwrap();
    let start = State { t: 0.0, q: vec![0.8], p: vec![0.5] };
    for scheme in schemes() {
        let discrete = DiscreteLagrangian::new(&pendulum, &scheme, 0.2).unwrap();
        let next = discrete.step(&start).unwrap();
        let (minus, plus) = discrete.legendre(0.0, &start.q, &next.q).unwrap();
        assert!((minus[0] - start.p[0]).abs() < 1e-13 && (plus[0] - next.p[0]).abs() < 1e-13);
        let e = 1e-4;
        let slope = (discrete.value(0.0, &start.q, &[next.q[0] + e]).unwrap()
            - discrete.value(0.0, &start.q, &[next.q[0] - e]).unwrap())
            / (2.0 * e);
        assert!((slope - next.p[0]).abs() < 1e-6, "{scheme:?}");
    }
}

#[test]
fn a_boundary_value_problem_finds_the_path_that_marching_finds() {
    let system = Pendulum::unit().system().unwrap();
    let (h, steps) = (0.1, 20);
    for scheme in schemes() {
        let discrete = DiscreteLagrangian::new(&system, &scheme, h).unwrap();
        let mut marched = vec![State { t: 0.0, q: vec![0.2], p: vec![0.9] }];
        for k in 0..steps {
            marched.push(discrete.step(&marched[k]).unwrap());
        }
        let (first, last) = (marched[0].q[0], marched[steps].q[0]);
        let line = |s: f64| vec![first + s * (last - first)];
        let path = stationary_path(&discrete, 0.0, &[first], &[last], steps, line).unwrap();
        for (state, q) in marched.iter().zip(&path) {
            assert!((state.q[0] - q[0]).abs() < 1e-12, "{scheme:?}");
        }
    }
    let midpoint = DiscreteLagrangian::new(&system, &Scheme::implicit_midpoint(), h).unwrap();
    let error = stationary_path(&midpoint, 0.0, &[0.0], &[1.0, 2.0], 3, |_| vec![0.0]);
    assert!(matches!(error, Err(CoreError::Length { .. })));
}

struct Turn;

impl Symmetry for Turn {
    fn generator<D: Scalar>(&self, q: &[D]) -> Vec<D> {
        vec![-q[1], q[0]]
    }
}

#[test]
fn the_discrete_noether_momentum_is_kept() {
    // In a central force with a magnetic field, p is not mass times velocity.
    let charged = lagrangian!(2; |_t, q, v| {
        (v[0] * v[0] + v[1] * v[1]) * 0.5 + (q[0] * v[1] - q[1] * v[0]) * 0.4
            - (q[0] * q[0] + q[1] * q[1]).sqrt()
    });
    for scheme in schemes() {
        let discrete = DiscreteLagrangian::new(&charged, &scheme, 0.1).unwrap();
        let mut state = State { t: 0.0, q: vec![1.0, 0.2], p: vec![-0.3, 0.8] };
        let initial = momentum_map(&Turn, &state.q, &state.p);
        for _ in 0..300 {
            state = discrete.step(&state).unwrap();
            assert!((momentum_map(&Turn, &state.q, &state.p) - initial).abs() < 1e-13, "{scheme:?}");
        }
        let v = velocities(&charged, state.t, &state.q, &state.p).unwrap();
        assert!(energy(&charged, state.t, &state.q, v.as_slice()).is_finite());
    }
}

#[test]
fn hermite_cubics_solve_the_boundary_value_problem_of_an_ordinary_lagrangian() {
    // The exact path of q̈ = −q from q = 1, v = 0 to t = 2 is cos t.
    let oscillator = FirstOrder(lagrangian!(1; |_t, q, v| (v[0] * v[0] - q[0] * q[0]) * 0.5));
    let node = |t: f64| HermiteState { q: vec![t.cos()], v: vec![-t.sin()] };
    let worst = |steps: usize| {
        let h = 2.0 / steps as f64;
        let rule = Quadrature::gauss_legendre(4).unwrap();
        let discrete = HermiteLagrangian::new(&oscillator, rule, h).unwrap();
        let path = stationary_hermite_path(&discrete, 0.0, &node(0.0), &node(2.0), steps).unwrap();
        path.iter().enumerate().map(|(k, z)| (z.q[0] - (k as f64 * h).cos()).abs()).fold(0.0, f64::max)
    };
    let order = (worst(8) / worst(16)).log2();
    assert!(order > 3.7, "{order}");
}

#[test]
fn an_acceleration_dependent_lagrangian_marches() {
    // The motion q = 0.7 cos t + 0.3 sin 2t has the Ostrogradsky momenta π = q̈ and p = −5 q̇ − q⃛.
    let q = |t: f64| 0.7 * t.cos() + 0.3 * (2.0 * t).sin();
    let v = |t: f64| -0.7 * t.sin() + 0.6 * (2.0 * t).cos();
    let a = |t: f64| -0.7 * t.cos() - 1.2 * (2.0 * t).sin();
    let j = |t: f64| 0.7 * t.sin() - 2.4 * (2.0 * t).cos();
    let error = |steps: usize| {
        let rule = Quadrature::gauss_legendre(4).unwrap();
        let h = 3.0 / steps as f64;
        let discrete = HermiteLagrangian::new(&PaisUhlenbeck(1.0, 2.0), rule, h).unwrap();
        let mut z = DVector::from_vec(vec![q(0.0), v(0.0)]);
        let mut momentum = DVector::from_vec(vec![-5.0 * v(0.0) - j(0.0), a(0.0)]);
        for k in 0..steps {
            (z, momentum) = discrete.step(k as f64 * h, &z, &momentum).unwrap();
        }
        (z[0] - q(3.0)).hypot(z[1] - v(3.0))
    };
    let order = (error(20) / error(40)).log2();
    assert!(order > 3.6, "{order}");
}
