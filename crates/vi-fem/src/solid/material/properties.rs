//! Tests properties of laws at random deformations and parameters: objectivity, isotropy, stress and tangent as
//! derivatives, and the stated domain. Every registered law takes part; `laws` has the fixed samples.
//! `PROPTEST_CASES=100000` draws more samples.

use proptest::prelude::*;

use super::Law;
use super::contract::{LawVisitor, Material};
use crate::small::tensor::{Mat3, Tangent, contract, product, transpose};

/// Draws any law, with its moduli times a factor and any ν if it has one.
pub(crate) fn law() -> impl Strategy<Value = Law> {
    let parameters = (0..Law::NAMES.len(), -3.0..6.0, prop_oneof![-0.9..0.45, Just(0.49), Just(0.499)]);
    parameters.prop_map(|(index, decades, poisson)| {
        let mut value = serde_json::to_value(&Law::examples()[index]).unwrap();
        for (key, entry) in value.as_object_mut().unwrap() {
            if let Some(number) = entry.as_f64().filter(|_| key != "density") {
                let scaled = number * 10_f64.powf(decades);
                *entry = serde_json::json!(if key == "poisson" { poisson } else { scaled });
            }
        }
        serde_json::from_value(value).unwrap()
    })
}

/// Draws a rotation about v by the angle |v|.
pub(crate) fn rotation() -> impl Strategy<Value = Mat3<f64>> {
    prop::array::uniform3(-3.0..3.0).prop_map(|v| {
        let turn = nalgebra::Rotation3::new(nalgebra::Vector3::from(v));
        [0, 1, 2].map(|i| [0, 1, 2].map(|j| turn[(i, j)]))
    })
}

/// Draws F = Q diag(s) Rᵀ, inverted ones too, but with no two principal stretches whose sum is near zero: there the
/// polar decomposition has a kink.
fn deformation() -> impl Strategy<Value = (Mat3<f64>, f64)> {
    let stretches = (prop::array::uniform3(-1.5_f64..1.5), any::<bool>(), 0.1_f64..0.8);
    (rotation(), stretches, rotation()).prop_map(|(q, (logarithms, is_inverted, part), r)| {
        let mut s = logarithms.map(f64::exp);
        s.sort_by(f64::total_cmp);
        if is_inverted {
            s[0] *= -part;
        }
        let stretched = [0, 1, 2].map(|i| [0, 1, 2].map(|j| q[i][j] * s[j]));
        (product(&stretched, &transpose(&r)), s[0].abs())
    })
}

fn norm(a: &Mat3<f64>) -> f64 {
    contract(a, a).sqrt()
}

fn along(f: &Mat3<f64>, by: f64, direction: &Mat3<f64>) -> Mat3<f64> {
    [0, 1, 2].map(|i| [0, 1, 2].map(|j| f[i][j] + by * direction[i][j]))
}

fn apply(tangent: &Tangent<f64>, direction: &Mat3<f64>) -> Mat3<f64> {
    let entry = |row: usize| (0..9).map(|k| tangent.entry(row, k) * direction[k / 3][k % 3]).sum();
    [0, 1, 2].map(|i| [0, 1, 2].map(|j| entry(3 * i + j)))
}

/// Returns the central difference of order 4.
fn derivative(step: f64, value: impl Fn(f64) -> f64) -> f64 {
    (8.0 * (value(step) - value(-step)) - (value(2.0 * step) - value(-2.0 * step))) / (12.0 * step)
}

/// One sample: F and its least |stretch|, rotations Q and R, directions of length 1.
struct Check {
    f: Mat3<f64>,
    least: f64,
    q: Mat3<f64>,
    directions: [Mat3<f64>; 2],
}

impl LawVisitor for Check {
    type Output = Result<(), TestCaseError>;

