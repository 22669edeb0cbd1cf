//! Laws that a program defines itself: an isotropic Ψ(F) from outside this crate, accepted wherever a scene takes a
//! law.
//!
//! A law registered in `materials!` is compiled for SIMD lanes. A law of a program is evaluated point by point, lane
//! after lane, through a pointer; with [`Differentiated`] it is also differentiated point by point.

use std::cell::Cell;
use std::fmt;
use std::sync::Arc;

use num_dual::{Dual64, HyperDual64};
use serde::{Serialize, Serializer};
use vi_core::lagrange::Scalar;

use super::contract::{Material, Outside, positive_determinant};
use super::near_rest::energy_or_work_of_stress;
use super::parameters::{Parameters, require_positive};
use crate::error::FemError;
use crate::lanes::real::Real;
use crate::small::tensor::{Mat3, Tangent, packed_index, product, transpose};

/// An isotropic hyperelastic law with its derivatives, at one point.
///
/// [`OwnLaw::new`] makes a material from it. Before a body uses it, its derivatives, objectivity and isotropy are
/// checked at some deformations.
pub trait PointLaw: Send + Sync + 'static {
    /// Returns the density of the body at rest, kg/m³.
    fn density(&self) -> f64;
    /// Returns Ψ(F), J/m³ of the body at rest. It is zero for F = I, and not finite outside its domain. The domain
    /// must lie in det F > 0. Its terms may cancel near rest: at strains below 1e-2 the work of the stress is used instead.
    fn energy(&self, f: &Mat3<f64>) -> f64;
    /// Returns the first Piola–Kirchhoff stress ∂Ψ/∂F, Pa.
    fn stress(&self, f: &Mat3<f64>) -> Mat3<f64>;
    /// Returns ∂²Ψ/∂F∂F, Pa.
    fn tangent(&self, f: &Mat3<f64>) -> Tangent<f64>;
}

/// An isotropic hyperelastic law, given by its energy alone.
pub trait EnergyDensity: Send + Sync + 'static {
    /// Returns the density of the body at rest, kg/m³.
    fn density(&self) -> f64;
    /// Returns Ψ(F), J/m³ of the body at rest; zero for F = I. Write numbers of type f64 on the right of `*` and `+`.
    fn energy<D: Scalar>(&self, f: &Mat3<D>) -> D;
}

/// A law whose derivatives are computed from its energy by dual numbers, exact to round-off.
#[derive(Debug, Clone)]
pub struct Differentiated<E>(pub E);

impl<E: EnergyDensity> PointLaw for Differentiated<E> {
    fn density(&self) -> f64 {
        self.0.density()
    }

    fn energy(&self, f: &Mat3<f64>) -> f64 {
        self.0.energy(f)
    }

    fn stress(&self, f: &Mat3<f64>) -> Mat3<f64> {
        let mut at = f.map(|row| row.map(Dual64::from_re));
        let mut stress = [[0.0; 3]; 3];
        for k in 0..9 {
            at[k / 3][k % 3].eps = 1.0;
            stress[k / 3][k % 3] = self.0.energy(&at).eps;
            at[k / 3][k % 3].eps = 0.0;
        }
        stress
    }

    fn tangent(&self, f: &Mat3<f64>) -> Tangent<f64> {
        let mut at = f.map(|row| row.map(HyperDual64::from_re));
        let mut tangent = [0.0; 45];
        for row in 0..9 {
            at[row / 3][row % 3].eps1 = 1.0;
            for column in 0..=row {
                at[column / 3][column % 3].eps2 = 1.0;
                tangent[packed_index(row, column)] = self.0.energy(&at).eps1eps2;
                at[column / 3][column % 3].eps2 = 0.0;
            }
            at[row / 3][row % 3].eps1 = 0.0;
        }
        Tangent(tangent)
    }
}

/// A material with a law that a program defines. In reports it is a table with its name and density, from which it
/// cannot be read back.
#[derive(Clone)]
pub struct OwnLaw {
    name: Arc<str>,
    law: Arc<dyn PointLaw>,
}

impl OwnLaw {
    /// Returns a material from a law with its derivatives; `name` appears in reports.
    pub fn new(name: &str, law: impl PointLaw) -> Self {
        Self { name: name.into(), law: Arc::new(law) }
    }

    /// Returns a material from an energy alone; `name` appears in reports.
    pub fn from_energy(name: &str, energy: impl EnergyDensity) -> Self {
        Self::new(name, Differentiated(energy))
    }
}

impl fmt::Debug for OwnLaw {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "OwnLaw({}, {} kg/m³)", self.name, self.law.density())
    }
}

