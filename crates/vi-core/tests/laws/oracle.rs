//! Tests the dense oracle: orders, momentum maps, time symmetry, and clear refusals.

use vi_core::problems::{Kepler, Oscillator, Pendulum, SpringChain};
use vi_core::{
    CoreError, Fixed, Interpolation, Path, Prescribed, Quadrature, Scheme, State, angular_momentum,
    linear_momentum, reference,
};

fn scheme(degree: usize, quadrature: Quadrature) -> Scheme {
    Scheme { interpolation: Interpolation::Polynomial(degree), quadrature }
}

fn error_on_pendulum(scheme: &Scheme, steps: usize) -> f64 {
    let problem = Pendulum::unit();
    let system = problem.system().unwrap();
    let end = 3.0;
    let mut state = State { t: 0.0, q: vec![1.2], p: vec![0.0] };
    for _ in 0..steps {
        state = reference::step(&system, scheme, &state, end / steps as f64).unwrap();
    }
    let exact = problem.exact(1.2, end);
    (state.q[0] - exact.q[0]).hypot(state.p[0] - exact.p[0])
}

#[test]
fn orders_are_those_of_the_pair() {
    let gauss = |s| Quadrature::gauss_legendre(s).unwrap();
    let lobatto = |s| Quadrature::lobatto(s).unwrap();
    // Each case is (scheme, order, steps of the coarse run). A path of degree s with a quadrature of order ≥ 2s has
    // order 2s; with a weaker rule the order is that of the rule.
    let cases = [
        (Scheme::symplectic_euler_a(), 1, 400),
        (Scheme::symplectic_euler_b(), 1, 400),
        (Scheme::stormer_verlet(), 2, 40),
        (Scheme::implicit_midpoint(), 2, 40),
        (scheme(1, gauss(3)), 2, 40),
        (Scheme::gauss(2).unwrap(), 4, 20),
        (scheme(2, lobatto(3)), 4, 20),
        (scheme(2, gauss(4)), 4, 20),
        (Scheme::gauss(3).unwrap(), 6, 10),
        (scheme(3, lobatto(4)), 6, 10),
        (Scheme::gauss(4).unwrap(), 8, 6),
        (Scheme::gauss(5).unwrap(), 10, 5),
    ];
    for (scheme, order, steps) in cases {
        let (coarse, fine) = (error_on_pendulum(&scheme, steps), error_on_pendulum(&scheme, 2 * steps));
        let observed = (coarse / fine).log2();
        assert!((observed - order as f64).abs() < 0.35, "{scheme:?}: {observed}, {coarse:e} {fine:e}");
    }
}

fn pairs() -> Vec<Scheme> {
    let mut pairs = vec![
        Scheme::symplectic_euler_a(),
        Scheme::symplectic_euler_b(),
        Scheme::stormer_verlet(),
        Scheme::implicit_midpoint(),
    ];
    for s in 1..=5 {
        pairs.push(Scheme::gauss(s).unwrap());
        pairs.push(scheme(s, Quadrature::lobatto(s + 1).unwrap()));
    }
    pairs
}

#[test]
fn momenta_of_a_free_chain_are_kept_and_symmetric_schemes_reverse() {
    let chain = SpringChain::unit(4);
    let system = chain.system().unwrap();
    let start = chain.disturbed_state();
    let (h, steps) = (0.1, 100);
    for scheme in pairs() {
        let mut state = start.clone();
        for _ in 0..steps {
            state = reference::step(&system, &scheme, &state, h).unwrap();
        }
        for (after, before) in [
            (linear_momentum(&system, &state), linear_momentum(&system, &start)),
            (angular_momentum(&system, &state), angular_momentum(&system, &start)),
        ] {
            for k in 0..3 {
                assert!((after[k] - before[k]).abs() < 1e-12, "{scheme:?}: {after:?} {before:?}");
            }
        }
        if scheme.is_symmetric() {
            for _ in 0..steps {
                state = reference::step(&system, &scheme, &state, -h).unwrap();
            }
            for (a, b) in state.q.iter().chain(&state.p).zip(start.q.iter().chain(&start.p)) {
                assert!((a - b).abs() < 1e-9, "{scheme:?}");
            }
        }
    }
}

#[test]
fn one_step_is_symplectic() {
    let chain = SpringChain::unit(2);
    let system = chain.system().unwrap();
    let start = chain.disturbed_state();
    let n = start.q.len();
    for scheme in
        [Scheme::stormer_verlet(), Scheme::gauss(2).unwrap(), scheme(2, Quadrature::lobatto(3).unwrap())]
    {
        let flow = |z: &[f64]| {
            let state = State { t: 0.0, q: z[..n].to_vec(), p: z[n..].to_vec() };
            let next = reference::step(&system, &scheme, &state, 0.2).unwrap();
            [next.q, next.p].concat()
        };
        let z: Vec<f64> = [start.q.clone(), start.p.clone()].concat();
        let e = 1e-4;
        let columns: Vec<Vec<f64>> = (0..2 * n)
            .map(|j| {
                let at = |steps: f64| {
                    let mut z = z.clone();
                    z[j] += steps * e;
                    flow(&z)
                };
                let (a, b, c, d) = (at(-2.0), at(-1.0), at(1.0), at(2.0));
                (0..2 * n).map(|i| (a[i] - 8.0 * b[i] + 8.0 * c[i] - d[i]) / (12.0 * e)).collect()
            })
            .collect();
        for i in 0..2 * n {
            for j in 0..2 * n {
                let area: f64 = (0..n)
                    .map(|k| columns[i][k] * columns[j][n + k] - columns[i][n + k] * columns[j][k])
                    .sum();
                let expected = if j == i + n {
                    1.0
                } else if i == j + n {
                    -1.0
                } else {
                    0.0
                };
                assert!((area - expected).abs() < 1e-9, "{scheme:?} {i} {j}: {area}");
            }
        }
    }
}

