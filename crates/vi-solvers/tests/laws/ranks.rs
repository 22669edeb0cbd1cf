//! Tests that several ranks, here threads, step a system to the bits, counts and errors of one process.

use std::sync::Arc;

use crate::springs::{Springs, block, block_system, deformed, fixed};
use vi_core::{Alone, Coordinates, Exchange, State, System, ThreadRank};
use vi_solvers::{Conductor, Member, Method, SolverError, SolverOptions, Stepper};

/// A byte string that no conductor sends.
const END: &[u8] = b"end";

/// Calls `conduct` with the stepper of `size` ranks for a system.
fn on_ranks<R: Send>(
    size: usize,
    (method, system, start): (&Method, &System, &State),
    conduct: impl FnOnce(&mut Conductor) -> R + Send,
) -> R {
    std::thread::scope(|scope| {
        let mut crew = ThreadRank::crew(size).into_iter().map(|rank| Arc::new(rank) as Arc<dyn Exchange>);
        let first = crew.next().unwrap();
        for rank in crew {
            scope.spawn(move || {
                let member = Member::new(system, start, (method, false), Arc::clone(&rank)).unwrap();
                let mut members = [Some(member)];
                loop {
                    let bytes = &rank.pieces(&[])[0];
                    if bytes == END {
                        return;
                    }
                    assert!(Member::obey(&mut members, bytes));
                }
            });
        }
        let alone = alone(method, system);
        let (component, run) = ((0, system, start), (method, false));
        let mut conductor = Conductor::new(alone, component, run, Arc::clone(&first)).unwrap();
        let result = conduct(&mut conductor);
        first.pieces(END);
        result
    })
}

fn alone(method: &Method, system: &System) -> Box<dyn Stepper> {
    let options = SolverOptions { ledger: false, ..SolverOptions::default() };
    vi_solvers::stepper(method, system, &options).unwrap()
}

fn explicit() -> impl Iterator<Item = Method> {
    Method::ALL.into_iter().filter(|method| method.facts().is_explicit && method.facts().is_variational())
}

fn clamped_block() -> (System, State) {
    let (system, x) = block_system([9, 4, 3], true);
    let state = system.state(0.0, &deformed(&x, 0.05), &deformed(&vec![0.0; x.len()], 0.3)).unwrap();
    (system, state)
}

#[test]
fn ranks_step_to_the_bits_of_one_process() {
    let (system, start) = clamped_block();
    for method in explicit() {
        let run = |stepper: &mut dyn Stepper| {
            let mut state = start.clone();
            for count in [1, 16, 1, 1, 5] {
                match count {
                    1 => stepper.step(&system, &mut state, 0.02).map(drop).unwrap(),
                    _ => stepper.steps(&system, &mut state, 0.02, count).map(drop).unwrap(),
                }
            }
            (state, stepper.work(), stepper.memory())
        };
        let expected = run(alone(&method, &system).as_mut());
        // There are eight or more chunks; the last of eleven ranks may have none.
        for size in [1, 2, 3, 4, 11] {
            let found = on_ranks(size, (&method, &system, &start), |conductor| run(conductor));
            assert_eq!(found, expected, "{} on {size} ranks", method.name());
        }
    }
}

#[test]
fn several_terms_share_their_nodes() {
    let (x, nodes) = block([6, 5, 4]);
    let ends = (0..x.len() as u32 / 3 - 70).flat_map(|node| [node, node + 70]).collect();
    let terms: Vec<Box<dyn vi_core::Potential>> =
        vec![Box::new(Springs::new(4, nodes, 1.0, &x)), Box::new(Springs::new(2, ends, 0.1, &x))];
    let coordinates = Coordinates::new(x.len(), fixed(&x, vec![0, 4, 5, 61])).unwrap();
    let mass = (0..x.len()).map(|k| 1.0 + 0.1 * (k / 3) as f64).collect();
    let system = System::new(mass, terms, coordinates).unwrap();
    let start = system.state(0.0, &deformed(&x, 0.05), &x).unwrap();
    let run = |stepper: &mut dyn Stepper| {
        let mut state = start.clone();
        stepper.steps(&system, &mut state, 0.01, 20).unwrap();
        state
    };
    let expected = run(alone(&Method::StormerVerlet, &system).as_mut());
    let found = on_ranks(4, (&Method::StormerVerlet, &system, &start), |conductor| run(conductor));
    assert_eq!(found, expected);
}

#[test]
fn a_run_goes_on_with_any_number_of_ranks() {
    let (system, start) = clamped_block();
    let method = Method::BlanesMoan4;
    let half = |stepper: &mut dyn Stepper, state: &mut State| {
        stepper.steps(&system, state, 0.02, 7).unwrap();
        stepper.memory()
    };
    let mut expected = start.clone();
    let mut stepper = alone(&method, &system);
    half(stepper.as_mut(), &mut expected);
    let end = half(stepper.as_mut(), &mut expected);
    for sizes in [[4, 2], [1, 3], [3, 1]] {
        let mut state = start.clone();
        let place = (&method, &system, &start);
        let memory = on_ranks(sizes[0], place, |conductor| half(conductor, &mut state));
        let found = on_ranks(sizes[1], place, |conductor| {
            conductor.restore(&system, &memory).unwrap();
            half(conductor, &mut state)
        });
        assert_eq!((&state, &found), (&expected, &end), "{sizes:?}");
        // And in one process.
        let mut stepper = alone(&method, &system);
        stepper.restore(&system, &memory).unwrap();
    }
}

#[test]
fn a_step_that_fails_on_one_rank_fails_as_in_one_process() {
    let (system, mut start) = clamped_block();
    // The nodes at one end, which one rank holds, fly away.
    start.p.iter_mut().rev().take(3).for_each(|p| *p = 1e200);
    let method = Method::StormerVerlet;
    let run = |stepper: &mut dyn Stepper| {
        let mut state = start.clone();
        assert!(stepper.steps(&system, &mut state, 0.02, 4).is_none());
        let error = stepper.step(&system, &mut state, 0.02).unwrap_err();
        assert_eq!(state, start);
        // Good steps are possible afterwards.
        let mut calm = State { p: vec![0.0; start.p.len()], ..start.clone() };
        stepper.step(&system, &mut calm, 0.02).unwrap();
        (error.to_string(), stepper.work(), calm)
    };
    let expected = run(alone(&method, &system).as_mut());
    for size in [2, 4] {
        assert_eq!(on_ranks(size, (&method, &system, &start), |conductor| run(conductor)), expected);
    }
}

#[test]
fn what_ranks_cannot_step_is_refused_by_name() {
    let (system, start) = clamped_block();
    let refused =
        |method: Method, ledger: bool| match Member::new(&system, &start, (&method, ledger), Arc::new(Alone))
        {
            Err(SolverError::Ranks { reason }) => reason,
            _ => panic!("accepted"),
        };
    assert!(refused(Method::ImplicitMidpoint, false).contains("\"implicit-midpoint\" does not run"));
    assert!(refused(Method::StormerVerlet, true).contains("output.ledger = false"));
}
