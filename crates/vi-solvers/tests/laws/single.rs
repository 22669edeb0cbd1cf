//! Tests factors in single precision: their errors are small or corrected, whatever the units. If round-off would
//! dominate, double precision takes over.

use crate::springs::{block_system, deformed};
use vi_core::System;
use vi_solvers::{Assembler, HessianEvaluation, LinearSolver, Method, SingleFactor, SolverOptions, Work};

#[test]
fn one_refinement_makes_it_double() {
    let (system, x) = block_system([16, 4, 4], true);
    let mut assembler = Assembler::new(&system);
    let k = assembler.hessian(&deformed(&x, 0.02), 0.0, HessianEvaluation::Projected).unwrap();
    let mut factor = SingleFactor::new(k).unwrap();
    // Units do not matter, although single precision cannot represent 1e-60.
    for unit in [1e-60, 1.0, 1e60] {
        let mass: Vec<f64> = system.free_mass().iter().map(|m| m * unit).collect();
        factor.factorize(&mass, unit, k).unwrap();
        let mut solution: Vec<f64> = (0..mass.len()).map(|k| 1e-50 * (1.3 * k as f64).sin()).collect();
        let residual = factor.solve(&mut solution).unwrap();
        assert!(residual < 1e-9, "{unit:e}: {residual:e}");
        assert!(solution.iter().all(|x| x.is_finite()));
    }
}

/// Makes ten steps from velocities of the given size.
fn run(
    system: &System,
    x: &[f64],
    size: f64,
    h: f64,
    (method, linear): (Method, LinearSolver),
) -> (Vec<f64>, Work, String) {
    let v: Vec<f64> = (0..x.len()).map(|k| size * (0.7 * k as f64).sin()).collect();
    let mut state = system.state(0.0, x, &v).unwrap();
    let options = SolverOptions { linear, tolerance: 1e-8, ..Default::default() };
    let mut stepper = vi_solvers::stepper(&method, system, &options).unwrap();
    for _ in 0..10 {
        stepper.step(system, &mut state, h).unwrap();
    }
    (state.q, stepper.work(), stepper.linear_solver().unwrap().to_owned())
}

#[test]
fn newton_corrects_what_it_leaves() {
    let (system, x) = block_system([8, 3, 3], true);
    for method in [Method::ImplicitMidpoint, Method::Gauss { stages: 2 }, Method::EnergyMomentum] {
        let (single, work, reason) = run(&system, &x, 0.3, 0.1, (method, LinearSolver::Cholesky));
        assert!(reason.contains("single precision"), "{reason}");
        let (double, exact_work, reason) = run(&system, &x, 0.3, 0.1, (method, LinearSolver::CholeskyDouble));
        assert!(reason.contains("double precision"), "{reason}");
        let distance = single.iter().zip(&double).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(distance < 1e-6, "{}: {distance:e}", method.name());
        // At most one more iteration per step and stage.
        assert!(work.solves <= exact_work.solves + 30, "{} {}", work.solves, exact_work.solves);
    }
}

#[test]
fn double_precision_takes_over_where_round_off_rules() {
    // A free block and a long step: its rigid motion has only inertia, 1e-8 of the stiffness times h²/4.
    let (system, x) = block_system([6, 3, 3], false);
    let (_, work, reason) = run(&system, &x, 1e-9, 1e4, (Method::ImplicitMidpoint, LinearSolver::Cholesky));
    assert!(reason.contains("double precision") && reason.contains("single"), "{reason} {work:?}");
}
