//! Tests the laws of live terms: their stencils change, and neither the motion nor its invariants depend on that.

use std::ops::Range;
use std::sync::atomic::Ordering;
use std::sync::{Arc, Mutex};

use crate::contacts::{LiveFloor, Repulsion};
use crate::springs::{Springs, block, fixed};
use vi_core::constraints::{Place, QuadraticConstraint};
use vi_core::{
    Account, Coordinates, EnergyLedger, HessianKind, Live, Potential, State, Stencils, System, Traits,
    angular_momentum, kinetic_energy, linear_momentum, reference,
};
use vi_solvers::{Method, SolverError, SolverOptions, StaticOptions, equilibrium, make_tangent, stepper};

/// Returns a strip of springs, 4 × 1 × 1 cells, with the additional terms `add`, clamped at x = 0 if `clamped`.
fn strip(clamped: bool, add: Vec<Box<dyn Potential>>) -> (System, Vec<f64>) {
    let (x, nodes) = block([4, 1, 1]);
    let clamp = (0..x.len() as u32).filter(|&dof| clamped && x[dof as usize / 3 * 3] == 0.0).collect();
    let coordinates = Coordinates::new(x.len(), fixed(&x, clamp)).unwrap();
    let springs: Box<dyn Potential> = Box::new(Springs::new(4, nodes, 1.0, &x));
    let terms = std::iter::once(springs).chain(add).collect();
    (System::new(vec![1.0; x.len()], terms, coordinates).unwrap(), x)
}

/// Returns velocities that fold the strip, so that points come close to each other.
fn folding(x: &[f64]) -> Vec<f64> {
    let points = x.chunks_exact(3);
    points.flat_map(|p| [1.2 * (2.0 - p[0]), 0.1 * p[2], 0.8 * (p[0] - 2.0) * (0.5 - p[1])]).collect()
}

fn close(a: &State, b: &State, tolerance: f64) -> bool {
    let pairs = a.q.iter().zip(&b.q).chain(a.p.iter().zip(&b.p));
    pairs.clone().all(|(a, b)| (a - b).abs() <= tolerance) && pairs.clone().any(|(a, _)| *a != 0.0)
}

const OPTIONS: SolverOptions = SolverOptions {
    tolerance: 1e-14,
    linear: vi_solvers::LinearSolver::Auto,
    ledger: false,
    impulses: false,
    max_iterations: 100,
    interrupt: vi_solvers::Interrupt::NEVER,
};

/// Steps the system with a live term and the one with which it is compared. Returns how often stencils were
/// requested, and the largest energy of the term.
fn compare(method: Method, live: &Arc<Repulsion>, reference_system: &System) -> (usize, f64) {
    let (system, x) = strip(false, Vec::new());
    let elastic = |state: &State| reference::energy(&system, &system.positions(state), 0.0);
    let (changing, _) = strip(false, Vec::new());
    let changing = changing.with_live(vec![Arc::clone(live) as Arc<dyn Live>]);
    let start = changing.state(0.0, &x, &folding(&x)).unwrap();
    let [mut a, mut b] = [start.clone(), start];
    let mut first = stepper(&method, reference_system, &OPTIONS).unwrap();
    let mut second = stepper(&method, &changing, &OPTIONS).unwrap();
    let mut largest = 0.0_f64;
    let mut calls = 0;
    for step in 0..60 {
        first.step(reference_system, &mut a, 0.02).unwrap();
        let before = live.calls.load(Ordering::Relaxed);
        second.step(&changing, &mut b, 0.02).unwrap();
        calls += live.calls.load(Ordering::Relaxed) - before;
        assert!(close(&a, &b, 1e-9), "{}: step {step}", method.name());
        let energy = |system: &System| reference::energy(system, &system.positions(&a), 0.0);
        assert!((energy(reference_system) - energy(&changing)).abs() < 1e-12);
        largest = largest.max(energy(&changing) - elastic(&a));
    }
    (calls, largest)
}

