//! Tests forces without a potential: order, ledger, refusals.

use crate::bodies::moving_chain;
use crate::forces::Linear;
use vi_core::problems::{Oscillator, Pendulum};
use vi_core::{State, StepEnergy, System};
use vi_solvers::{Method, SolverError, SolverOptions, stepper};

/// Returns the exact position and velocity at t of the unit oscillator with damping c from (1, 0).
fn exact(c: f64, t: f64) -> (f64, f64) {
    let (decay, omega) = (0.5 * c, (1.0 - 0.25 * c * c).sqrt());
    let (sin, cos) = (omega * t).sin_cos();
    let e = (-decay * t).exp();
    (e * (cos + decay / omega * sin), -e * sin / omega)
}

#[test]
fn orders_are_kept_and_the_ledger_closes() {
    let c = 0.3;
    let problem = Oscillator::with_frequency(1.0);
    for (method, order) in [
        (Method::StormerVerlet, 2.0),
        (Method::ImplicitMidpoint, 2.0),
        (Method::EnergyMomentum, 2.0),
        (Method::BackwardEuler, 1.0),
        (Method::Bdf2, 2.0),
        (Method::Newmark { beta: 0.25, gamma: 0.5 }, 2.0),
        (Method::GeneralizedAlpha { spectral_radius: 0.9 }, 2.0),
        (Method::SymplecticEulerA, 1.0),
        (Method::SymplecticEulerB, 1.0),
    ] {
        let error = |steps: usize| {
            let system = problem.system().unwrap().with_forces(vec![Linear::shared(0.0, 0.0, c)]).unwrap();
            let options = SolverOptions { ledger: true, tolerance: 1e-14, ..Default::default() };
            let mut stepper = stepper(&method, &system, &options).unwrap();
            let mut state = State { t: 0.0, q: vec![1.0], p: vec![0.0] };
            let before = problem.energy(&state);
            let mut sum = StepEnergy::default();
            for _ in 0..steps {
                sum += stepper.step(&system, &mut state, 3.0 / steps as f64).unwrap().energy;
            }
            let change = problem.energy(&state) - before;
            assert!((sum.total() - change).abs() < 1e-13, "{}: {sum:?} {change}", method.name());
            assert!(sum.damping < -0.2 && sum.force == 0.0);
            let (q, v) = exact(c, 3.0);
            (state.q[0] - q).hypot(state.p[0] - v)
        };
        let observed = (error(100) / error(200)).log2();
        assert!((observed - order).abs() < 0.1, "{}: {observed}", method.name());
    }
}

/// The division of the balance has the order of the scheme: the work of damping and of prescribed motion converges with order 2, also if
/// the stage is not in the middle of the step.
#[test]
fn works_have_the_order_of_the_scheme() {
    let methods = [
        Method::ImplicitMidpoint,
        Method::EnergyMomentum,
        Method::Bdf2,
        Method::Newmark { beta: 0.25, gamma: 0.5 },
        Method::GeneralizedAlpha { spectral_radius: 0.6 },
    ];
    let options = SolverOptions { ledger: true, tolerance: 1e-14, ..Default::default() };
    for method in methods {
        let works = |system: &System, state: &State, steps: usize| {
            let (mut stepper, mut state) = (stepper(&method, system, &options).unwrap(), state.clone());
            let mut sum = StepEnergy::default();
            for _ in 0..steps {
                sum += stepper.step(system, &mut state, 3.0 / steps as f64).unwrap().energy;
            }
            sum
        };
        let oscillator = Oscillator::with_frequency(1.0);
        let system = oscillator.system().unwrap().with_forces(vec![Linear::shared(0.0, 0.0, 0.3)]).unwrap();
        let state = State { t: 0.0, q: vec![1.0], p: vec![0.0] };
        let (x, v) = exact(0.3, 3.0);
        let dissipated = 0.5 * (x * x + v * v - 1.0);
        let error = |steps| (works(&system, &state, steps).damping - dissipated).abs();
        let observed = (error(200) / error(400)).log2();
        assert!((observed - 2.0).abs() < 0.2, "damping by {}: {observed}", method.name());

        let (system, state) = moving_chain(4);
        let [coarse, middle, fine] = [600, 1200, 2400].map(|steps| works(&system, &state, steps).prescribed);
        let observed = ((coarse - middle) / (middle - fine)).abs().log2();
        assert!((observed - 2.0).abs() < 0.3, "prescribed motion by {}: {observed}", method.name());
    }
}

