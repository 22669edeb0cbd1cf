//! Tests the laws of the steppers with constraints: the dense RATTLE, rigid bodies against the Lie-group integrator
//! and the exact flip, momenta, energy, the constraint manifold, the ledger.

use crate::springs::{Springs, block, fixed};
use nalgebra::{DMatrix, DVector};
use vi_core::constraints::{Place, QuadraticConstraint, Rattle};
use vi_core::problems::{flip_period, principal_inertia};
use vi_core::rotations::{RigidBody, RigidState, Weightless, identity, rotate};
use vi_core::{
    Combination, Coordinates, EnergyLedger, Prescribed, Scheme, State, System, TiedMass, angular_momentum,
    kinetic_energy, linear_momentum, reference,
};
use vi_solvers::{Method, SolverError, SolverOptions, StaticOptions, Stepper, stepper};

/// Returns the schemes that accept constraints.
fn methods() -> impl Iterator<Item = Method> {
    Method::ALL.into_iter().filter(|method| method.facts().accepts.constraints)
}

fn stepper_of(method: Method, system: &System) -> Box<dyn Stepper> {
    let options = SolverOptions { tolerance: 1e-14, ledger: true, ..SolverOptions::default() };
    stepper(&method, system, &options).unwrap()
}

fn total(system: &System, state: &State) -> f64 {
    kinetic_energy(system, state) + reference::energy(system, &system.positions(state), state.t)
}

/// Returns the largest |g|.
fn defect(system: &System, state: &State) -> f64 {
    let x = system.positions(state);
    system.constraints().iter().map(|g| g.value(&x).abs()).fold(0.0, f64::max)
}

/// Returns three points connected by rods, the first held, with a spring across: a double pendulum.
fn linkage() -> (System, State) {
    let x = vec![0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0, -0.8, 0.3];
    let rod = |a: u32, b: u32, length: f64| {
        QuadraticConstraint::distance("rod", &Place::node(a), &Place::node(b), length)
    };
    let hold = QuadraticConstraint::coincidence("pivot", &Place::node(0), &Place::fixed([0.0; 3]));
    let constraints = hold.into_iter().chain([rod(0, 1, 1.0), rod(1, 2, 0.73_f64.sqrt())]).collect();
    let springs = Springs::new(2, vec![0, 2], 3.0, &[0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.5, 0.0, 0.0]);
    let coordinates = Coordinates::new(9, vec![]).unwrap();
    let system =
        System::new(vec![1.0, 1.0, 1.0, 0.6, 0.6, 0.6, 0.9, 0.9, 0.9], vec![Box::new(springs)], coordinates)
            .unwrap()
            .with_constraints(constraints)
            .unwrap();
    let start = system.state(0.0, &x, &[0.0, 0.0, 0.0, 0.0, 0.4, 0.5, 0.0, 0.4, 0.5]).unwrap();
    let start = Rattle::new(&system, system.constraints().to_vec()).tangent(&start).unwrap();
    (system, start)
}

/// Returns a free body in natural coordinates (c, d₁, d₂, d₃) with angular momentum Π about its principal axes.
fn free_body(mass: f64, moments: [f64; 3], spin: [f64; 3]) -> (System, State) {
    let euler: Vec<f64> = (0..3).map(|k| 0.5 * (moments.iter().sum::<f64>() - 2.0 * moments[k])).collect();
    let masses: Vec<f64> = [mass].iter().chain(&euler).flat_map(|&m| [m; 3]).collect();
    let coordinates = Coordinates::new(12, vec![]).unwrap().with_combinations(&[], &[1, 2, 3]).unwrap();
    let system = System::new(masses, vec![], coordinates)
        .unwrap()
        .with_constraints(QuadraticConstraint::orthonormal("body", [1, 2, 3]).to_vec())
        .unwrap();
    let [a, b, c]: [f64; 3] = std::array::from_fn(|k| spin[k] / moments[k]);
    let x = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0];
    // ω × d_k
    let v = [0.2, -0.1, 0.3, 0.0, c, -b, -c, 0.0, a, b, -a, 0.0];
    let state = system.state(0.0, &x, &v).unwrap();
    (system, state)
}

