//! Tests the continuous theory: Lagrange residuals, variations, Noether's theorem, higher Lagrangians.

use num_dual::{Dual, Dual64};
use vi_core::lagrange::{
    Scalar, Symmetry, Trajectory, accelerations, action, along, along_varied, energy, higher_residual,
    momenta, momentum_map, motion, residual, symmetry_defect, total_derivative, variation, velocities,
};
use vi_core::problems::PaisUhlenbeck;
use vi_core::{lagrangian, trajectory};

#[test]
fn residuals_vanish_on_exact_paths_and_not_on_wrong_ones() {
    let (omega, g) = (1.7, 9.81);
    let oscillator = lagrangian!(1; [omega] |_t, q, v| (v[0] * v[0] - q[0] * q[0] * (omega * omega)) * 0.5);
    let exact = trajectory!([omega] | t | vec![(t * omega).sin() * 0.3 + (t * omega).cos() * 1.1]);
    let wrong = trajectory!([omega] | t | vec![(t * (1.01 * omega)).sin() * 0.3]);
    let fall = lagrangian!(3; [g] |_t, q, v| {
        (v[0] * v[0] + v[1] * v[1] + v[2] * v[2]) * 0.5 - q[2] * g
    });
    let parabola = trajectory!([g] | t | vec![t * 2.0, t * -1.0 + 3.0, t * 4.0 - t * t * (0.5 * g)]);
    // A circular orbit of radius 2 with μ = 8 has angular velocity 1.
    let kepler = lagrangian!(2; |_t, q, v| {
        (v[0] * v[0] + v[1] * v[1]) * 0.5 + (q[0] * q[0] + q[1] * q[1]).sqrt().recip() * 8.0
    });
    let circle = trajectory!(|t| vec![t.cos() * 2.0, t.sin() * 2.0]);
    for t in [0.0, 0.4, 1.3, 2.9] {
        assert!(residual(&oscillator, &exact, t).amax() < 1e-12);
        assert!(residual(&fall, &parabola, t).amax() < 1e-12);
        assert!(residual(&kepler, &circle, t).amax() < 1e-12);
    }
    assert!(residual(&oscillator, &wrong, 0.4).amax() > 1e-3);
}

#[test]
fn time_dependent_lagrangians_have_their_explicit_term() {
    // The motions of L = e^{γt} (v² − ω²q²)/2 are damped oscillations (Caldirola–Kanai).
    let (gamma, omega) = (0.4, 2.0);
    let damped = lagrangian!(1; [gamma, omega] |t, q, v| {
        (t * gamma).exp() * (v[0] * v[0] - q[0] * q[0] * (omega * omega)) * 0.5
    });
    let ringing = (omega * omega - 0.25 * gamma * gamma).sqrt();
    let path = trajectory!([gamma, ringing] | t | vec![(t * (-0.5 * gamma)).exp() * (t * ringing).cos()]);
    for t in [0.0, 0.7, 2.0] {
        assert!(residual(&damped, &path, t).amax() < 1e-12);
        let (q, v, a) = motion(&path, t);
        assert!((accelerations(&damped, t, &q, &v).unwrap()[0] - a[0]).abs() < 1e-12);
    }
}

#[test]
fn legendre_transforms_are_inverse_and_energy_is_kept_along_motions() {
    // The Lagrangian has a velocity-dependent mass and a magnetic term.
    let odd = lagrangian!(2; |_t, q, v| {
        (v[0] * v[0] * (q[1] * q[1] + 1.0) + v[1] * v[1] * 2.0) * 0.5 + v[0].powi(4) * 0.1
            + q[0] * v[1] - q[1] * v[0] - q[0] * q[0] * 0.5
    });
    let (q, v) = ([0.3, -0.8], [0.7, 0.2]);
    let p = momenta(&odd, 0.0, &q, &v);
    let back = velocities(&odd, 0.0, &q, p.as_slice()).unwrap();
    assert!((back[0] - v[0]).abs() < 1e-14 && (back[1] - v[1]).abs() < 1e-14);
    // With the accelerations of the Lagrange equations, dE/dt = 0.
    let a = accelerations(&odd, 0.0, &q, &v).unwrap();
    let at = |e: f64| {
        let q = [q[0] + e * v[0] + 0.5 * e * e * a[0], q[1] + e * v[1] + 0.5 * e * e * a[1]];
        energy(&odd, 0.0, &q, &[v[0] + e * a[0], v[1] + e * a[1]])
    };
    assert!(((at(1e-5) - at(-1e-5)) / 2e-5).abs() < 1e-9);
    let massless = lagrangian!(1; |_t, q, v| q[0] * v[0]);
    assert!(accelerations(&massless, 0.0, &[1.0], &[0.0]).is_err());
}

