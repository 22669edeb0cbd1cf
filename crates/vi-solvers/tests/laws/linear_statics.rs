//! Tests equilibria of bodies whose tangent is the same everywhere: one factor serves all load steps.

use std::ops::Range;

use vi_core::{Account, Coordinates, HessianKind, Potential, State, Stencils, System, Traits};
use vi_solvers::{StaticOptions, Stepper, quasi_static};

const STIFFNESS: f64 = 3.0;
const LOAD: f64 = 0.6;

/// V = ½ k x² − t P x, whose Hessian is declared as constant or not.
struct Spring(HessianKind);

impl Potential for Spring {
    fn name(&self) -> &str {
        "spring"
    }
    fn account(&self) -> Account {
        Account::Elastic
    }
    fn stencils(&self) -> Stencils<'_> {
        Stencils { arity: 1, block: 1, nodes: &[0] }
    }
    fn traits(&self) -> Traits {
        Traits { hessian: self.0, time_dependent: true }
    }
    fn energies(&self, _: Range<usize>, x: &[f64], t: f64, out: &mut [f64]) {
        out[0] = 0.5 * STIFFNESS * x[0] * x[0] - t * LOAD * x[0];
    }
    fn gradients(&self, _: Range<usize>, x: &[f64], t: f64, out: &mut [f64]) {
        out[0] = STIFFNESS * x[0] - t * LOAD;
    }
    fn hessians(&self, _: Range<usize>, _: &[f64], _: f64, out: &mut [f64]) {
        out[0] = STIFFNESS;
    }
}

fn system(hessian: HessianKind) -> System {
    System::new(vec![1.0], vec![Box::new(Spring(hessian))], Coordinates::all_free(1)).unwrap()
}

fn stepper(system: &System) -> Box<dyn Stepper> {
    quasi_static(system, StaticOptions::default(), true)
}

/// Makes ten load steps, and checks each equilibrium. Continues with a new stepper after half of them if `stops`. Returns the numbers of
/// factors and of Hessians.
fn counts(hessian: HessianKind, stops: bool) -> [u64; 2] {
    let system = system(hessian);
    let mut state = State { t: 0.0, q: vec![0.0], p: vec![0.0] };
    let mut run = stepper(&system);
    let mut counts = [0; 2];
    for step in 1..=10 {
        if stops && step == 6 {
            let memory = run.memory();
            run = stepper(&system);
            run.restore(&system, &memory).unwrap();
        }
        let work = run.step(&system, &mut state, 0.1).unwrap().work;
        counts = [counts[0] + work.factorizations, counts[1] + work.hessians];
        let exact = 0.1 * f64::from(step) * LOAD / STIFFNESS;
        assert!((state.q[0] - exact).abs() < 1e-12, "{step}: {} instead of {exact}", state.q[0]);
    }
    counts
}

#[test]
fn one_factor_serves_all_load_steps() {
    assert_eq!(counts(HessianKind::Constant, false), [1, 1]);
    let [factors, _] = counts(HessianKind::Varying, false);
    assert!(factors >= 10, "{factors}");
}

/// A run that is continued makes the factor again, but counts what a run without interruption counts.
#[test]
fn a_continued_run_counts_the_factor_once() {
    assert_eq!(counts(HessianKind::Constant, true), [1, 1]);
}