#[test]
fn verlet_is_the_dense_rattle() {
    let (system, start) = linkage();
    let rattle = Rattle::new(&system, system.constraints().to_vec());
    let mut stepper = stepper_of(Method::StormerVerlet, &system);
    let (mut fast, mut slow) = (start.clone(), start);
    for _ in 0..20 {
        stepper.step(&system, &mut fast, 0.02).unwrap();
        slow = rattle.step(&slow, 0.02).unwrap();
    }
    for k in 0..9 {
        assert!((fast.q[k] - slow.q[k]).abs() < 1e-12 && (fast.p[k] - slow.p[k]).abs() < 1e-12);
    }
}

#[test]
fn orders_are_kept_on_the_surface() {
    let (system, start) = linkage();
    let run = |method: Method, steps: usize| {
        let mut stepper = stepper_of(method, &system);
        let mut state = start.clone();
        for _ in 0..steps {
            stepper.step(&system, &mut state, 0.4 / steps as f64).unwrap();
        }
        state.q
    };
    let exact = run(Method::StormerVerlet, 4096);
    for method in methods() {
        let error = |steps: usize| {
            let gaps = run(method, steps).into_iter().zip(&exact).map(|(a, b)| (a - b).abs());
            gaps.fold(0.0, f64::max)
        };
        let order = (error(32) / error(64)).log2();
        let expected = method.facts().order as f64;
        assert!((order - expected).abs() < 0.2, "{}: order {order}", method.name());
    }
}

#[test]
fn symmetric_schemes_go_back_where_they_came_from() {
    let (system, start) = linkage();
    for method in [Method::StormerVerlet, Method::ImplicitMidpoint] {
        let mut stepper = stepper_of(method, &system);
        let mut state = start.clone();
        for _ in 0..50 {
            stepper.step(&system, &mut state, 0.02).unwrap();
        }
        state.p.iter_mut().for_each(|p| *p = -*p);
        for _ in 0..50 {
            stepper.step(&system, &mut state, 0.02).unwrap();
        }
        for k in 0..9 {
            assert!((state.q[k] - start.q[k]).abs() < 1e-10, "{}", method.name());
            assert!((state.p[k] + start.p[k]).abs() < 1e-10, "{}", method.name());
        }
    }
}

#[test]
fn a_free_body_keeps_its_momenta_energy_and_shape() {
    let (system, start) = free_body(2.0, [1.0, 2.0, 2.8], [0.05, 2.0, 0.02]);
    for method in methods() {
        let mut stepper = stepper_of(method, &system);
        let mut state = start.clone();
        let mut ledger = EnergyLedger::new(total(&system, &start), total(&system, &start));
        for _ in 0..2000 {
            let report = stepper.step(&system, &mut state, 0.01).unwrap();
            let energy = total(&system, &state);
            ledger.enter(report.energy, energy, energy);
        }
        assert!(defect(&system, &state) < 1e-14, "{}", method.name());
        assert!(ledger.unexplained().abs() < 1e-11, "{}: {ledger:?}", method.name());
        let keeps = method.facts().conserves;
        let pairs = [
            (true, linear_momentum(&system, &start), linear_momentum(&system, &state)),
            (keeps.angular_momentum, angular_momentum(&system, &start), angular_momentum(&system, &state)),
        ];
        for (_, before, after) in pairs.into_iter().filter(|(is_kept, ..)| *is_kept) {
            for k in 0..3 {
                assert!((before[k] - after[k]).abs() < 1e-11, "{}: {before:?} {after:?}", method.name());
            }
        }
        if !keeps.angular_momentum {
            assert!(ledger.current < ledger.initial, "{}: {ledger:?}", method.name());
            continue;
        }
        let limit = if method == Method::EnergyMomentum { 1e-12 } else { 1e-4 * ledger.initial };
        assert!(ledger.drift < limit, "{}: {}", method.name(), ledger.drift);
    }
}

