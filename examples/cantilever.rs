//! A cantilever that bends under its weight, compared with beam theory: small deflections are ρ g A L⁴/(8 E I).

use variational::prelude::*;

fn main() {
    let (length, height, young, density) = (1.0, 0.1, 1e9, 1000.0);
    let law = Law::StVenantKirchhoff(Isotropic { young, poisson: 0.0, density });
    let shape = BoxMesh {
        size: [length, height, height],
        cells: [20, 2, 2],
        element: CellKind::Hex20,
        origin: [0.0; 3],
    };
    let mut scene = Scene::new(Time::new(1.0, 1.0, SchemeName::ImplicitMidpoint))
        .gravity([0.0, -9.81, 0.0])
        .body(Body::from_box("beam", shape, law))
        .fix(Fix::region("beam", "x-min"));
    scene.statics = Some(Static::default());
    let mut simulation = Simulation::new(scene).expect("a valid scene");
    simulation.step().expect("an equilibrium");
    let rest = &simulation.bodies()[0].mesh.points;
    let now = simulation.positions(0);
    let sag = rest.iter().zip(&now).map(|(rest, now)| rest[1] - now[1]).fold(0.0, f64::max);
    let expected = density * 9.81 * height * height * length.powi(4) / (8.0 * young * height.powi(4) / 12.0);
    println!("sag {sag:.6e} m, beam theory {expected:.6e} m");
    // Shear deformation adds 1 % to the theory of slender beams.
    assert!((sag / expected - 1.0).abs() < 0.02);
}
