//! Laws that a scene gives as a formula for the energy, which is differentiated exactly.

use std::collections::BTreeMap;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::contract::{Material, Outside, positive_determinant};
use super::jet::Jet;
use super::near_rest::energy_or_work_of_stress;
use super::parameters::{Parameters, require_positive};
use super::program::Program;
use crate::error::FemError;
use crate::lanes::real::Real;
use crate::path::expression::Expression;
use crate::small::tensor::{
    Mat3, Tangent, cofactor, contract, dot, left_cauchy_green, mat3, product, right_cauchy_green,
};

/// Parameters of [`Formula`]: `{ law = "formula", energy = "mu/2*(I1 - 3 - 2*log(J)) + k/2*(J - 1)^2", constants = {
/// mu = 4e5, k = 1e6 }, density = 1000.0 }`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct FormulaParameters {
    /// Ψ, J/m³ of the body at rest: a formula of I1 = tr C, I2 = (I1² − tr C²)/2 and J = det F, with C = FᵀF, and of
    /// the constants. It is zero and has no stress at rest (I1 = I2 = 3, J = 1). It may use `+ - * / ^ ( )`, `pi`
    /// and `sin cos tan asin acos atan sinh cosh tanh exp log sqrt abs min max pow`.
    pub energy: String,
    /// Named constants of the formula, in the units that it needs.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub constants: BTreeMap<String, f64>,
    /// Density ρ of the body at rest, kg/m³; positive.
    #[schemars(extend("exclusiveMinimum" = 0.0))]
    pub density: f64,
}

impl FormulaParameters {
    fn program(&self) -> Result<Program, FemError> {
        let wrong = |problem: String| FemError::Invalid { what: "constants", problem };
        let mut names = vec!["I1", "I2", "J"];
        for (name, value) in &self.constants {
            if names[..3].contains(&name.as_str()) {
                return Err(wrong(format!("`{name}` is an invariant: give the constant another name")));
            }
            if !value.is_finite() {
                return Err(wrong(format!("`{name}` is {value}, but must be finite")));
            }
            names.push(name);
        }
        let formula = Expression::parse(&self.energy, &names)?;
        Program::new(&formula, &self.constants.values().copied().collect::<Vec<_>>())
    }
}

const IDENTITY: Mat3<f64> = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];

/// Largest energy and stress at rest, relative to the stiffness: round-off of a formula.
const ROUND_OFF: f64 = 1e-12;

impl Parameters for FormulaParameters {
    fn density(&self) -> f64 {
        self.density
    }

    /// Returns λ = ∂²Ψ/∂F₁₁∂F₂₂ and μ = ∂²Ψ/∂F₁₂² at rest, or NaN if the formula does not parse.
    fn lame(&self) -> (f64, f64) {
        let Ok(program) = self.program() else { return (f64::NAN, f64::NAN) };
        let tangent = Formula { program }.tangent(&IDENTITY);
        (tangent.entry(0, 4), tangent.entry(1, 1))
    }

    fn check(&self) -> Vec<FemError> {
        let mut problems = Vec::new();
        require_positive(&mut problems, "density", self.density, "density must be positive (kg/m³)");
        let wrong = |problem: String| FemError::Invalid { what: "energy", problem };
        let law = match self.program() {
            Ok(program) => Formula { program },
            Err(error) => {
                problems.push(error);
                return problems;
            }
        };
        let (lambda, mu) = self.lame();
        let stiffness = lambda + 2.0 * mu;
        let (energy, stress) = (law.sum(&IDENTITY), law.stress(&IDENTITY)[0][0]);
        if !(mu > 0.0 && lambda + 2.0 / 3.0 * mu > 0.0 && stiffness.is_finite()) {
            problems.push(wrong(format!(
                "the moduli at rest are μ = {mu:e} Pa and λ = {lambda:e} Pa; μ and λ + 2μ/3 must be positive"
            )));
        } else if energy.is_nan() || energy.abs() > ROUND_OFF * stiffness {
            problems.push(wrong(format!(
                "it is {energy:e} J/m³ at rest (I1 = I2 = 3, J = 1), but must be zero: subtract that value"
            )));
        } else if stress.is_nan() || stress.abs() > ROUND_OFF * stiffness {
            problems.push(wrong(format!(
                "the stress at rest is {stress:e} Pa, but must be zero: 2 ∂Ψ/∂I1 + 4 ∂Ψ/∂I2 + ∂Ψ/∂J = 0 at I1 = I2 = \
                 3, J = 1"
            )));
        }
        problems
    }