#[test]
fn a_motion_does_not_notice_that_stencils_change() {
    let methods = [
        Method::StormerVerlet,
        Method::BlanesMoan4,
        Method::ImplicitMidpoint,
        Method::Gauss { stages: 2 },
        Method::BackwardEuler,
    ];
    for method in methods {
        let live = Arc::new(Repulsion::new(20, false));
        let (fixed, _) = strip(false, vec![Box::new(live.fixed())]);
        let (calls, largest) = compare(method, &live, &fixed);
        assert!(calls > 3 && largest > 1e-3, "{}: {calls} {largest}", method.name());
    }
}

/// In a large step points come close that were far apart at its beginning. Newton's method needs no more iterations than with all
/// stencils, because the Hessian contains the pairs of its iterates.
#[test]
fn large_steps_converge_as_with_all_stencils() {
    for method in [Method::BackwardEuler, Method::Newmark { beta: 0.25, gamma: 0.5 }] {
        let live = Arc::new(Repulsion::new(20, false));
        let (all, x) = strip(false, vec![Box::new(live.fixed())]);
        let (near, _) = strip(false, Vec::new());
        let near = near.with_live(vec![live as Arc<dyn Live>]);
        let iterations = [all, near].map(|system| {
            let mut state = system.state(0.0, &x, &folding(&x)).unwrap();
            let mut stepper = stepper(&method, &system, &OPTIONS).unwrap();
            (0..10).map(|_| stepper.step(&system, &mut state, 0.2).unwrap().iterations).sum::<u32>()
        });
        assert!(iterations[1] <= iterations[0] + 2, "{}: {iterations:?}", method.name());
    }
}

#[test]
fn a_motion_by_discrete_gradients_does_not_notice_it_either() {
    for method in [Method::StormerVerlet, Method::ImplicitMidpoint, Method::EnergyMomentum] {
        let live = Arc::new(Repulsion::new(20, true));
        // The reach is so long that all pairs are stencils from the start.
        let far: Arc<dyn Live> = Arc::new(Repulsion { reach: 100.0, ..Repulsion::new(20, true) });
        let (calls, largest) = compare(method, &live, &strip(false, Vec::new()).0.with_live(vec![far]));
        assert!(calls > 3 && largest > 1e-3, "{}: {calls} {largest}", method.name());
    }
}

#[test]
fn an_equilibrium_does_not_notice_that_stencils_change() {
    let live = Arc::new(Repulsion { distance: 1.1, ..Repulsion::new(20, false) });
    let (whole, x) = strip(true, vec![Box::new(live.fixed())]);
    let (changing, _) = strip(true, Vec::new());
    let changing = changing.with_live(vec![live as Arc<dyn Live>]);
    let solve = |system: &System| {
        let mut state = system.state(0.0, &x, &vec![0.0; x.len()]).unwrap();
        let options = StaticOptions { tolerance: 1e-12, find_critical: false, ..StaticOptions::default() };
        equilibrium(system, &mut state, &options).unwrap();
        state
    };
    let (a, b) = (solve(&whole), solve(&changing));
    let start = whole.state(0.0, &x, &vec![0.0; x.len()]).unwrap();
    assert!(a.q.iter().zip(&start.q).any(|(a, b)| (a - b).abs() > 1e-3));
    assert!(a.q.iter().zip(&b.q).all(|(a, b)| (a - b).abs() < 1e-9));
}

/// A point of weight P that a spring of stiffness k hardly holds: V = P z + ½ k (z − z₀)².
struct Weight {
    force: f64,
    stiffness: f64,
    height: f64,
}

impl Potential for Weight {
    fn name(&self) -> &str {
        "weight"
    }
    fn account(&self) -> Account {
        Account::Gravity
    }
    fn stencils(&self) -> Stencils<'_> {
        Stencils { arity: 1, block: 3, nodes: &[0] }
    }
    fn traits(&self) -> Traits {
        Traits { hessian: HessianKind::Constant, time_dependent: false }
    }
    fn energies(&self, _: Range<usize>, x: &[f64], _: f64, out: &mut [f64]) {
        out[0] = self.force * x[2] + 0.5 * self.stiffness * (x[2] - self.height).powi(2);
    }
    fn gradients(&self, _: Range<usize>, x: &[f64], _: f64, out: &mut [f64]) {
        out.copy_from_slice(&[0.0, 0.0, self.force + self.stiffness * (x[2] - self.height)]);
    }
    fn hessians(&self, _: Range<usize>, _: &[f64], _: f64, out: &mut [f64]) {
        out.fill(0.0);
        out[5] = self.stiffness;
    }
}

