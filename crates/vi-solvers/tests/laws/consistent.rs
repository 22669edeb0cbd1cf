//! Tests the laws of implicit schemes with consistent mass: oracle, orders, energy, momenta, time symmetry, ledger,
//! memory, and refused systems.

use std::sync::Arc;

use crate::bodies::{assert_close, assert_momenta, distance, run, stepper_of, to_round_off};
use vi_core::problems::{Jet, SpringChain, Term};
use vi_core::{
    Coordinates, EnergyLedger, Fixed, HessianKind, Potential, Prescribed, Scheme, State, System,
    kinetic_energy, reference, solve_mass,
};
use vi_solvers::{Method, SolverError, SolverOptions, modes};

/// Returns ½ m/6 (2 v_a² + 2 v_b² + 2 v_a·v_b) of neighbours: bars of mass m = 3.
fn bars(nodes: usize) -> Vec<Arc<dyn Potential>> {
    let jet = |_: usize, v: &[f64; 6]| {
        let mut jet = Jet { energy: 0.0, gradient: [0.0; 6], hessian: [[0.0; 6]; 6] };
        for i in 0..6 {
            for j in [i, (i + 3) % 6] {
                jet.hessian[i][j] = if i == j { 1.0 } else { 0.5 };
                jet.gradient[i] += jet.hessian[i][j] * v[j];
            }
            jet.energy += 0.5 * jet.gradient[i] * v[i];
        }
        jet
    };
    let nodes = (1..nodes as u32).flat_map(|b| [b - 1, b]).collect();
    vec![Arc::new(Term { name: "bars", block: 3, nodes, hessian: HessianKind::Constant, jet })]
}

/// Returns a free chain, or one whose first node is held and whose last moves only along x and z.
fn chain(nodes: usize, held: bool) -> (System, State) {
    let chain = SpringChain::unit(nodes);
    let free = chain.system().unwrap();
    let start = chain.disturbed_state();
    let last = 3 * nodes as u32 - 2;
    let fixed = |dofs: Vec<u32>| {
        let at = dofs.iter().map(|&dof| start.q[dof as usize]).collect();
        Prescribed { dofs, path: Box::new(Fixed(at)) }
    };
    let prescribed = if held { vec![fixed(vec![0, 1, 2]), fixed(vec![last])] } else { Vec::new() };
    let system = chain.system_holding(prescribed).unwrap().with_consistent_mass(bars(nodes)).unwrap();
    let state = system.state(0.0, &start.q, &free.velocities(&start)).unwrap();
    (system, state)
}

fn gauss() -> impl Iterator<Item = Method> {
    (1..=5).map(|stages| Method::Gauss { stages })
}

fn conserving() -> impl Iterator<Item = Method> {
    [Method::ImplicitMidpoint, Method::EnergyMomentum].into_iter().chain(gauss())
}

fn implicit() -> impl Iterator<Item = Method> {
    Method::ALL.into_iter().filter(|method| !method.facts().is_explicit).chain(gauss())
}

#[test]
fn kernels_agree_with_the_oracle() {
    for held in [false, true] {
        let (system, start) = chain(5, held);
        for method in gauss() {
            let Method::Gauss { stages } = method else { continue };
            let scheme = Scheme::gauss(stages).unwrap();
            let (mut fast, mut slow) = (start.clone(), start.clone());
            let mut stepper = stepper_of(method, &system);
            for _ in 0..10 {
                stepper.step(&system, &mut fast, 0.2).unwrap();
                slow = reference::step(&system, &scheme, &slow, 0.2).unwrap();
            }
            assert_close(&fast, &slow, 1e-12, &format!("{method:?}, held: {held}"));
        }
    }
}

#[test]
fn orders_are_observed() {
    let (system, start) = chain(4, true);
    let mut exact = start.clone();
    run(Method::Gauss { stages: 5 }, &system, &mut exact, 1.0 / 64.0, 64);
    for method in implicit().filter(|method| method.facts().order <= 6) {
        let order = method.facts().order;
        let error = |steps: usize| {
            let mut state = start.clone();
            run(method, &system, &mut state, 1.0 / steps as f64, steps);
            distance(&state, &exact)
        };
        let steps = [0, 800, 60, 0, 12, 0, 6][order];
        let observed = (error(steps) / error(2 * steps)).log2();
        assert!((observed - order as f64).abs() < 0.4, "{method:?}: {observed}");
    }
}

#[test]
fn momenta_are_kept() {
    let (system, start) = chain(6, false);
    for method in conserving() {
        let mut state = start.clone();
        run(method, &system, &mut state, 0.1, 1000);
        assert_momenta(&system, &start, &state, 1e-12, &format!("{method:?}"));
    }
}

#[test]
fn symmetric_schemes_reverse() {
    let (system, start) = chain(6, true);
    for method in conserving() {
        let mut state = start.clone();
        for _ in 0..2 {
            run(method, &system, &mut state, 0.1, 100);
            state.p.iter_mut().for_each(|p| *p = -*p);
        }
        assert!(distance(&state, &start) < 1e-9, "{method:?}: {:e}", distance(&state, &start));
    }
}

