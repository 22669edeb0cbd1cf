//! Tests small oscillations with gyroscopic terms: Foucault's pendulum, Lagrange's points, gyroscopic stabilisation.

use vi_core::CoreError;
use vi_core::lagrange::{Lagrangian, Scalar};
use vi_core::oscillations::{is_spectrally_stable, oscillations};
use vi_core::problems::SpringChain;

/// A particle in a plane frame that rotates with Ω, in a potential ½ (a x² + b y²): L = ½ |v + Ω × q|² − V.
struct Turning {
    rate: f64,
    field: [f64; 2],
}

impl Lagrangian for Turning {
    fn dof_count(&self) -> usize {
        2
    }
    fn value<D: Scalar>(&self, _t: D, q: &[D], v: &[D]) -> D {
        let (x, y) = (v[0] - q[1] * self.rate, v[1] + q[0] * self.rate);
        (x * x + y * y) * 0.5 - q[0] * q[0] * (0.5 * self.field[0]) - q[1] * q[1] * (0.5 * self.field[1])
    }
}

#[test]
fn foucaults_pendulum_beats_with_the_turning_of_the_ground() {
    let found = oscillations(&Turning { rate: 0.3, field: [4.0, 4.0] }, 0.0, &[0.0, 0.0]).unwrap();
    assert_eq!(found.len(), 2);
    for (motion, expected) in found.iter().zip([1.7, 2.3]) {
        assert!((motion.frequency() - expected).abs() < 1e-12 && motion.rate.re.abs() < 1e-12);
        // The motion is circular: y lags or leads x by a quarter period.
        let ratio = motion.shape[1] / motion.shape[0];
        assert!((ratio.norm() - 1.0).abs() < 1e-10 && ratio.re.abs() < 1e-10);
    }
}

/// In a rotating frame a saddle is stable between bounds (a rotating trap).
#[test]
fn turning_can_stabilise_a_hill() {
    let stable = |rate: f64| {
        let found = oscillations(&Turning { rate, field: [-1.0, -1.0] }, 0.0, &[0.0, 0.0]).unwrap();
        is_spectrally_stable(&found, 1e-9)
    };
    // On an axisymmetric hill the particle rolls off in the inertial frame, whatever the rate of the frame.
    assert!(!stable(0.5) && !stable(3.0));
    let saddle = |rate: f64| {
        let found = oscillations(&Turning { rate, field: [1.0, -0.5] }, 0.0, &[0.0, 0.0]).unwrap();
        is_spectrally_stable(&found, 1e-9)
    };
    // With K = diag(a − Ω², b − Ω²) the characteristic equation is λ⁴ + (a + b + 2Ω²) λ² + (a − Ω²)(b − Ω²) = 0, which
    // is stable for Ω² > a.
    assert!(!saddle(0.5) && !saddle(0.9) && saddle(1.1) && saddle(2.0));
}

/// The restricted three-body problem in the frame of the two primaries, at distance 1 and angular velocity 1.
struct ThreeBodies {
    /// Mass fraction of the lighter primary.
    part: f64,
}

impl Lagrangian for ThreeBodies {
    fn dof_count(&self) -> usize {
        2
    }
    fn value<D: Scalar>(&self, _t: D, q: &[D], v: &[D]) -> D {
        let (x, y) = (v[0] - q[1], v[1] + q[0]);
        let distance = |at: f64| ((q[0] - at) * (q[0] - at) + q[1] * q[1]).sqrt();
        let field =
            distance(-self.part).recip() * (1.0 - self.part) + distance(1.0 - self.part).recip() * self.part;
        (x * x + y * y) * 0.5 + field
    }
}

#[test]
fn lagranges_triangle_is_stable_below_gascheaus_ratio() {
    let at = |part: f64| {
        let q = [0.5 - part, 0.75_f64.sqrt()];
        oscillations(&ThreeBodies { part }, 0.0, &q).unwrap()
    };
    for part in [0.001, 0.012, 0.038] {
        let found = at(part);
        // The characteristic equation is λ⁴ + λ² + (27/4) μ (1 − μ) = 0.
        let root = (1.0 - 27.0 * part * (1.0 - part)).sqrt();
        for (motion, expected) in found.iter().zip([(0.5 * (1.0 - root)).sqrt(), (0.5 * (1.0 + root)).sqrt()])
        {
            assert!((motion.frequency() - expected).abs() < 1e-8, "{part}: {motion:?} {expected}");
        }
        assert!(is_spectrally_stable(&found, 1e-7));
    }
    // The critical mass fraction is μ₁ = ½ (1 − √(23/27)) = 0.03852…
    assert!(!is_spectrally_stable(&at(0.039), 1e-3));
}

#[test]
fn a_place_that_is_no_equilibrium_is_refused() {
    let chain = SpringChain::unit(4);
    let system = chain.system().unwrap();
    let rest = chain.disturbed_state();
    assert!(matches!(oscillations(&system, 0.0, &rest.q), Err(CoreError::Convergence { .. })));
}