    fn example() -> Self {
        let constants = [("mu", 4e5), ("k", 9e5)].map(|(name, value)| (name.to_owned(), value));
        Self {
            energy: "mu/2*(I1 - 3 - 2*log(J)) + mu/20*(I2 - 3 - 4*log(J)) + k/2*(J - 1)^2".to_owned(),
            constants: constants.into(),
            density: 1000.0,
        }
    }
}

/// Ψ(I₁, I₂, J) for J > 0, from a formula.
#[derive(Debug, Clone)]
pub struct Formula {
    program: Program,
}

/// The invariants and ∂I₁/∂F = 2F, ∂I₂/∂F = 2 (I₁ F − F C), ∂J/∂F = cof F. I₂ is computed only if it occurs.
struct Invariants<R> {
    values: [R; 3],
    first: [Mat3<R>; 3],
}

impl Formula {
    /// Returns the value of the formula, whose terms may cancel near rest; +∞ for J ≤ 0.
    #[inline(always)]
    fn sum<R: Real>(&self, f: &Mat3<R>) -> R {
        let Invariants { values, .. } = self.invariants(f);
        let Jet { value, .. } = self.program.at::<R, 0, 0>(values);
        values[2].if_positive(value, value.constant(f64::INFINITY))
    }

    #[inline(always)]
    fn invariants<R: Real>(&self, f: &Mat3<R>) -> Invariants<R> {
        let i1 = contract(f, f);
        let dj = cofactor(f);
        let j = dot(f[0], dj[0]);
        let di1 = mat3!(i j => f[i][j] * 2.0);
        if !self.program.uses_second {
            return Invariants { values: [i1, i1, j], first: [di1, di1, dj] };
        }
        let c = right_cauchy_green(f);
        let i2 = (i1 * i1 - contract(&c, &c)) * 0.5;
        let fc = product(f, &c);
        let di2 = mat3!(i j => (i1 * f[i][j] - fc[i][j]) * 2.0);
        Invariants { values: [i1, i2, j], first: [di1, di2, dj] }
    }
}

impl Material for Formula {
    type Parameters = FormulaParameters;

    /// A formula that does not parse, which [`Parameters::check`] refuses, gives NaN.
    fn new(parameters: &FormulaParameters) -> Self {
        Self { program: parameters.program().unwrap_or_else(|_| Program::undefined()) }
    }

    #[inline(always)]
    fn energy<R: Real>(&self, f: &Mat3<R>) -> R {
        energy_or_work_of_stress(self, f, self.sum(f))
    }

    #[inline(always)]
    fn stress<R: Real>(&self, f: &Mat3<R>) -> Mat3<R> {
        let Invariants { values, first } = self.invariants(f);
        let by = self.program.gradient(values);
        let valid = values[2].if_positive(by[2], by[2].constant(f64::NAN));
        let mut stress = mat3!(i j => by[0].mul_add(first[0][i][j], valid * first[2][i][j]));
        if self.program.uses_second {
            stress = mat3!(i j => by[1].mul_add(first[1][i][j], stress[i][j]));
        }
        stress
    }

