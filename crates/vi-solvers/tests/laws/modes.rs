//! Tests modes against closed forms, with multiple eigenvalues and rigid motions.

use vi_core::problems::{Jet, Term};
use vi_core::{Coordinates, Fixed, HessianKind, Potential, Prescribed, State, System};
use vi_solvers::{ModeOptions, SolverError, modes};

use crate::forces::Turning;

/// Returns unit masses connected by springs of zero length, V = ½ Σ |x_a − x_(a+1)|²: every frequency is triple.
fn chain(nodes: u32, clamped: bool) -> (System, State) {
    let jet = |_: usize, x: &[f64; 6]| {
        let mut hessian = [[0.0; 6]; 6];
        let mut gradient = [0.0; 6];
        let mut energy = 0.0;
        for i in 0..3 {
            let d = x[i] - x[3 + i];
            energy += 0.5 * d * d;
            (gradient[i], gradient[3 + i]) = (d, -d);
            (hessian[i][i], hessian[3 + i][3 + i]) = (1.0, 1.0);
            (hessian[i][3 + i], hessian[3 + i][i]) = (-1.0, -1.0);
        }
        Jet { energy, gradient, hessian }
    };
    let pairs = (0..nodes - 1).flat_map(|a| [a, a + 1]).collect();
    let term = Term { name: "chain", block: 3, nodes: pairs, hessian: HessianKind::Constant, jet };
    let count = 3 * nodes as usize;
    let dofs = if clamped { vec![0, 1, 2] } else { vec![] };
    let path = Box::new(Fixed(vec![0.0; dofs.len()]));
    let coordinates = Coordinates::new(count, vec![Prescribed { dofs, path }]).unwrap();
    let terms: Vec<Box<dyn Potential>> = vec![Box::new(term)];
    let system = System::new(vec![1.0; count], terms, coordinates).unwrap();
    // Spread the nodes, so that rotations move them.
    let x: Vec<f64> = (0..count).map(|k| (0.3 * k as f64).sin() + (k % 3) as f64 * 0.1 * k as f64).collect();
    let state = system.state(0.0, &x, &vec![0.0; count]).unwrap();
    (system, state)
}

#[test]
fn triple_frequencies_of_a_free_chain_are_all_found() {
    let nodes = 40;
    let (system, state) = chain(nodes, false);
    let options = ModeOptions { count: 14, tolerance: 1e-9, ..Default::default() };
    let found = modes(&system, &state, vec![], &options).unwrap().modes;
    assert_eq!(found.len(), 14);
    for (k, mode) in found.iter().enumerate() {
        // 4 sin²(jπ/2n), each three times.
        let exact =
            4.0 * (f64::from(k as u32 / 3) * std::f64::consts::PI / f64::from(2 * nodes)).sin().powi(2);
        assert!((mode.omega_squared - exact).abs() < 1e-12, "mode {k}: {} {exact}", mode.omega_squared);
        assert_eq!(mode.is_rigid, k < 3, "mode {k}");
        assert!(mode.residual < 1e-6, "mode {k}: {:e}", mode.residual);
        let norm: f64 = mode.shape.iter().map(|x| x * x).sum();
        assert!((norm - 1.0).abs() < 1e-12);
        for other in &found[..k] {
            let product: f64 = mode.shape.iter().zip(&other.shape).map(|(a, b)| a * b).sum();
            assert!(product.abs() < 1e-9, "{product:e}");
        }
    }
}