/// A floor that records the longest reach, m, that was requested.
struct Asked(LiveFloor, Mutex<f64>);

impl Live for Asked {
    fn name(&self) -> &str {
        self.0.name()
    }
    fn reach(&self) -> f64 {
        self.0.reach()
    }
    fn near(&self, x: &[f64], reach: f64) -> Arc<dyn Potential> {
        let mut longest = self.1.lock().unwrap();
        *longest = longest.max(reach);
        self.0.near(x, reach)
    }
}

/// A floor that would rub.
struct Rough(LiveFloor);

impl Live for Rough {
    fn name(&self) -> &str {
        "rough floor"
    }
    fn reach(&self) -> f64 {
        self.0.reach()
    }
    fn near(&self, x: &[f64], reach: f64) -> Arc<dyn Potential> {
        self.0.near(x, reach)
    }
    fn dissipates(&self) -> bool {
        true
    }
}

/// Schemes that act by the potential of live terms alone refuse those that dissipate; no friction is ignored silently.
#[test]
fn schemes_that_would_ignore_friction_refuse_it_by_name() {
    let floor = || LiveFloor { count: 20, distance: 0.1, stiffness: 1.0 };
    let with = |live: Arc<dyn Live>| strip(false, Vec::new()).0.with_live(vec![live]);
    let (smooth, rough) = (with(Arc::new(floor())), with(Arc::new(Rough(floor()))));
    for method in Method::ALL {
        let accepts = method.facts().accepts.dissipative_terms;
        assert!(stepper(&method, &smooth, &OPTIONS).is_ok(), "{}", method.name());
        match stepper(&method, &rough, &OPTIONS).err() {
            None => assert!(accepts, "{}", method.name()),
            Some(SolverError::Dissipative { scheme, term, schemes }) => {
                assert!(!accepts && scheme == method.name() && term == "rough floor", "{scheme} {term}");
                assert!(schemes.contains("energy-momentum"), "{schemes}");
            }
            other => panic!("{}: {other:?}", method.name()),
        }
    }
}

/// The schemes that a refusal names are those that accept the whole system, and not only the part that is refused.
#[test]
fn a_refusal_names_schemes_that_accept_the_system() {
    let floor = || LiveFloor { count: 20, distance: 0.1, stiffness: 1.0 };
    let rod = || QuadraticConstraint::distance("rod", &Place::node(0), &Place::node(1), 1.0);
    let (smooth, rough): (Arc<dyn Live>, Arc<dyn Live>) = (Arc::new(floor()), Arc::new(Rough(floor())));
    for (live, constraints) in [(&smooth, vec![rod()]), (&rough, vec![rod()]), (&rough, Vec::new())] {
        let system = strip(false, Vec::new()).0.with_live(vec![Arc::clone(live)]);
        let system = system.with_constraints(constraints).unwrap();
        let mut refused = 0;
        for method in Method::ALL {
            let schemes = match method.check(&system) {
                Err(SolverError::Constrained { schemes, .. } | SolverError::Dissipative { schemes, .. }) => {
                    schemes
                }
                other => {
                    assert!(other.is_ok(), "{other:?}");
                    continue;
                }
            };
            refused += 1;
            let all = || Method::ALL.into_iter();
            for name in schemes.split(", ") {
                let named = all().find(|method| method.name() == name).unwrap();
                assert!(named.check(&system).is_ok() && named.facts().accepts.contact, "{schemes}");
            }
            // The list contains every scheme that conserves momenta and accepts the system.
            for other in
                all().filter(|other| other.facts().conserves.angular_momentum && other.check(&system).is_ok())
            {
                assert!(schemes.split(", ").any(|name| name == other.name()), "{schemes}");
            }
        }
        assert!(refused > 0);
    }
}

