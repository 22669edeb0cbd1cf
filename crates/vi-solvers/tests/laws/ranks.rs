//! Tests that several ranks, here threads, step a system to the bits, counts and errors of one process.

use std::sync::Arc;

use crate::springs::{Springs, block, block_system, deformed, fixed};
use vi_core::{Coordinates, Exchange, SharedTerms, State, System, ThreadRank};
use vi_solvers::{
    Assembler, LinearSolver, Member, Method, Partners, SolverOptions, Stepper, highest_frequency,
    stepper_of_ranks,
};

/// A byte string that no conductor sends.
const END: &[u8] = b"end";

/// Makes a system and its initial state.
type Make<'a> = &'a (dyn Fn() -> (System, State) + Sync);

/// A scheme, a system, whether to keep the ledger, and the linear solver.
type Place<'a> = (&'a Method, Make<'a>, (bool, LinearSolver));

const PLAIN: (bool, LinearSolver) = (false, LinearSolver::Auto);

/// Calls `conduct` with a system that `size` ranks share, and with its stepper.
fn on_ranks<R: Send>(
    size: usize,
    (method, make, (ledger, linear)): Place<'_>,
    conduct: impl FnOnce(&System, &mut dyn Stepper) -> R + Send,
) -> R {
    let options = &SolverOptions { ledger, linear, ..SolverOptions::default() };
    std::thread::scope(|scope| {
        let mut crew = ThreadRank::crew(size).into_iter().map(|rank| Arc::new(rank) as Arc<dyn Exchange>);
        let first = crew.next().unwrap();
        for rank in crew {
            scope.spawn(move || {
                let (system, start) = make();
                let member = Member::new(&system, &start, (method, options), Arc::clone(&rank)).unwrap();
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
        let (system, start) = make();
        let partners = Partners::new((0, &system, &start), (method, options), Arc::clone(&first)).unwrap();
        let partners = Arc::new(partners);
        let system = system.with_shared(Arc::clone(&partners) as Arc<dyn SharedTerms>);
        let mut stepper = stepper_of_ranks(method, &system, options, &partners).unwrap();
        let result = conduct(&system, stepper.as_mut());
        first.pieces(END);
        result
    })
}

/// Calls `conduct` with a system of one process and its stepper.
fn alone<R>(
    (method, make, (ledger, linear)): Place<'_>,
    conduct: impl FnOnce(&System, &mut dyn Stepper) -> R,
) -> R {
    let (system, _) = make();
    let options = SolverOptions { ledger, linear, ..SolverOptions::default() };
    let mut stepper = vi_solvers::stepper(method, &system, &options).unwrap();
    conduct(&system, stepper.as_mut())
}

fn explicit() -> impl Iterator<Item = Method> {
    Method::ALL.into_iter().filter(|method| method.facts().is_explicit && method.facts().is_variational())
}

fn clamped_block() -> (System, State) {
    let (system, x) = block_system([9, 4, 3], true);
    let state = system.state(0.0, &deformed(&x, 0.05), &deformed(&vec![0.0; x.len()], 0.3)).unwrap();
    (system, state)
}

fn two_terms() -> (System, State) {
    let (x, nodes) = block([6, 5, 4]);
    let ends = (0..x.len() as u32 / 3 - 70).flat_map(|node| [node, node + 70]).collect();
    let terms: Vec<Box<dyn vi_core::Potential>> =
        vec![Box::new(Springs::new(4, nodes, 1.0, &x)), Box::new(Springs::new(2, ends, 0.1, &x))];
    let coordinates = Coordinates::new(x.len(), fixed(&x, vec![0, 4, 5, 61])).unwrap();
    let mass = (0..x.len()).map(|k| 1.0 + 0.1 * (k / 3) as f64).collect();
    let system = System::new(mass, terms, coordinates).unwrap();
    let start = system.state(0.0, &deformed(&x, 0.05), &x).unwrap();
    (system, start)
}

/// Makes some steps; returns the state, the counts of the work and the memory.
fn some_steps(
    system: &System,
    stepper: &mut dyn Stepper,
) -> (State, vi_solvers::Work, vi_solvers::StepperMemory) {
    let mut state = clamped_block().1;
    for count in [1, 16, 1, 1, 5] {
        match count {
            1 => stepper.step(system, &mut state, 0.02).map(drop).unwrap(),
            _ => stepper.steps(system, &mut state, 0.02, count).map(drop).unwrap(),
        }
    }
    (state, stepper.work(), stepper.memory())
}

#[test]
fn ranks_step_to_the_bits_of_one_process() {
    for method in explicit() {
        let place: Place<'_> = (&method, &clamped_block, PLAIN);
        let expected = alone(place, some_steps);
        // There are eight or more chunks; the last of eleven ranks may have none.
        for size in [1, 2, 3, 4, 11] {
            assert_eq!(on_ranks(size, place, some_steps), expected, "{} on {size} ranks", method.name());
        }
    }
}

#[test]
fn ranks_find_the_highest_frequency_of_one_process() {
    let place: Place<'_> = (&Method::StormerVerlet, &clamped_block, PLAIN);
    let highest =
        |system: &System, _: &mut dyn Stepper| highest_frequency(system, &clamped_block().1).unwrap();
    let expected = alone(place, highest);
    for size in [1, 2, 3, 4] {
        assert_eq!(on_ranks(size, place, highest), expected, "{size} ranks");
    }
}

#[test]
fn steps_of_the_first_rank_have_the_bits_of_one_process() {
    let run = |system: &System, stepper: &mut dyn Stepper| {
        let mut state = clamped_block().1;
        let reports: Vec<_> =
            (0..4).map(|_| stepper.step(system, &mut state, 0.05).unwrap()).map(|r| r.energy).collect();
        (state, reports, stepper.work(), stepper.memory())
    };
    let implicit: Vec<Method> =
        Method::ALL.into_iter().filter(|method| !method.facts().is_explicit).collect();
    let by = |linear: LinearSolver| implicit.iter().map(move |method| (*method, (false, linear)));
    let ledger = [(Method::StormerVerlet, (true, LinearSolver::Auto))];
    for (method, options) in by(LinearSolver::Auto).chain(by(LinearSolver::Pcg)).chain(ledger) {
        let place: Place<'_> = (&method, &clamped_block, options);
        let expected = alone(place, run);
        for size in [2, 4] {
            assert_eq!(
                on_ranks(size, place, run),
                expected,
                "{} by {options:?} on {size} ranks",
                method.name()
            );
        }
    }
}

#[test]
fn ranks_solve_with_a_coarse_space_to_the_bits_of_one_process() {
    let make = || {
        let (system, x) = block_system([30, 18, 17], true);
        let state = system.state(0.0, &deformed(&x, 0.05), &deformed(&vec![0.0; x.len()], 0.3)).unwrap();
        (system, state)
    };
    let run = |system: &System, stepper: &mut dyn Stepper| {
        let mut state = make().1;
        stepper.step(system, &mut state, 0.5).unwrap();
        (state, stepper.work(), stepper.memory())
    };
    let place: Place<'_> = (&Method::ImplicitMidpoint, &make, (false, LinearSolver::Pcg));
    let expected = alone(place, run);
    assert!(expected.1.pcg_iterations > 0);
    for size in [2, 3, 5] {
        let found = on_ranks(size, place, run);
        assert_eq!(found.1, expected.1, "{size} ranks");
        assert!(found.0 == expected.0 && found.2 == expected.2, "{size} ranks");
    }
}

#[test]
fn ranks_sum_energies_and_gradients_to_the_bits_of_one_process() {
    for make in [&clamped_block as Make<'_>, &two_terms] {
        let (_, start) = make();
        let sums = |system: &System, _: &mut dyn Stepper| {
            let (x, mut assembler) = (system.positions(&start), Assembler::new(system));
            let mut gradient = vec![0.0; x.len()];
            assembler.gradient(&x, 0.0, &mut gradient);
            (assembler.energies(&x, 0.0), gradient)
        };
        for method in [Method::StormerVerlet, Method::ImplicitMidpoint] {
            let expected = alone((&method, make, PLAIN), sums);
            for size in [1, 3, 11] {
                assert_eq!(on_ranks(size, (&method, make, PLAIN), sums), expected, "{size} ranks");
            }
        }
    }
}

#[test]
fn several_terms_share_their_nodes() {
    let run = |system: &System, stepper: &mut dyn Stepper| {
        let mut state = two_terms().1;
        stepper.steps(system, &mut state, 0.01, 20).unwrap();
        state
    };
    let place: Place<'_> = (&Method::StormerVerlet, &two_terms, PLAIN);
    assert_eq!(on_ranks(4, place, run), alone(place, run));
}

#[test]
fn a_run_goes_on_with_any_number_of_ranks() {
    let place: Place<'_> = (&Method::BlanesMoan4, &clamped_block, PLAIN);
    let half = |system: &System, stepper: &mut dyn Stepper, state: &mut State| {
        stepper.steps(system, state, 0.02, 7).unwrap();
        stepper.memory()
    };
    let mut expected = clamped_block().1;
    let end = alone(place, |system, stepper| {
        half(system, stepper, &mut expected);
        half(system, stepper, &mut expected)
    });
    for sizes in [[4, 2], [1, 3], [3, 1]] {
        let mut state = clamped_block().1;
        let memory = on_ranks(sizes[0], place, |system, stepper| half(system, stepper, &mut state));
        let found = on_ranks(sizes[1], place, |system, stepper| {
            stepper.restore(system, &memory).unwrap();
            half(system, stepper, &mut state)
        });
        assert_eq!((&state, &found), (&expected, &end), "{sizes:?}");
        // And in one process.
        alone(place, |system, stepper| stepper.restore(system, &memory).unwrap());
    }
}

/// Ranks that keep a state themselves go back to it to the bits of one process that restores its own copy.
#[test]
fn ranks_go_back_to_the_state_that_they_keep() {
    let go = |system: &System, stepper: &mut dyn Stepper, state: &mut State, count| {
        stepper.steps(system, state, 0.02, count).unwrap();
    };
    let halves = |system: &System, stepper: &mut dyn Stepper, state: &mut State| {
        for _ in 0..6 {
            stepper.step(system, state, 0.01).unwrap();
        }
        (state.clone(), stepper.work(), stepper.memory())
    };
    for method in explicit() {
        let place: Place<'_> = (&method, &clamped_block, PLAIN);
        // From the start, and from a later state.
        for before in [0, 5] {
            let expected = alone(place, |system, stepper| {
                let mut state = clamped_block().1;
                (0..before).for_each(|_| go(system, stepper, &mut state, 2));
                assert!(!stepper.keep(&state).unwrap());
                let kept = (state.clone(), stepper.memory());
                go(system, stepper, &mut state, 9);
                state = kept.0;
                stepper.restore(system, &kept.1).unwrap();
                halves(system, stepper, &mut state)
            });
            for size in [1, 2, 4] {
                let found = on_ranks(size, place, |system, stepper| {
                    let mut state = clamped_block().1;
                    assert!(stepper.go_back(&mut state).is_err(), "nothing is kept");
                    (0..before).for_each(|_| go(system, stepper, &mut state, 2));
                    assert!(stepper.keep(&state).unwrap());
                    let kept = state.clone();
                    // A state can be left more than once.
                    for count in [3, 9] {
                        go(system, stepper, &mut state, count);
                        stepper.go_back(&mut state).unwrap();
                        assert_eq!(state, kept);
                    }
                    halves(system, stepper, &mut state)
                });
                assert_eq!(found, expected, "{} on {size} ranks", method.name());
            }
        }
    }
}

#[test]
fn a_step_that_fails_on_one_rank_fails_as_in_one_process() {
    let mut start = clamped_block().1;
    // The nodes at one end, which one rank holds, fly away.
    start.p.iter_mut().rev().take(3).for_each(|p| *p = 1e200);
    let run = |system: &System, stepper: &mut dyn Stepper| {
        let mut state = start.clone();
        assert!(stepper.steps(system, &mut state, 0.02, 4).is_none());
        let error = stepper.step(system, &mut state, 0.02).unwrap_err();
        assert_eq!(state, start);
        // Good steps are possible afterwards.
        let mut calm = State { p: vec![0.0; start.p.len()], ..start.clone() };
        stepper.step(system, &mut calm, 0.02).unwrap();
        (error.to_string(), stepper.work(), calm)
    };
    let place: Place<'_> = (&Method::StormerVerlet, &clamped_block, PLAIN);
    let expected = alone(place, run);
    for size in [2, 4] {
        assert_eq!(on_ranks(size, place, run), expected);
    }
}
