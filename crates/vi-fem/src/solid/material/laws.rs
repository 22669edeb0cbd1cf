//! Tests the laws that every registered material law must obey. The registration line adds a new law.

use super::contract::Material;
use super::eigensystem::projected_tangent;
use super::parameters::Parameters;
use crate::lanes::real::Real;
use crate::small::tensor::{Mat3, Tangent, contract, product, transpose};

const IDENTITY: Mat3<f64> = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];

/// Deformations of all sizes with J > 0.
const SAMPLES: [Mat3<f64>; 5] = [
    IDENTITY,
    [[1.01, 0.003, -0.002], [0.001, 0.98, 0.004], [-0.003, 0.002, 1.02]],
    [[1.3, 0.2, -0.1], [-0.3, 0.8, 0.25], [0.15, -0.2, 1.1]],
    [[0.1, -1.4, 0.2], [0.9, 0.3, -0.1], [0.2, 0.1, 0.7]],
    [[2.0, 0.5, 0.0], [0.0, 0.6, 0.3], [0.4, 0.0, 1.2]],
];
/// Deformations outside the domain of some laws: inverted, stretched a hundredfold.
const EXTREME: [Mat3<f64>; 2] = [
    [[-0.6, 0.1, 0.2], [0.0, 1.1, -0.2], [0.3, 0.1, 0.9]],
    [[100.0, 0.0, 0.0], [0.0, 0.5, 0.0], [0.0, 0.0, 0.5]],
];
/// A body compressed to a point: a law may be defined there or not.
const POINT: Mat3<f64> = [[0.0; 3]; 3];

/// Checks all properties of a law.
pub(super) fn check<M: Material>(name: &str) {
    let parameters = M::Parameters::example();
    assert!(parameters.check().is_empty(), "{name}: the example parameters must be sound");
    let material = M::new(&parameters);
    states_its_domain(&material, name);
    // Include the inverted sample if the law is defined there.
    let mut samples = SAMPLES.to_vec();
    samples.extend(EXTREME[..1].iter().filter(|f| material.inside(f).is_ok()));
    rests_without_energy_or_stress(&material, name);
    small_strains_see_lame(&material, &parameters, name);
    small_strains_have_energies_without_cancellation(&material, &parameters, name);
    for f in &samples {
        stress_is_the_gradient_of_energy(&material, f, name);
        tangent_is_the_gradient_of_stress(&material, f, name);
        projection_is_the_positive_part(&material, f, name);
        if !M::LINEAR {
            is_objective_and_isotropic(&material, f, name);
        }
    }
}

fn moved(f: &Mat3<f64>, entry: usize, by: f64) -> Mat3<f64> {
    let mut f = *f;
    f[entry / 3][entry % 3] += by;
    f
}

/// Returns the Richardson-extrapolated central difference, with an error of O(ε⁴).
fn derivative(value: impl Fn(f64) -> f64) -> f64 {
    let (a, b) = (1e-3, 5e-4);
    let central = |e: f64| (value(e) - value(-e)) / (2.0 * e);
    (4.0 * central(b) - central(a)) / 3.0
}

fn norm(p: &Mat3<f64>) -> f64 {
    contract(p, p).sqrt()
}

fn rests_without_energy_or_stress<M: Material>(material: &M, name: &str) {
    let scale = material.tangent(&IDENTITY).entry(0, 0);
    assert!(material.energy(&IDENTITY).abs() <= 1e-15 * scale, "{name}: energy at rest");
    assert!(norm(&material.stress(&IDENTITY)) <= 1e-15 * scale, "{name}: stress at rest");
}

fn small_strains_see_lame<M: Material>(material: &M, parameters: &M::Parameters, name: &str) {
    let (lambda, mu) = parameters.lame();
    let tangent = material.tangent(&IDENTITY);
    let delta = |a: usize, b: usize| if a == b { 1.0 } else { 0.0 };
    for row in 0..9 {
        for column in 0..9 {
            let (i, j, k, l) = (row / 3, row % 3, column / 3, column % 3);
            let expected = lambda * delta(i, j) * delta(k, l)
                + mu * (delta(i, k) * delta(j, l) + delta(i, l) * delta(j, k));
            let found = tangent.entry(row, column);
            assert!((found - expected).abs() <= 1e-13 * mu.max(lambda), "{name}: {row} {column}: {found}");
        }
    }
}

