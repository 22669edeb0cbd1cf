//! Tests conjugate gradients: they solve, fall back, refuse, and give the same bits again.

use crate::springs::{Springs, block, block_system, deformed, fixed};
use vi_core::{Coordinates, System};
use vi_solvers::{
    Assembler, Factor, HessianEvaluation, LinearSolver, Method, Pcg, Preconditioner, SolverError,
    SolverOptions, SymmetricMatrix, Work,
};

const KINDS: [Preconditioner; 3] =
    [Preconditioner::BlockJacobi, Preconditioner::Ssor, Preconditioner::BlockIncompleteCholesky];

fn hessian(system: &System, x: &[f64]) -> SymmetricMatrix {
    Assembler::new(system).hessian(x, 0.0, HessianEvaluation::Projected).unwrap().clone()
}

fn wave(n: usize) -> Vec<f64> {
    (0..n).map(|k| (1.3 * k as f64).sin()).collect()
}

/// Returns the positions of the free coordinates.
fn places(system: &System, x: &[f64]) -> Vec<f64> {
    let mut places = vec![0.0; system.coordinates().free_count()];
    system.coordinates().restrict(x, &mut places);
    places
}

fn largest_difference(a: &[f64], b: &[f64]) -> f64 {
    let scale = b.iter().fold(0.0_f64, |m, v| m.max(v.abs()));
    a.iter().zip(b).fold(0.0_f64, |m, (a, b)| m.max((a - b).abs())) / scale
}

fn check(system: &System, x: &[f64], c: f64) {
    let k = hessian(system, x);
    let b = wave(k.free_count());
    let mut factor = Factor::new(&k).unwrap();
    factor.factorize(system.free_mass(), c, &k).unwrap();
    let mut expected = b.clone();
    factor.solve(&mut expected).unwrap();
    let mut solution = vec![0.0; b.len()];
    let mut counts = Vec::new();
    for kind in KINDS {
        let mut pcg = Pcg::new(&k, kind);
        assert_eq!(pcg.prepare(system.free_mass(), c, &k, &places(system, x)).unwrap(), kind);
        let report = pcg.solve(&b, &mut solution, 1e-11, 1000).unwrap();
        assert!(largest_difference(&solution, &expected) < 1e-9, "{kind:?} {report:?}");
        counts.push(report.iterations);
        // The factor of the same matrix is its inverse.
        let report = pcg.solve_with(&mut factor, &b, &mut solution, 1e-10, 1000).unwrap();
        assert!(report.iterations <= 2, "{report:?}");
    }
    assert!(counts[1] < counts[0] && counts[2] < counts[0], "{counts:?}");
}

#[test]
fn agrees_with_the_factor() {
    for cells in [[4, 2, 2], [16, 4, 4], [30, 10, 10]] {
        let (system, x) = block_system(cells, true);
        check(&system, &deformed(&x, 0.02), 10.0);
    }
}

#[test]
fn a_loose_solve_has_the_error_that_was_asked_for() {
    let (system, x) = block_system([30, 10, 10], true);
    let k = hessian(&system, &deformed(&x, 0.02));
    let b = wave(k.free_count());
    let energy = |u: &[f64]| {
        let mut product = vec![0.0; u.len()];
        k.multiply(u, &mut product);
        let masses = system.free_mass();
        (0..u.len()).map(|i| u[i] * (masses[i] * u[i] + 10.0 * product[i])).sum::<f64>()
    };
    let mut pcg = Pcg::new(&k, Preconditioner::BlockIncompleteCholesky);
    pcg.prepare(system.free_mass(), 10.0, &k, &places(&system, &x)).unwrap();
    let [mut loose, mut exact] = [(); 2].map(|()| vec![0.0; b.len()]);
    pcg.solve(&b, &mut exact, 1e-11, 1000).unwrap();
    for tolerance in [0.3, 0.05, 0.01] {
        pcg.solve(&b, &mut loose, tolerance, 1000).unwrap();
        let error: Vec<f64> = loose.iter().zip(&exact).map(|(a, b)| a - b).collect();
        let relative = (energy(&error) / energy(&exact)).sqrt();
        assert!(relative < tolerance, "{tolerance}: {relative}");
    }
}

