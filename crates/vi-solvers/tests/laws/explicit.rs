//! Tests the laws of the explicit schemes: oracle, orders, momenta, time symmetry, stability limits, work.

use crate::bodies::{moving_chain, run, stepper_of};
use vi_core::problems::{Oscillator, Pendulum, SpringChain};
use vi_core::{EnergyLedger, State, System, kinetic_energy, reference};
use vi_solvers::{Method, SolverError, SolverOptions};

fn explicit() -> impl Iterator<Item = Method> {
    Method::ALL.into_iter().filter(|method| method.facts().is_explicit)
}

fn variational() -> impl Iterator<Item = Method> {
    explicit().filter(|method| method.facts().is_variational())
}

#[test]
fn kernels_agree_with_the_oracle() {
    let chain = SpringChain::unit(5);
    for (system, start) in [(chain.system().unwrap(), chain.disturbed_state()), moving_chain(5)] {
        for (method, scheme) in explicit().filter_map(|method| Some((method, method.scheme()?))) {
            let mut fast = start.clone();
            let mut slow = start.clone();
            let mut stepper = stepper_of(method, &system);
            for _ in 0..20 {
                stepper.step(&system, &mut fast, 0.1).unwrap();
                slow = reference::step(&system, &scheme, &slow, 0.1).unwrap();
            }
            crate::bodies::assert_close(&fast, &slow, 1e-12, method.name());
        }
    }
}

/// Returns the observed order: that of the finest pair of step counts whose errors are far above round-off.
fn observed_order(error: impl Fn(usize) -> f64) -> f64 {
    let is_above = |&steps: &usize| error(2 * steps) > 1e-11;
    let steps = (1..10).map(|k| 1 << k).take_while(is_above).last().unwrap();
    (error(steps) / error(2 * steps)).log2()
}

#[test]
fn orders_are_observed() {
    let problem = Pendulum::unit();
    let system = problem.system().unwrap();
    let error = |method: Method, steps: usize| {
        let mut state = State { t: 0.0, q: vec![1.2], p: vec![0.0] };
        run(method, &system, &mut state, 3.0 / steps as f64, steps);
        let exact = problem.exact(1.2, 3.0);
        (state.q[0] - exact.q[0]).hypot(state.p[0] - exact.p[0])
    };
    for method in explicit() {
        let facts = method.facts();
        let observed = observed_order(|steps| error(method, steps));
        assert!((observed - facts.order as f64).abs() < 0.35, "{}: order {observed}", facts.name);
    }
}

#[test]
fn orders_are_observed_in_space_and_with_moving_clamps() {
    // Compare with the same scheme at a step so small that its error is round-off.
    let chain = SpringChain::unit(4);
    for (system, start) in [(chain.system().unwrap(), chain.disturbed_state()), moving_chain(4)] {
        let mut exact = start.clone();
        run(Method::BlanesMoan6, &system, &mut exact, 1.0 / 640.0, 640);
        let error = |method: Method, steps: usize| {
            let mut state = start.clone();
            run(method, &system, &mut state, 1.0 / steps as f64, steps);
            crate::bodies::distance(&state, &exact)
        };
        for method in explicit() {
            let facts = method.facts();
            let observed = observed_order(|steps| error(method, steps));
            assert!((observed - facts.order as f64).abs() < 0.4, "{}: order {observed}", facts.name);
        }
    }
}

#[test]
fn momenta_are_kept() {
    let chain = SpringChain::unit(6);
    let system = chain.system().unwrap();
    for method in variational() {
        let mut state = chain.disturbed_state();
        let start = state.clone();
        run(method, &system, &mut state, 0.05, 1000);
        crate::bodies::assert_momenta(&system, &start, &state, 1e-12, method.name());
    }
}

#[test]
fn symmetric_schemes_reverse() {
    let chain = SpringChain::unit(6);
    let system = chain.system().unwrap();
    for method in variational().filter(|method| method.facts().is_symmetric) {
        let start = chain.disturbed_state();
        let mut state = start.clone();
        run(method, &system, &mut state, 0.05, 200);
        state.p.iter_mut().for_each(|p| *p = -*p);
        run(method, &system, &mut state, 0.05, 200);
        state.p.iter_mut().for_each(|p| *p = -*p);
        assert!(crate::bodies::distance(&state, &start) < 1e-9, "{}", method.name());
    }
}

#[test]
fn verlet_on_the_oscillator_keeps_its_modified_energy_and_phase() {
    let (omega, h) = (3.0, 0.2);
    let z: f64 = h * omega;
    let system = Oscillator::with_frequency(omega).system().unwrap();
    let mut state = State { t: 0.0, q: vec![1.0], p: vec![0.0] };
    let modified =
        |s: &State| 0.5 * s.p[0] * s.p[0] + 0.5 * omega * omega * s.q[0] * s.q[0] * (1.0 - z * z / 4.0);
    let start = modified(&state);
    let frequency = 2.0 / h * (z / 2.0).asin();
    let mut stepper = stepper_of(Method::StormerVerlet, &system);
    for step in 1..=1000 {
        stepper.step(&system, &mut state, h).unwrap();
        assert!((modified(&state) - start).abs() < 1e-12 * start);
        assert!((state.q[0] - (frequency * h * f64::from(step)).cos()).abs() < 1e-11);
    }
}

