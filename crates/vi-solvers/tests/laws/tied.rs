//! Tests the laws of tied nodes: gradients and Hessians are pulled back as by the dense oracle, every scheme agrees
//! with the oracle, and momenta of tied bodies are conserved.

use crate::springs::{Springs, block, deformed, fixed};
use vi_core::{
    Combination, Coordinates, CoreError, Scheme, State, System, TiedMass, angular_momentum, kinetic_energy,
    linear_momentum, reference,
};
use vi_solvers::{Assembler, HessianEvaluation, Method, SolverOptions, stepper};

fn tie(node: u32, terms: &[(u32, f64)], mass: TiedMass) -> Combination {
    Combination { node, terms: terms.to_vec(), mass }
}

/// Returns two boxes of springs. A corner of the second is tied to a face of the first, one node is sewn to a node of
/// the first, and one is tied to the sewn node.
fn riding(held: Vec<u32>) -> (System, Vec<f64>) {
    let (first, nodes) = block([2, 1, 1]);
    let n = first.len() as u32 / 3;
    let mut x = first.clone();
    x.extend(first.chunks(3).flat_map(|p| [p[0] + 0.4, p[1] + 1.0, p[2] + 0.3]));
    let stencils: Vec<u32> = nodes.iter().copied().chain(nodes.iter().map(|node| node + n)).collect();
    let ties = [
        tie(n, &[(2, 0.5), (3, 0.2), (6, 0.3)], TiedMass::Lumped),
        tie(n + 1, &[(7, 1.0)], TiedMass::Exact),
        tie(n + 5, &[(n + 1, 0.25), (n + 4, 0.75)], TiedMass::Lumped),
    ];
    let coordinates =
        Coordinates::new(x.len(), fixed(&x, held)).unwrap().with_combinations(&ties, &[]).unwrap();
    let mass = (0..x.len()).map(|k| 1.0 + 0.1 * (k / 3) as f64).collect();
    let term = Springs::new(4, stencils, 1.0, &x);
    (System::new(mass, vec![Box::new(term)], coordinates).unwrap(), x)
}

/// Returns two boxes of springs, each with a corner at a corner of a cube that deforms homogeneously: x = c + X₁ d₁ +
/// X₂ d₂ + X₃ d₃ about its centre.
fn on_directors() -> (System, State) {
    let (first, nodes) = block([1, 1, 1]);
    let n = first.len() as u32 / 3;
    let mut x = first.clone();
    x.extend(first.chunks(3).flat_map(|p| [p[0] + 3.0, p[1], p[2]]));
    let stencils: Vec<u32> = nodes.iter().copied().chain(nodes.iter().map(|node| node + n)).collect();
    let c = 2 * n;
    x.extend([2.0, 0.5, 0.5, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]);
    let directors = [c + 1, c + 2, c + 3];
    let ties: Vec<Combination> = (0..n)
        .filter(|&node| first[3 * node as usize] == 1.0)
        .flat_map(|node| [node, node + n - 4])
        .map(|node| {
            let at = |k: usize| x[3 * node as usize + k] - x[3 * c as usize + k];
            tie(node, &[(c, 1.0), (c + 1, at(0)), (c + 2, at(1)), (c + 3, at(2))], TiedMass::Exact)
        })
        .collect();
    let coordinates =
        Coordinates::new(x.len(), vec![]).unwrap().with_combinations(&ties, &directors).unwrap();
    let term = Springs::new(4, stencils, 1.0, &x);
    let mass = vec![0.7; x.len()];
    let system = System::new(mass, vec![Box::new(term)], coordinates).unwrap();
    let v: Vec<f64> = (0..x.len()).map(|k| 0.3 * (1.3 * k as f64).sin()).collect();
    let start = deformed(&x, 0.05);
    let state = system.state(0.0, &start, &v).unwrap();
    (system, state)
}

#[test]
fn sums_are_pulled_back_as_the_oracle_does() {
    let partly = vec![6, 9, 10, 11, 21];
    for (system, x) in [riding(vec![]), riding(partly)] {
        let start = system.state(0.0, &deformed(&x, 0.1), &x).unwrap();
        let x = system.positions(&start);
        let (gradient, hessian) =
            (reference::gradient(&system, &x, 0.0), reference::hessian(&system, &x, 0.0));
        let mut assembler = Assembler::new(&system);
        let mut out = vec![0.0; x.len()];
        assembler.gradient(&x, 0.0, &mut out);
        let free = system.coordinates().free();
        let scale = gradient.iter().fold(0.0_f64, |m, g| m.max(g.abs()));
        assert!(out.iter().zip(&gradient).all(|(a, b)| (a - b).abs() <= 1e-13 * scale));
        let sparse = assembler.hessian(&x, 0.0, HessianEvaluation::Exact).unwrap();
        for (j, &column) in free.iter().enumerate() {
            let mut unit = vec![0.0; free.len()];
            unit[j] = 1.0;
            let mut product = unit.clone();
            sparse.multiply(&unit, &mut product);
            for (i, &row) in free.iter().enumerate() {
                let expected = hessian[(row as usize, column as usize)];
                assert!((product[i] - expected).abs() < 1e-12 * hessian.amax(), "({row}, {column})");
            }
        }
    }
}