/// Two materials are equal if they are clones of one.
impl PartialEq for OwnLaw {
    fn eq(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.law, &other.law)
    }
}

impl Serialize for OwnLaw {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        #[derive(Serialize)]
        struct Said<'a> {
            name: &'a str,
            density: f64,
        }
        Said { name: &self.name, density: self.law.density() }.serialize(serializer)
    }
}

const IDENTITY: Mat3<f64> = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];

/// Deformations at which a law is checked: a small one, and one with strains of about 20 %.
const SAMPLES: [Mat3<f64>; 2] = [
    [[1.01, 0.003, -0.002], [0.001, 0.98, 0.004], [-0.003, 0.002, 1.02]],
    [[1.15, 0.1, -0.05], [-0.15, 0.9, 0.12], [0.08, -0.1, 1.05]],
];

/// A rotation about (0.36, 0.48, 0.8) by 90°.
const ROTATION: Mat3<f64> = [[0.1296, -0.6272, 0.768], [0.9728, 0.2304, 0.024], [-0.192, 0.744, 0.64]];

/// Largest error of a derivative relative to the stiffness at rest. Differences are accurate to 1e-8.
const TOLERANCE: f64 = 1e-6;

impl OwnLaw {
    /// Returns the first rule for laws that this law breaks, at rest or at the samples inside its domain.
    fn broken_rule(&self) -> Option<String> {
        const STEP: f64 = 1e-4;
        let law = self.law.as_ref();
        let scale = law.tangent(&IDENTITY).entry(0, 0);
        let is_close = |a: f64, b: f64| (a - b).abs() <= TOLERANCE * scale;
        if !(scale > 0.0 && scale.is_finite()) {
            return Some(format!("its stiffness ∂²Ψ/∂F₁₁² at rest is {scale} Pa, but must be positive"));
        }
        if !is_close(law.energy(&IDENTITY), 0.0) {
            return Some(format!("Ψ(I) is {:e} J/m³, but must be zero", law.energy(&IDENTITY)));
        }
        if let Some(stress) = law.stress(&IDENTITY).as_flattened().iter().find(|&&p| !is_close(p, 0.0)) {
            return Some(format!("a stress at rest is {stress:e} Pa, but must be zero"));
        }
        for f in SAMPLES.iter().filter(|f| law.energy(f).is_finite()) {
            let moved = |k: usize, by: f64| {
                let mut f = *f;
                f[k / 3][k % 3] += by;
                f
            };
            let (stress, tangent) = (law.stress(f), law.tangent(f));
            for k in 0..9 {
                let (i, j) = (k / 3, k % 3);
                let slope = (law.energy(&moved(k, STEP)) - law.energy(&moved(k, -STEP))) / (2.0 * STEP);
                if !is_close(slope, stress[i][j]) {
                    let found = stress[i][j];
                    return Some(format!(
                        "its stress P{i}{j} is {found:e} Pa, but ∂Ψ/∂F is {slope:e} Pa, at F = {f:?}"
                    ));
                }
                let (ahead, behind) = (law.stress(&moved(k, STEP)), law.stress(&moved(k, -STEP)));
                for row in 0..9 {
                    let slope = (ahead[row / 3][row % 3] - behind[row / 3][row % 3]) / (2.0 * STEP);
                    let found = tangent.entry(row, k);
                    // The third derivatives of stiff volume terms are some hundred times the stiffness.
                    if (slope - found).abs() > 100.0 * TOLERANCE * scale {
                        return Some(format!(
                            "its tangent ({row}, {k}) is {found:e} Pa, but ∂P/∂F is {slope:e} Pa, at F = {f:?}"
                        ));
                    }
                }
            }
            for (rotated, property) in
                [(product(&ROTATION, f), "objective"), (product(f, &transpose(&ROTATION)), "isotropic")]
            {
                let (energy, after) = (law.energy(f), law.energy(&rotated));
                if !is_close(energy, after) {
                    return Some(format!(
                        "it is not {property}: a rotation changes Ψ from {energy:e} to {after:e} J/m³"
                    ));
                }
            }
        }
        None
    }
}

impl Parameters for OwnLaw {
    fn density(&self) -> f64 {
        self.law.density()
    }

    /// Returns λ = ∂²Ψ/∂F₁₁∂F₂₂ and μ = ∂²Ψ/∂F₁₂² at rest, Pa.
    fn lame(&self) -> (f64, f64) {
        let tangent = self.law.tangent(&IDENTITY);
        (tangent.entry(0, 4), tangent.entry(1, 1))
    }

