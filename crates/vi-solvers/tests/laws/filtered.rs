//! Tests the laws of a filtered mass: oracle, momenta, time symmetry, symplectic form, energy, the frequency of every wave of a
//! bar, stability limits, and refused systems.

use std::f64::consts::PI;

use crate::bodies::{assert_close, assert_momenta, falling_chain, run, stepper_of};
use vi_core::problems::{Jet, SpringChain, Term};
use vi_core::{
    Coordinates, Fixed, HessianKind, MassFilter, Prescribed, State, System, kinetic_energy, reference,
};
use vi_solvers::{Method, SolverError, SolverOptions, highest_frequency, mass_filter, stepper};

fn explicit() -> impl Iterator<Item = Method> {
    Method::ALL.into_iter().filter(|method| method.facts().is_explicit && method.facts().is_variational())
}

/// Returns a chain with a filtered mass, free or with its first node and the height of its last one held.
fn chain(nodes: usize, held: bool) -> (System, State) {
    let chain = SpringChain::unit(nodes);
    let (free, start) = (chain.system().unwrap(), chain.disturbed_state());
    let fixed = |dofs: Vec<u32>| {
        let at = dofs.iter().map(|&dof| start.q[dof as usize]).collect();
        Prescribed { dofs, path: Box::new(Fixed(at)) }
    };
    let held = if held { vec![fixed(vec![0, 1, 2]), fixed(vec![3 * nodes as u32 - 1])] } else { Vec::new() };
    let system = chain.system_holding(held).unwrap();
    let at_rest: Vec<f64> = (0..nodes).flat_map(|node| [node as f64, 0.0, 0.0]).collect();
    let filter = mass_filter(&system, &at_rest).unwrap();
    let system = system.with_filter(filter).unwrap();
    let state = system.state(0.0, &start.q, &free.velocities(&start)).unwrap();
    (system, state)
}

#[test]
fn kernels_agree_with_the_oracle() {
    for held in [false, true] {
        let (system, start) = chain(5, held);
        for (method, scheme) in explicit().filter_map(|method| Some((method, method.scheme()?))) {
            let (mut fast, mut slow) = (start.clone(), start.clone());
            let mut stepper = stepper_of(method, &system);
            for _ in 0..20 {
                stepper.step(&system, &mut fast, 0.1).unwrap();
                slow = reference::step(&system, &scheme, &slow, 0.1).unwrap();
            }
            assert_close(&fast, &slow, 1e-11, &format!("{}, held: {held}", method.name()));
        }
    }
}

#[test]
fn momenta_and_velocities_are_inverse_to_each_other() {
    let (system, state) = chain(9, true);
    let velocity = system.velocity(&state.p);
    let back = system.momentum(&velocity);
    for (back, p) in back.iter().zip(&state.p) {
        assert!((back - p).abs() < 1e-13, "{back} {p}");
    }
    let twice: f64 = velocity.iter().zip(&state.p).map(|(v, p)| v * p).sum();
    assert!((kinetic_energy(&system, &state) - 0.5 * twice).abs() < 1e-14 * twice);
}

#[test]
fn momenta_are_kept() {
    let (system, start) = chain(6, false);
    for method in explicit() {
        let mut state = start.clone();
        run(method, &system, &mut state, 0.05, 1000);
        assert_momenta(&system, &start, &state, 1e-12, method.name());
    }
}

#[test]
fn symmetric_schemes_reverse() {
    let (system, start) = chain(6, true);
    for method in explicit().filter(|method| method.facts().is_symmetric) {
        let mut state = start.clone();
        run(method, &system, &mut state, 0.1, 50);
        state.p.iter_mut().for_each(|p| *p = -*p);
        run(method, &system, &mut state, 0.1, 50);
        state.p.iter_mut().for_each(|p| *p = -*p);
        state.t = start.t;
        assert_close(&state, &start, 1e-9, method.name());
    }
}