#[test]
fn a_consistent_mass_is_taken_and_equal_runs_give_equal_bits() {
    let nodes = 30;
    let (system, state) = chain(nodes, true);
    // M of linear bars of unit length: 2/3 on the diagonal, 1/6 next to it, 1/3 at the free end.
    let mass = || {
        let jet = |_: usize, v: &[f64; 6]| {
            let mut hessian = [[0.0; 6]; 6];
            for i in 0..3 {
                (hessian[i][i], hessian[3 + i][3 + i]) = (1.0 / 3.0, 1.0 / 3.0);
                (hessian[i][3 + i], hessian[3 + i][i]) = (1.0 / 6.0, 1.0 / 6.0);
            }
            let gradient: [f64; 6] = std::array::from_fn(|i| (0..6).map(|j| hessian[i][j] * v[j]).sum());
            let energy = 0.5 * gradient.iter().zip(v).map(|(g, v)| g * v).sum::<f64>();
            Jet { energy, gradient, hessian }
        };
        let pairs = (0..nodes - 1).flat_map(|a| [a, a + 1]).collect();
        let term = Term { name: "mass", block: 3, nodes: pairs, hessian: HessianKind::Constant, jet };
        vec![Box::new(term) as Box<dyn Potential>]
    };
    let options = ModeOptions { count: 6, ..Default::default() };
    let found = modes(&system, &state, mass(), &options).unwrap().modes;
    for (k, mode) in found.iter().enumerate() {
        // A fixed–free bar of n − 1 linear elements: ω² = 6 (1 − c)/(2 + c) with c = cos((2j − 1)π/2(n − 1)).
        let j = f64::from(k as u32 / 3) + 0.5;
        let c = (j * std::f64::consts::PI / f64::from(nodes - 1)).cos();
        let exact = 6.0 * (1.0 - c) / (2.0 + c);
        assert!((mode.omega_squared / exact - 1.0).abs() < 1e-10, "mode {k}: {} {exact}", mode.omega_squared);
        assert!(!mode.is_rigid);
    }
    assert_eq!(found, modes(&system, &state, mass(), &options).unwrap().modes);
    // The effective masses of all modes sum to the mass that can move: 29 kg minus 1/3 kg on the held node and twice
    // 1/6 kg that couples it to its neighbour.
    let all = modes(&system, &state, mass(), &ModeOptions { count: 200, ..Default::default() }).unwrap();
    for axis in 0..3 {
        let sum: f64 = all.modes.iter().map(|mode| mode.participation[axis].powi(2)).sum();
        assert!((sum - all.free_mass[axis]).abs() < 1e-11 * sum, "{sum} {}", all.free_mass[axis]);
        assert!((sum - (f64::from(nodes - 1) - 2.0 / 3.0)).abs() < 1e-11, "{sum}");
    }
}

#[test]
fn more_modes_than_unknowns_are_all_there_are() {
    let (system, state) = chain(3, true);
    let found =
        modes(&system, &state, vec![], &ModeOptions { count: 50, ..Default::default() }).unwrap().modes;
    assert_eq!(found.len(), 6);
}

/// Modes of a tangent that is not symmetric are refused by the name of the force.
#[test]
fn an_unsymmetric_tangent_has_no_modes() {
    let jet = |_: usize, x: &[f64; 2]| Jet {
        energy: 0.5 * (x[0] * x[0] + 4.0 * x[1] * x[1]),
        gradient: [x[0], 4.0 * x[1]],
        hessian: [[1.0, 0.0], [0.0, 4.0]],
    };
    let system = || {
        let term = Term { name: "springs", block: 2, nodes: vec![0], hessian: HessianKind::Constant, jet };
        let system = System::new(vec![1.0; 2], vec![Box::new(term)], Coordinates::all_free(2)).unwrap();
        (system, State { t: 0.0, q: vec![0.1, 0.2], p: vec![0.0; 2] })
    };
    let options = ModeOptions { count: 2, ..Default::default() };
    let ((plain, state), (other, _)) = (system(), system());
    let turned = plain.with_forces(vec![std::sync::Arc::new(Turning { c: 0.1, block: 2 })]).unwrap();
    match modes(&turned, &state, vec![], &options) {
        // The part of f along mode x is c, and ω² = 1.
        Err(SolverError::Circulatory { force, size }) => {
            assert!(force == "turning force" && (size - 0.1).abs() < 1e-6, "{force}: {size}");
        }
        other => panic!("{other:?}"),
    }
    // A force that is not turned has the symmetric tangent zero.
    let pulled = other.with_forces(vec![std::sync::Arc::new(Turning { c: 0.0, block: 2 })]).unwrap();
    let found = modes(&pulled, &state, vec![], &options).unwrap().modes;
    assert!((found[0].omega_squared - 1.0).abs() < 1e-10, "{}", found[0].omega_squared);
}
