//! Tests the laws of the implicit schemes: oracle, orders, momenta, time symmetry, ledger, work, memory.

use crate::bodies::{moving_chain, run, stepper_of};
use vi_core::problems::{Oscillator, Pendulum, SpringChain};
use vi_core::{EnergyLedger, State, System, kinetic_energy, reference};
use vi_solvers::{Method, SolverError, SolverOptions};

fn gauss() -> impl Iterator<Item = Method> {
    (1..=5).map(|stages| Method::Gauss { stages })
}

fn variational() -> impl Iterator<Item = Method> {
    std::iter::once(Method::ImplicitMidpoint).chain(gauss())
}

fn comparison() -> impl Iterator<Item = Method> {
    Method::ALL.into_iter().filter(|method| {
        let facts = method.facts();
        !facts.is_explicit && !facts.is_variational() && *method != Method::EnergyMomentum
    })
}

fn all() -> impl Iterator<Item = Method> {
    variational().chain(comparison()).chain([Method::EnergyMomentum])
}

#[test]
fn kernels_agree_with_the_oracle() {
    let chain = SpringChain::unit(5);
    for (system, start) in [(chain.system().unwrap(), chain.disturbed_state()), moving_chain(5)] {
        for method in variational() {
            let scheme = method.scheme().unwrap();
            let mut fast = start.clone();
            let mut slow = start.clone();
            let mut stepper = stepper_of(method, &system);
            for _ in 0..10 {
                stepper.step(&system, &mut fast, 0.2).unwrap();
                slow = reference::step(&system, &scheme, &slow, 0.2).unwrap();
            }
            crate::bodies::assert_close(&fast, &slow, 1e-12, &format!("{method:?}"));
        }
    }
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
    for method in all() {
        let facts = method.facts();
        let steps = [0, 800, 60, 0, 20, 0, 10, 0, 6, 0, 5][facts.order];
        let observed = (error(method, steps) / error(method, 2 * steps)).log2();
        assert!((observed - facts.order as f64).abs() < 0.35, "{method:?}: {observed}");
    }
}

#[test]
fn orders_are_observed_with_moving_clamps() {
    let (system, start) = moving_chain(4);
    let mut exact = start.clone();
    run(Method::BlanesMoan6, &system, &mut exact, 1.0 / 640.0, 640);
    let error = |method: Method, steps: usize| {
        let mut state = start.clone();
        run(method, &system, &mut state, 1.0 / steps as f64, steps);
        crate::bodies::distance(&state, &exact)
    };
    for method in all().filter(|method| method.facts().order <= 6) {
        let order = method.facts().order;
        let steps = [0, 800, 60, 0, 10, 0, 5][order];
        let observed = (error(method, steps) / error(method, 2 * steps)).log2();
        assert!((observed - order as f64).abs() < 0.4, "{method:?}: {observed}");
    }
}

#[test]
fn momenta_are_kept() {
    let chain = SpringChain::unit(6);
    let system = chain.system().unwrap();
    for method in variational().chain([Method::EnergyMomentum]) {
        let start = chain.disturbed_state();
        let mut state = start.clone();
        run(method, &system, &mut state, 0.1, 1000);
        crate::bodies::assert_momenta(&system, &start, &state, 1e-12, &format!("{method:?}"));
    }
}

#[test]
fn symmetric_schemes_reverse() {
    let chain = SpringChain::unit(6);
    let system = chain.system().unwrap();
    for method in variational().chain([Method::EnergyMomentum]) {
        let start = chain.disturbed_state();
        let mut state = start.clone();
        run(method, &system, &mut state, 0.1, 100);
        state.p.iter_mut().for_each(|p| *p = -*p);
        run(method, &system, &mut state, 0.1, 100);
        state.p.iter_mut().for_each(|p| *p = -*p);
        assert!(crate::bodies::distance(&state, &start) < 1e-9, "{method:?}");
    }
}