#[test]
fn forward_euler_grows_the_area_as_theory_says() {
    let (omega, h) = (3.0, 0.1);
    let z2: f64 = (h * omega) * (h * omega);
    let oscillator = Oscillator::with_frequency(omega);
    let system = oscillator.system().unwrap();
    let mut state = State { t: 0.0, q: vec![1.0], p: vec![0.5] };
    let mut stepper = stepper_of(Method::ForwardEuler, &system);
    for _ in 0..50 {
        let before = oscillator.energy(&state);
        stepper.step(&system, &mut state, h).unwrap();
        assert!((oscillator.energy(&state) / before - (1.0 + z2)).abs() < 1e-13);
    }
}

#[test]
fn ledger_closes_to_round_off() {
    let chain = SpringChain::unit(6);
    for (system, start) in [(chain.system().unwrap(), chain.disturbed_state()), moving_chain(6)] {
        for method in explicit() {
            let options = SolverOptions { ledger: true, ..Default::default() };
            let mut stepper = vi_solvers::stepper(&method, &system, &options).unwrap();
            let mut state = start.clone();
            let total = |system: &System, state: &State| {
                reference::energy(system, &system.positions(state), state.t) + kinetic_energy(system, state)
            };
            let mut ledger = EnergyLedger::new(total(&system, &state), kinetic_energy(&system, &state));
            for _ in 0..200 {
                let report = stepper.step(&system, &mut state, 0.02).unwrap();
                ledger.enter(report.energy, total(&system, &state), kinetic_energy(&system, &state));
            }
            let unexplained = ledger.unexplained().abs() / ledger.kinetic_max;
            assert!(unexplained < 1e-12, "{}: {unexplained:e}", method.name());
        }
    }
}

#[test]
fn work_of_moving_clamps_is_the_change_of_energy_up_to_the_schemes_order() {
    let (system, start) = moving_chain(6);
    let scheme_part = |steps: usize| {
        let options = SolverOptions { ledger: true, ..Default::default() };
        let mut stepper = vi_solvers::stepper(&Method::BlanesMoan4, &system, &options).unwrap();
        let mut state = start.clone();
        let h = 2.0 / steps as f64;
        (0..steps).map(|_| stepper.step(&system, &mut state, h).unwrap().energy.scheme).sum::<f64>()
    };
    let observed = (scheme_part(20) / scheme_part(40)).abs().log2();
    assert!(observed > 3.5, "{observed}");
}

#[test]
fn a_failed_step_leaves_the_state_and_names_the_place() {
    let (system, mut state) = crate::bodies::brittle_pair();
    let start = state.clone();
    for method in explicit() {
        let mut stepper = stepper_of(method, &system);
        let mut failure = None;
        for _ in 0..3 {
            let before = state.clone();
            if let Err(error) = stepper.step(&system, &mut state, 10.0) {
                assert_eq!(state, before);
                failure = Some(error);
                break;
            }
        }
        let error = failure.expect("the body is torn");
        assert!(
            matches!(&error.cause, SolverError::Term { term, .. } if &*term.term == "brittle"),
            "{error}"
        );
        state = start.clone();
    }
}

#[test]
fn explicit_runs_make_no_hessian_and_reuse_the_last_force() {
    let chain = SpringChain::unit(6);
    let system = chain.system().unwrap();
    for method in explicit() {
        let mut stepper = stepper_of(method, &system);
        let mut state = chain.disturbed_state();
        for _ in 0..10 {
            stepper.step(&system, &mut state, 0.01).unwrap();
        }
        let work = stepper.work();
        assert_eq!((work.hessians, work.factorizations, work.solves, work.steps), (0, 0, 0, 10));
        let per_step = method.facts().forces_per_step as u64;
        let first = u64::from(method.facts().is_symmetric);
        assert_eq!(work.gradients, 10 * per_step + first, "{}", method.name());
        // The stepper notices that the state was changed from outside: the result is that of a new stepper.
        state.q[0] += 1e-3;
        let mut other = state.clone();
        stepper.step(&system, &mut state, 0.01).unwrap();
        stepper_of(method, &system).step(&system, &mut other, 0.01).unwrap();
        assert_eq!(state, other);
    }
}

/// A single pass over the coordinates and the ordinary path with a ledger give the same arithmetic, also if the body
/// is moved from outside between two steps.
#[test]
fn a_ledger_does_not_change_the_path() {
    let chain = SpringChain::unit(3000);
    for (system, start) in [(chain.system().unwrap(), chain.disturbed_state()), moving_chain(3000)] {
        for method in variational() {
            let path = |ledger: bool| {
                let options = SolverOptions { ledger, ..SolverOptions::default() };
                let mut stepper = vi_solvers::stepper(&method, &system, &options).unwrap();
                let mut state = start.clone();
                for step in 0..6 {
                    if step == 3 {
                        state.q[1234] += 1e-3;
                        state.p[7] -= 1e-2;
                    }
                    stepper.step(&system, &mut state, 0.05).unwrap();
                }
                state
            };
            assert_eq!(path(false), path(true), "{}", method.name());
        }
    }
}

#[test]
fn free_fall_is_exact_and_keeps_the_shape() {
    for method in variational().filter(|method| method.facts().order >= 2) {
        let (system, start) = crate::bodies::falling_chain(5);
        let mut state = start.clone();
        run(method, &system, &mut state, 0.05, 1000);
        crate::bodies::assert_fall(&start, &state, method.name());
    }
}