    fn check(&self) -> Vec<FemError> {
        let mut problems = Vec::new();
        let density = self.law.density();
        require_positive(&mut problems, "density", density, "density must be positive (kg/m³)");
        problems.extend(
            self.broken_rule().map(|problem| FemError::Invalid { what: "law of the program's own", problem }),
        );
        problems
    }

    /// Returns μ ε:ε for small strains, with E = 1 MPa and ν = 0.
    fn example() -> Self {
        struct Soft;
        impl EnergyDensity for Soft {
            fn density(&self) -> f64 {
                1000.0
            }
            fn energy<D: Scalar>(&self, f: &Mat3<D>) -> D {
                let squares = f.as_flattened().iter().map(|&entry| entry * entry);
                let sum = squares.fold(f[0][0] * 0.0, |sum, square| sum + square);
                let j = f[0][0] * (f[1][1] * f[2][2] - f[1][2] * f[2][1])
                    - f[0][1] * (f[1][0] * f[2][2] - f[1][2] * f[2][0])
                    + f[0][2] * (f[1][0] * f[2][1] - f[1][1] * f[2][0]);
                (sum - j.ln() * 2.0 - 3.0) * 2.5e5
            }
        }
        Self::from_energy("soft", Soft)
    }
}

/// Adapts a program's law to the contract of the laws of this crate.
pub(crate) struct Own(Arc<dyn PointLaw>);

impl Material for Own {
    type Parameters = OwnLaw;

    fn new(parameters: &OwnLaw) -> Self {
        Self(Arc::clone(&parameters.law))
    }

    #[inline(always)]
    fn energy<R: Real>(&self, f: &Mat3<R>) -> R {
        let [energy] = by_point(f, |f| [self.0.energy(f)]);
        energy_or_work_of_stress(self, f, energy)
    }

    #[inline(always)]
    fn stress<R: Real>(&self, f: &Mat3<R>) -> Mat3<R> {
        let [a, b, c, d, e, f, g, h, i] = by_point(f, |f| {
            let mut flat = [0.0; 9];
            flat.copy_from_slice(self.0.stress(f).as_flattened());
            flat
        });
        [[a, b, c], [d, e, f], [g, h, i]]
    }

    #[inline(always)]
    fn tangent<R: Real>(&self, f: &Mat3<R>) -> Tangent<R> {
        Tangent(by_point(f, |f| self.0.tangent(f).0))
    }

    fn inside(&self, f: &Mat3<f64>) -> Result<(), Outside> {
        positive_determinant(f)?;
        let value = self.0.energy(f);
        let outside = Outside {
            quantity: "energy density of the program's own law",
            value,
            domain: "must be finite",
            excess: 0.0,
        };
        if value.is_finite() { Ok(()) } else { Err(outside) }
    }
}

/// Largest number of lanes of a group.
const LANES: usize = 8;

