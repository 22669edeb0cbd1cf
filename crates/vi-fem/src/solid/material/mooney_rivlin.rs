//! Compressible Mooney–Rivlin, for rubber.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::contract::{Material, Outside, positive_determinant};
use super::near_rest::NearRest;
use super::parameters::Parameters;
use super::parameters::require_positive;
use crate::error::FemError;
use crate::lanes::real::Real;
use crate::small::tensor::{
    Mat3, Tangent, cofactor, contract, dot, left_cauchy_green, mat3, product, right_cauchy_green,
};

/// Parameters of [`MooneyRivlin`].
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct MooneyRivlinParameters {
    /// c₁₀, Pa; the shear modulus μ = 2 (c₁₀ + c₀₁) must be positive.
    pub c10: f64,
    /// c₀₁, Pa; not negative.
    #[schemars(extend("minimum" = 0.0))]
    pub c01: f64,
    /// Bulk modulus κ, Pa; positive.
    #[schemars(extend("exclusiveMinimum" = 0.0))]
    pub bulk: f64,
    /// Density ρ of the body at rest, kg/m³; positive.
    #[schemars(extend("exclusiveMinimum" = 0.0))]
    pub density: f64,
}

impl Parameters for MooneyRivlinParameters {
    fn density(&self) -> f64 {
        self.density
    }

    fn lame(&self) -> (f64, f64) {
        let mu = 2.0 * (self.c10 + self.c01);
        (self.bulk - 2.0 / 3.0 * mu, mu)
    }

    fn check(&self) -> Vec<FemError> {
        let mut problems = Vec::new();
        let shear = self.c10 + self.c01;
        require_positive(
            &mut problems,
            "c10",
            shear,
            "c10 + c01, half the shear modulus, must be positive (Pa)",
        );
        if !(self.c01 >= 0.0 && self.c01.is_finite()) {
            let requirement = "c01 must not be negative (Pa)";
            problems.push(FemError::Parameter { key: "c01", value: self.c01, requirement });
        }
        require_positive(&mut problems, "bulk", self.bulk, "the bulk modulus must be positive (Pa)");
        require_positive(&mut problems, "density", self.density, "density must be positive (kg/m³)");
        problems
    }

    fn example() -> Self {
        Self { c10: 1.5e5, c01: 4e4, bulk: 8e5, density: 1100.0 }
    }
}

/// Ψ = c₁₀ (J^(−2/3) I₁ − 3) + c₀₁ (J^(−4/3) I₂ − 3) + κ/2 (J − 1)² with I₁ = tr C, I₂ = (I₁² − tr C²)/2, C = FᵀF, J
/// > 0 (Holzapfel 2000, §6.4–6.5). For small strains μ = 2 (c₁₀ + c₀₁) and λ = κ − 2μ/3.
#[derive(Debug, Clone)]
pub struct MooneyRivlin {
    c10: f64,
    c01: f64,
    bulk: f64,
}

/// The invariants I₁, I₂, J and their derivatives ∂I₁/∂F = 2F, ∂I₂/∂F = 2 (I₁ F − F C), ∂J/∂F = cof F.
struct Invariants<R> {
    i1: R,
    i2: R,
    j: R,
    /// J^(−2/3).
    power: R,
    di1: Mat3<R>,
    di2: Mat3<R>,
    dj: Mat3<R>,
}

#[inline(always)]
fn invariants<R: Real>(f: &Mat3<R>) -> Invariants<R> {
    let c = right_cauchy_green(f);
    let i1 = c[0][0] + c[1][1] + c[2][2];
    let i2 = (i1 * i1 - contract(&c, &c)) * 0.5;
    let fc = product(f, &c);
    let dj = cofactor(f);
    let j = dot(f[0], dj[0]);
    let inverse_root = j.constant(1.0) / j.cbrt();
    Invariants {
        i1,
        i2,
        j,
        power: j.if_positive(inverse_root * inverse_root, j.constant(f64::NAN)),
        di1: mat3!(i j => f[i][j] * 2.0),
        di2: mat3!(i j => (i1 * f[i][j] - fc[i][j]) * 2.0),
        dj,
    }
}