#[test]
fn energy_is_bounded_over_long_runs_and_joined_steps_are_single_steps() {
    let (system, start) = chain(6, true);
    let omega = highest_frequency(&system, &start).unwrap().omega;
    let options = SolverOptions { ledger: false, ..SolverOptions::default() };
    let mut stepper = vi_solvers::stepper(&Method::StormerVerlet, &system, &options).unwrap();
    let energy = |state: &State| {
        let x = system.positions(state);
        let mut energies = vi_solvers::Assembler::new(&system);
        kinetic_energy(&system, state) + energies.energies(&x, 0.0).total()
    };
    let (mut state, first, h) = (start.clone(), energy(&start), 0.2 / omega);
    let mut farthest = [0.0_f64; 2];
    for block in 0..1000 {
        let mut joined = state.clone();
        if block == 0 {
            // With a ledger, steps take the ordinary path.
            let options = SolverOptions { ledger: true, ..SolverOptions::default() };
            let mut single = vi_solvers::stepper(&Method::StormerVerlet, &system, &options).unwrap();
            stepper.steps(&system, &mut joined, h, 100).unwrap();
            for _ in 0..100 {
                single.step(&system, &mut state, h).unwrap();
            }
            assert!(joined.q == state.q && joined.p == state.p);
        } else {
            stepper.steps(&system, &mut joined, h, 100).unwrap();
        }
        state = joined;
        let half = &mut farthest[block / 500];
        *half = half.max((energy(&state) - first).abs());
    }
    assert!(farthest[0] < 0.02 * first && farthest[1] < 1.5 * farthest[0], "{farthest:?} of {first}");
}

#[test]
fn free_fall_is_exactly_that_of_lumped_mass() {
    let (lumped, start) = falling_chain(7);
    let filter = mass_filter(&lumped, &lumped.positions(&start)).unwrap();
    let (filtered, _) = falling_chain(7);
    let filtered = filtered.with_filter(filter).unwrap();
    let thrown = |system: &System| {
        let v: Vec<f64> = (0..21).map(|dof| [3.0, -2.0, 5.0][dof % 3]).collect();
        let mut state = system.state(0.0, &lumped.positions(&start), &v).unwrap();
        run(Method::StormerVerlet, system, &mut state, 1e-3, 200);
        state
    };
    let (a, b) = (thrown(&lumped), thrown(&filtered));
    for (a, b) in a.q.iter().zip(&b.q).chain(a.p.iter().zip(&b.p)) {
        assert!((a - b).abs() <= 1e-13 * a.abs().max(1.0), "{a} {b}");
    }
}

/// A bar of linear springs of stiffness k along all axes, with equal masses and halves at its free ends: mode j of n
/// springs is cos πji/n, with λ = (2k/m)(1 − cos πj/n).
const STIFFNESS: f64 = 3.0;
const MASS: f64 = 2.0;

fn bar(springs: usize) -> (System, MassFilter) {
    let jet = |_: usize, x: &[f64; 6]| {
        let mut jet = Jet { energy: 0.0, gradient: [0.0; 6], hessian: [[0.0; 6]; 6] };
        for i in 0..6 {
            jet.hessian[i][i] = STIFFNESS;
            jet.hessian[i][(i + 3) % 6] = -STIFFNESS;
            jet.gradient[i] = STIFFNESS * (x[i] - x[(i + 3) % 6]);
            jet.energy += 0.5 * jet.gradient[i] * x[i];
        }
        jet
    };
    let nodes = (1..=springs as u32).flat_map(|b| [b - 1, b]).collect();
    let term = Term { name: "springs", block: 3, nodes, hessian: HessianKind::Constant, jet };
    let mass = |dof: usize| if (1..springs).contains(&(dof / 3)) { MASS } else { 0.5 * MASS };
    let count = 3 * (springs + 1);
    let mass = (0..count).map(mass).collect();
    let system = System::new(mass, vec![Box::new(term)], Coordinates::all_free(count)).unwrap();
    let filter = mass_filter(&system, &vec![0.0; count]).unwrap();
    (system.with_filter(filter.clone()).unwrap(), filter)
}

fn mode(springs: usize, j: usize) -> (f64, Vec<f64>) {
    let kappa = PI * j as f64 / springs as f64;
    let shape = (0..3 * (springs + 1)).map(|dof| (kappa * (dof / 3) as f64).cos() * (1 + dof % 3) as f64);
    (2.0 * STIFFNESS / MASS * (1.0 - kappa.cos()), shape.collect())
}

#[test]
fn every_wave_of_a_bar_has_the_frequency_of_the_polynomial() {
    let springs = 12;
    let (system, filter) = bar(springs);
    let h = 0.3;
    for j in 1..=springs {
        let (lambda, shape) = mode(springs, j);
        let square = lambda * filter.factor(lambda);
        let mut state = State { t: 0.0, q: shape.clone(), p: vec![0.0; shape.len()] };
        let mut stepper = stepper_of(Method::StormerVerlet, &system);
        // A leapfrog step has cos θ = 1 − ω²h²/2.
        let theta = (1.0 - 0.5 * square * h * h).acos();
        for step in 1..=40 {
            stepper.step(&system, &mut state, h).unwrap();
            let amplitude = (theta * f64::from(step)).cos();
            for (q, shape) in state.q.iter().zip(&shape) {
                assert!((q - amplitude * shape).abs() < 1e-11, "mode {j}: {q} {}", amplitude * shape);
            }
        }
    }
}

