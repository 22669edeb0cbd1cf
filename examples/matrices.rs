//! Mass and stiffness of a scene for another solver: finds the lowest frequency of a cantilever by inverse iteration
//! that only uses products of sprs matrices. Run it with `--features sprs`.

use sprs::CsMat;
use variational::prelude::*;
use variational::simulation::matrices::Matrices;

fn product(matrix: &CsMat<f64>, x: &[f64]) -> Vec<f64> {
    let mut out = vec![0.0; x.len()];
    sprs::prod::mul_acc_mat_vec_csr(matrix.view(), x, &mut out[..]);
    out
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// Solves K x = b by conjugate gradients.
fn solve(k: &CsMat<f64>, b: &[f64]) -> Vec<f64> {
    let (mut x, mut r, mut d) = (vec![0.0; b.len()], b.to_vec(), b.to_vec());
    let mut left = dot(&r, &r);
    let first = left;
    while left > 1e-24 * first {
        let image = product(k, &d);
        let step = left / dot(&d, &image);
        x.iter_mut().zip(&d).for_each(|(x, d)| *x += step * d);
        r.iter_mut().zip(&image).for_each(|(r, p)| *r -= step * p);
        let next = dot(&r, &r);
        d.iter_mut().zip(&r).for_each(|(d, r)| *d = r + next / left * *d);
        left = next;
    }
    x
}

fn main() {
    let (length, height, young, density) = (1.0, 0.1, 1e9, 1000.0);
    let law = Law::Linear(Isotropic { young, poisson: 0.0, density });
    let size = [length, height, height];
    let shape = BoxMesh { size, cells: [10, 1, 1], element: CellKind::Hex20, origin: [0.0; 3] };
    let mut scene = Scene::new(Time::new(1.0, 1e-3, SchemeName::ImplicitMidpoint))
        .body(Body::from_box("beam", shape, law))
        .fix(Fix::region("beam", "x-min"));
    scene.solver.mass = Some(MassKind::Consistent);
    let simulation = Simulation::new(scene).expect("a valid scene");
    let Matrices { mass, stiffness, .. } = simulation.matrices(0).expect("matrices");
    let (mass, stiffness) = (mass.to_csr(), stiffness.to_csr());
    let mut mode = vec![1.0; mass.rows()];
    for _ in 0..10 {
        mode = solve(&stiffness, &product(&mass, &mode));
        let size = dot(&mode, &product(&mass, &mode)).sqrt();
        mode.iter_mut().for_each(|x| *x /= size);
    }
    let frequency = dot(&mode, &product(&stiffness, &mode)).sqrt() / std::f64::consts::TAU;
    // Euler and Bernoulli: 1.875104² √(E I/(ρ A L⁴))/2π.
    let expected = 1.875_104_f64.powi(2) * (young / density * height * height / 12.0).sqrt()
        / (std::f64::consts::TAU * length * length);
    println!("{frequency:.3} Hz, beam theory {expected:.3} Hz");
    assert!((frequency / expected - 1.0).abs() < 0.02);
}
