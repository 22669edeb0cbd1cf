//! Tests closed forms and published numbers of integrators on small problems, all run through the dense oracle:
//! reference cases, section "Integrators".

use vi_core::problems::{Kepler, Oscillator, Pendulum};
use vi_core::{Scheme, State, System, reference};

fn run(system: &System, scheme: &Scheme, start: &State, h: f64, steps: usize, mut see: impl FnMut(&State)) {
    let mut state = start.clone();
    for _ in 0..steps {
        state = reference::step(system, scheme, &state, h).unwrap();
        see(&state);
    }
}

fn max_energy_error(
    system: &System,
    scheme: &Scheme,
    start: &State,
    h: f64,
    steps: usize,
    energy: impl Fn(&State) -> f64,
) -> f64 {
    let initial = energy(start);
    let mut worst = 0.0_f64;
    run(system, scheme, start, h, steps, |state| worst = worst.max((energy(state) - initial).abs()));
    worst
}

/// Returns the 2 × 2 matrix of one step of a linear system.
fn step_matrix(system: &System, scheme: &Scheme, h: f64) -> [[f64; 2]; 2] {
    let column = |q: f64, p: f64| {
        let next = reference::step(system, scheme, &State { t: 0.0, q: vec![q], p: vec![p] }, h).unwrap();
        [next.q[0], next.p[0]]
    };
    let (a, b) = (column(1.0, 0.0), column(0.0, 1.0));
    [[a[0], b[0]], [a[1], b[1]]]
}

/// Returns ω_d of a step whose matrix is similar to a rotation by ω_d h.
fn discrete_frequency(system: &System, scheme: &Scheme, h: f64) -> f64 {
    let m = step_matrix(system, scheme, h);
    (0.5 * (m[0][0] + m[1][1])).acos() / h
}

#[test]
fn every_variational_scheme_keeps_phase_area() {
    let problem = Oscillator::with_frequency(1.3);
    let system = problem.system().unwrap();
    let schemes = [
        Scheme::symplectic_euler_a(),
        Scheme::symplectic_euler_b(),
        Scheme::stormer_verlet(),
        Scheme::implicit_midpoint(),
        Scheme::gauss(2).unwrap(),
        Scheme::gauss(5).unwrap(),
    ];
    for scheme in schemes {
        let m = step_matrix(&system, &scheme, 0.7);
        let area = m[0][0] * m[1][1] - m[0][1] * m[1][0];
        assert!((area - 1.0).abs() < 2e-15 * 4.0, "{scheme:?}: {area}");
    }
}

#[test]
fn discrete_frequencies_of_the_oscillator() {
    let omega = 1.7;
    let system = Oscillator::with_frequency(omega).system().unwrap();
    for h in [0.05, 0.3, 1.0] {
        let z = h * omega;
        let cases = [
            (Scheme::stormer_verlet(), 2.0 / h * (z / 2.0).asin()),
            (Scheme::implicit_midpoint(), 2.0 / h * (z / 2.0).atan()),
            (Scheme::gauss(2).unwrap(), 2.0 / h * (z / 2.0 / (1.0 - z * z / 12.0)).atan()),
        ];
        for (scheme, expected) in cases {
            let found = discrete_frequency(&system, &scheme, h);
            assert!((found / expected - 1.0).abs() < 1e-12, "{scheme:?} z = {z}: {found} {expected}");
        }
    }
}

#[test]
fn verlet_keeps_its_modified_energy_and_is_stable_below_two() {
    let omega = 2.0;
    let system = Oscillator::with_frequency(omega).system().unwrap();
    let start = State { t: 0.0, q: vec![0.3], p: vec![-0.4] };
    for z in [0.1, 1.0, 1.9, 1.999] {
        let h = z / omega;
        let modified =
            |s: &State| 0.5 * s.p[0] * s.p[0] + 0.5 * omega * omega * s.q[0] * s.q[0] * (1.0 - 0.25 * z * z);
        let error = max_energy_error(&system, &Scheme::stormer_verlet(), &start, h, 2000, modified);
        let scale = 0.5 * (0.16 + omega * omega * 0.09);
        assert!(error < 1e-12 * scale, "z = {z}: {error:e}");
    }
    let trace = |h: f64| {
        let m = step_matrix(&system, &Scheme::stormer_verlet(), h);
        (m[0][0] + m[1][1]).abs()
    };
    assert!(trace(1.9999 / omega) < 2.0 && trace(2.0001 / omega) > 2.0);
}