#[test]
fn free_fall_is_exact_and_keeps_the_shape() {
    for method in variational().chain([Method::EnergyMomentum]) {
        let (system, start) = crate::bodies::falling_chain(5);
        let mut state = start.clone();
        run(method, &system, &mut state, 0.05, 1000);
        crate::bodies::assert_fall(&start, &state, &format!("{method:?}"));
    }
}

#[test]
fn closed_forms_on_the_oscillator() {
    let (omega, h) = (3.0, 0.4);
    let z: f64 = h * omega;
    let oscillator = Oscillator::with_frequency(omega);
    let system = oscillator.system().unwrap();
    // The phase per step of schemes that conserve H.
    let gauss_2 = Method::Gauss { stages: 2 };
    for (method, phase) in [
        (Method::ImplicitMidpoint, 2.0 * (z / 2.0).atan()),
        (Method::EnergyMomentum, 2.0 * (z / 2.0).atan()),
        (gauss_2, 2.0 * ((z / 2.0) / (1.0 - z * z / 12.0)).atan()),
    ] {
        let mut state = State { t: 0.0, q: vec![1.0], p: vec![0.0] };
        let start = oscillator.energy(&state);
        let mut stepper = stepper_of(method, &system);
        for step in 1..=1000 {
            stepper.step(&system, &mut state, h).unwrap();
            assert!((oscillator.energy(&state) - start).abs() < 1e-12 * start, "{method:?}");
            assert!((state.q[0] - (phase * f64::from(step)).cos()).abs() < 1e-11, "{method:?}");
        }
    }
    // The area factor of backward Euler, measured as energy: the step is a similarity of phase space.
    let mut state = State { t: 0.0, q: vec![1.0], p: vec![0.5] };
    let mut stepper = stepper_of(Method::BackwardEuler, &system);
    for _ in 0..20 {
        let before = oscillator.energy(&state);
        stepper.step(&system, &mut state, h).unwrap();
        assert!((oscillator.energy(&state) / before * (1.0 + z * z) - 1.0).abs() < 1e-13);
    }
}

#[test]
fn ledger_closes_to_round_off() {
    let chain = SpringChain::unit(6);
    for (system, start) in [(chain.system().unwrap(), chain.disturbed_state()), moving_chain(6)] {
        for method in all() {
            // Include a loose tolerance, with which the work of the residual is significant.
            for tolerance in [1e-3, 1e-14] {
                let options = SolverOptions { ledger: true, tolerance, ..Default::default() };
                let mut stepper = vi_solvers::stepper(&method, &system, &options).unwrap();
                let mut state = start.clone();
                let total = |system: &System, state: &State| {
                    reference::energy(system, &system.positions(state), state.t)
                        + kinetic_energy(system, state)
                };
                let kinetic = kinetic_energy(&system, &state);
                let mut ledger = EnergyLedger::new(total(&system, &state), kinetic);
                for _ in 0..100 {
                    let report = stepper.step(&system, &mut state, 0.1).unwrap();
                    ledger.enter(report.energy, total(&system, &state), kinetic_energy(&system, &state));
                }
                let unexplained = ledger.unexplained().abs() / ledger.kinetic_max;
                assert!(unexplained < 1e-12, "{method:?} {tolerance}: {unexplained:e} {ledger:?}");
                if method == Method::EnergyMomentum {
                    assert!(ledger.parts.scheme.abs() < 1e-12 * ledger.kinetic_max, "{ledger:?}");
                }
            }
        }
    }
}

