//! Orthotropic St. Venant–Kirchhoff in plane stress: woven cloth.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::bending::Bending;
use crate::sheet_material::{
    SheetCommon, SheetMaterial, SheetParameters, SheetResponse, area_density, check_sheet, require_positive,
};
use crate::{Direction, FemError};

/// W = ½ eᵀQ e, e = (E₁₁, E₂₂, 2E₁₂) in the frame of warp and weft;
/// Q = [[E₁, ν₁₂E₂, 0], [ν₁₂E₂, E₂, 0], [0, 0, G(1 − ν₁₂ν₂₁)]]/(1 − ν₁₂ν₂₁), ν₂₁ = ν₁₂ E₂/E₁
/// (Reddy, *Mechanics of Laminated Composite Plates and Shells*, eq. 1.3.36).
#[derive(Debug, Clone)]
pub struct OrthotropicSheet {
    moduli: [[f64; 3]; 3],
}

/// Parameters of an orthotropic sheet: `{ law = "orthotropic", young_warp = 1e6, young_weft = 5e5,
/// poisson = 0.2, shear = 5e4, warp = [1, 0, 0], area_density = 0.2, thickness = 1e-3 }`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct OrthotropicParameters {
    /// Young's modulus E₁ along the warp, Pa; positive.
    #[schemars(extend("exclusiveMinimum" = 0.0))]
    pub young_warp: f64,
    /// Young's modulus E₂ along the weft, Pa; positive.
    #[schemars(extend("exclusiveMinimum" = 0.0))]
    pub young_weft: f64,
    /// Poisson's ratio ν₁₂: contraction of the weft under tension of the warp; ν₁₂² < E₁/E₂.
    pub poisson: f64,
    /// Shear modulus G between warp and weft, Pa; positive.
    #[schemars(extend("exclusiveMinimum" = 0.0))]
    pub shear: f64,
    /// Direction of the warp on the sheet at rest (default: along x).
    #[serde(default = "default_warp")]
    pub warp: Direction,
    /// Density ρ at rest, kg/m³; this or `area_density`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub density: Option<f64>,
    /// Mass per area at rest, kg/m²; this or `density`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub area_density: Option<f64>,
    /// Thickness h, m; positive.
    #[schemars(extend("exclusiveMinimum" = 0.0))]
    pub thickness: f64,
    /// How the sheet resists bending.
    #[serde(default)]
    pub bending: Bending,
    /// Let wrinkles below the size of the mesh take away compression; not for this law.
    #[serde(default)]
    pub tension_field: bool,
}

fn default_warp() -> Direction {
    Direction::Constant([1.0, 0.0, 0.0])
}

impl SheetParameters for OrthotropicParameters {
    fn common(&self) -> SheetCommon {
        SheetCommon {
            area_density: area_density(self.density, self.area_density, self.thickness),
            thickness: self.thickness,
            bending: self.bending,
            tension_field: self.tension_field,
        }
    }

    fn moduli(&self) -> [[f64; 3]; 3] {
        let factor = 1.0 / (1.0 - self.poisson * self.poisson * self.young_weft / self.young_warp);
        let coupling = factor * self.poisson * self.young_weft;
        [
            [factor * self.young_warp, coupling, 0.0],
            [coupling, factor * self.young_weft, 0.0],
            [0.0, 0.0, self.shear],
        ]
    }

    fn direction(&self) -> Option<&Direction> {
        Some(&self.warp)
    }

    fn check(&self) -> Vec<FemError> {
        let mut problems = Vec::new();
        for (key, value) in
            [("young_warp", self.young_warp), ("young_weft", self.young_weft), ("shear", self.shear)]
        {
            require_positive(&mut problems, key, value, "moduli must be positive (Pa)");
        }
        let is_stable = self.poisson * self.poisson * self.young_weft < self.young_warp;
        if !is_stable {
            problems.push(FemError::Parameter {
                key: "poisson",
                value: self.poisson,
                requirement: "its square must be below young_warp / young_weft, or the sheet is unstable",
            });
        }
        problems.extend(self.warp.problem("warp"));
        check_sheet(&mut problems, self.density, self.area_density, self.thickness);
        problems
    }

    fn example() -> Self {
        Self {
            young_warp: 1e6,
            young_weft: 4e5,
            poisson: 0.2,
            shear: 1e5,
            warp: Direction::Constant([1.0, 0.5, 0.0]),
            density: Some(1000.0),
            area_density: None,
            thickness: 1e-2,
            bending: Bending::Shell,
            tension_field: false,
        }
    }
}

impl SheetMaterial for OrthotropicSheet {
    type Parameters = OrthotropicParameters;
    const HAS_TENSION_FIELD: bool = false;

    fn new(parameters: &OrthotropicParameters) -> Self {
        Self { moduli: parameters.moduli() }
    }

    fn response(&self, strain: &[f64; 3]) -> SheetResponse {
        let stress = self.moduli.map(|row| row[0] * strain[0] + row[1] * strain[1] + row[2] * strain[2]);
        let energy = 0.5 * (0..3).map(|k| stress[k] * strain[k]).sum::<f64>();
        SheetResponse { energy, stress, tangent: self.moduli }
    }
}