#[test]
fn midpoint_keeps_the_energy_of_the_oscillator() {
    let problem = Oscillator { mass: 0.7, stiffness: 5.0 };
    let system = problem.system().unwrap();
    let start = State { t: 0.0, q: vec![0.3], p: vec![-0.4] };
    for h in [0.01, 1.0, 50.0] {
        let error =
            max_energy_error(&system, &Scheme::implicit_midpoint(), &start, h, 2000, |s| problem.energy(s));
        assert!(error < 1e-12 * problem.energy(&start), "h = {h}: {error:e}");
    }
}

#[test]
fn verlet_energy_error_on_kepler_and_pendulum() {
    let problem = Kepler::<2> { mu: 1.0 };
    let system = problem.system().unwrap();
    let start = problem.pericentre(0.6);
    assert_eq!((start.q[0], start.p[1]), (0.4, 2.0));
    for (h, expected) in [(0.05, 9.38867e-3), (0.01, 3.70681e-4), (0.005, 9.26329e-5)] {
        let steps = (200.0_f64 / h).round() as usize;
        let (energy, mut worst, mut spin) = (problem.energy(&start), 0.0_f64, 0.0_f64);
        run(&system, &Scheme::stormer_verlet(), &start, h, steps, |s| {
            worst = worst.max((problem.energy(s) - energy).abs());
            spin = spin.max((problem.angular_momentum(s) - 0.8).abs());
        });
        assert!((worst / expected - 1.0).abs() < 1e-6 * 5.0, "h = {h}: {worst:e}");
        assert!(spin < 1e-13, "h = {h}: {spin:e}");
    }

    let problem = Pendulum::unit();
    let system = problem.system().unwrap();
    let start = State { t: 0.0, q: vec![1.0], p: vec![0.0] };
    for (h, expected, digit) in [(0.1, 1.06123e-3, 1e-8), (0.05, 2.65287e-4, 1e-9), (0.025, 6.6325e-5, 1e-9)]
    {
        let steps = (200.0_f64 / h).round() as usize;
        let worst =
            max_energy_error(&system, &Scheme::stormer_verlet(), &start, h, steps, |s| problem.energy(s));
        assert!((worst - expected).abs() < digit, "h = {h}: {worst:e}");
    }
}

#[test]
fn pendulum_periods() {
    let problem = Pendulum::unit();
    let cases =
        [(0.5, 6.38278969767774), (1.0, 6.69997566437045), (2.0, 8.34975292691849), (3.0, 16.1555393723934)];
    let system = problem.system().unwrap();
    let scheme = Scheme::gauss(4).unwrap();
    for (amplitude, period) in cases {
        assert!((problem.period(amplitude) / period - 1.0).abs() < 1e-14);
        // Integration confirms the period: after one period the state is the initial one.
        let start = State { t: 0.0, q: vec![amplitude], p: vec![0.0] };
        let steps = 200;
        let mut end = start.clone();
        run(&system, &scheme, &start, period / steps as f64, steps, |s| end = s.clone());
        assert!((end.q[0] - amplitude).abs() < 1e-10 && end.p[0].abs() < 1e-10, "{amplitude}: {end:?}");
    }
}

#[test]
fn shadow_hamiltonians_drift_with_the_fourth_order() {
    let problem = Pendulum::unit();
    let system = problem.system().unwrap();
    let start = State { t: 0.0, q: vec![1.0], p: vec![0.3] };
    // The modified Hamiltonian contains V'' q̇² and |V'|², here of V = −cos q with unit mass.
    let terms = |s: &State| (s.q[0].cos() * s.p[0] * s.p[0], s.q[0].sin() * s.q[0].sin());
    let verlet = |s: &State, h: f64| {
        let (curvature, force) = terms(s);
        problem.energy(s) + h * h * (curvature / 12.0 - force / 24.0)
    };
    let midpoint = |s: &State, h: f64| {
        let (curvature, force) = terms(s);
        problem.energy(s) - h * h / 24.0 * (curvature + force)
    };
    type Shadow<'a> = &'a dyn Fn(&State, f64) -> f64;
    let shadows: [(Scheme, Shadow); 2] =
        [(Scheme::stormer_verlet(), &verlet), (Scheme::implicit_midpoint(), &midpoint)];
    for (scheme, shadow) in shadows {
        let drift = |h: f64| {
            let steps = (50.0_f64 / h).round() as usize;
            max_energy_error(&system, &scheme, &start, h, steps, |s| shadow(s, h))
        };
        let (coarse, fine) = (drift(0.1), drift(0.05));
        let order = (coarse / fine).log2();
        assert!((order - 4.0).abs() < 0.1, "{scheme:?}: order {order}, {coarse:e}");
    }
}
