//! Tests the sparse factor: it solves, refuses matrices that are not positive definite, and gives the same bits
//! again.

use crate::springs::{Springs, block, block_system, deformed, fixed};
use vi_core::{Coordinates, System};
use vi_solvers::{Assembler, Factor, HessianEvaluation, SolverError, SymmetricMatrix};

fn hessian(system: &System, x: &[f64], kind: HessianEvaluation) -> SymmetricMatrix {
    Assembler::new(system).hessian(x, 0.0, kind).unwrap().clone()
}

fn wave(n: usize) -> Vec<f64> {
    (0..n).map(|k| (1.3 * k as f64).sin()).collect()
}

/// Returns ‖(M + cK) x − b‖ / ‖b‖, computed from the matrix itself.
fn residual(mass: &[f64], c: f64, k: &SymmetricMatrix, x: &[f64], b: &[f64]) -> f64 {
    let mut product = vec![0.0; x.len()];
    k.multiply(x, &mut product);
    let (mut r, mut norm) = (0.0, 0.0);
    for i in 0..x.len() {
        let m = mass.get(i).copied().unwrap_or(0.0);
        r += (m * x[i] + c * product[i] - b[i]).powi(2);
        norm += b[i] * b[i];
    }
    (r / norm).sqrt()
}

#[test]
fn solves_to_round_off() {
    for cells in [[1, 1, 1], [6, 2, 2], [16, 4, 4], [20, 20, 1]] {
        let (system, x) = block_system(cells, true);
        let k = hessian(&system, &deformed(&x, 0.02), HessianEvaluation::Projected);
        let mass = system.free_mass();
        let mut factor = Factor::new(&k).unwrap();
        let b = wave(mass.len());
        for c in [1e-3, 1.0, 50.0] {
            factor.factorize(mass, c, &k).unwrap();
            let mut solution = b.clone();
            let reported = factor.solve(&mut solution).unwrap();
            assert!(residual(mass, c, &k, &solution, &b) < 1e-12, "{cells:?} {c} {reported:e}");
        }
    }
}

#[test]
fn statics_needs_no_mass() {
    let (system, x) = block_system([8, 3, 3], true);
    let k = hessian(&system, &x, HessianEvaluation::Exact);
    let mut factor = Factor::new(&k).unwrap();
    factor.factorize(&[], 2.0, &k).unwrap();
    let b = wave(k.free_count());
    let mut solution = b.clone();
    factor.solve(&mut solution).unwrap();
    assert!(residual(&[], 2.0, &k, &solution, &b) < 1e-11);
}

#[test]
fn prescribed_axes_do_not_enter() {
    let (x, nodes) = block([4, 4, 4]);
    let dofs = (0..x.len() as u32).filter(|dof| dof % 5 == 0 || dof % 3 == 1).collect();
    let coordinates = Coordinates::new(x.len(), fixed(&x, dofs)).unwrap();
    let term = Springs::new(4, nodes, 1.0, &x);
    let system = System::new(vec![1.0; x.len()], vec![Box::new(term)], coordinates).unwrap();
    let k = hessian(&system, &x, HessianEvaluation::Exact);
    let mut factor = Factor::new(&k).unwrap();
    factor.factorize(system.free_mass(), 3.0, &k).unwrap();
    let b = wave(k.free_count());
    let mut solution = b.clone();
    factor.solve(&mut solution).unwrap();
    assert!(residual(system.free_mass(), 3.0, &k, &solution, &b) < 1e-12);
}

#[test]
fn an_indefinite_matrix_is_refused_and_the_next_one_taken() {
    let (system, x) = block_system([6, 3, 3], true);
    let compressed: Vec<f64> = x.iter().map(|x| 0.3 * x).collect();
    let bad = hessian(&system, &compressed, HessianEvaluation::Exact);
    let mut factor = Factor::new(&bad).unwrap();
    assert_eq!(factor.solve(&mut wave(bad.free_count())), Err(SolverError::NotFactored));
    let error = factor.factorize(system.free_mass(), 10.0, &bad).unwrap_err();
    assert!(error.free < bad.free_count());
    assert_eq!(factor.solve(&mut wave(bad.free_count())), Err(SolverError::NotFactored));
    let mut assembler = Assembler::new(&system);
    let good = assembler.hessian(&compressed, 0.0, HessianEvaluation::Projected).unwrap();
    let mut factor = Factor::new(good).unwrap();
    factor.factorize(system.free_mass(), 10.0, good).unwrap();
    factor.solve(&mut wave(good.free_count())).unwrap();
}

#[test]
fn a_diagonal_matrix_is_a_matrix() {
    let (x, _) = block([2, 2, 2]);
    let term = Springs::new(2, vec![3, 3], 1.0, &x);
    let system =
        System::new(vec![2.0; x.len()], vec![Box::new(term)], Coordinates::all_free(x.len())).unwrap();
    let k = hessian(&system, &x, HessianEvaluation::Exact);
    let mut factor = Factor::new(&k).unwrap();
    factor.factorize(system.free_mass(), 1.0, &k).unwrap();
    let mut solution = wave(x.len());
    factor.solve(&mut solution).unwrap();
    assert!(solution.iter().zip(wave(x.len())).all(|(x, b)| (2.0 * x - b).abs() < 1e-15));
}

#[test]
fn bits_do_not_depend_on_threads() {
    let (system, x) = block_system([20, 8, 8], true);
    let k = hessian(&system, &deformed(&x, 0.01), HessianEvaluation::Exact);
    let run = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let mut factor = Factor::new(&k).unwrap();
            factor.factorize(system.free_mass(), 5.0, &k).unwrap();
            let mut solution = wave(k.free_count());
            factor.solve(&mut solution).unwrap();
            solution.into_iter().map(f64::to_bits).collect::<Vec<_>>()
        })
    };
    let one = run(1);
    assert!(one == run(2) && one == run(8));
}
