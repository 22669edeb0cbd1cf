//! Tests the sums over stencils against entry-by-entry sums. They give the same bits on any number of threads, and
//! evaluate nothing that cannot have changed.

use crate::springs::{Springs, block, block_system, deformed, dense, fixed};
use vi_core::{Account, Coordinates, HessianKind, Potential, Stencils, System, Traits};
use vi_solvers::{Assembler, HessianEvaluation, SymmetricMatrix};

/// Compares the free part of a dense matrix with a sparse one, column by column.
fn assert_same_matrix(system: &System, sparse: &SymmetricMatrix, dense: &[Vec<f64>]) {
    let free = system.coordinates().free();
    assert_eq!(sparse.free_count(), free.len());
    let scale = dense.iter().flatten().fold(0.0_f64, |m, v| m.max(v.abs()));
    for (j, &dof) in free.iter().enumerate() {
        let mut unit = vec![0.0; free.len()];
        let mut column = unit.clone();
        unit[j] = 1.0;
        sparse.multiply(&unit, &mut column);
        for (i, &row) in free.iter().enumerate() {
            let expected = dense[row as usize][dof as usize];
            assert!((column[i] - expected).abs() < 1e-13 * scale, "({row}, {dof})");
        }
    }
}

fn check(system: &System, x: &[f64]) {
    let (energy, gradient, hessian) = dense(system, x, 0.3);
    let mut assembler = Assembler::new(system);
    let mut out = vec![f64::NAN; x.len()];
    for _ in 0..2 {
        assert!((assembler.energies(x, 0.3).total() - energy).abs() <= 1e-13 * energy.abs());
        assembler.gradient(x, 0.3, &mut out);
        let scale = gradient.iter().fold(0.0_f64, |m, v| m.max(v.abs()));
        assert!(out.iter().zip(&gradient).all(|(a, b)| (a - b).abs() <= 1e-13 * scale));
        assert_same_matrix(system, assembler.hessian(x, 0.3, HessianEvaluation::Exact).unwrap(), &hessian);
    }
}

#[test]
fn sums_agree_with_entry_by_entry_sums() {
    let (system, x) = block_system([9, 3, 3], true);
    check(&system, &deformed(&x, 0.1));
    let (system, x) = block_system([5, 4, 1], false);
    check(&system, &deformed(&x, 0.1));
}

#[test]
fn axes_can_be_prescribed_one_by_one() {
    let (x, nodes) = block([3, 3, 3]);
    let count = x.len() as u32;
    let dofs = (0..count).filter(|dof| dof % 7 == 0 || dof % 3 == 2).collect();
    let coordinates = Coordinates::new(x.len(), fixed(&x, dofs)).unwrap();
    let term = Springs::new(4, nodes, 2.0, &x);
    let system = System::new(vec![1.0; x.len()], vec![Box::new(term)], coordinates).unwrap();
    check(&system, &deformed(&x, 0.1));
}

#[test]
fn terms_of_different_arity_and_repeated_nodes_share_a_matrix() {
    let (x, nodes) = block([3, 2, 2]);
    let pairs = Springs::new(2, vec![0, 11, 5, 30, 7, 7], 3.0, &x);
    let many = Springs::new(9, vec![1, 2, 3, 5, 8, 13, 21, 34, 13], 0.1, &x);
    let tets = Springs::new(4, nodes, 1.0, &x);
    let terms: Vec<Box<dyn Potential>> = vec![Box::new(pairs), Box::new(tets), Box::new(many)];
    let system = System::new(vec![1.0; x.len()], terms, Coordinates::all_free(x.len())).unwrap();
    check(&system, &deformed(&x, 0.2));
}

#[test]
fn bits_do_not_depend_on_threads() {
    let (system, x) = block_system([24, 6, 6], true);
    let x = deformed(&x, 0.1);
    let run = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let mut assembler = Assembler::new(&system);
            let energy = assembler.energies(&x, 0.0).total();
            let mut gradient = vec![0.0; x.len()];
            assembler.gradient(&x, 0.0, &mut gradient);
            let hessian = assembler.hessian(&x, 0.0, HessianEvaluation::Exact).unwrap();
            let n = hessian.free_count();
            let mut product = vec![0.0; n];
            hessian.multiply(&gradient[gradient.len() - n..], &mut product);
            (energy.to_bits(), gradient.into_iter().chain(product).map(f64::to_bits).collect::<Vec<_>>())
        })
    };
    let one = run(1);
    assert!(one == run(2) && one == run(8));
}

