//! Tests generalised coordinates and statics: d'Alembert equals Lagrange, constraint forces, the lever, the bead on a
//! hoop and its bifurcation.

use nalgebra::DVector;
use vi_core::discrete::DiscreteLagrangian;
use vi_core::generalised::{
    Embedded, applied_force, constraint_force, control_tangent, generalised_accelerations, motion_of_points,
    tangent,
};
use vi_core::lagrange::{Expand, accelerations};
use vi_core::problems::{BeadOnHoop, Lever};
use vi_core::statics::{
    AtRest, Energy, bifurcation_between, equilibria, first_variation, follow, virtual_work,
};
use vi_core::{CoreError, Scheme, State};

const BEAD: BeadOnHoop = BeadOnHoop { radius: 1.3, gravity: 9.81, omega: 4.0 };

#[test]
fn d_alembert_and_lagrange_agree_and_the_constraint_force_does_no_virtual_work() {
    let (t, q, v) = (0.3, [1.1], [0.7]);
    let (x, x_dot) = motion_of_points(&BEAD, t, &q, &v);
    let s = tangent(&BEAD, t, &q);
    let sigma = control_tangent(&BEAD, t, &q);
    assert!((x_dot - (&s * 0.7 + &sigma * BEAD.omega).column(0)).amax() < 1e-14);
    let force = applied_force(&BEAD, t, &x);
    let by_force = generalised_accelerations(&BEAD, t, &q, &v, &force).unwrap();
    let by_lagrange = accelerations(&Embedded(BEAD), t, &q, &v).unwrap();
    assert!((&by_force - &by_lagrange).amax() < 1e-13);
    // Derived by hand: r q̈ = r ω² sin q cos q + g sin q.
    let (sin, cos) = q[0].sin_cos();
    assert!((by_force[0] - (16.0 * sin * cos + 9.81 / 1.3 * sin)).abs() < 1e-13);
    let reaction = constraint_force(&BEAD, t, &q, &v, by_force.as_slice(), &force);
    assert!((s.transpose() * &reaction).amax() < 1e-12);
    assert!(reaction.norm() > 1.0, "the wire does push");
    // The mass matrix is M(q) = SᵀMS.
    let mass = Embedded(BEAD).expansion(t, &q, &v).vv;
    assert!((mass - s.transpose() * s).amax() < 1e-13);
}

#[test]
fn a_driven_frame_integrates_variationally() {
    // The Jacobi integral ½ r² q̇² + amended potential is conserved. L depends on time only through the frame, and in
    // the expansion by dual numbers this dependence cancels.
    let bead = Embedded(BEAD);
    let discrete = DiscreteLagrangian::new(&bead, &Scheme::gauss(3).unwrap(), 0.02).unwrap();
    let mut state = State { t: 0.0, q: vec![2.0], p: vec![0.4] };
    let jacobi = |s: &State| 0.5 * s.p[0] * s.p[0] / (1.3 * 1.3) + BEAD.value(BEAD.omega, &s.q);
    let initial = jacobi(&state);
    for _ in 0..500 {
        state = discrete.step(&state).unwrap();
        assert!((jacobi(&state) - initial).abs() < 1e-7 * initial.abs());
    }
}

#[test]
fn the_law_of_the_lever_is_virtual_work() {
    let lever = Lever { loads: vec![(2.0, -3.0), (1.0, 2.0), (0.5, 8.0)], gravity: 9.81 };
    assert!(lever.moment().abs() < 1e-14);
    let tilted = Lever { loads: vec![(2.0, -3.0), (1.0, 2.0)], ..lever.clone() };
    for (lever, balances) in [(lever, true), (tilted, false)] {
        let moment = lever.moment();
        let at_rest = AtRest(Embedded(lever));
        let level = DVector::zeros(1);
        let work = virtual_work(&at_rest, 0.0, &level, &DVector::from_element(1, 1.0));
        assert!((work + moment).abs() < 1e-13);
        assert_eq!(work.abs() < 1e-13, balances);
        // A lever out of balance hangs straight down in its stable equilibrium; straight up is the unstable one.
        if !balances {
            let starts: Vec<Vec<f64>> = (0..8).map(|k| vec![0.7 * k as f64 - 2.5]).collect();
            let found = equilibria(&at_rest, 0.0, &starts, 1e-6);
            assert!(found.iter().any(|e| e.is_stable()) && found.iter().any(|e| !e.is_stable()));
            for equilibrium in found {
                assert!(first_variation(&at_rest, 0.0, &equilibrium.q).amax() < 1e-12);
                assert!(equilibrium.q[0].cos().abs() < 1e-12);
            }
        }
    }
}