/// A body turns by the angles θ_n about a fixed axis. Its increments are chords, and the constraints act along the radii at the
/// end of the step, where tan θ_(n+1) = sin θ_n/(2 − cos θ_n) follows; the first step has tan θ₁ = hω.
#[test]
fn implicit_euler_turns_a_body_by_the_angles_of_its_recurrence() {
    let (moments, omega, h) = ([1.0, 1.3, 1.9], 2.0, 0.01);
    let (system, mut state) = free_body(2.0, moments, [0.0, 0.0, moments[2] * omega]);
    let mut stepper = stepper_of(Method::BackwardEuler, &system);
    let (mut angle, mut turn) = (0.0, f64::atan(h * omega));
    for _ in 0..200 {
        stepper.step(&system, &mut state, h).unwrap();
        angle += turn;
        turn = f64::atan(turn.sin() / (2.0 - turn.cos()));
        let found = state.q[4].atan2(state.q[3]);
        assert!(((found - angle) / std::f64::consts::TAU).fract().abs() < 1e-12, "{found} {angle}");
    }
}

#[test]
fn a_free_body_agrees_with_the_lie_group_integrator_and_flips_on_time() {
    let (moments, spin) = ([1.0, 2.0, 2.8], [0.05, 2.0, 0.02]);
    let (system, start) = free_body(2.0, moments, spin);
    let period = flip_period(moments, spin);
    let lie =
        RigidBody { mass: 2.0, inertia: principal_inertia(moments), is_pivoted: true, potential: Weightless };
    let mut group = RigidState { t: 0.0, place: [0.0; 3], turn: identity(), momentum: [0.0; 3], spin };
    let scheme = Scheme::gauss(3).unwrap();
    let steps = 200;
    for _ in 0..steps {
        group = lie.step(&scheme, &group, 0.25 * period / steps as f64).unwrap();
    }
    for method in [Method::StormerVerlet, Method::ImplicitMidpoint, Method::EnergyMomentum] {
        let error = |steps: usize| {
            let mut stepper = stepper_of(method, &system);
            let mut state = start.clone();
            for _ in 0..steps {
                stepper.step(&system, &mut state, 0.25 * period / steps as f64).unwrap();
            }
            (0..3)
                .flat_map(|k| {
                    let axis: [f64; 3] = std::array::from_fn(|i| f64::from(u8::from(i == k)));
                    let d = rotate(&group.turn, &axis);
                    let q = &state.q;
                    (0..3).map(move |i| (q[3 + 3 * k + i] - d[i]).abs()).collect::<Vec<_>>()
                })
                .fold(0.0, f64::max)
        };
        let (coarse, fine) = (error(400), error(800));
        assert!(fine < 2e-3, "{}: {fine}", method.name());
        assert!(((coarse / fine).log2() - 2.0).abs() < 0.1, "{}: {coarse} {fine}", method.name());
    }
    // The rotation about the intermediate axis returns after one period.
    let mut stepper = stepper_of(Method::ImplicitMidpoint, &system);
    let mut state = start.clone();
    let steps = 4000;
    for _ in 0..steps {
        stepper.step(&system, &mut state, period / steps as f64).unwrap();
    }
    let v = system.velocities(&state);
    // Π₂ = I₂ ω₂ with ω₂ = d₁·ḋ₃, because d₃ rotates towards d₁.
    let omega: f64 = (0..3).map(|i| v[9 + i] * state.q[3 + i]).sum();
    assert!((moments[1] * omega - spin[1]).abs() < 1e-2, "{omega}");
}