#[test]
fn hessians_are_derivatives_of_gradients_through_the_ties() {
    let (system, start) = on_directors();
    let gradient = |q: &[f64]| {
        let x = system.positions(&State { t: 0.0, q: q.to_vec(), p: start.p.clone() });
        let mut out = vec![0.0; q.len()];
        system.coordinates().restrict(&reference::gradient(&system, &x, 0.0), &mut out);
        out
    };
    let x = system.positions(&start);
    let mut assembler = Assembler::new(&system);
    let k = assembler.hessian(&x, 0.0, HessianEvaluation::Exact).unwrap().clone();
    let direction: Vec<f64> = (0..start.q.len()).map(|i| (2.1 * i as f64).cos()).collect();
    let mut product = vec![0.0; start.q.len()];
    k.multiply(&direction, &mut product);
    let at = |s: f64| -> Vec<f64> {
        gradient(&start.q.iter().zip(&direction).map(|(q, d)| q + s * d).collect::<Vec<_>>())
    };
    let (ahead, behind) = (at(1e-5), at(-1e-5));
    for i in 0..product.len() {
        assert!((product[i] - (ahead[i] - behind[i]) / 2e-5).abs() < 1e-6);
    }
}

#[test]
fn every_variational_scheme_is_the_oracles() {
    let (riding, x) = riding(vec![6, 7, 8]);
    let v: Vec<f64> = (0..x.len()).map(|k| 0.2 * (0.9 * k as f64).sin()).collect();
    let riding_state = riding.state(0.0, &deformed(&x, 0.05), &v).unwrap();
    for (system, start) in [(riding, riding_state), on_directors()] {
        for (method, scheme) in [
            (Method::StormerVerlet, Scheme::stormer_verlet()),
            (Method::ImplicitMidpoint, Scheme::implicit_midpoint()),
            (Method::Gauss { stages: 2 }, Scheme::gauss(2).unwrap()),
        ] {
            let options = SolverOptions { tolerance: 1e-14, ..SolverOptions::default() };
            let mut fast = start.clone();
            stepper(&method, &system, &options).unwrap().step(&system, &mut fast, 0.05).unwrap();
            let slow = reference::step(&system, &scheme, &start, 0.05).unwrap();
            let gap = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
            assert!(gap(&fast.q, &slow.q) < 1e-12 && gap(&fast.p, &slow.p) < 1e-12, "{}", method.name());
        }
    }
}

#[test]
fn momenta_of_what_is_tied_are_kept() {
    let (riding, x) = riding(vec![]);
    let v: Vec<f64> = (0..x.len()).map(|k| 0.2 * (0.9 * k as f64).sin()).collect();
    let riding_state = riding.state(0.0, &deformed(&x, 0.05), &v).unwrap();
    for (system, start) in [(riding, riding_state), on_directors()] {
        for method in [Method::StormerVerlet, Method::ImplicitMidpoint, Method::EnergyMomentum] {
            let options = SolverOptions { tolerance: 1e-13, ..SolverOptions::default() };
            let mut stepper = stepper(&method, &system, &options).unwrap();
            let mut state = start.clone();
            let total = |state: &State| {
                kinetic_energy(&system, state) + reference::energy(&system, &system.positions(state), state.t)
            };
            for _ in 0..100 {
                stepper.step(&system, &mut state, 0.05).unwrap();
            }
            let pairs = [
                (linear_momentum(&system, &start), linear_momentum(&system, &state)),
                (angular_momentum(&system, &start), angular_momentum(&system, &state)),
            ];
            for (before, after) in pairs {
                for k in 0..3 {
                    assert!((before[k] - after[k]).abs() < 2e-12, "{}: {before:?} {after:?}", method.name());
                }
            }
            if method == Method::EnergyMomentum {
                assert!((total(&start) - total(&state)).abs() < 1e-11);
            }
        }
    }
}

#[test]
fn ties_that_make_no_sense_are_refused() {
    let all = || Coordinates::new(12, vec![]).unwrap();
    let ring = [tie(0, &[(1, 1.0)], TiedMass::Exact), tie(1, &[(0, 1.0)], TiedMass::Exact)];
    assert!(matches!(all().with_combinations(&ring, &[]), Err(CoreError::Combination { .. })));
    let not_one = [tie(0, &[(1, 0.5), (2, 0.4)], TiedMass::Lumped)];
    assert!(matches!(all().with_combinations(&not_one, &[]), Err(CoreError::Combination { .. })));
    let held = Coordinates::new(12, fixed(&[0.0; 12], vec![1])).unwrap();
    let fine = [tie(0, &[(1, 0.5), (2, 0.5)], TiedMass::Exact)];
    assert!(matches!(held.with_combinations(&fine, &[]), Err(CoreError::Combination { .. })));
    let coupled = all().with_combinations(&fine, &[]).unwrap();
    let error = System::new(vec![1.0; 12], vec![], coupled).err().unwrap();
    assert!(error.to_string().contains("lump its mass"), "{error}");
}
