//! Tests the diagnostics on maps with known answers.

use vi_core::diagnostics::{
    Envelope, Section, area_factor, map_derivative, midpoint_shadow, reversal_defect, symplecticity_defect,
    verlet_shadow,
};
use vi_core::problems::{HenonHeiles, Oscillator, SpringChain};
use vi_core::{Scheme, State, System, kinetic_energy, reference};

fn flow<'a>(system: &'a System, scheme: &'a Scheme, h: f64) -> impl Fn(&[f64]) -> Vec<f64> + 'a {
    move |z| {
        let n = z.len() / 2;
        let state = State { t: 0.0, q: z[..n].to_vec(), p: z[n..].to_vec() };
        let next = reference::step(system, scheme, &state, h).unwrap();
        [next.q, next.p].concat()
    }
}

#[test]
fn area_factors_of_euler_and_of_a_variational_step() {
    let (omega, h) = (1.5_f64, 0.3);
    let z = h * omega;
    let forward = |x: &[f64]| vec![x[0] + h * x[1], x[1] - h * omega * omega * x[0]];
    let scale = 1.0 / (1.0 + z * z);
    let backward = |x: &[f64]| vec![(x[0] + h * x[1]) * scale, (x[1] - h * omega * omega * x[0]) * scale];
    let area = |derivative| area_factor(&derivative);
    assert!((area(map_derivative(forward, &[0.3, 0.8], 1e-3)) - (1.0 + z * z)).abs() < 1e-12);
    assert!((area(map_derivative(backward, &[0.3, 0.8], 1e-3)) - 1.0 / (1.0 + z * z)).abs() < 1e-12);
    let system = Oscillator::with_frequency(omega).system().unwrap();
    let scheme = Scheme::stormer_verlet();
    let verlet = flow(&system, &scheme, h);
    assert!((area(map_derivative(verlet, &[0.3, 0.8], 1e-3)) - 1.0).abs() < 1e-12);
    assert!(symplecticity_defect(&map_derivative(forward, &[0.3, 0.8], 1e-3)) > 0.1);
}

#[test]
fn variational_steps_are_symplectic_and_symmetric_ones_reverse() {
    let chain = SpringChain::unit(3);
    let system = chain.system().unwrap();
    let start = chain.disturbed_state();
    let z = [start.q, start.p].concat();
    for scheme in [Scheme::symplectic_euler_a(), Scheme::implicit_midpoint(), Scheme::gauss(2).unwrap()] {
        let derivative = map_derivative(flow(&system, &scheme, 0.2), &z, 5e-3);
        assert!(symplecticity_defect(&derivative) < 1e-9, "{scheme:?}");
        let defect = reversal_defect(flow(&system, &scheme, 0.1), &z, 50);
        assert_eq!(defect < 1e-10, scheme.is_symmetric(), "{scheme:?} {defect:e}");
    }
}

#[test]
fn shadow_hamiltonians_of_a_nonlinear_chain_drift_with_order_four() {
    let chain = SpringChain::unit(3);
    let system = chain.system().unwrap();
    type Shadow = fn(&System, &State, f64) -> f64;
    let cases: [(Scheme, Shadow); 2] =
        [(Scheme::stormer_verlet(), verlet_shadow), (Scheme::implicit_midpoint(), midpoint_shadow)];
    for (scheme, shadow) in cases {
        let drift = |h: f64| {
            let mut state = chain.disturbed_state();
            let initial = shadow(&system, &state, h);
            let mut worst = 0.0_f64;
            for _ in 0..(10.0 / h) as usize {
                state = reference::step(&system, &scheme, &state, h).unwrap();
                worst = worst.max((shadow(&system, &state, h) - initial).abs());
            }
            worst
        };
        let order = (drift(0.1) / drift(0.05)).log2();
        assert!((order - 4.0).abs() < 0.3, "{scheme:?} {order}");
    }
}

#[test]
fn an_envelope_tells_oscillation_from_drift() {
    let mut flat = Envelope::new(1000);
    let mut sinking = Envelope::new(1000);
    for k in 0..10_000 {
        let x = (k as f64 * 0.1).sin();
        flat.enter(x);
        sinking.enter(x - 1e-3 * k as f64);
    }
    assert!((flat.spread() - 2.0).abs() < 1e-3 && flat.drift().abs() < 1e-3);
    assert!((sinking.drift() + 9.0).abs() < 0.02);
}

#[test]
fn a_poincare_section_is_met_to_order_four() {
    let system = HenonHeiles.system().unwrap();
    let energy = 1.0 / 12.0;
    let section = Section { coordinate: 0, level: 0.0 };
    let rate = |s: &State| {
        let force = reference::gradient(&system, &s.q, s.t);
        (s.p.clone(), force.iter().map(|f| -f).collect())
    };
    let mut state = HenonHeiles.on_section(energy, 0.1, 0.05).unwrap();
    let mut crossings = 0;
    for _ in 0..4000 {
        let next = reference::step(&system, &Scheme::gauss(2).unwrap(), &state, 0.05).unwrap();
        if let Some(hit) = section.crossing(&state, &next, rate) {
            crossings += 1;
            let total = kinetic_energy(&system, &hit) + reference::energy(&system, &hit.q, hit.t);
            assert!(hit.q[0].abs() < 1e-12 && (total - energy).abs() < 1e-7 && hit.p[0] > 0.0);
        }
        state = next;
    }
    assert!(crossings > 25, "{crossings}");
    assert!(HenonHeiles.on_section(0.01, 1.0, 0.0).is_none());
}