/// The first correction falls by a thousand kilometres. Stencils are requested only as far as the floor.
#[test]
fn a_far_correction_asks_for_near_stencils() {
    let floor = Arc::new(Asked(LiveFloor { count: 1, distance: 0.1, stiffness: 1.0 }, Mutex::new(0.0)));
    let x = [0.0, 0.0, 0.2];
    let weight = Weight { force: 1.0, stiffness: 1e-6, height: x[2] };
    let coordinates = Coordinates::new(3, fixed(&x, vec![0, 1])).unwrap();
    let system = System::new(vec![1.0; 3], vec![Box::new(weight)], coordinates).unwrap();
    let system = system.with_live(vec![Arc::clone(&floor) as Arc<dyn Live>]);
    let mut state = system.state(0.0, &x, &[0.0; 3]).unwrap();
    let options = StaticOptions { tolerance: 1e-12, find_critical: false, ..StaticOptions::default() };
    equilibrium(&system, &mut state, &options).unwrap();
    // 3 k (d − z)²/z + k (d − z)³/z² = P.
    let z = state.q[0];
    let force = 3.0 * (0.1 - z).powi(2) / z + (0.1 - z).powi(3) / (z * z);
    assert!((force - 1.0).abs() < 1e-6, "{z}: {force}");
    assert!(*floor.1.lock().unwrap() < 2.0, "{:?}", floor.1);
}

/// A scheme that acts by the gradient of live terms requests stencils where it evaluates them, and not between the ends of earlier
/// steps: a band that folds needs less than two requests per step, however many iterations a step takes.
#[test]
fn a_scheme_without_discrete_gradients_requests_few_stencils() {
    const STEPS: usize = 40;
    let mut iterations = 0;
    let live = Arc::new(Repulsion { distance: 0.5, ..Repulsion::new(20, true) });
    let (system, x) = strip(false, Vec::new());
    let system = system.with_live(vec![Arc::clone(&live) as Arc<dyn Live>]);
    let mut state = system.state(0.0, &x, &folding(&x)).unwrap();
    let mut stepper = stepper(&Method::BackwardEuler, &system, &OPTIONS).unwrap();
    for _ in 0..STEPS {
        iterations += stepper.step(&system, &mut state, 0.05).unwrap().iterations;
    }
    let calls = live.calls.load(Ordering::Relaxed);
    assert!(calls <= 2 * STEPS, "{calls} requests in {iterations} iterations");
}

/// Ordering and layout are computed once, and again only when a pair comes close that was not among the stencils
/// before.
#[test]
fn a_pattern_is_analysed_only_when_it_changes() {
    let still = |distance: f64| {
        let live = Arc::new(Repulsion { distance, ..Repulsion::new(20, false) });
        let (system, x) = strip(false, Vec::new());
        let system = system.with_live(vec![live as Arc<dyn Live>]);
        let mut state = system.state(0.0, &x, &[0.3, 0.1, -0.2].repeat(x.len() / 3)).unwrap();
        let mut stepper = stepper(&Method::ImplicitMidpoint, &system, &OPTIONS).unwrap();
        for _ in 0..40 {
            stepper.step(&system, &mut state, 0.05).unwrap();
        }
        stepper.analyses()
    };
    // A rigid motion requests new stencils, which are the same as before.
    assert_eq!(still(0.5), 1);
    let live = Arc::new(Repulsion::new(20, false));
    let (system, x) = strip(false, Vec::new());
    let system = system.with_live(vec![Arc::clone(&live) as Arc<dyn Live>]);
    let mut state = system.state(0.0, &x, &folding(&x)).unwrap();
    let mut stepper = stepper(&Method::ImplicitMidpoint, &system, &OPTIONS).unwrap();
    for _ in 0..60 {
        stepper.step(&system, &mut state, 0.02).unwrap();
    }
    let calls = live.calls.load(Ordering::Relaxed) as u64;
    assert!((2..calls).contains(&stepper.analyses()), "{} analyses, {calls} calls", stepper.analyses());
}