/// Checks Ψ = μ ε:ε + λ/2 (tr ε)² at strains of 1e-6, to the strain: a sum that cancels is off by 1e-16/1e-12.
fn small_strains_have_energies_without_cancellation<M: Material>(
    material: &M,
    parameters: &M::Parameters,
    name: &str,
) {
    let (lambda, mu) = parameters.lame();
    let strain = [[0.7e-6, 0.2e-6, -0.4e-6], [0.2e-6, -0.9e-6, 0.3e-6], [-0.4e-6, 0.3e-6, 0.5e-6]];
    for isotropic in [0.0, 1e-6, -1e-6] {
        let strain = [0, 1, 2].map(|i| [0, 1, 2].map(|j| strain[i][j] + isotropic * IDENTITY[i][j]));
        let f = [0, 1, 2].map(|i| [0, 1, 2].map(|j| strain[i][j] + IDENTITY[i][j]));
        let trace: f64 = (0..3).map(|i| strain[i][i]).sum();
        let expected = mu * contract(&strain, &strain) + 0.5 * lambda * trace * trace;
        let angles: &[f64] = if M::LINEAR { &[0.0] } else { &[0.0, 0.3, 2.1] };
        for angle in angles {
            let found = material.energy(&product(&rotation([0.36, 0.48, 0.8], *angle), &f));
            assert!((found - expected).abs() <= 2e-5 * expected, "{name} at {angle}: {found} {expected}");
        }
    }
}

fn stress_is_the_gradient_of_energy<M: Material>(material: &M, f: &Mat3<f64>, name: &str) {
    let stress = material.stress(f);
    let scale = norm(&stress) + material.tangent(&IDENTITY).entry(0, 0);
    for entry in 0..9 {
        let expected = derivative(|e| material.energy(&moved(f, entry, e)));
        let found = stress[entry / 3][entry % 3];
        assert!((found - expected).abs() <= 1e-9 * scale, "{name} at {f:?}: P {entry}: {found} {expected}");
    }
}

fn tangent_is_the_gradient_of_stress<M: Material>(material: &M, f: &Mat3<f64>, name: &str) {
    let tangent = material.tangent(f);
    let scale = tangent.0.iter().fold(0.0f64, |a, b| a.max(b.abs()));
    for column in 0..9 {
        for row in 0..9 {
            let expected = derivative(|e| material.stress(&moved(f, column, e))[row / 3][row % 3]);
            let found = tangent.entry(row, column);
            let error = (found - expected).abs();
            assert!(error <= 1e-8 * scale, "{name} at {f:?}: C {row} {column}: {found} {expected}");
        }
    }
}

/// Returns the rows of a rotation by `angle` about `axis` (of length 1).
fn rotation(axis: [f64; 3], angle: f64) -> Mat3<f64> {
    let (s, c) = angle.sin_cos();
    let [x, y, z] = axis;
    let cross = [[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]];
    [0, 1, 2].map(|i| [0, 1, 2].map(|j| c * IDENTITY[i][j] + s * cross[i][j] + (1.0 - c) * axis[i] * axis[j]))
}

fn is_objective_and_isotropic<M: Material>(material: &M, f: &Mat3<f64>, name: &str) {
    let (energy, stress) = (material.energy(f), material.stress(f));
    let scale = material.tangent(&IDENTITY).entry(0, 0);
    for q in [
        rotation([0.0, 0.0, 1.0], std::f64::consts::FRAC_PI_2),
        rotation([0.36, 0.48, 0.8], 2.1),
        rotation([1.0, 0.0, 0.0], std::f64::consts::PI),
    ] {
        let close = |a: &Mat3<f64>, b: &Mat3<f64>| {
            let difference = [0, 1, 2].map(|i| [0, 1, 2].map(|j| a[i][j] - b[i][j]));
            norm(&difference) <= 1e-12 * (scale + norm(b))
        };
        let rotated = product(&q, f);
        assert!((material.energy(&rotated) - energy).abs() <= 1e-12 * (scale + energy), "{name}: Ψ(QF)");
        assert!(close(&material.stress(&rotated), &product(&q, &stress)), "{name}: P(QF) = Q P");
        let rotated = product(f, &transpose(&q));
        assert!((material.energy(&rotated) - energy).abs() <= 1e-12 * (scale + energy), "{name}: Ψ(FQᵀ)");
        assert!(close(&material.stress(&rotated), &product(&stress, &transpose(&q))), "{name}: P(FQᵀ)");
    }
}

fn projection_is_the_positive_part<M: Material>(material: &M, f: &Mat3<f64>, name: &str) {
    let matrix = |tangent: &Tangent<f64>| nalgebra::DMatrix::from_fn(9, 9, |i, j| tangent.entry(i, j));
    let eigen = matrix(&material.tangent(f)).symmetric_eigen();
    let positive = nalgebra::DMatrix::from_diagonal(&eigen.eigenvalues.map(|value| value.max(0.0)));
    let expected = &eigen.eigenvectors * positive * eigen.eigenvectors.transpose();
    let found = matrix(&projected_tangent(material, f));
    let error = (found - &expected).norm();
    assert!(error <= 1e-11 * eigen.eigenvalues.amax(), "{name} at {f:?}: projection off by {error}");
}

