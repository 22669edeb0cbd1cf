//! Contracts of a sheet law: its energy in plane stress, its parameters, and the data common to all sheets.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::error::FemError;
use crate::lanes::real::Real;
use crate::sheet::bending::Bending;
use crate::sheet::direction::Direction;
use crate::solid::material::parameters::{Isotropic, Parameters};

/// A membrane law in plane stress, written once over the scalar or SIMD lane R. It gives the energy density W(e)
/// (J/m³ of the sheet at rest) of Green's strain e = (E₁₁, E₂₂, 2E₁₂), E = ½(FᵀF − I), in an orthonormal frame of the
/// rest plane, with F = ∂x/∂X (3 × 2). The strain across the thickness is eliminated by S₃₃ = 0. The law is objective
/// because it depends on E only.
pub trait SheetMaterial: Send + Sync + 'static {
    /// The parameters in a scene file.
    type Parameters: SheetParameters;

    /// Returns the law with these parameters, which have passed [`SheetParameters::check`].
    fn new(parameters: &Self::Parameters) -> Self;
    /// Returns W(e) and its derivatives; W = +∞ outside the domain.
    fn response<R: Real>(&self, strain: &[R; 3]) -> SheetResponse<R>;
    /// Returns the relaxed W(e) of a sheet that wrinkles instead of carrying compression (Pipkin 1986).
    fn relaxed(&self, strain: &[f64; 3]) -> SheetResponse;
}

/// W and its derivatives at a strain.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct SheetResponse<R = f64> {
    /// W, J/m³.
    pub energy: R,
    /// Second Piola–Kirchhoff stress ∂W/∂e = (S₁₁, S₂₂, S₁₂), Pa.
    pub stress: [R; 3],
    /// ∂²W/∂e², Pa; symmetric.
    pub tangent: [[R; 3]; 3],
}

/// Parameters of a sheet law.
pub trait SheetParameters {
    /// Returns the data common to all sheets.
    fn common(&self) -> SheetCommon;
    /// Returns the plane-stress moduli ∂²W/∂e² at rest, Pa, in the frame of the law's own axes.
    fn moduli(&self) -> [[f64; 3]; 3];
    /// Returns the direction on the sheet at rest that the law's first axis follows, if the law has axes.
    fn direction(&self) -> Option<&Direction> {
        None
    }
    /// Returns everything that is wrong with the parameters.
    fn check(&self) -> Vec<FemError>;
    /// Returns valid parameters for tests and first steps.
    fn example() -> Self
    where
        Self: Sized;
}

/// The data common to all sheets.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SheetCommon {
    /// Mass per area at rest, kg/m².
    pub area_density: f64,
    /// Thickness, m.
    pub thickness: f64,
    /// The model of the resistance to bending.
    pub bending: Bending,
    /// Whether wrinkles smaller than the elements relax compression.
    pub tension_field: bool,
}

/// Parameters of an isotropic sheet:
/// `{ law = "neo-hookean", young = 1e6, poisson = 0.3, density = 1000.0, thickness = 1e-3 }`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct IsotropicSheet {
    /// Young's modulus E, Pa; positive.
    #[schemars(extend("exclusiveMinimum" = 0.0))]
    pub young: f64,
    /// Poisson's ratio ν, dimensionless; in (−1, ½).
    #[schemars(extend("exclusiveMinimum" = -1.0, "exclusiveMaximum" = 0.5))]
    pub poisson: f64,
    /// Density ρ at rest, kg/m³; give this or `area_density`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub density: Option<f64>,
    /// Mass per area at rest, kg/m²; give this or `density`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub area_density: Option<f64>,
    /// Thickness h, m; positive.
    #[schemars(extend("exclusiveMinimum" = 0.0))]
    pub thickness: f64,
    /// The model of the resistance to bending.
    #[serde(default)]
    pub bending: Bending,
    /// Whether wrinkles smaller than the elements relax compression.
    #[serde(default)]
    pub tension_field: bool,
}

impl IsotropicSheet {
    /// Returns the Lamé constants (λ, μ) of the solid, Pa.
    pub(crate) fn lame(&self) -> (f64, f64) {
        Isotropic { young: self.young, poisson: self.poisson, density: 1.0 }.lame()
    }

    /// Returns (E ν/(1 − ν²), μ), the Lamé constants in plane stress, Pa.
    pub(crate) fn plane_stress(&self) -> (f64, f64) {
        (
            self.young * self.poisson / (1.0 - self.poisson * self.poisson),
            self.young / (2.0 * (1.0 + self.poisson)),
        )
    }
}

impl SheetParameters for IsotropicSheet {
    fn common(&self) -> SheetCommon {
        SheetCommon {
            area_density: area_density(self.density, self.area_density, self.thickness),
            thickness: self.thickness,
            bending: self.bending,
            tension_field: self.tension_field,
        }
    }

    fn moduli(&self) -> [[f64; 3]; 3] {
        let (lambda, mu) = self.plane_stress();
        let axial = lambda + 2.0 * mu;
        [[axial, lambda, 0.0], [lambda, axial, 0.0], [0.0, 0.0, mu]]
    }

    fn check(&self) -> Vec<FemError> {
        let mut problems = Vec::new();
        require_positive(&mut problems, "young", self.young, "Young's modulus must be positive (Pa)");
        if !(self.poisson > -1.0 && self.poisson < 0.5) {
            problems.push(FemError::Parameter {
                key: "poisson",
                value: self.poisson,
                requirement: "Poisson's ratio must lie in (-1, 0.5); for a nearly incompressible sheet write 0.49",
            });
        }
        check_sheet(&mut problems, self.density, self.area_density, self.thickness);
        problems
    }

    fn example() -> Self {
        Self {
            young: 1e6,
            poisson: 0.3,
            density: Some(1000.0),
            area_density: None,
            thickness: 1e-2,
            bending: Bending::Shell,
            tension_field: false,
        }
    }
}

/// Returns the mass per area (kg/m²) from whichever of the two was given.
pub(crate) fn area_density(density: Option<f64>, area_density: Option<f64>, thickness: f64) -> f64 {
    area_density.or_else(|| density.map(|density| density * thickness)).unwrap_or(f64::NAN)
}

/// Checks the data common to all sheets.
pub(crate) fn check_sheet(
    problems: &mut Vec<FemError>,
    density: Option<f64>,
    area_density: Option<f64>,
    thickness: f64,
) {
    require_positive(
        problems,
        "thickness",
        thickness,
        "the thickness of a sheet must be positive (m); for cloth without bending stiffness write \
         bending = \"none\"",
    );
    match (density, area_density) {
        (Some(value), None) => {
            require_positive(problems, "density", value, "density must be positive (kg/m³)");
        }
        (None, Some(value)) => {
            require_positive(problems, "area_density", value, "mass per area must be positive (kg/m²)");
        }
        (given, _) => problems.push(FemError::Invalid {
            what: "sheet material",
            problem: format!(
                "give density (kg/m³) or area_density (kg/m²), {}",
                if given.is_some() { "not both" } else { "one of them" }
            ),
        }),
    }
}

/// Adds a problem unless `value` is positive and finite.
pub(crate) fn require_positive(
    problems: &mut Vec<FemError>,
    key: &'static str,
    value: f64,
    requirement: &'static str,
) {
    if !(value > 0.0 && value.is_finite()) {
        problems.push(FemError::Parameter { key, value, requirement });
    }
}

/// Work on a law whose type is known only at run time.
pub(crate) trait SheetVisitor {
    type Output;
    fn visit<M: SheetMaterial>(self, material: M) -> Self::Output;
}