#[test]
fn energy_momentum_keeps_the_energy_of_large_motions() {
    for held in [false, true] {
        let (system, mut state) = chain(6, held);
        let energy = |state: &State| {
            kinetic_energy(&system, state) + reference::energy(&system, &system.positions(state), 0.0)
        };
        let before = energy(&state);
        run(Method::EnergyMomentum, &system, &mut state, 0.1, 1000);
        assert!((energy(&state) - before).abs() < 1e-12 * before, "{:e}", energy(&state) - before);
    }
}

#[test]
fn the_ledger_closes_and_velocities_are_known() {
    let (system, start) = chain(5, true);
    for method in implicit() {
        let options = SolverOptions { ledger: true, ..to_round_off() };
        let mut stepper = vi_solvers::stepper(&method, &system, &options).unwrap();
        let mut state = start.clone();
        let energy = |state: &State| {
            kinetic_energy(&system, state) + reference::energy(&system, &system.positions(state), 0.0)
        };
        let mut ledger = EnergyLedger::new(energy(&state), kinetic_energy(&system, &state));
        for _ in 0..50 {
            let step = stepper.step(&system, &mut state, 0.05).unwrap().energy;
            ledger.enter(step, energy(&state), kinetic_energy(&system, &state));
        }
        let left = ledger.unexplained().abs();
        assert!(left < 1e-11 * energy(&start), "{method:?}: {left:e}");
        let known = stepper.velocity(&state).unwrap().to_vec();
        for (known, exact) in known.iter().zip(system.velocity(&state.p)) {
            assert!((known - exact).abs() < 1e-13, "{method:?}");
        }
    }
}

#[test]
fn a_stepper_continues_from_its_memory_bit_for_bit() {
    let (system, start) = chain(6, true);
    for method in implicit() {
        let mut stepper = stepper_of(method, &system);
        let mut state = start.clone();
        for _ in 0..7 {
            stepper.step(&system, &mut state, 0.1).unwrap();
        }
        let mut continued = stepper_of(method, &system);
        continued.restore(&system, &stepper.memory()).unwrap();
        let mut other = state.clone();
        for _ in 0..7 {
            stepper.step(&system, &mut state, 0.1).unwrap();
            continued.step(&system, &mut other, 0.1).unwrap();
        }
        assert_eq!(state, other, "{method:?}");
    }
}

#[test]
fn modes_take_the_mass_of_the_system() {
    let (system, state) = chain(6, true);
    let lumped = SpringChain::unit(6).system_holding(Vec::new()).unwrap();
    assert!(lumped.kinetic().is_none());
    for mode in modes(&system, &state, Vec::new(), &Default::default()).unwrap().modes {
        let p = system.momentum(&mode.shape);
        let norm: f64 = p.iter().zip(&mode.shape).map(|(p, v)| p * v).sum();
        assert!((norm - 1.0).abs() < 1e-10, "{norm}");
    }
}

#[test]
fn momentum_and_velocity_are_inverse_to_each_other() {
    let (system, state) = chain(40, true);
    let v = system.velocity(&state.p);
    for (p, back) in state.p.iter().zip(system.momentum(&v)) {
        assert!((p - back).abs() < 1e-14, "{p} {back}");
    }
    let dense = system.dense_mass() * nalgebra::DVector::from_vec(v.clone());
    for (p, back) in state.p.iter().zip(dense.iter()) {
        assert!((p - back).abs() < 1e-13, "{p} {back}");
    }
    // A good start needs no iteration.
    let multiply = |v: &[f64], out: &mut [f64]| out.copy_from_slice(&system.momentum(v));
    let mut again = v.clone();
    assert_eq!(solve_mass(multiply, system.free_mass(), &state.p, &mut again), 0);
    assert_eq!(again, v);
}

#[test]
fn explicit_schemes_and_moving_supports_are_refused() {
    let (system, _) = chain(4, false);
    for method in Method::ALL.into_iter().filter(|method| method.facts().is_explicit) {
        let error = vi_solvers::stepper(&method, &system, &to_round_off()).err().unwrap();
        assert!(matches!(error, SolverError::ConsistentMass { .. }), "{error}");
    }
    let (moving, _) = crate::bodies::moving_chain(4);
    let error = moving.with_consistent_mass(bars(4)).err().unwrap().to_string();
    assert!(error.contains("moves"), "{error}");
    let springs = SpringChain::unit(4);
    let not_quadratic = Term {
        name: "springs",
        block: 3,
        nodes: vec![0, 1],
        hessian: HessianKind::Varying,
        jet: |_, _: &[f64; 6]| Jet { energy: 0.0, gradient: [0.0; 6], hessian: [[0.0; 6]; 6] },
    };
    let free = System::new(vec![1.0; 12], Vec::new(), Coordinates::all_free(12)).unwrap();
    assert!(free.with_consistent_mass(vec![Arc::new(not_quadratic)]).is_err());
    assert!(springs.system().unwrap().with_consistent_mass(Vec::new()).unwrap().kinetic().is_none());
}