/// Linear and angular momentum are conserved to round-off, and energy too by energy–momentum; the ledger closes.
#[test]
fn discrete_gradients_keep_what_they_promise() {
    for method in [Method::EnergyMomentum, Method::ImplicitMidpoint, Method::StormerVerlet] {
        let live = Arc::new(Repulsion::new(20, true));
        let (system, x) = strip(false, Vec::new());
        let system = system.with_live(vec![live as Arc<dyn Live>]);
        let mut state = system.state(0.0, &x, &folding(&x)).unwrap();
        let options = SolverOptions { ledger: true, ..OPTIONS };
        let mut stepper = stepper(&method, &system, &options).unwrap();
        let energy = |state: &State| {
            kinetic_energy(&system, state) + reference::energy(&system, &system.positions(state), state.t)
        };
        let momenta = |state: &State| [linear_momentum(&system, state), angular_momentum(&system, state)];
        let (before, [linear, angular]) = (energy(&state), momenta(&state));
        let mut ledger = EnergyLedger::new(before, before);
        for _ in 0..100 {
            let report = stepper.step(&system, &mut state, 0.01).unwrap();
            ledger.enter(report.energy, energy(&state), 0.0);
        }
        let name = method.name();
        for (now, then) in momenta(&state).iter().flatten().zip(linear.iter().chain(&angular)) {
            assert!((now - then).abs() < 1e-10, "{name}: {now} {then}");
        }
        let drift = (energy(&state) - before).abs() / before;
        let bound = if method == Method::EnergyMomentum { 1e-10 } else { 1e-2 };
        assert!(drift < bound, "{name}: {drift}");
        assert!(ledger.unexplained().abs() < 1e-10 * before, "{name}: {ledger:?}");
    }
}

/// Points thrown at a barrier never cross it, however long the step is, and return with their energy.
#[test]
fn a_barrier_is_not_crossed_at_any_step() {
    for method in [Method::EnergyMomentum, Method::ImplicitMidpoint, Method::StormerVerlet] {
        for h in [0.003, 0.02, 0.1] {
            let x = vec![0.0, 0.0, 0.5, 1.0, 0.0, 0.9];
            let coordinates = Coordinates::all_free(6);
            let system = System::new(vec![2.0; 6], Vec::new(), coordinates).unwrap();
            let floor = LiveFloor { count: 2, distance: 0.1, stiffness: 5.0 };
            let system = system.with_live(vec![Arc::new(floor) as Arc<dyn Live>]);
            let mut state = system.state(0.0, &x, &[0.1, 0.0, -4.0, 0.0, 0.2, -9.0]).unwrap();
            let energy = |state: &State| {
                kinetic_energy(&system, state) + reference::energy(&system, &system.positions(state), state.t)
            };
            let before = energy(&state);
            let mut stepper = stepper(&method, &system, &OPTIONS).unwrap();
            while state.t < 0.6 {
                stepper.step(&system, &mut state, h).unwrap();
                assert!(state.q[2] > 0.0 && state.q[5] > 0.0, "{} {h}", method.name());
                let drift = (energy(&state) - before).abs() / before;
                assert!(drift < 1e-9, "{} {h}: {drift} at {}", method.name(), state.t);
            }
            let back: Vec<f64> = state.p.iter().map(|p| p / 2.0).collect();
            assert!((back[2] - 4.0).abs() < 1e-7 && (back[5] - 9.0).abs() < 1e-7, "{} {h}", method.name());
        }
    }
}

