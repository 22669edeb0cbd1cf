//! Defines a material law by its energy alone: Gent's rubber, whose chains cannot be stretched beyond a limit. A cube
//! of it is pulled to 1.8 times its length, and the pulling force agrees with the law.

use variational::core::lagrange::Scalar;
use variational::fem::{Differentiated, EnergyDensity, OwnLaw, PointLaw, Translate};
use variational::prelude::*;

/// Ψ = −μ J_m/2 ln(1 − (I₁ − 3)/J_m) − μ ln J + λ/2 ln²J (Gent 1996), for I₁ − 3 < J_m.
#[derive(Clone)]
struct Gent {
    mu: f64,
    lambda: f64,
    limit: f64,
}

impl EnergyDensity for Gent {
    fn density(&self) -> f64 {
        1000.0
    }

    fn energy<D: Scalar>(&self, f: &[[D; 3]; 3]) -> D {
        let minor = |a: usize, b: usize| f[1][a] * f[2][b] - f[1][b] * f[2][a];
        let log_j = (f[0][0] * minor(1, 2) - f[0][1] * minor(0, 2) + f[0][2] * minor(0, 1)).ln();
        let squares = f.as_flattened().iter().map(|&entry| entry * entry);
        let stretch = squares.reduce(|sum, square| sum + square).expect("nine entries") - 3.0;
        let chains = (stretch * (-1.0 / self.limit) + 1.0).ln() * (-0.5 * self.mu * self.limit);
        chains - log_j * self.mu + log_j * log_j * (0.5 * self.lambda)
    }
}

fn main() {
    let gent = Gent { mu: 3e5, lambda: 1e6, limit: 2.5 };
    let shape = BoxMesh { size: [0.1; 3], cells: [2; 3], element: CellKind::Hex8, origin: [0.0; 3] };
    let pull = Motion::Translate(Translate { velocity: [0.08, 0.0, 0.0], start: 0.0, end: None });
    let mut scene = Scene::new(Time::new(1.0, 0.05, SchemeName::ImplicitMidpoint))
        .body(Body::from_box("cube", shape, OwnLaw::from_energy("gent", gent.clone())))
        .fix(Fix::region("cube", "x-min").axes(&[Axis::X]))
        .fix(Fix::region("cube", "y-min").axes(&[Axis::Y]))
        .fix(Fix::region("cube", "z-min").axes(&[Axis::Z]))
        .fix(Fix::region("cube", "x-max").axes(&[Axis::X]).motion(pull));
    scene.statics = Some(Static::default());
    let mut simulation = Simulation::new(scene).expect("a valid scene");
    while !simulation.is_done() {
        simulation.step().expect("an equilibrium");
    }
    let width = simulation.positions(0).iter().map(|x| x[1]).fold(0.0, f64::max);
    let side = width / 0.1;
    let stress = Differentiated(gent).stress(&[[1.8, 0.0, 0.0], [0.0, side, 0.0], [0.0, 0.0, side]]);
    let force: f64 = simulation.reactions(0).iter().map(|r| r[0].max(0.0)).sum();
    println!("{force:.6} N pull it, P₁₁ A = {:.6} N", stress[0][0] * 0.01);
    assert!((force / (stress[0][0] * 0.01) - 1.0).abs() < 1e-6);
    assert!(stress[1][1].abs() < 1e-6 * stress[0][0], "nothing holds its sides");
}