#[test]
fn a_failed_step_leaves_the_state_and_names_the_cause() {
    let (system, mut state) = crate::bodies::brittle_pair();
    // The pair is torn from the start: no step helps.
    state.q[1] = 2.5;
    for method in all() {
        let before = state.clone();
        let error = stepper_of(method, &system).step(&system, &mut state, 0.1).unwrap_err();
        assert_eq!(state, before);
        assert!(matches!(&error.cause, SolverError::Term { at_start: true, .. }), "{method:?} {error}");
        assert!(!error.smaller_step_may_help());
    }
    // One iteration is not enough for a large step.
    let chain = SpringChain::unit(6);
    let system = chain.system().unwrap();
    let options = SolverOptions { max_iterations: 1, tolerance: 1e-9, ..Default::default() };
    // A truncated solve need not converge.
    for method in all().filter(|method| !matches!(method, Method::TruncatedEuler { .. })) {
        let mut state = chain.disturbed_state();
        let mut stepper = vi_solvers::stepper(&method, &system, &options).unwrap();
        let error = stepper.step(&system, &mut state, 1.0).unwrap_err();
        assert_eq!(state, chain.disturbed_state());
        assert!(matches!(error.cause, SolverError::NoConvergence { .. }), "{method:?} {error}");
        assert!(error.smaller_step_may_help());
    }
}

#[test]
fn a_step_into_a_wall_stays_in_the_domain() {
    let (system, start) = crate::bodies::brittle_pair();
    for method in variational() {
        let mut state = start.clone();
        let mut stepper = stepper_of(method, &system);
        for _ in 0..50 {
            stepper.step(&system, &mut state, 0.3).unwrap();
            assert!((state.q[1] - state.q[0] - 1.0).is_finite());
        }
    }
}

#[test]
fn memory_continues_to_the_bit() {
    let chain = SpringChain::unit(8);
    let system = chain.system().unwrap();
    for method in Method::ALL {
        let h = if method.facts().is_explicit { 0.05 } else { 0.2 };
        for tolerance in [1e-6, 1e-14] {
            let options = SolverOptions { tolerance, ..Default::default() };
            let new = || vi_solvers::stepper(&method, &system, &options).unwrap();
            let mut state = chain.disturbed_state();
            let mut stepper = new();
            for _ in 0..13 {
                stepper.step(&system, &mut state, h).unwrap();
            }
            let (memory, mut copy) = (stepper.memory(), state.clone());
            let mut other = new();
            other.restore(&system, &memory).unwrap();
            for step in 0..30 {
                stepper.step(&system, &mut state, h).unwrap();
                other.step(&system, &mut copy, h).unwrap();
                assert_eq!(state, copy, "{method:?} {tolerance} step {step}");
            }
            assert!(new().restore(&system, &Default::default()).is_err());
        }
    }
}

#[test]
fn a_linear_system_factors_once_and_iterates_once() {
    let system = Oscillator::with_frequency(2.0).system().unwrap();
    for method in all().filter(|method| !matches!(method, Method::Gauss { .. })) {
        let mut state = State { t: 0.0, q: vec![1.0], p: vec![0.3] };
        let options = SolverOptions::default();
        let mut stepper = vi_solvers::stepper(&method, &system, &options).unwrap();
        let steps = 20;
        for _ in 0..steps {
            stepper.step(&system, &mut state, 0.1).unwrap();
        }
        let work = stepper.work();
        // BDF2 begins with a step of implicit midpoint, which has another matrix.
        let factors = if method == Method::Bdf2 { 2 } else { 1 };
        assert_eq!(work.factorizations, factors, "{method:?}");
        assert_eq!((work.newton_iterations, work.solves), (steps, steps), "{method:?}");
    }
}

/// While a body moves little, the coupled equations of the stages of a Gauss step are nearly linear. Then a few factors, and twenty solves
/// per stage, suffice for any number of stages, although h times the highest frequency is up to 20. An iteration makes one solve per
/// stage. (Splittings of least spectral radius needed up to 12 factors and, with accurate solutions by GMRES, 38 solves per stage.)
#[test]
fn coupled_stages_of_small_motions_converge_with_few_factors() {
    let chain = SpringChain::unit(30);
    let system = chain.system().unwrap();
    for h in [2.0, 10.0] {
        for stages in 2..=5 {
            let method = Method::Gauss { stages };
            let x: Vec<f64> = (0..90).map(|dof| if dof % 3 == 0 { (dof / 3) as f64 } else { 0.0 }).collect();
            let v: Vec<f64> = (0..90).map(|dof| 1e-6 * (f64::from(dof) * 1.7).sin()).collect();
            let mut state = system.state(0.0, &x, &v).unwrap();
            let mut stepper = vi_solvers::stepper(&method, &system, &SolverOptions::default()).unwrap();
            let steps = 10;
            for step in 0..steps {
                let outcome = stepper.step(&system, &mut state, h);
                assert!(outcome.is_ok(), "{method:?}, h = {h}, step {step}: {outcome:?}");
            }
            let work = stepper.work();
            let [factors, solves, iterations] = [work.factorizations, work.solves, work.newton_iterations];
            assert!(factors <= 4, "{method:?}, h = {h}: {factors}");
            assert!(h > 2.0 || iterations <= 12 * steps, "{method:?}, h = {h}: {iterations}");
            assert!(solves <= 20 * stages as u64 * steps, "{method:?}, h = {h}: {solves}");
        }
    }
}