/// Two dumbbells, points on rods of length 1, are thrown at a floor with spin. They bounce and never cross it at any
/// step. Rods keep their length, momenta along the floor are conserved, and the ledger closes. The energy is
/// restored: to round-off by energy–momentum, and to the order of the scheme by the others.
#[test]
fn rods_bounce_off_a_floor() {
    let x = [0.0, 0.0, 0.6, 0.8, 0.0, 1.2, 3.0, 0.0, 0.3, 3.0, 1.0, 0.3];
    let v = [0.1, 0.2, -2.0, 0.1, 0.2, -2.0, 0.0, 0.3, -1.0, 0.0, 0.3, -3.0];
    let floor = || Arc::new(LiveFloor { count: 4, distance: 0.1, stiffness: 5.0 }) as Arc<dyn Live>;
    let rod = |a: u32, b: u32| QuadraticConstraint::distance("rod", &Place::node(a), &Place::node(b), 1.0);
    let mass = [1.0, 2.0, 0.5, 1.5].into_iter().flat_map(|mass| [mass; 3]).collect();
    let system = System::new(mass, Vec::new(), Coordinates::all_free(12)).unwrap();
    let system = system.with_constraints(vec![rod(0, 1), rod(2, 3)]).unwrap().with_live(vec![floor()]);
    let energy = |state: &State| {
        kinetic_energy(&system, state) + reference::energy(&system, &system.positions(state), state.t)
    };
    // Returns the largest relative change of energy at times when nothing touches the floor.
    let run = |method: Method, h: f64| {
        let mut state = system.state(0.0, &x, &v).unwrap();
        make_tangent(&system, &mut state).unwrap();
        let (before, momentum) = (energy(&state), linear_momentum(&system, &state));
        let mut ledger = EnergyLedger::new(before, before);
        let options = SolverOptions { ledger: true, ..OPTIONS };
        let mut stepper = stepper(&method, &system, &options).unwrap();
        let (mut drift, mut turns) = (0.0_f64, 0);
        while state.t < 1.5 {
            let report = stepper.step(&system, &mut state, h).unwrap();
            ledger.enter(report.energy, energy(&state), 0.0);
            let name = format!("{} {h} at {}", method.name(), state.t);
            assert!((0..4).all(|k| state.q[3 * k + 2] > 0.0), "{name}: {:?}", state.q);
            for constraint in system.constraints() {
                assert!(constraint.value(&state.q).abs() < 1e-13, "{name}");
            }
            let now = linear_momentum(&system, &state);
            assert!((0..2).all(|axis| (now[axis] - momentum[axis]).abs() < 1e-10), "{name}");
            turns += usize::from(now[2] > 0.0);
            drift = drift.max((energy(&state) - before).abs() / before);
        }
        assert!(turns > 0 && state.q[2] + state.q[5] > 0.2, "{} {h}: no bounce", method.name());
        assert!(ledger.unexplained().abs() < 1e-9 * before, "{} {h}: {ledger:?}", method.name());
        drift
    };
    for method in [Method::EnergyMomentum, Method::ImplicitMidpoint, Method::StormerVerlet] {
        let drifts = [0.02, 0.005, 0.00125].map(|h| run(method, h));
        if method == Method::EnergyMomentum {
            assert!(drifts.iter().all(|drift| *drift < 1e-9), "{drifts:?}");
        } else {
            assert!(drifts[0] < 0.1 && drifts[2] < 0.1 * drifts[0], "{}: {drifts:?}", method.name());
        }
    }
}

#[test]
fn a_run_continues_to_the_same_bits() {
    for method in [Method::StormerVerlet, Method::ImplicitMidpoint, Method::EnergyMomentum] {
        let live = Arc::new(Repulsion::new(20, true));
        let (system, x) = strip(false, Vec::new());
        let system = system.with_live(vec![live as Arc<dyn Live>]);
        let mut state = system.state(0.0, &x, &folding(&x)).unwrap();
        let options = SolverOptions { tolerance: 1e-8, ..OPTIONS };
        let mut first = stepper(&method, &system, &options).unwrap();
        for _ in 0..37 {
            first.step(&system, &mut state, 0.02).unwrap();
        }
        let (memory, mut continued) = (first.memory(), state.clone());
        let mut second = stepper(&method, &system, &options).unwrap();
        second.restore(&system, &memory).unwrap();
        for step in 0..30 {
            first.step(&system, &mut state, 0.02).unwrap();
            second.step(&system, &mut continued, 0.02).unwrap();
            assert_eq!(state, continued, "{}: step {step}", method.name());
        }
    }
}

#[test]
fn a_live_term_that_names_a_missing_node_is_named() {
    let live = Arc::new(LiveFloor { count: 40, distance: 0.1, stiffness: 1.0 });
    let (system, x) = strip(false, Vec::new());
    let long = vec![0.0; 3 * 40];
    assert!(system.terms().clone().with_live(vec![live]).near(&long).is_err());
    assert!(x.len() < long.len());
}
