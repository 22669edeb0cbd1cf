//! Tests that work ends on request within a step or a solve, and leaves no trace.

use std::ops::Range;
use std::sync::Arc;
use std::sync::atomic::{AtomicI64, Ordering};

use crate::bodies::spring;
use vi_core::problems::Term;
use vi_core::{
    Account, Coordinates, Fixed, HessianKind, Potential, Prescribed, State, Stencils, System, Traits,
};
use vi_solvers::{
    Interrupt, LinearSolver, Method, ModeOptions, PathControl, SolverError, SolverOptions, StaticOptions,
    Stepper, equilibrium, modes, path_following, quasi_static, stepper,
};

/// Asks to end the work when the forces have been evaluated for the given number of times.
#[derive(Clone)]
struct Alarm {
    interrupt: Interrupt,
    left: Arc<AtomicI64>,
}

impl Alarm {
    fn new() -> Self {
        Self { interrupt: Interrupt::new(), left: Arc::new(AtomicI64::new(i64::MAX)) }
    }

    fn set(&self, evaluations: i64) {
        self.interrupt.withdraw();
        self.left.store(evaluations, Ordering::SeqCst);
    }

    fn tick(&self) {
        if self.left.fetch_sub(1, Ordering::SeqCst) == 1 {
            self.interrupt.ask();
        }
    }
}

const NODES: usize = 8;

/// V = 3 t z of each node; an evaluation of its gradients counts for the alarm.
struct Weight {
    nodes: Vec<u32>,
    alarm: Alarm,
}

impl Potential for Weight {
    fn name(&self) -> &str {
        "weight"
    }
    fn account(&self) -> Account {
        Account::Load
    }
    fn stencils(&self) -> Stencils<'_> {
        Stencils { arity: 1, block: 3, nodes: &self.nodes }
    }
    fn traits(&self) -> Traits {
        Traits { hessian: HessianKind::Zero, time_dependent: true }
    }
    fn energies(&self, range: Range<usize>, x: &[f64], t: f64, out: &mut [f64]) {
        (0..range.len()).for_each(|k| out[k] = 3.0 * t * x[3 * k + 2]);
    }
    fn gradients(&self, range: Range<usize>, _x: &[f64], t: f64, out: &mut [f64]) {
        self.alarm.tick();
        (0..3 * range.len()).for_each(|k| out[k] = if k % 3 == 2 { 3.0 * t } else { 0.0 });
    }
    fn hessians(&self, range: Range<usize>, _x: &[f64], _t: f64, out: &mut [f64]) {
        out[..6 * range.len()].fill(0.0);
    }
}

/// Returns a chain of springs that is held at both ends and stretched, with a weight that grows with time.
fn chain(alarm: &Alarm) -> (System, State) {
    let springs = Term {
        name: "springs",
        block: 3,
        nodes: (1..NODES as u32).flat_map(|b| [b - 1, b]).collect(),
        hessian: HessianKind::Varying,
        jet: |_, x: &[f64; 6]| spring(x, 100.0, 0.5),
    };
    let weight = Weight { nodes: (1..NODES as u32 - 1).collect(), alarm: alarm.clone() };
    let x: Vec<f64> = (0..3 * NODES).map(|dof| if dof % 3 == 0 { (dof / 3) as f64 } else { 0.0 }).collect();
    let last = 3 * NODES as u32 - 3;
    let held = |first: u32| Prescribed {
        dofs: (first..first + 3).collect(),
        path: Box::new(Fixed(x[first as usize..first as usize + 3].to_vec())),
    };
    let coordinates = Coordinates::new(3 * NODES, vec![held(0), held(last)]).unwrap();
    let terms: Vec<Box<dyn Potential>> = vec![Box::new(springs), Box::new(weight)];
    let system = System::new(vec![1.0; 3 * NODES], terms, coordinates).unwrap();
    let v: Vec<f64> = (0..3 * NODES).map(|dof| (0.7 * dof as f64).sin()).collect();
    let state = system.state(0.0, &x, &v).unwrap();
    (system, state)
}

/// Makes steps, of which the alarm may interrupt the third; then it is made again. Returns the end, and whether the step was
/// interrupted.
fn run(
    make: &dyn Fn(&System, &Interrupt) -> Box<dyn Stepper>,
    h: f64,
    evaluations: i64,
    name: &str,
) -> (State, bool) {
    let alarm = Alarm::new();
    let (system, mut state) = chain(&alarm);
    let mut stepper = make(&system, &alarm.interrupt);
    let mut was_interrupted = false;
    for step in 0..4 {
        let (before, memory) = (state.clone(), stepper.memory());
        if step == 2 {
            alarm.set(evaluations);
        }
        let mut made = stepper.step(&system, &mut state, h);
        if let Err(error) = &made {
            assert!(error.is_interruption() && !error.smaller_step_may_help(), "{name}: {error}");
            assert_eq!(state, before, "{name}: {evaluations}");
            was_interrupted = true;
            alarm.set(i64::MAX);
            stepper.restore(&system, &memory).unwrap();
            made = stepper.step(&system, &mut state, h);
        }
        made.unwrap_or_else(|error| panic!("{name}: {evaluations}: {error}"));
        alarm.set(i64::MAX);
    }
    (state, was_interrupted)
}