#[test]
fn prescribed_axes_do_not_enter() {
    let (x, nodes) = block([6, 4, 4]);
    let dofs = (0..x.len() as u32).filter(|dof| dof % 11 == 0 || dof % 13 == 1).collect();
    let coordinates = Coordinates::new(x.len(), fixed(&x, dofs)).unwrap();
    let term = Springs::new(4, nodes, 1.0, &x);
    let system = System::new(vec![1.0; x.len()], vec![Box::new(term)], coordinates).unwrap();
    check(&system, &x, 3.0);
}

#[test]
fn implicit_steps_are_the_same_with_either_solver() {
    let (system, x) = block_system([8, 3, 3], true);
    let v: Vec<f64> = (0..x.len()).map(|k| 0.3 * (0.7 * k as f64).sin()).collect();
    let start = system.state(0.0, &x, &v).unwrap();
    let methods =
        [Method::ImplicitMidpoint, Method::Gauss { stages: 2 }, Method::EnergyMomentum, Method::Bdf2];
    for method in methods {
        let run = |linear: LinearSolver| {
            let options = SolverOptions { linear, tolerance: 1e-10, ..Default::default() };
            let mut stepper = vi_solvers::stepper(&method, &system, &options).unwrap();
            assert_eq!(stepper.linear_solver(), None);
            let mut state = start.clone();
            for _ in 0..10 {
                stepper.step(&system, &mut state, 0.1).unwrap();
            }
            let reason = stepper.linear_solver().unwrap().to_owned();
            (state.q, stepper.work(), reason)
        };
        let (direct, counts, reason) = run(LinearSolver::Cholesky);
        assert!(counts.pcg_iterations == 0 && reason.starts_with("cholesky"), "{reason} {counts:?}");
        let (iterated, Work { pcg_iterations, .. }, reason) = run(LinearSolver::Pcg);
        assert!(pcg_iterations > 0 && reason.starts_with("pcg"), "{reason}");
        let difference = largest_difference(&iterated, &direct);
        assert!(difference < 1e-8, "{}: {difference:e}", method.name());
        // For a small system no comparison is made.
        let (_, counts, reason) = run(LinearSolver::Auto);
        assert!(counts.pcg_iterations == 0 && reason.starts_with("cholesky"), "{reason}");
    }
}

#[test]
fn a_stale_factor_is_a_good_preconditioner() {
    let (system, x) = block_system([16, 4, 4], true);
    let (old, new) = (hessian(&system, &x), deformed(&x, 0.01));
    let mut assembler = Assembler::new(&system);
    let mass = system.free_mass();
    let k = assembler.hessian(&x, 0.0, HessianEvaluation::Projected).unwrap();
    let mut factor = Factor::new(k).unwrap();
    factor.factorize(mass, 10.0, k).unwrap();
    let mut pcg = Pcg::new(k, Preconditioner::BlockJacobi);
    let k = assembler.hessian(&new, 0.0, HessianEvaluation::Projected).unwrap();
    pcg.set_matrix(mass, 10.0, k);
    let b = wave(old.free_count());
    let mut solution = vec![0.0; b.len()];
    let report = pcg.solve_with(&mut factor, &b, &mut solution, 1e-6, 50).unwrap();
    assert!(report.iterations <= 8, "{report:?}");
}

#[test]
fn what_does_not_converge_or_is_indefinite_is_an_error() {
    let (system, x) = block_system([10, 3, 3], true);
    let mut assembler = Assembler::new(&system);
    let mass = system.free_mass();
    let k = assembler.hessian(&x, 0.0, HessianEvaluation::Exact).unwrap();
    let b = wave(k.free_count());
    let mut solution = vec![0.0; b.len()];
    let mut pcg = Pcg::new(k, Preconditioner::BlockJacobi);
    pcg.prepare(mass, 100.0, k, &places(&system, &x)).unwrap();
    let error = pcg.solve(&b, &mut solution, 1e-10, 3).unwrap_err();
    assert!(matches!(error, SolverError::ConjugateGradients { iterations: 3, .. }));
    let compressed: Vec<f64> = x.iter().map(|x| 0.3 * x).collect();
    let k = assembler.hessian(&compressed, 0.0, HessianEvaluation::Exact).unwrap();
    assert!(pcg.prepare(mass, 100.0, k, &places(&system, &compressed)).is_err());
    // A positive definite preconditioner does not hide an indefinite matrix.
    let k = assembler.hessian(&x, 0.0, HessianEvaluation::Exact).unwrap();
    let mut factor = Factor::new(k).unwrap();
    factor.factorize(mass, 1.0, k).unwrap();
    pcg.set_matrix(mass, -100.0, k);
    let error = pcg.solve_with(&mut factor, &b, &mut solution, 1e-10, 500).unwrap_err();
    assert!(matches!(error, SolverError::NegativeCurvature { .. }), "{error:?}");
}