#[test]
fn the_variation_obeys_product_chain_and_commutation_rules() {
    let f = lagrangian!(1; |t, q, v| q[0] * q[0] * v[0] + t * q[0]);
    let g = lagrangian!(1; |_t, q, v| q[0].sin() + v[0] * v[0]);
    let product = lagrangian!(1; |t, q, v| (q[0] * q[0] * v[0] + t * q[0]) * (q[0].sin() + v[0] * v[0]));
    let chain = lagrangian!(1; |t, q, v| (q[0] * q[0] * v[0] + t * q[0]).exp());
    let path = trajectory!(|t| vec![(t * 1.3).sin() + t * 0.2]);
    let eta = trajectory!(|t| vec![(t - 0.5) * t * (t * 2.0).cos()]);
    for t in [0.1, 0.9] {
        let (df, dg) = (variation(&f, &path, &eta, t), variation(&g, &path, &eta, t));
        let (at_f, at_g) = (along(&f, &path, t), along(&g, &path, t));
        assert!((variation(&product, &path, &eta, t) - (at_f * dg + at_g * df)).abs() < 1e-14);
        assert!((variation(&chain, &path, &eta, t) - at_f.exp() * df).abs() < 1e-14);
        // Checks δ(df/dt) = d/dt(δf) by nesting the dual numbers of ε and t in both orders.
        let constant = |x: f64| Dual64::from_re(x);
        let epsilon_outside = along_varied(
            &f,
            &path,
            &eta,
            Dual::new(Dual64::new(t, 1.0), constant(0.0)),
            Dual::new(constant(0.0), constant(1.0)),
        );
        let time_outside = along_varied(
            &f,
            &path,
            &eta,
            Dual::new(constant(t), constant(1.0)),
            Dual::new(Dual64::new(0.0, 1.0), constant(0.0)),
        );
        assert!((epsilon_outside.eps.eps - time_outside.eps.eps).abs() < 1e-13);
        let e = 1e-5;
        let slope = (variation(&f, &path, &eta, t + e) - variation(&f, &path, &eta, t - e)) / (2.0 * e);
        assert!((time_outside.eps.eps - slope).abs() < 1e-8);
    }
    assert!(
        (total_derivative(&g, &path, 0.3) - {
            let (q, v, a) = motion(&path, 0.3);
            q[0].cos() * v[0] + 2.0 * v[0] * a[0]
        })
        .abs()
            < 1e-14
    );
}

#[test]
fn the_action_is_stationary_on_motions_only() {
    let pendulum = lagrangian!(1; |_t, q, v| v[0] * v[0] * 0.5 - q[0] * q[0] * 0.5);
    let path = trajectory!(|t| vec![t.cos()]);
    // δS = [p η] − ∫ residual η; if η vanishes at the ends, only the residual contributes.
    struct Varied(f64, f64);
    impl Trajectory for Varied {
        fn at<D: Scalar>(&self, t: D) -> Vec<D> {
            vec![(t * self.1).cos() + t * (t * -1.0 + 2.0) * self.0]
        }
    }
    let slope = |frequency: f64| {
        let s = |e: f64| action(&pendulum, &Varied(e, frequency), 0.0, 2.0, 8).unwrap();
        (s(1e-4) - s(-1e-4)) / 2e-4
    };
    assert!(slope(1.0).abs() < 1e-11);
    assert!(slope(1.2).abs() > 0.05);
    let exact = -(4.0_f64).sin() / 4.0;
    assert!((action(&pendulum, &path, 0.0, 2.0, 8).unwrap() - exact).abs() < 1e-14);
    assert!(action(&pendulum, &path, 0.0, 2.0, 0).is_err());
}

struct Turn;

impl Symmetry for Turn {
    fn generator<D: Scalar>(&self, q: &[D]) -> Vec<D> {
        vec![-q[1], q[0]]
    }
}

#[test]
fn a_symmetry_is_seen_and_gives_its_momentum() {
    let central = lagrangian!(2; |_t, q, v| {
        let r2 = q[0] * q[0] + q[1] * q[1];
        (v[0] * v[0] + v[1] * v[1]) * 0.5 - r2 * r2
    });
    let tilted = lagrangian!(2; |_t, q, v| (v[0] * v[0] + v[1] * v[1]) * 0.5 - q[0]);
    let (q, v) = ([0.3, 0.9], [-0.2, 0.4]);
    assert!(symmetry_defect(&central, &Turn, 0.0, &q, &v).abs() < 1e-15);
    assert!(symmetry_defect(&tilted, &Turn, 0.0, &q, &v).abs() > 0.1);
    assert!((momentum_map(&Turn, &q, &v) - (0.3 * 0.4 + 0.9 * 0.2)).abs() < 1e-15);
}

#[test]
fn higher_lagrangians_have_their_fourth_order_equation() {
    // The solutions of q⁗ + 5 q̈ + 4 q = 0 have the frequencies 1 and 2 only.
    let path = trajectory!(|t| vec![t.cos() * 0.7 + (t * 2.0).sin() * 0.3]);
    let wrong = trajectory!(|t| vec![(t * 1.5).cos()]);
    for t in [0.0, 0.6, 1.7] {
        assert!(higher_residual(&PaisUhlenbeck(1.0, 2.0), &path, t).amax() < 1e-12);
    }
    assert!(higher_residual(&PaisUhlenbeck(1.0, 2.0), &wrong, 0.3).amax() > 0.1);
    // For a Lagrangian of first order, the higher residual is minus the ordinary one.
    let quartic = lagrangian!(1; |_t, q, v| v[0] * v[0] * (q[0] * q[0] + 1.0) - q[0].powi(4));
    let ordinary = residual(&quartic, &path, 0.4)[0];
    let higher = higher_residual(&vi_core::lagrange::FirstOrder(quartic), &path, 0.4)[0];
    assert!((ordinary + higher).abs() < 1e-12);
}