/// Checks the law of this test for interruptions after every number of evaluations, until a step ends before them.
fn assert_no_trace(make: &dyn Fn(&System, &Interrupt) -> Box<dyn Stepper>, h: f64, name: &str) {
    let (whole, _) = run(make, h, i64::MAX, name);
    let mut interruptions = 0;
    for evaluations in 1.. {
        let (end, was_interrupted) = run(make, h, evaluations, name);
        assert_eq!(end, whole, "{name}: {evaluations}");
        if !was_interrupted {
            break;
        }
        interruptions += 1;
    }
    assert!(interruptions > 1, "{name}: {interruptions} interruptions");
}

#[test]
fn an_interrupted_step_leaves_no_trace() {
    let implicit = Method::ALL.into_iter().filter(|method| !method.facts().is_explicit);
    for method in implicit.chain([Method::Gauss { stages: 1 }, Method::Gauss { stages: 3 }]) {
        for linear in [LinearSolver::Cholesky, LinearSolver::Pcg] {
            let make = |system: &System, interrupt: &Interrupt| {
                let interrupt = interrupt.clone();
                let options = SolverOptions { linear, interrupt, tolerance: 1e-8, ..Default::default() };
                stepper(&method, system, &options).unwrap()
            };
            assert_no_trace(&make, 0.2, &format!("{}, {}", method.name(), linear.name()));
        }
    }
}

#[test]
fn an_interrupted_load_step_leaves_no_trace() {
    for linear in [LinearSolver::Cholesky, LinearSolver::Pcg] {
        let make = |system: &System, interrupt: &Interrupt| {
            let options = StaticOptions { linear, interrupt: interrupt.clone(), ..Default::default() };
            quasi_static(system, options, true)
        };
        assert_no_trace(&make, 0.2, linear.name());
    }
    let make = |system: &System, interrupt: &Interrupt| {
        let options = StaticOptions {
            increment: 0.1,
            largest_increment: 0.1,
            arc_steps: Some(5),
            interrupt: interrupt.clone(),
            ..Default::default()
        };
        path_following(system, options, PathControl::Arc, false).unwrap()
    };
    assert_no_trace(&make, 0.1, "arc");
}

/// A search for an equilibrium that was interrupted gives this reason, not the increments that it could not make.
#[test]
fn an_interrupted_search_says_so() {
    for evaluations in (1..200).step_by(7) {
        for arc_steps in [None, Some(50)] {
            let alarm = Alarm::new();
            let (system, mut state) = chain(&alarm);
            state.p.fill(0.0);
            let before = state.clone();
            alarm.set(evaluations);
            let options = StaticOptions {
                increment: 0.05,
                largest_increment: 0.05,
                arc_steps,
                interrupt: alarm.interrupt.clone(),
                ..Default::default()
            };
            match equilibrium(&system, &mut state, &options) {
                Err(error) => {
                    assert_eq!(error, SolverError::Interrupted);
                    assert_eq!(state, before);
                }
                Ok(_) => assert!(evaluations > 20, "{evaluations}"),
            }
        }
    }
}

#[test]
fn an_interrupted_search_for_modes_says_so() {
    let alarm = Alarm::new();
    let (system, state) = chain(&alarm);
    let options = ModeOptions { count: 3, interrupt: alarm.interrupt.clone(), ..Default::default() };
    assert!(modes(&system, &state, Vec::new(), &options).is_ok());
    alarm.interrupt.ask();
    assert_eq!(modes(&system, &state, Vec::new(), &options).unwrap_err(), SolverError::Interrupted);
    alarm.interrupt.withdraw();
    assert!(modes(&system, &state, Vec::new(), &options).is_ok());
}

/// A request that cannot be made never stands; clones share theirs, and are equal.
#[test]
fn clones_share_a_request() {
    Interrupt::NEVER.ask();
    assert!(!Interrupt::NEVER.is_asked() && !Interrupt::default().is_possible());
    let (one, other) = (Interrupt::new(), Interrupt::new());
    let same = one.clone();
    assert!(one == same && one != other && one != Interrupt::NEVER);
    one.ask();
    assert!(same.is_asked() && same.check() == Err(SolverError::Interrupted) && !other.is_asked());
    same.withdraw();
    assert!(!one.is_asked());
}
