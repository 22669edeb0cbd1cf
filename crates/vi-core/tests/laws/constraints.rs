//! Tests that constraints hold to round-off under RATTLE and its generalisations of higher order, and compares them
//! with projection.

use vi_core::constraints::{Constrained, Constraint, Rattle};
use vi_core::lagrange::Scalar;
use vi_core::problems::{Sphere, SphericalPendulum};
use vi_core::{Scheme, State, kinetic_energy, lagrangian, reference};

const PENDULUM: SphericalPendulum = SphericalPendulum { length: 1.0, gravity: 1.0 };

fn start() -> State {
    State { t: 0.0, q: vec![0.6, 0.0, -0.8], p: vec![0.0, 0.9, 0.0] }
}

fn on_sphere(state: &State) -> (f64, f64) {
    let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    ((dot(&state.q, &state.q) - 1.0).abs(), dot(&state.q, &state.p).abs())
}

#[test]
fn rattle_stays_on_its_surface_over_a_million_steps() {
    let system = PENDULUM.particle().unwrap();
    let rattle = Rattle::new(&system, Sphere(1.0));
    let mut state = start();
    let energy = |s: &State| kinetic_energy(&system, s) + s.q[2];
    let (initial, mut worst, mut surface) = (energy(&state), 0.0_f64, (0.0_f64, 0.0_f64));
    let spin = state.q[0] * state.p[1] - state.q[1] * state.p[0];
    for _ in 0..1_000_000 {
        state = rattle.step(&state, 0.02).unwrap();
        let (position, velocity) = on_sphere(&state);
        surface = (surface.0.max(position), surface.1.max(velocity));
        worst = worst.max((energy(&state) - initial).abs());
    }
    assert!(surface.0 < 1e-12 && surface.1 < 1e-12, "{surface:?}");
    assert!(worst < 2e-4, "energy oscillates, it does not drift: {worst:e}");
    let now = state.q[0] * state.p[1] - state.q[1] * state.p[0];
    assert!((now - spin).abs() < 1e-10, "{:e}", now - spin);
}

#[test]
fn the_lobatto_family_begins_with_rattle_and_has_order_2s() {
    let system = PENDULUM.particle().unwrap();
    let rattle = Rattle::new(&system, Sphere(1.0));
    let first = Constrained::new(&system, Sphere(1.0), 1, 0.1).unwrap();
    let (a, b) = (rattle.step(&start(), 0.1).unwrap(), first.step(&start()).unwrap());
    for (a, b) in a.q.iter().chain(&a.p).zip(b.q.iter().chain(&b.p)) {
        assert!((a - b).abs() < 1e-13);
    }
    let end = |degree: usize, steps: usize| {
        let integrator = Constrained::new(&system, Sphere(1.0), degree, 2.0 / steps as f64).unwrap();
        let mut state = start();
        for _ in 0..steps {
            state = integrator.step(&state).unwrap();
            let (position, velocity) = on_sphere(&state);
            assert!(position < 1e-13 && velocity < 1e-13);
        }
        state
    };
    let exact = end(4, 40);
    for (degree, steps) in [(1, 40), (2, 16), (3, 8)] {
        let error = |steps| {
            let found = end(degree, steps);
            found.q.iter().zip(&exact.q).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
        };
        let order = (error(steps) / error(2 * steps)).log2();
        assert!((order - 2.0 * degree as f64).abs() < 0.4, "degree {degree}: {order}");
    }
}

#[test]
fn angles_and_multipliers_give_the_same_motion() {
    // Compares the spherical pendulum in two angles by Gauss-4 with the same pendulum on its sphere by degree 4.
    let system = PENDULUM.particle().unwrap();
    let (h, steps) = (0.05, 40);
    let on_surface = Constrained::new(&system, Sphere(1.0), 4, h).unwrap();
    let in_angles =
        vi_core::discrete::DiscreteLagrangian::new(&PENDULUM, &Scheme::gauss(4).unwrap(), h).unwrap();
    let theta = 0.8_f64.acos();
    let mut a = start();
    let mut b = State { t: 0.0, q: vec![theta, 0.0], p: vec![0.0, 0.6 * 0.9] };
    for _ in 0..steps {
        a = on_surface.step(&a).unwrap();
        b = in_angles.step(&b).unwrap();
    }
    let (theta, phi) = (b.q[0], b.q[1]);
    let position = [theta.sin() * phi.cos(), theta.sin() * phi.sin(), -theta.cos()];
    for k in 0..3 {
        assert!((a.q[k] - position[k]).abs() < 1e-9, "{:?} {position:?}", a.q);
    }
}

/// Two rods: |x_1| = 1 and |x_2 − x_1| = 1.
struct Rods;

impl Constraint for Rods {
    fn count(&self) -> usize {
        2
    }
    fn value<D: Scalar>(&self, q: &[D]) -> Vec<D> {
        let (x, y) = (q[2] - q[0], q[3] - q[1]);
        vec![(q[0] * q[0] + q[1] * q[1] - 1.0) * 0.5, (x * x + y * y - 1.0) * 0.5]
    }
}

#[test]
fn a_double_pendulum_of_rods_keeps_its_energy_and_any_lagrangian_will_do() {
    let two = lagrangian!(4; |_t, q, v| {
        (v[0] * v[0] + v[1] * v[1] + v[2] * v[2] + v[3] * v[3]) * 0.5 - q[1] - q[3]
    });
    let integrator = Constrained::new(&two, Rods, 2, 0.02).unwrap();
    let mut state = State { t: 0.0, q: vec![1.0, 0.0, 2.0, 0.0], p: vec![0.0; 4] };
    for _ in 0..1000 {
        state = integrator.step(&state).unwrap();
        let energy = 0.5 * state.p.iter().map(|p| p * p).sum::<f64>() + state.q[1] + state.q[3];
        assert!(energy.abs() < 1e-3);
        assert!(Rods.value(&state.q).iter().all(|g| g.abs() < 1e-13));
    }
}

#[test]
fn a_penalty_is_no_constraint() {
    // With a stiff spring in place of the rod the motion is symplectic but leaves the surface.
    let stiff = lagrangian!(3; |_t, q, v| {
        let r = (q[0] * q[0] + q[1] * q[1] + q[2] * q[2]).sqrt();
        (v[0] * v[0] + v[1] * v[1] + v[2] * v[2]) * 0.5 - q[2] - (r - 1.0) * (r - 1.0) * 500.0
    });
    let discrete =
        vi_core::discrete::DiscreteLagrangian::new(&stiff, &Scheme::stormer_verlet(), 0.02).unwrap();
    let mut state = start();
    let mut away = 0.0_f64;
    for _ in 0..500 {
        state = discrete.step(&state).unwrap();
        away = away.max(on_sphere(&state).0);
    }
    assert!(away > 1e-3, "{away:e}");
    assert!(reference::step(&PENDULUM.particle().unwrap(), &Scheme::stormer_verlet(), &start(), 0.1).is_ok());
}

#[test]
fn a_state_is_made_tangent_and_an_unreachable_surface_is_an_error() {
    let system = PENDULUM.particle().unwrap();
    let rattle = Rattle::new(&system, Sphere(1.0));
    let off = State { p: vec![0.3, 0.9, 0.5], ..start() };
    assert!(on_sphere(&rattle.tangent(&off).unwrap()).1 < 1e-15);
    let fast = State { p: vec![0.0, 50.0, 0.0], ..start() };
    assert!(rattle.step(&fast, 1.0).is_err());
}