    fn visit<M: Material>(self, material: M) -> Self::Output {
        let Self { f, least, q, directions: [a, b] } = self;
        let (energy, stress) = (material.energy(&f), material.stress(&f));
        if material.inside(&f).is_err() {
            prop_assert_eq!(energy, f64::INFINITY);
            prop_assert!(stress.iter().flatten().any(|value| value.is_nan()));
            return Ok(());
        }
        let tangent = material.tangent(&f);
        let stiffness = tangent.0.iter().fold(0.0_f64, |largest, c| largest.max(c.abs()));
        let scale = stiffness * norm(&f);
        prop_assert!(energy.is_finite() && energy >= -1e-12 * scale, "Ψ = {}", energy);
        // Ψ varies on the scale of the least stretch: the error of a difference with step h is about (h/least)⁴.
        let step = 1e-3 * least;
        let is_near_edge = |direction, by| material.inside(&along(&f, by, direction)).is_err();
        if [&a, &b]
            .iter()
            .any(|direction| is_near_edge(direction, 100.0 * step) || is_near_edge(direction, -100.0 * step))
        {
            return Ok(());
        }
        let slope = derivative(step, |e| material.energy(&along(&f, e, &a)));
        let found = contract(&stress, &a);
        prop_assert!((found - slope).abs() <= 1e-8 * scale / least, "P: {} but {}", found, slope);
        let curve = derivative(step, |e| contract(&material.stress(&along(&f, e, &a)), &b));
        let (found, mirrored) = (contract(&apply(&tangent, &a), &b), contract(&apply(&tangent, &b), &a));
        prop_assert!((found - curve).abs() <= 1e-8 * stiffness / least, "C: {} but {}", found, curve);
        prop_assert!((found - mirrored).abs() <= 1e-14 * stiffness);
        if !M::LINEAR {
            for (rotated, expected) in [
                (product(&q, &f), product(&q, &stress)),
                (product(&f, &transpose(&q)), product(&stress, &transpose(&q))),
            ] {
                let off = material.energy(&rotated) - energy;
                prop_assert!(off.abs() <= 1e-11 * scale * norm(&f), "Ψ rotated is off by {:e}", off);
                let off = norm(&along(&material.stress(&rotated), -1.0, &expected));
                prop_assert!(off <= 1e-11 * scale / least, "P rotated is off by {:e}", off);
            }
        }
        Ok(())
    }
}

proptest! {
    #![proptest_config(crate::fixed_seed())]

    #[test]
    fn laws_keep_their_laws_anywhere(
        law in law(),
        (f, least) in deformation(),
        q in rotation(),
        directions in prop::array::uniform2(prop::array::uniform3(prop::array::uniform3(-1.0..1.0)))
            .prop_filter("directions", |all| all.iter().all(|d| norm(d) > 0.1)),
    ) {
        let directions = directions.map(|d: Mat3<f64>| d.map(|row| row.map(|entry| entry / norm(&d))));
        law.visit(Check { f, least, q, directions })?;
    }

    /// Tests that NaN, infinite and huge entries cause no panic, and that NaN and infinite entries give no finite
    /// energy.
    #[test]
    fn no_deformation_panics(law in law(), f in prop::array::uniform9(prop_oneof![
        4 => -1e3_f64..1e3, 1 => Just(0.0), 1 => Just(f64::NAN), 1 => Just(f64::INFINITY), 1 => Just(1e200), 1 => Just(-1e-300),
    ])) {
        struct Evaluate(Mat3<f64>);
        impl LawVisitor for Evaluate {
            type Output = f64;
            fn visit<M: Material>(self, material: M) -> f64 {
                material.stress(&self.0);
                material.tangent(&self.0);
                material.energy(&self.0)
            }
        }
        let is_finite = f.iter().all(|entry| entry.is_finite());
        let energy = law.visit(Evaluate([0, 1, 2].map(|i| [0, 1, 2].map(|j| f[3 * i + j]))));
        prop_assert!(is_finite || !energy.is_finite(), "{}: Ψ({:?}) = {}", law.name(), f, energy);
    }
}