#[test]
fn bits_do_not_depend_on_threads() {
    let (system, x) = block_system([48, 14, 14], true);
    let k = hessian(&system, &x);
    let b = wave(k.free_count());
    for kind in KINDS {
        let run = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| {
                let mut pcg = Pcg::new(&k, kind);
                pcg.prepare(system.free_mass(), 5.0, &k, &places(&system, &x)).unwrap();
                let mut solution = b.clone();
                pcg.solve(&b, &mut solution, 1e-8, 500).unwrap();
                solution.into_iter().map(f64::to_bits).collect::<Vec<_>>()
            })
        };
        assert!(run(1) == run(2), "{kind:?}");
    }
}

/// Returns the place of a cell of a grid on Morton's curve.
fn morton(at: &[f64]) -> u64 {
    (0..30).map(|bit| ((at[bit % 3] as u64 >> (bit / 3)) & 1) << bit).sum()
}

/// Returns the number of iterations for a clamped bar of 4n × n × n cells without mass, numbered along a curve.
fn iterations(n: usize) -> u32 {
    let (grid, mut nodes) = block([4 * n, n, n]);
    let mut order: Vec<usize> = (0..grid.len() / 3).collect();
    order.sort_by_key(|&node| morton(&grid[3 * node..3 * node + 3]));
    let mut place = vec![0; order.len()];
    order.iter().zip(0..).for_each(|(&node, k)| place[node] = k);
    nodes.iter_mut().for_each(|node| *node = place[*node as usize]);
    let x: Vec<f64> = order.iter().flat_map(|&node| grid[3 * node..3 * node + 3].to_vec()).collect();
    let clamp = (0..x.len() as u32).filter(|&dof| x[dof as usize / 3 * 3] == 0.0).collect();
    let coordinates = Coordinates::new(x.len(), fixed(&x, clamp)).unwrap();
    let springs = Springs::new(4, nodes, 1.0, &x);
    let system = System::new(vec![1.0; x.len()], vec![Box::new(springs)], coordinates).unwrap();
    let k = hessian(&system, &x);
    let mut pcg = Pcg::new(&k, Preconditioner::BlockIncompleteCholesky);
    pcg.prepare(&[], 1.0, &k, &places(&system, &x)).unwrap();
    let mut solution = vec![0.0; k.free_count()];
    pcg.solve(&wave(k.free_count()), &mut solution, 1e-8, 1000).unwrap().iterations
}

#[test]
fn iterations_stay_bounded_when_a_mesh_is_refined() {
    let counts = [8, 12, 18, 24].map(iterations);
    let [least, most] = [counts.iter().min().unwrap(), counts.iter().max().unwrap()];
    assert!(4 * most <= 5 * least, "{counts:?}");
}

#[test]
fn the_coarse_space_serves_bodies_that_are_not_connected() {
    let (one, mut nodes) = block([10, 6, 6]);
    let count = one.len() as u32 / 3;
    let other: Vec<u32> = nodes.iter().map(|node| node + count).collect();
    nodes.extend(other);
    // The nodes of the two bodies alternate in the numbering.
    let alternate = |node: u32| if node < count { 2 * node } else { 2 * (node - count) + 1 };
    nodes.iter_mut().for_each(|node| *node = alternate(*node));
    let mut x = Vec::new();
    for node in one.chunks(3) {
        x.extend_from_slice(node);
        x.extend([node[0], node[1], node[2] + 20.0]);
    }
    let clamp = (0..x.len() as u32).filter(|&dof| x[dof as usize / 3 * 3] == 0.0).collect();
    let coordinates = Coordinates::new(x.len(), fixed(&x, clamp)).unwrap();
    let springs = Springs::new(4, nodes, 1.0, &x);
    let system = System::new(vec![1.0; x.len()], vec![Box::new(springs)], coordinates).unwrap();
    check(&system, &x, 1e4);
}