/// Checks that a law has finite values inside its domain; outside, the energy is infinite and the stress is not
/// finite.
fn states_its_domain<M: Material>(material: &M, name: &str) {
    assert!(SAMPLES.iter().all(|f| material.inside(f).is_ok()), "{name}: the samples must be in the domain");
    for f in SAMPLES.iter().chain(&EXTREME).chain([&POINT]) {
        let (energy, stress) = (material.energy(f), material.stress(f));
        if let Err(outside) = material.inside(f) {
            assert_eq!(energy, f64::INFINITY, "{name}: energy outside the domain at {f:?}");
            assert!(stress.iter().flatten().any(|value| value.is_nan()), "{name}: stress outside");
            assert!(outside.excess >= 0.0 && !outside.quantity.is_empty(), "{name}: {outside:?}");
        } else if *f != POINT {
            let is_finite = energy.is_finite() && stress.iter().flatten().all(|value| value.is_finite());
            assert!(is_finite, "{name}: values inside the domain at {f:?}");
        }
    }
}

/// Tests uniaxial stress of the logarithmic neo-Hookean law: the lateral stretch and P₁₁/E against independently
/// computed numbers (stretch, ν, lateral stretch, stress).
#[test]
fn neo_hookean_uniaxial_stress() {
    for (stretch, poisson, lateral, stress) in [
        (0.5, 0.3, 1.2107673905, -0.9353520569),
        (2.0, 0.3, 0.7980775445, 0.6467446602),
        (0.5, 0.45, 1.3508697467, -1.0861028086),
        (2.0, 0.45, 0.7259350056, 0.5987962703),
    ] {
        let material = super::registered::NeoHookean::new(&super::parameters::Isotropic {
            young: 1.0,
            poisson,
            density: 1.0,
        });
        let f = |side: f64| [[stretch, 0.0, 0.0], [0.0, side, 0.0], [0.0, 0.0, side]];
        let (mut low, mut high) = (0.2, 3.0);
        for _ in 0..200 {
            let middle = 0.5 * (low + high);
            if material.stress(&f(middle))[1][1] < 0.0 { low = middle } else { high = middle }
        }
        assert!((low - lateral).abs() < 1e-10, "{low} {lateral}");
        assert!((material.stress(&f(low))[0][0] - stress).abs() < 1e-10);
    }
}

#[test]
fn a_scene_names_a_law() {
    use super::Law;
    let schema = serde_json::to_value(schemars::schema_for!(Law)).unwrap();
    assert!(schema.to_string().contains("exclusiveMinimum"));
    let law: Law =
        serde_json::from_str(r#"{ "law": "neo-hookean", "young": 1e6, "poisson": 0.3, "density": 1000.0 }"#)
            .unwrap();
    assert_eq!((law.name(), law.density()), ("neo-hookean", 1000.0));
    let unknown = serde_json::from_str::<Law>(
        r#"{ "law": "linear", "young": 1e6, "poisson": 0.3, "density": 1.0, "youngs": 3.0 }"#,
    );
    assert!(unknown.unwrap_err().to_string().contains("youngs"));
    let wrong: Law =
        serde_json::from_str(r#"{ "law": "linear", "young": -1.0, "poisson": 0.5, "density": 0.0 }"#)
            .unwrap();
    assert_eq!(wrong.check().unwrap_err().len(), 3);
}

/// Tests that a law gives the same with f64 and with lanes.
#[test]
fn lanes_agree_with_scalars() {
    use super::Law;
    use crate::lanes::pack::Pack;
    struct Compare;
    impl super::contract::LawVisitor for Compare {
        type Output = ();
        fn visit<M: Material>(self, material: M) {
            let mut packed = [Pack::default(); 9];
            for (lane, f) in SAMPLES.iter().cycle().take(8).enumerate() {
                for entry in 0..9 {
                    packed[entry].0[lane] = f[entry / 3][entry % 3];
                }
            }
            let mut stress = [packed];
            super::batch::stresses(pulp::Arch::new(), &material, &mut stress);
            for (lane, f) in SAMPLES.iter().cycle().take(8).enumerate() {
                let expected = material.stress(f);
                let scale = norm(&expected) + material.tangent(f).entry(0, 0);
                for entry in 0..9 {
                    let error = stress[0][entry].0[lane] - expected[entry / 3][entry % 3];
                    assert!(Real::abs(error) <= 1e-13 * scale);
                }
            }
        }
    }
    for law in Law::examples() {
        law.visit(Compare);
    }
}