#[test]
fn a_body_at_rest_in_balance_is_not_solved() {
    let chain = SpringChain::unit(6);
    let system = chain.system().unwrap();
    let x: Vec<f64> = (0..18).map(|dof| if dof % 3 == 0 { (dof / 3) as f64 } else { 0.0 }).collect();
    let start = system.state(0.0, &x, &[0.0; 18]).unwrap();
    for method in all() {
        let options = SolverOptions::default();
        let mut stepper = vi_solvers::stepper(&method, &system, &options).unwrap();
        let mut state = start.clone();
        for _ in 0..5 {
            assert_eq!(stepper.step(&system, &mut state, 0.1).unwrap().iterations, 0);
        }
        let work = stepper.work();
        assert_eq!(
            (work.hessians, work.factorizations, work.solves, work.skipped),
            (0, 0, 0, 5),
            "{method:?}"
        );
        assert_eq!((&state.q, &state.p), (&start.q, &start.p));
        // Once pushed, it moves.
        state.p[0] = 0.1;
        assert!(stepper.step(&system, &mut state, 0.1).unwrap().iterations > 0, "{method:?}");
    }
}

#[test]
fn options_outside_their_domain_are_refused() {
    let system = Oscillator::with_frequency(2.0).system().unwrap();
    for method in [
        Method::Gauss { stages: 0 },
        Method::Gauss { stages: 6 },
        Method::Newmark { beta: 0.0, gamma: 0.5 },
        Method::Newmark { beta: 0.25, gamma: 0.3 },
        Method::GeneralizedAlpha { spectral_radius: 1.5 },
    ] {
        let outcome = vi_solvers::stepper(&method, &system, &SolverOptions::default());
        assert!(matches!(outcome.err(), Some(SolverError::Option { .. })), "{method:?}");
    }
    let options = SolverOptions { tolerance: 0.0, ..Default::default() };
    assert!(vi_solvers::stepper(&Method::ImplicitMidpoint, &system, &options).is_err());
}

/// A truncated solve makes no more linear solves per step than it may, also where it is far from converged. With enough
/// solves it is backward Euler.
#[test]
fn a_truncated_solve_keeps_its_price_and_converges_with_it() {
    let chain = SpringChain::unit(12);
    let system = chain.system().unwrap();
    let end = |method: Method, h: f64| {
        let mut state = chain.disturbed_state();
        let mut stepper = stepper_of(method, &system);
        for _ in 0..20 {
            let work = stepper.step(&system, &mut state, h).unwrap().work;
            if let Method::TruncatedEuler { solves } = method {
                // A factor in single precision is checked by one more solve.
                assert!(work.solves <= u64::from(solves) + 1 && work.factorizations <= 1, "{work:?}");
            }
        }
        state
    };
    for solves in [1, 4] {
        let state = end(Method::TruncatedEuler { solves }, 20.0);
        assert!(state.q.iter().chain(&state.p).all(|value| value.is_finite()));
    }
    let (few, many) = (end(Method::TruncatedEuler { solves: 100 }, 0.5), end(Method::BackwardEuler, 0.5));
    crate::bodies::assert_close(&few, &many, 1e-4, "100 solves");
}