#[test]
fn momenta_are_the_derivatives_of_the_discrete_lagrangian() {
    // For any variation of the initial state dL_d = p1·dq1 − p0·dq0.
    let problem = Kepler::<2> { mu: 1.0 };
    let system = problem.system().unwrap();
    let (start, h) = (problem.pericentre(0.3), 0.2);
    for scheme in pairs() {
        let at = |e: f64| {
            let mut state = start.clone();
            state.q[0] += 0.3 * e;
            state.q[1] -= 0.7 * e;
            state.p[0] += 0.2 * e;
            state.p[1] += 0.5 * e;
            let action = reference::discrete_lagrangian(&system, &scheme, &state, h).unwrap();
            (action, state.clone(), reference::step(&system, &scheme, &state, h).unwrap())
        };
        let e = 1e-4;
        let (minus, here, plus) = (at(-e), at(0.0), at(e));
        let slope = (plus.0 - minus.0) / (2.0 * e);
        let boundary: f64 = (0..2)
            .map(|i| {
                here.2.p[i] * (plus.2.q[i] - minus.2.q[i]) / (2.0 * e)
                    - here.1.p[i] * (plus.1.q[i] - minus.1.q[i]) / (2.0 * e)
            })
            .sum();
        assert!((slope - boundary).abs() < 1e-7, "{scheme:?}: {slope} {boundary}");
    }
}

#[test]
fn a_degenerate_pair_is_refused_with_the_facts() {
    let system = Oscillator::with_frequency(1.0).system().unwrap();
    let state = State { t: 0.0, q: vec![1.0], p: vec![0.0] };
    for (degree, rule) in [
        (2, Quadrature::midpoint()),
        (2, Quadrature::left()),
        (3, Quadrature::trapezoid()),
        (4, Quadrature::gauss_legendre(3).unwrap()),
    ] {
        let points = rule.nodes().len();
        assert_eq!(
            reference::step(&system, &scheme(degree, rule), &state, 0.1),
            Err(CoreError::Degenerate { degree, points })
        );
    }
    for bad in [0.0, f64::NAN, f64::INFINITY] {
        let error = reference::step(&system, &Scheme::stormer_verlet(), &state, bad);
        assert!(matches!(error, Err(CoreError::StepSize { .. })));
    }
    let short = State { t: 0.0, q: vec![], p: vec![0.0] };
    assert!(matches!(
        reference::step(&system, &Scheme::stormer_verlet(), &short, 0.1),
        Err(CoreError::Length { .. })
    ));
}

struct Shaker;

impl Path for Shaker {
    fn position(&self, t: f64, out: &mut [f64]) {
        out.copy_from_slice(&[0.1 * t.sin(), 0.0, 0.2 * t * t]);
    }
    fn velocity(&self, t: f64, out: &mut [f64]) {
        out.copy_from_slice(&[0.1 * t.cos(), 0.0, 0.4 * t]);
    }
}

#[test]
fn prescribed_coordinates_follow_their_path_at_the_quadrature_times() {
    // With the far node held and the near one driven, degree-s Gauss still has order 2s: the prescribed motion is
    // evaluated at the quadrature points only.
    let chain = SpringChain::unit(3);
    let hold = || {
        vec![
            Prescribed { dofs: vec![0, 1, 2], path: Box::new(Shaker) },
            Prescribed { dofs: vec![6, 7, 8], path: Box::new(Fixed(vec![2.0, 0.1, 0.0])) },
        ]
    };
    let system = chain.system_holding(hold()).unwrap();
    let end = |scheme: &Scheme, steps: usize| {
        let mut state = State { t: 0.0, q: vec![1.1, 0.2, -0.1], p: vec![0.1, -0.2, 0.3] };
        for _ in 0..steps {
            state = reference::step(&system, scheme, &state, 2.0 / steps as f64).unwrap();
        }
        state
    };
    let exact = end(&Scheme::gauss(5).unwrap(), 40);
    for (scheme, order) in [(Scheme::stormer_verlet(), 2.0), (Scheme::gauss(2).unwrap(), 4.0)] {
        let error = |steps| {
            let found = end(&scheme, steps);
            found.q.iter().zip(&exact.q).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
        };
        let observed = (error(20) / error(40)).log2();
        assert!((observed - order).abs() < 0.3, "{scheme:?}: {observed}");
    }
}

#[test]
fn kepler_follows_its_ellipse() {
    let problem = Kepler::<3> { mu: 2.0 };
    let system = problem.system().unwrap();
    let mut state = problem.pericentre(0.4);
    let steps = 60;
    let h = 0.7 * problem.period() / steps as f64;
    for _ in 0..steps {
        state = reference::step(&system, &Scheme::gauss(5).unwrap(), &state, h).unwrap();
    }
    let exact = problem.exact(0.4, state.t);
    for (a, b) in state.q.iter().chain(&state.p).zip(exact.q.iter().chain(&exact.p)) {
        assert!((a - b).abs() < 1e-11, "{a} {b}");
    }
}