/// Evaluates N numbers at each lane's own F.
#[inline(always)]
fn by_point<R: Real, const N: usize>(f: &Mat3<R>, evaluate: impl Fn(&Mat3<f64>) -> [f64; N]) -> [R; N] {
    let mut points = [IDENTITY; LANES];
    let mut count = 0;
    for i in 0..3 {
        for j in 0..3 {
            let (lane, entries) = (Cell::new(0), Cell::new([0.0; LANES]));
            // Record each lane's number in turn.
            let _ = f[i][j].map(|value| {
                let mut taken = entries.get();
                taken[lane.get()] = value;
                entries.set(taken);
                lane.set(lane.get() + 1);
                value
            });
            count = lane.get();
            for (point, entry) in points.iter_mut().zip(entries.get()) {
                point[i][j] = entry;
            }
        }
    }
    let mut values = [[0.0; N]; LANES];
    for lane in 0..count {
        values[lane] = evaluate(&points[lane]);
    }
    let mut out = [f[0][0]; N];
    for k in 0..N {
        let lane = Cell::new(0);
        out[k] = f[0][0].map(|_| {
            let value = values[lane.get()][k];
            lane.set(lane.get() + 1);
            value
        });
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use vi_mesh::{BoxMesh, CellKind};

    use crate::lanes::instructions::InstructionSet;
    use crate::solid::elastic::elastic_on;
    use crate::solid::material::Law;
    use crate::solid::material::parameters::Isotropic;

    /// The neo-Hookean law given by its energy alone, plus a term that is not objective.
    struct Copy {
        wrong: f64,
    }

    const PARAMETERS: Isotropic = Isotropic { young: 1e6, poisson: 0.3, density: 1000.0 };

    impl EnergyDensity for Copy {
        fn density(&self) -> f64 {
            PARAMETERS.density
        }
        fn energy<D: Scalar>(&self, f: &Mat3<D>) -> D {
            let (lambda, mu) = PARAMETERS.lame();
            let squares = f.as_flattened().iter().map(|&entry| entry * entry);
            let sum = squares.fold(f[0][0] * 0.0, |sum, square| sum + square);
            let j = f[0][0] * (f[1][1] * f[2][2] - f[1][2] * f[2][1])
                - f[0][1] * (f[1][0] * f[2][2] - f[1][2] * f[2][0])
                + f[0][2] * (f[1][0] * f[2][1] - f[1][1] * f[2][0]);
            let log = j.ln();
            (sum - 3.0 - log * 2.0) * (0.5 * mu) + log * log * (0.5 * lambda) + f[0][1] * f[0][1] * self.wrong
        }
    }

    struct WrongTangent(Differentiated<Copy>);

    impl PointLaw for WrongTangent {
        fn density(&self) -> f64 {
            self.0.density()
        }
        fn energy(&self, f: &Mat3<f64>) -> f64 {
            self.0.energy(f)
        }
        fn stress(&self, f: &Mat3<f64>) -> Mat3<f64> {
            self.0.stress(f)
        }
        fn tangent(&self, f: &Mat3<f64>) -> Tangent<f64> {
            let mut tangent = self.0.tangent(f);
            tangent.0[3] += 1e4;
            tangent
        }
    }

    /// Tests that energies, forces and Hessians of a law given by its energy alone agree with those of the registered
    /// law to round-off, on every instruction set, for linear tetrahedra and other elements.
    #[test]
    fn a_law_from_outside_is_the_law_inside() {
        let own = Law::from(OwnLaw::from_energy("copy", Copy { wrong: 0.0 }));
        assert_eq!(own.check(), Ok(()));
        let (lambda, mu) = own.parameters().lame();
        let expected = PARAMETERS.lame();
        assert!((lambda / expected.0 - 1.0).abs() < 1e-12 && (mu / expected.1 - 1.0).abs() < 1e-12);
        let registered = Law::NeoHookean(PARAMETERS);
        for element in [CellKind::Tet4, CellKind::Hex8] {
            let shape = BoxMesh { size: [1.0; 3], cells: [2, 1, 1], element, origin: [0.0; 3] };
            let mesh = shape.build().unwrap();
            let elements = mesh.cells_of_dimension(3);
            let bend = |x: &[f64; 3]| [x[0] * 1.1 + 0.1 * x[1] * x[1], x[1] * 0.95, x[2] + 0.05 * x[0]];
            let x: Vec<f64> = mesh.points.iter().flat_map(bend).collect();
            for set in [InstructionSet::Scalar, InstructionSet::Best] {
                let blocks = |law: &Law| {
                    let terms = elastic_on(set, &mesh, &elements, law, 0, "b").unwrap();
                    let (term, size) = (&terms[0], terms[0].stencils().size());
                    let count = term.stencils().count();
                    let (mut e, mut g) = (vec![0.0; count], vec![0.0; count * size]);
                    let mut h = vec![0.0; count * vi_core::packed_len(size)];
                    term.energies(0..count, &x, 0.0, &mut e);
                    term.gradients(0..count, &x, 0.0, &mut g);
                    term.hessians(0..count, &x, 0.0, &mut h);
                    [e, g, h]
                };
                for (own, registered) in blocks(&own).iter().zip(&blocks(&registered)) {
                    let scale = registered.iter().fold(0.0_f64, |most, value| most.max(value.abs()));
                    let pairs = own.iter().zip(registered);
                    let apart = pairs.fold(0.0_f64, |most, (a, b)| most.max((a - b).abs()));
                    assert!(apart < 1e-12 * scale, "{element:?}, {set:?}: {apart:e} of {scale:e}");
                }
            }
        }
    }

    #[test]
    fn a_law_that_breaks_a_rule_is_refused_by_name() {
        let said = |law: OwnLaw| Law::from(law).check().unwrap_err()[0].to_string();
        let anisotropic = said(OwnLaw::from_energy("wrong", Copy { wrong: 1e5 }));
        assert!(anisotropic.contains("objective"), "{anisotropic}");
        let tangent = said(OwnLaw::new("wrong", WrongTangent(Differentiated(Copy { wrong: 0.0 }))));
        assert!(tangent.contains("its tangent"), "{tangent}");
    }
}