#[test]
fn gauss_keeps_its_order_and_its_ledger() {
    let c = 0.3;
    let problem = Oscillator::with_frequency(1.0);
    for (stages, steps) in [(2, 20), (3, 8), (4, 4)] {
        let error = |steps: usize| {
            let system = problem.system().unwrap().with_forces(vec![Linear::shared(0.0, 0.0, c)]).unwrap();
            let options = SolverOptions { ledger: true, tolerance: 1e-14, ..Default::default() };
            let mut stepper = stepper(&Method::Gauss { stages }, &system, &options).unwrap();
            let mut state = State { t: 0.0, q: vec![1.0], p: vec![0.0] };
            let before = problem.energy(&state);
            let mut sum = StepEnergy::default();
            for _ in 0..steps {
                sum += stepper.step(&system, &mut state, 3.0 / steps as f64).unwrap().energy;
            }
            let change = problem.energy(&state) - before;
            assert!((sum.total() - change).abs() < 1e-12, "{stages}: {sum:?} {change}");
            // Collocation integrates the work of damping exactly: the scheme adds no energy for a quadratic energy.
            assert!(sum.damping < -0.2 && sum.force == 0.0 && sum.scheme.abs() < 1e-12, "{sum:?}");
            let (q, v) = exact(c, 3.0);
            (state.q[0] - q).hypot(state.p[0] - v)
        };
        let observed = (error(steps) / error(2 * steps)).log2();
        assert!((observed - 2.0 * stages as f64).abs() < 0.3, "{stages}: {observed}");
    }
}

#[test]
fn energy_momentum_does_exactly_the_work_of_forces() {
    // The energy of a pendulum is not quadratic; the scheme adds no energy nevertheless.
    let system = Pendulum::unit().system().unwrap().with_forces(vec![Linear::shared(0.2, 0.1, 0.3)]).unwrap();
    let options = SolverOptions { ledger: true, tolerance: 1e-12, ..Default::default() };
    let mut stepper = stepper(&Method::EnergyMomentum, &system, &options).unwrap();
    let mut state = State { t: 0.0, q: vec![1.2], p: vec![0.5] };
    for _ in 0..200 {
        let energy = stepper.step(&system, &mut state, 0.1).unwrap().energy;
        assert!(energy.scheme.abs() < 1e-13 && energy.damping != 0.0, "{energy:?}");
    }
}

#[test]
fn forces_of_position_keep_the_high_orders() {
    // f = b x stiffens or softens the oscillator: ω² = 1 − b.
    let problem = Oscillator::with_frequency(1.0);
    for (method, order) in [(Method::BlanesMoan4, 4.0), (Method::BlanesMoan6, 6.0)] {
        let error = |steps: usize| {
            let system = problem.system().unwrap().with_forces(vec![Linear::shared(0.0, 0.5, 0.0)]).unwrap();
            let mut stepper = stepper(&method, &system, &SolverOptions::default()).unwrap();
            let mut state = State { t: 0.0, q: vec![1.0], p: vec![0.0] };
            for _ in 0..steps {
                stepper.step(&system, &mut state, 6.0 / steps as f64).unwrap();
            }
            (state.q[0] - (6.0 * 0.5_f64.sqrt()).cos()).abs()
        };
        let observed = (error(4) / error(8)).log2();
        assert!((observed - order).abs() < 0.6, "{}: {observed}", method.name());
    }
}

#[test]
fn schemes_refuse_what_they_cannot_take() {
    let problem = Oscillator::with_frequency(1.0);
    let system = problem.system().unwrap().with_forces(vec![Linear::shared(0.0, 0.0, 0.1)]).unwrap();
    for method in [Method::BlanesMoan4, Method::BlanesMoan6, Method::ForwardEuler] {
        match stepper(&method, &system, &SolverOptions::default()).err() {
            Some(SolverError::Force { force, .. }) => assert_eq!(force, "linear force"),
            other => panic!("{}: {other:?}", method.name()),
        }
    }
}