/// The polynomial is that of the highest eigenvalue of the bar, 4k/m, to round-off: no start of a search and no numbering enters the
/// motion.
#[test]
fn the_polynomial_is_that_of_the_highest_eigenvalue() {
    for springs in [1, 2, 5, 40, 200] {
        let (_, filter) = bar(springs);
        let exact = MassFilter::new(&Coordinates::all_free(3), &[1.0; 3], &[]);
        let exact = exact.with_highest(4.0 * STIFFNESS / MASS);
        for lambda in [0.1, 1.0, 6.0] {
            let (found, wanted) = (filter.factor(lambda), exact.factor(lambda));
            assert!((found - wanted).abs() < 1e-11, "{springs} springs, λ = {lambda}: {found} {wanted}");
        }
    }
}

#[test]
fn the_limit_is_that_of_the_highest_filtered_wave() {
    let springs = 40;
    let (system, filter) = bar(springs);
    let squares = (1..=springs).map(|j| mode(springs, j).0).map(|lambda| lambda * filter.factor(lambda));
    let highest = squares.fold(0.0, f64::max).sqrt();
    let at_rest = State { t: 0.0, q: vec![0.0; 3 * (springs + 1)], p: vec![0.0; 3 * (springs + 1)] };
    let found = highest_frequency(&system, &at_rest).unwrap().omega;
    assert!(found > (1.0 - 1e-6) * highest && found < 1.011 * highest, "{found} {highest}");
    // Lumped mass alone allows steps that are shorter by this factor.
    assert!(2.0 * (STIFFNESS / MASS).sqrt() / highest > 2.8, "{highest}");
    for (share, is_stable) in [(0.995, true), (1.005, false)] {
        let q: Vec<f64> = (0..at_rest.q.len()).map(|k| 1e-3 * (k as f64 * 1.7).sin()).collect();
        let mut state = State { q, ..at_rest.clone() };
        run(Method::StormerVerlet, &system, &mut state, 2.0 * share / highest, 2000);
        let largest = state.q.iter().fold(0.0_f64, |most, q| most.max(q.abs()));
        assert!((largest < 1.0) == is_stable, "{share}: {largest:e}");
    }
}

#[test]
fn steps_keep_the_symplectic_form() {
    // The system is linear, so the step is a matrix S with SᵀJ S = J.
    let (system, _) = bar(3);
    let n = 12;
    let columns: Vec<Vec<f64>> = (0..2 * n)
        .map(|k| {
            let unit = |i: usize| f64::from(i == k);
            let mut state =
                State { t: 0.0, q: (0..n).map(unit).collect(), p: (n..2 * n).map(unit).collect() };
            run(Method::StormerVerlet, &system, &mut state, 0.7, 1);
            state.q.into_iter().chain(state.p).collect()
        })
        .collect();
    for (i, a) in columns.iter().enumerate() {
        for (j, b) in columns.iter().enumerate() {
            let form: f64 = (0..n).map(|k| a[k] * b[n + k] - a[n + k] * b[k]).sum();
            let wanted = f64::from(i + n == j) - f64::from(j + n == i);
            assert!((form - wanted).abs() < 1e-13, "{i} {j}: {form}");
        }
    }
}

#[test]
fn what_it_does_not_support_is_refused_by_name() {
    let (system, _) = chain(4, false);
    for method in Method::ALL.into_iter().filter(|method| !explicit().any(|other| other == *method)) {
        let error = stepper(&method, &system, &SolverOptions::default()).err().unwrap();
        assert!(matches!(error, SolverError::FilteredMass { .. }), "{error}");
        assert!(error.to_string().contains("stormer-verlet"), "{error}");
    }
    let (moving, _) = crate::bodies::moving_chain(4);
    let at_rest: Vec<f64> = (0..12).map(|dof| if dof % 3 == 0 { f64::from(dof / 3) } else { 0.0 }).collect();
    let filter = mass_filter(&moving, &at_rest).unwrap();
    let error = moving.with_filter(filter).err().unwrap().to_string();
    assert!(error.contains("supports move"), "{error}");
}