#[test]
fn the_bead_has_its_equilibria_stabilities_and_frequencies() {
    for (omega, degrees, frequency) in [
        (4.0, 127.8158054, 3.159943631),
        (5.0, 113.1039171, 4.598973364),
        (2.0, 180.0, (9.81_f64 - 4.0).sqrt()),
    ] {
        let bead = BeadOnHoop { radius: 1.0, gravity: 9.81, omega };
        let starts: Vec<Vec<f64>> = (0..12).map(|k| vec![0.05 + 0.28 * k as f64]).collect();
        let mut found = equilibria(&AtRest(Embedded(bead)), 0.0, &starts, 1e-6);
        found.retain(|e| e.q[0] > -1e-9 && e.q[0] < std::f64::consts::PI + 1e-9);
        assert_eq!(found.len(), if omega > 9.81_f64.sqrt() { 3 } else { 2 }, "{found:?}");
        let stable: Vec<_> = found.iter().filter(|e| e.is_stable()).collect();
        assert_eq!(stable.len(), 1);
        assert!((stable[0].q[0].to_degrees() - degrees).abs() < 1e-7);
        assert!((stable[0].q[0] - bead.equilibrium()).abs() < 1e-7);
        // The frequency of small oscillations satisfies ω² = V''/M.
        assert!((stable[0].curvatures[0].sqrt() - frequency).abs() < 1e-8);
        assert!((bead.frequency() - frequency).abs() < 1e-8);
        // Integration confirms it: after one period of small oscillation the bead is back.
        let steps = 60;
        let embedded = Embedded(bead);
        let h = 2.0 * std::f64::consts::PI / frequency / steps as f64;
        let discrete = DiscreteLagrangian::new(&embedded, &Scheme::gauss(3).unwrap(), h).unwrap();
        let start = bead.equilibrium() + 1e-5;
        let mut state = State { t: 0.0, q: vec![start], p: vec![0.0] };
        for _ in 0..steps {
            state = discrete.step(&state).unwrap();
        }
        assert!((state.q[0] - start).abs() < 1e-9);
    }
}

#[test]
fn a_bifurcation_is_followed_in_its_parameter() {
    // At the bottom the bead loses its stability at ω = √(g/r), where the branch of tilted equilibria begins.
    let bead = BeadOnHoop { radius: 1.0, gravity: 9.81, omega: 0.0 };
    let down = equilibria(&bead, 1.0, &[vec![3.0]], 1e-6).remove(0);
    let branch = follow(&bead, &down, 0.2, 20).unwrap();
    let change = branch.windows(2).position(|pair| pair[0].is_stable() != pair[1].is_stable()).unwrap();
    let critical = bifurcation_between(&bead, &branch[change], &branch[change + 1], 1e-10).unwrap();
    assert!((critical.parameter - 9.81_f64.sqrt()).abs() < 1e-9);
    // Follows the tilted branch from ω = 6 down towards the bifurcation.
    let tilted = equilibria(&bead, 6.0, &[vec![1.9]], 1e-6).remove(0);
    for point in follow(&bead, &tilted, -0.05, 55).unwrap() {
        let exact = BeadOnHoop { omega: point.parameter, ..bead }.equilibrium();
        assert!((point.q[0] - exact).abs() < 1e-10 || point.parameter < 9.81_f64.sqrt() + 1e-6);
    }
}

/// The energy x⁴/4 − x²/2 + μ x has two folds.
struct Fold;

impl Energy for Fold {
    fn dof_count(&self) -> usize {
        1
    }
    fn value<D: vi_core::lagrange::Scalar>(&self, parameter: D, q: &[D]) -> D {
        q[0].powi(4) * 0.25 - q[0] * q[0] * 0.5 + parameter * q[0]
    }
}

#[test]
fn continuation_turns_folds() {
    let start = equilibria(&Fold, -1.0, &[vec![1.5]], 1e-6).remove(0);
    let branch = follow(&Fold, &start, 0.05, 100).unwrap();
    for point in &branch {
        let x = point.q[0];
        assert!((x * x * x - x + point.parameter).abs() < 1e-12);
    }
    let top = branch.iter().filter(|p| p.q[0] > 0.0).map(|p| p.parameter).fold(f64::MIN, f64::max);
    assert!((top - 2.0 / 27.0_f64.sqrt()).abs() < 2e-3, "the fold at 2/√27: {top}");
    assert!(branch.iter().any(|p| !p.is_stable()) && branch.last().unwrap().is_stable());
    let flat = equilibria(&Fold, 0.0, &[vec![1.0 / 3.0_f64.sqrt()]], 1e-6);
    assert!(flat.len() <= 1, "a start on a fold leads somewhere or nowhere, never to a panic");
    assert!(CoreError::SingularStiffness { parameter: 0.0 }.to_string().contains("singular"));
}
