//! Tests the frequencies that adaptive steps follow: they are those of the motion relative to a flight, and of nothing else.

use crate::bodies::stepper_of;
use vi_core::problems::{Jet, SpringChain, Term};
use vi_core::{Coordinates, HessianKind, Path, Potential, Prescribed, State, System};
use vi_solvers::{Frequencies, Method};

fn frequency(system: &System, state: &State) -> f64 {
    Frequencies::new(system).of_motion(system, state).unwrap().square.sqrt()
}

/// Returns the state with velocities (m/s) added to its nodes.
fn boosted(system: &System, state: &State, velocity: impl Fn(usize) -> [f64; 3]) -> State {
    let free = system.coordinates().free().iter().map(|&dof| dof as usize);
    let p = free.zip(&state.p).zip(system.free_mass());
    let p = p.map(|((dof, p), mass)| p + mass * velocity(dof / 3)[dof % 3]).collect();
    State { p, ..state.clone() }
}

/// Springs of no length between pairs of nodes, of this stiffness (N/m).
fn springs(stiffness: f64, nodes: Vec<u32>) -> Box<dyn Potential> {
    let jet = move |_: usize, x: &[f64; 6]| {
        let mut jet = Jet { energy: 0.0, gradient: [0.0; 6], hessian: [[0.0; 6]; 6] };
        for i in 0..6 {
            jet.hessian[i][i] = stiffness;
            jet.hessian[i][(i + 3) % 6] = -stiffness;
            jet.gradient[i] = stiffness * (x[i] - x[(i + 3) % 6]);
            jet.energy += 0.5 * jet.gradient[i] * x[i];
        }
        jet
    };
    Box::new(Term { name: "springs", block: 3, nodes, hessian: HessianKind::Constant, jet })
}

/// A spring of no length between a node and the origin.
fn anchor(stiffness: f64, node: u32) -> Box<dyn Potential> {
    let jet = move |_: usize, x: &[f64; 3]| Jet {
        energy: 0.5 * stiffness * x.iter().map(|x| x * x).sum::<f64>(),
        gradient: x.map(|x| stiffness * x),
        hessian: std::array::from_fn(|i| std::array::from_fn(|j| if i == j { stiffness } else { 0.0 })),
    };
    Box::new(Term { name: "anchor", block: 3, nodes: vec![node], hessian: HessianKind::Constant, jet })
}

/// A body that flies requires the same steps as at rest, and so does its reversed motion.
#[test]
fn a_flight_changes_no_frequency() {
    let chain = SpringChain::unit(7);
    let (system, state) = (chain.system().unwrap(), chain.disturbed_state());
    let at_rest = frequency(&system, &boosted(&system, &state, |_| [0.0; 3]));
    for velocity in [[1.0, 0.0, 0.0], [30.0, -40.0, 20.0], [0.0, 1e3, -1e3]] {
        let flying = boosted(&system, &state, |_| velocity);
        let found = frequency(&system, &flying);
        assert!((found / at_rest - 1.0).abs() < 1e-6, "{velocity:?}: {found} {at_rest}");
        let reversed = State { p: flying.p.iter().map(|p| -p).collect(), ..flying };
        assert_eq!(frequency(&system, &reversed), found);
    }
}

/// Bodies of one system that nothing connects fly apart without a change.
#[test]
fn each_body_may_have_a_flight_of_its_own() {
    let system =
        System::new(vec![1.0; 12], vec![springs(9.0, vec![0, 1, 2, 3])], Coordinates::all_free(12)).unwrap();
    let q = vec![0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 5.0, 0.0, 0.0, 6.0, 0.0, 0.0];
    let p = vec![0.1, 0.0, 0.0, -0.1, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0];
    let state = State { t: 0.0, q, p };
    // ω² = 2k/m.
    let omega = 18.0_f64.sqrt();
    for velocity in [0.0, 1.0, 100.0] {
        let state =
            boosted(
                &system,
                &state,
                |node| if node < 2 { [velocity, 0.0, 0.0] } else { [0.0, -velocity, 0.0] },
            );
        let found = frequency(&system, &state);
        assert!((found / omega - 1.0).abs() < 1e-6, "{velocity} m/s: {found} {omega}");
    }
}

/// A uniform flight requires no step, also after steps whose equations were solved to round-off.
#[test]
fn a_flight_alone_has_no_frequency() {
    let chain = SpringChain::unit(7);
    let system = chain.system().unwrap();
    let q: Vec<f64> = (0..21).map(|dof| if dof % 3 == 0 { f64::from(dof / 3) } else { 0.0 }).collect();
    let still = State { t: 0.0, q, p: vec![0.0; 21] };
    let mut state = boosted(&system, &still, |_| [30.0, -40.0, 20.0]);
    let start = state.clone();
    assert_eq!(frequency(&system, &state), 0.0);
    for method in [Method::ImplicitMidpoint, Method::EnergyMomentum, Method::StormerVerlet] {
        state = start.clone();
        let mut stepper = stepper_of(method, &system);
        (0..50).for_each(|_| {
            stepper.step(&system, &mut state, 0.1).unwrap();
        });
        // Round-off turns it at most.
        let found = frequency(&system, &state);
        assert!(found < 1e-9, "{}: {found:e} rad/s", method.name());
    }
}

/// A stiff body on a soft spring swings at the rate of the spring: its place matters, and is not taken for a flight.
#[test]
fn a_body_on_a_spring_swings_at_its_rate() {
    let mut potentials = vec![springs(1e8, vec![0, 1]), anchor(8.0, 0)];
    let system =
        System::new(vec![1.0; 6], std::mem::take(&mut potentials), Coordinates::all_free(6)).unwrap();
    let still = State { t: 0.0, q: vec![0.0, 0.0, 0.0, 0.0, 0.0, 0.0], p: vec![0.0; 6] };
    let state = boosted(&system, &State { q: vec![1.0; 6], ..still }, |_| [3.0, 0.0, 0.0]);
    // ω² = k/(2 m).
    assert!((frequency(&system, &state) - 2.0).abs() < 1e-3, "{}", frequency(&system, &state));
}

/// A support that moves uniformly.
struct Carriage([f64; 3]);

impl Path for Carriage {
    fn position(&self, t: f64, out: &mut [f64]) {
        out.iter_mut().zip(self.0).for_each(|(out, v)| *out = v * t);
    }
    fn velocity(&self, _t: f64, out: &mut [f64]) {
        out.copy_from_slice(&self.0);
    }
}

/// A body on a support that moves uniformly requires the same steps as on a support at rest.
#[test]
fn a_moving_support_carries_its_body() {
    let chain = SpringChain::unit(5);
    let free = chain.disturbed_state();
    let on = |velocity: [f64; 3]| {
        let held = Prescribed { dofs: vec![0, 1, 2], path: Box::new(Carriage(velocity)) };
        let system = chain.system_holding(vec![held]).unwrap();
        let state = State { t: 0.0, q: free.q[3..].to_vec(), p: free.p[3..].to_vec() };
        let state = boosted(&system, &state, |_| velocity);
        frequency(&system, &state)
    };
    let at_rest = on([0.0; 3]);
    for velocity in [[1.0, 0.0, 0.0], [-30.0, 50.0, 7.0]] {
        let found = on(velocity);
        assert!((found / at_rest - 1.0).abs() < 1e-6, "{velocity:?}: {found} {at_rest}");
    }
}