    /// Returns Σ Ψ_a ∂²I_a/∂F∂F + Σ Ψ_ab ∂I_a/∂F ⊗ ∂I_b/∂F, with ∂²I₂/∂F∂F = 4 F⊗F + 2 (I₁ I − δ_ik C_jl − B_ik δ_jl −
    /// F_il F_kj).
    #[inline(always)]
    fn tangent<R: Real>(&self, f: &Mat3<R>) -> Tangent<R> {
        let Invariants { values, first: [di1, di2, dj] } = self.invariants(f);
        let Jet { first: by, second, .. } = self.program.at::<R, 3, 6>(values);
        let mut tangent = Tangent::identity(by[0] * 2.0);
        if self.program.uses_second {
            tangent = Tangent::identity(by[0] * 2.0 + by[1] * values[0] * 2.0);
            tangent.add_square(by[1] * 4.0, f);
            tangent.add_material_blocks(by[1] * -2.0, &right_cauchy_green(f));
            tangent.add_spatial_blocks(by[1] * -2.0, &left_cauchy_green(f));
            tangent.add_crossed(by[1] * -2.0, f);
            tangent.add_product(second[1], &di1, &di2);
            tangent.add_square(second[2], &di2);
            tangent.add_product(second[4], &di2, &dj);
        }
        tangent.add_square(second[0], &di1);
        tangent.add_product(second[3], &di1, &dj);
        tangent.add_square(second[5], &dj);
        tangent.add_cofactor_derivative(by[2], f);
        tangent
    }

    fn inside(&self, f: &Mat3<f64>) -> Result<(), Outside> {
        positive_determinant(f)?;
        let value = self.sum(f);
        let (quantity, domain) = ("energy density of the formula", "must be finite");
        if value.is_finite() { Ok(()) } else { Err(Outside { quantity, value, domain, excess: 0.0 }) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::solid::material::Law;
    use crate::solid::material::neo_hookean::NeoHookean;
    use crate::solid::material::parameters::Isotropic;

    fn formula(energy: &str, constants: &[(&str, f64)]) -> FormulaParameters {
        let constants = constants.iter().map(|(name, value)| ((*name).to_owned(), *value)).collect();
        FormulaParameters { energy: energy.to_owned(), constants, density: 1000.0 }
    }

    /// The neo-Hookean law as a formula is the registered law to round-off.
    #[test]
    fn a_formula_is_the_law_that_it_writes() {
        let isotropic = Isotropic { young: 1e6, poisson: 0.3, density: 1000.0 };
        let (lambda, mu) = isotropic.lame();
        let parameters =
            formula("mu/2*(I1 - 3 - 2*log(J)) + lambda/2*log(J)^2", &[("lambda", lambda), ("mu", mu)]);
        assert!(parameters.check().is_empty(), "{:?}", parameters.check());
        assert!((parameters.lame().0 / lambda - 1.0).abs() < 1e-12);
        let (own, registered) = (Formula::new(&parameters), NeoHookean::new(&isotropic));
        let f = [[1.3, 0.2, -0.1], [-0.3, 0.8, 0.25], [0.15, -0.2, 1.1]];
        let close = |a: f64, b: f64| (a - b).abs() < 1e-12 * 1e6;
        assert!(close(own.energy(&f), registered.energy(&f)));
        let (a, b) = (own.stress(&f), registered.stress(&f));
        assert!(a.as_flattened().iter().zip(b.as_flattened()).all(|(&a, &b)| close(a, b)));
        let (a, b) = (own.tangent(&f), registered.tangent(&f));
        assert!(a.0.iter().zip(&b.0).all(|(&a, &b)| close(a, b)));
    }

    #[test]
    fn wrong_formulas_are_refused_with_the_reason() {
        let mu = [("mu", 1e6)];
        for (energy, part) in [
            ("mu*(I1 - 3", "expected ')'"),
            ("nu*(I1 - 3)", "not `nu`"),
            ("mu*(I1 - 3 - 2*log(J)) + 1e4*(J - 1)^2 + 5", "at rest (I1"),
            ("mu*(I1 - 3) + mu*(J - 1)^2", "stress at rest"),
            ("-mu*(I1 - 3 - 2*log(J))", "must be positive"),
            ("mu*floor(J)", "jumps"),
        ] {
            let said = format!(
                "{:?}",
                formula(energy, &mu).check().iter().map(ToString::to_string).collect::<Vec<_>>()
            );
            assert!(said.contains(part), "{energy}: {said}");
        }
        assert!(formula("J", &[("J", 1.0)]).check()[0].to_string().contains("another name"));
    }

    #[test]
    fn a_scene_can_name_it() {
        let law = Law::Formula(FormulaParameters::example());
        let text = serde_json::to_string(&law).unwrap();
        assert_eq!(serde_json::from_str::<Law>(&text).unwrap(), law);
        assert!(law.check().is_ok(), "{:?}", law.check());
    }
}
