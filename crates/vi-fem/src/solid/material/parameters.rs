//! Parameters of a material in scene files, with ranges and units.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::error::FemError;

/// Parameters of a law.
pub trait Parameters {
    /// Returns the density of the body at rest, kg/m³.
    fn density(&self) -> f64;
    /// Returns the Lamé constants (λ, μ) of the law for small strains, Pa.
    fn lame(&self) -> (f64, f64);
    /// Returns every parameter that is out of its range.
    fn check(&self) -> Vec<FemError>;
    /// Returns valid parameters of a soft rubber, for tests and first steps.
    fn example() -> Self
    where
        Self: Sized;
}

/// Parameters of an isotropic law with two elastic constants.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Isotropic {
    /// Young's modulus E, Pa; positive.
    #[schemars(extend("exclusiveMinimum" = 0.0))]
    pub young: f64,
    /// Poisson's ratio ν, dimensionless; in (−1, ½).
    #[schemars(extend("exclusiveMinimum" = -1.0, "exclusiveMaximum" = 0.5))]
    pub poisson: f64,
    /// Density ρ of the body at rest, kg/m³; positive.
    #[schemars(extend("exclusiveMinimum" = 0.0))]
    pub density: f64,
}

impl Parameters for Isotropic {
    fn density(&self) -> f64 {
        self.density
    }

    /// Returns λ = E ν/((1 + ν)(1 − 2ν)) and μ = E/(2(1 + ν)).
    fn lame(&self) -> (f64, f64) {
        let (young, poisson) = (self.young, self.poisson);
        (young * poisson / ((1.0 + poisson) * (1.0 - 2.0 * poisson)), young / (2.0 * (1.0 + poisson)))
    }

    fn check(&self) -> Vec<FemError> {
        let mut problems = Vec::new();
        require_positive(&mut problems, "young", self.young, "Young's modulus must be positive (Pa)");
        if !(self.poisson > -1.0 && self.poisson < 0.5) {
            problems.push(FemError::Parameter {
                key: "poisson",
                value: self.poisson,
                requirement: "Poisson's ratio must lie in (-1, 0.5); for a nearly incompressible body write 0.49",
            });
        }
        require_positive(&mut problems, "density", self.density, "density must be positive (kg/m³)");
        problems
    }

    fn example() -> Self {
        Self { young: 1e6, poisson: 0.3, density: 1000.0 }
    }
}

/// Adds a problem unless `value` is positive and finite.
pub(super) fn require_positive(
    problems: &mut Vec<FemError>,
    key: &'static str,
    value: f64,
    requirement: &'static str,
) {
    if !(value > 0.0 && value.is_finite()) {
        problems.push(FemError::Parameter { key, value, requirement });
    }
}