/// Returns a box of springs with a face that is part of a rigid body, which hangs by a ball joint from a moving or a
/// fixed point. A spring at the far end acts as gravity.
fn hanging(is_moving: bool) -> (System, State) {
    let (mut x, nodes) = block([2, 1, 1]);
    let n = x.len() as u32 / 3;
    let (c, pivot) = (n, n + 4);
    let centre = [2.0, 0.5, 0.5];
    x.extend([centre, [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [3.0, 0.5, 0.5]].as_flattened());
    let ties: Vec<Combination> = (0..n)
        .filter(|&node| x[3 * node as usize] == 2.0)
        .map(|node| {
            let at = |k: usize| x[3 * node as usize + k] - centre[k];
            let terms = vec![(c, 1.0), (c + 1, at(0)), (c + 2, at(1)), (c + 3, at(2))];
            Combination { node, terms, mass: TiedMass::Exact }
        })
        .collect();
    let dofs: Vec<u32> = (3 * pivot..3 * pivot + 3).collect();
    let held = match is_moving {
        true => vec![Prescribed { dofs, path: Box::new(Circle) }],
        false => fixed(&x, dofs),
    };
    let directors = [c + 1, c + 2, c + 3];
    let coordinates = Coordinates::new(x.len(), held).unwrap().with_combinations(&ties, &directors).unwrap();
    let mut mass = vec![0.5; x.len()];
    for (k, own) in [1.0, 0.2, 0.3, 0.4].into_iter().enumerate() {
        mass[3 * (c as usize + k)..][..3].fill(own);
    }
    let body = Springs::new(4, nodes, 4.0, &x);
    let weight = Springs::new(2, vec![0, pivot], 0.1, &[0.0, 0.0, 0.0, 1.0, 0.0, 0.0].repeat(9)[..x.len()]);
    let mut constraints = QuadraticConstraint::orthonormal("hub", directors).to_vec();
    let arm = Place::sum(vec![(c, 1.0), (c + 1, 1.0)]);
    constraints.extend(QuadraticConstraint::coincidence("joint", &arm, &Place::node(pivot)));
    let system = System::new(mass, vec![Box::new(body), Box::new(weight)], coordinates)
        .unwrap()
        .with_constraints(constraints)
        .unwrap();
    let omega = [0.3, 0.5, -0.4];
    let v: Vec<f64> = (0..x.len() / 3)
        .flat_map(|node| {
            let is_director = node > c as usize && node <= c as usize + 3;
            let pivot = if is_director { [0.0; 3] } else { [3.0, 0.5, 0.5] };
            let r: [f64; 3] = std::array::from_fn(|k| x[3 * node + k] - pivot[k]);
            let drift = if is_moving && !is_director { 0.5 } else { 0.0 };
            [
                omega[1] * r[2] - omega[2] * r[1],
                omega[2] * r[0] - omega[0] * r[2] + drift,
                omega[0] * r[1] - omega[1] * r[0],
            ]
        })
        .collect();
    let state = system.state(0.0, &x, &v).unwrap();
    (system, state)
}

/// A circle of radius ½ m about (2.5, 0.5, 0.5), traversed once in 2π s.
struct Circle;

impl vi_core::Path for Circle {
    fn position(&self, t: f64, out: &mut [f64]) {
        out.copy_from_slice(&[2.5 + 0.5 * t.cos(), 0.5 + 0.5 * t.sin(), 0.5]);
    }
    fn velocity(&self, t: f64, out: &mut [f64]) {
        out.copy_from_slice(&[-0.5 * t.sin(), 0.5 * t.cos(), 0.0]);
    }
}

#[test]
fn springs_on_a_jointed_body_close_the_ledger() {
    for is_moving in [false, true] {
        let (system, start) = hanging(is_moving);
        for method in methods() {
            let mut stepper = stepper_of(method, &system);
            let mut state = start.clone();
            let first = total(&system, &start);
            let mut ledger = EnergyLedger::new(first, first);
            for _ in 0..200 {
                let report = stepper.step(&system, &mut state, 0.01).unwrap();
                ledger.enter(report.energy, total(&system, &state), 0.0);
            }
            let name = method.name();
            assert!(defect(&system, &state) < 1e-13, "{name}: {}", defect(&system, &state));
            assert!(ledger.unexplained().abs() < 1e-11, "{name}: {ledger:?}");
            assert!(is_moving == (ledger.parts.prescribed != 0.0), "{name}: {ledger:?}");
            let limit = match (method, is_moving) {
                (Method::EnergyMomentum, false) => 1e-9,
                _ if method.facts().order == 1 => 0.1,
                _ => 1e-2,
            };
            assert!(ledger.drift < limit * first, "{name}: {ledger:?}");
        }
    }
}

#[test]
fn redundant_joints_are_solved_all_the_same() {
    // A body held at three points has nine equations. Together with the six of the body itself, six are dependent.
    let (system, _) = free_body(2.0, [1.0, 2.0, 2.8], [0.0; 3]);
    let mut constraints = system.constraints().to_vec();
    for director in [1, 2] {
        let point = Place::sum(vec![(0, 1.0), (director, 1.0)]);
        let mut place = [0.0; 3];
        place[director as usize - 1] = 1.0;
        constraints.extend(QuadraticConstraint::coincidence("pin", &point, &Place::fixed(place)));
    }
    let system = system.with_constraints(constraints).unwrap();
    let x = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0];
    // A rotation about the line through both points, (−1, 1, 0)/√2.
    let v = [0.0, 0.0, -1.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0, -1.0, -1.0, 0.0];
    let start = system.state(0.0, &x, &v).unwrap();
    for method in methods() {
        let mut stepper = stepper_of(method, &system);
        let mut state = start.clone();
        for _ in 0..100 {
            stepper.step(&system, &mut state, 0.01).unwrap();
        }
        assert!(defect(&system, &state) < 1e-13, "{}", method.name());
        let (before, after) = (kinetic_energy(&system, &start), kinetic_energy(&system, &state));
        // Implicit Euler loses 2 (hω)² of the energy of a rotation per step; here (hω)² = 2e-4.
        let limit = if method.facts().conserves.angular_momentum { 1e-3 } else { 4e-2 };
        assert!((before - after).abs() < limit * before, "{}: {before} {after}", method.name());
    }
}