impl Material for MooneyRivlin {
    type Parameters = MooneyRivlinParameters;

    fn new(parameters: &MooneyRivlinParameters) -> Self {
        Self { c10: parameters.c10, c01: parameters.c01, bulk: parameters.bulk }
    }

    #[inline(always)]
    fn energy<R: Real>(&self, f: &Mat3<R>) -> R {
        let Invariants { i1, i2, j, power, .. } = invariants(f);
        let volume = j - 1.0;
        let far = (power * i1 - 3.0) * self.c10 + (power * power * i2 - 3.0) * self.c01;
        // With p = J^(−2/3), p − 1 = −x/(1 + x)/(p² + p + 1). The sums below have no term of first order.
        let rest = NearRest::of(f);
        let change = -rest.x / ((rest.x + 1.0) * (power * power + power + 1.0));
        let curved = change * 3.0 + rest.x;
        let twice_trace = rest.trace * 2.0;
        let first = change * twice_trace + curved - rest.excess;
        let squared = change * (power + 1.0) * (twice_trace * 2.0 + rest.second * 4.0);
        let second = squared + (curved - rest.excess + rest.second * 2.0) * 2.0 + change * change * 3.0;
        let shear = rest.select(first * self.c10 + second * self.c01, far);
        let energy = shear + volume * volume * (0.5 * self.bulk);
        j.if_positive(energy, j.constant(f64::INFINITY))
    }

    #[inline(always)]
    fn stress<R: Real>(&self, f: &Mat3<R>) -> Mat3<R> {
        let Invariants { i1, i2, j, power, di1, di2, dj } = invariants(f);
        let (by_i1, by_i2) = (power * self.c10, power * power * self.c01);
        let by_j = (j - 1.0) * self.bulk - (by_i1 * i1 * 2.0 + by_i2 * i2 * 4.0) / (j * 3.0);
        mat3!(i j => by_i1.mul_add(di1[i][j], by_i2.mul_add(di2[i][j], by_j * dj[i][j])))
    }

    #[inline(always)]
    fn tangent<R: Real>(&self, f: &Mat3<R>) -> Tangent<R> {
        let Invariants { i1, i2, j, power, di1, di2, dj } = invariants(f);
        let inverse = j.constant(1.0) / (j * 3.0);
        let (by_i1, by_i2) = (power * self.c10, power * power * self.c01);
        let by_j = (j - 1.0) * self.bulk - (by_i1 * i1 * 2.0 + by_i2 * i2 * 4.0) * inverse;
        // Ψ_JJ = κ + 10/9 c₁₀ J^(−8/3) I₁ + 28/9 c₀₁ J^(−10/3) I₂
        let by_jj = (by_i1 * i1 * 10.0 + by_i2 * i2 * 28.0) * inverse * inverse + self.bulk;
        // ∂²I₁/∂F∂F = 2 I; ∂²I₂/∂F∂F = 4 F⊗F + 2 (I₁ I − δ_ik C_jl − B_ik δ_jl − F_il F_kj)
        let mut tangent = Tangent::identity(by_i1 * 2.0 + by_i2 * i1 * 2.0);
        tangent.add_square(by_i2 * 4.0, f);
        tangent.add_material_blocks(by_i2 * -2.0, &right_cauchy_green(f));
        tangent.add_spatial_blocks(by_i2 * -2.0, &left_cauchy_green(f));
        tangent.add_crossed(by_i2 * -2.0, f);
        tangent.add_cofactor_derivative(by_j, f);
        tangent.add_square(by_jj, &dj);
        tangent.add_product(by_i1 * inverse * -2.0, &di1, &dj);
        tangent.add_product(by_i2 * inverse * -4.0, &di2, &dj);
        tangent
    }

    fn inside(&self, f: &Mat3<f64>) -> Result<(), Outside> {
        positive_determinant(f)
    }
}