#[test]
fn energies_are_right_to_the_last_bits() {
    // Alternating huge and small terms whose exact sum is known.
    struct Terms(Vec<u32>);
    impl Potential for Terms {
        fn name(&self) -> &str {
            "terms"
        }
        fn account(&self) -> Account {
            Account::Load
        }
        fn stencils(&self) -> Stencils<'_> {
            Stencils { arity: 1, block: 1, nodes: &self.0 }
        }
        fn traits(&self) -> Traits {
            Traits { hessian: HessianKind::Zero, time_dependent: false }
        }
        fn energies(&self, range: std::ops::Range<usize>, _x: &[f64], _t: f64, out: &mut [f64]) {
            for (k, out) in range.zip(out) {
                *out = if k % 2 == 0 { 1e12 } else { -1e12 } + (k / 2) as f64 * 2_f64.powi(-10);
            }
        }
        fn gradients(&self, _: std::ops::Range<usize>, _x: &[f64], _t: f64, out: &mut [f64]) {
            out.fill(0.0);
        }
        fn hessians(&self, _: std::ops::Range<usize>, _x: &[f64], _t: f64, out: &mut [f64]) {
            out.fill(0.0);
        }
    }
    let count = 40_000_u32;
    let term = Terms((0..count).collect());
    let system =
        System::new(vec![1.0; count as usize], vec![Box::new(term)], Coordinates::all_free(count as usize));
    let system = system.unwrap();
    let x = vec![0.0; count as usize];
    let half = f64::from(count) / 2.0;
    let exact = half * (half - 1.0) * 2_f64.powi(-10);
    assert_eq!(Assembler::new(&system).energies(&x, 0.0).load, exact);
}

#[test]
fn what_is_fixed_is_evaluated_once() {
    // Two boxes, the second of which is fixed as a whole.
    let (x, nodes) = block([4, 4, 4]);
    let shift = x.len() as u32 / 3;
    let other = nodes.iter().map(|node| node + shift).collect::<Vec<_>>();
    let both: Vec<f64> = x.iter().chain(&x).copied().collect();
    let coordinates = Coordinates::new(both.len(), fixed(&both, (3 * shift..6 * shift).collect())).unwrap();
    let terms: Vec<Box<dyn Potential>> =
        vec![Box::new(Springs::new(4, nodes, 1.0, &both)), Box::new(Springs::new(4, other, 1.0, &both))];
    let system = System::new(vec![1.0; both.len()], terms, coordinates).unwrap();
    let mut assembler = Assembler::new(&system);
    let mut out = vec![0.0; both.len()];
    assembler.gradient(&both, 0.0, &mut out);
    assert_eq!(assembler.work().constant_stencils, 384);
    assembler.hessian(&both, 0.0, HessianEvaluation::Exact).unwrap();
    assert_eq!(assembler.work().hessian_skipped_stencils, 384);
    check(&system, &deformed(&both, 0.0));
}

#[test]
fn a_fault_names_the_first_stencil() {
    let (system, mut x) = block_system([3, 3, 3], false);
    let assembler = Assembler::new(&system);
    assert!(assembler.fault(&x, 0.0).is_none());
    x[3 * 20] = f64::NAN;
    let fault = assembler.fault(&x, 0.0).unwrap();
    let stencils = system.potentials()[0].stencils();
    let first = (0..stencils.count()).find(|&s| stencils.of(s).contains(&20)).unwrap();
    assert_eq!((&*fault.term, fault.fault.element), ("springs", 7 * first));
}

#[test]
fn mean_deformations_sum_over_the_stencils_of_a_node() {
    let (system, x) = block_system([6, 4, 4], false);
    let mut sums = vec![[0.0; 9]; x.len() / 3];
    assert!(Assembler::new(&system).mean_deformations(&x, &mut sums));
    let stencils = system.potentials()[0].stencils();
    let mut expected = vec![[0.0; 9]; x.len() / 3];
    for stencil in 0..stencils.count() {
        for &node in stencils.of(stencil) {
            for k in 0..9 {
                expected[node as usize][k] += (stencil + k) as f64;
            }
        }
    }
    assert_eq!(sums, expected);
}