/// In equilibrium, forces are combinations of the gradients of the constraints, and the constraints are met.
#[test]
fn equilibria_balance_forces_and_constraints() {
    let (hung, swinging) = (hanging(false), linkage());
    for (system, start) in [hung, swinging] {
        let mut state = start;
        vi_solvers::equilibrium(&system, &mut state, &StaticOptions::default()).unwrap();
        assert!(defect(&system, &state) < 1e-12, "{:e}", defect(&system, &state));
        assert!(state.p.iter().all(|&p| p == 0.0));
        let (x, coordinates) = (system.positions(&state), system.coordinates());
        let free = |mut covector: Vec<f64>| {
            coordinates.pull_back(&mut covector);
            let mut out = vec![0.0; coordinates.free_count()];
            coordinates.restrict(&covector, &mut out);
            DVector::from_vec(out)
        };
        let forces = free(reference::gradient(&system, &x, state.t));
        let columns: Vec<DVector<f64>> = system
            .constraints()
            .iter()
            .map(|constraint| {
                let mut gradient = vec![0.0; x.len()];
                constraint.add_gradient(&x, 1.0, &mut gradient);
                free(gradient)
            })
            .collect();
        let g = DMatrix::from_columns(&columns);
        let multipliers = g.clone().svd(true, true).solve(&forces, 1e-12).unwrap();
        let unbalanced = (&forces - g * multipliers).norm();
        assert!(unbalanced < 1e-7 * forces.norm().max(1e-3), "{unbalanced:e} of {:e}", forces.norm());
    }
}

/// A refusal names every implicit scheme that takes constraints.
#[test]
fn other_schemes_refuse_constraints_by_name() {
    let (system, start) = linkage();
    let implicit = || methods().filter(|method| !method.facts().is_explicit).map(|method| method.name());
    for method in Method::ALL.into_iter().filter(|method| !method.facts().accepts.constraints) {
        let error = stepper(&method, &system, &SolverOptions::default()).err().unwrap();
        assert!(matches!(&error, SolverError::Constrained { .. }), "{}", method.name());
        let said = error.to_string();
        assert!(said.contains("pivot") && implicit().all(|name| said.contains(name)), "{said}");
    }
    let modes = vi_solvers::modes(&system, &start, vec![], &vi_solvers::ModeOptions::default());
    assert!(matches!(modes, Err(SolverError::ConstrainedAnalysis { .. })));
}
