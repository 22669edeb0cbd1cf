//! Orthotropic St. Venant–Kirchhoff in plane stress: woven cloth.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::error::FemError;
use crate::lanes::real::Real;
use crate::sheet::bending::Bending;
use crate::sheet::direction::Direction;
use crate::sheet::material::{
    SheetCommon, SheetMaterial, SheetParameters, SheetResponse, area_density, check_sheet, require_positive,
};
use crate::small::tensor::{dot, mat3, vec3};

/// W = ½ eᵀQ e with e = (E₁₁, E₂₂, 2E₁₂) in the frame of warp and weft, and Q = [[E₁, ν₁₂E₂, 0], [ν₁₂E₂, E₂, 0], [0,
/// 0, G(1 − ν₁₂ν₂₁)]]/(1 − ν₁₂ν₂₁), ν₂₁ = ν₁₂ E₂/E₁ (Reddy, *Mechanics of Laminated Composite Plates and Shells*, eq.
/// 1.3.36).
#[derive(Debug, Clone)]
pub struct OrthotropicSheet {
    moduli: [[f64; 3]; 3],
    /// Q⁻¹, 1/Pa.
    compliance: [[f64; 3]; 3],
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
    /// Poisson's ratio ν₁₂, the contraction of the weft under tension along the warp; ν₁₂² < E₁/E₂.
    pub poisson: f64,
    /// Shear modulus G between warp and weft, Pa; positive.
    #[schemars(extend("exclusiveMinimum" = 0.0))]
    pub shear: f64,
    /// Direction of the warp on the sheet at rest (default: along x).
    #[serde(default = "default_warp")]
    pub warp: Direction,
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
                requirement: "poisson² must be below young_warp / young_weft; otherwise the sheet is unstable",
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

    fn new(parameters: &OrthotropicParameters) -> Self {
        let OrthotropicParameters { young_warp: e1, young_weft: e2, poisson, shear, .. } = *parameters;
        let coupling = -poisson / e1;
        let compliance = [[1.0 / e1, coupling, 0.0], [coupling, 1.0 / e2, 0.0], [0.0, 0.0, 1.0 / shear]];
        Self { moduli: parameters.moduli(), compliance }
    }

    #[inline(always)]
    fn response<R: Real>(&self, strain: &[R; 3]) -> SheetResponse<R> {
        let tangent = mat3!(i j => strain[0].constant(self.moduli[i][j]));
        let stress = vec3!(i => dot(tangent[i], *strain));
        SheetResponse { energy: dot(stress, *strain) * 0.5, stress, tangent }
    }

    /// Returns min ½ (e + Δ)ᵀQ (e + Δ) over wrinkle strains Δ ≥ 0, which equals max S·e − ½ SᵀQ⁻¹S over stresses S ≥
    /// 0. The sheet is taut if Q e ≥ 0. Otherwise it is in tension along one direction t: max ½ Y(t) (t·e t)₊² with
    /// 1/Y = tt·Q⁻¹tt.
    fn relaxed(&self, strain: &[f64; 3]) -> SheetResponse {
        let taut = self.response(strain);
        let [s11, s22, s12] = taut.stress;
        if s11 + s22 >= 0.0 && s11 * s22 >= s12 * s12 {
            return taut;
        }
        let Some(theta) = self.tension_direction(strain) else { return SheetResponse::default() };
        let Tension { slope, by_theta, curvature, stiffness, energy } = self.tension(strain, theta);
        // The direction depends on the strain: dθ = −φ_θe·de/φ_θθ.
        let entry = |a: usize, b: usize| {
            let direct = stiffness * slope.1[a] * slope.1[b];
            direct - if curvature < 0.0 { by_theta[a] * by_theta[b] / curvature } else { 0.0 }
        };
        SheetResponse {
            energy,
            stress: slope.1.map(|p| slope.0 * p),
            tangent: [0, 1, 2].map(|a| [0, 1, 2].map(|b| entry(a, b))),
        }
    }
}

/// φ(θ, e) = ½ Y ε² with ε = p·e, and its derivatives.
struct Tension {
    energy: f64,
    /// ∂φ/∂e = Y ε p, as the tension Y ε and p = (t₁², t₂², t₁t₂).
    slope: (f64, [f64; 3]),
    /// The stiffness Y, Pa.
    stiffness: f64,
    /// ∂²φ/∂θ∂e.
    by_theta: [f64; 3],
    /// ∂²φ/∂θ².
    curvature: f64,
}

impl OrthotropicSheet {
    fn tension(&self, e: &[f64; 3], theta: f64) -> Tension {
        let (s, c) = theta.sin_cos();
        // p and its first and second derivatives by θ.
        let p = [c * c, s * s, s * c];
        let dp = [-2.0 * s * c, 2.0 * s * c, c * c - s * s];
        let ddp = [-2.0 * dp[2], 2.0 * dp[2], -4.0 * s * c];
        let along = |p: &[f64; 3]| (0..3).map(|k| p[k] * e[k]).sum::<f64>();
        let form = |p: &[f64; 3], q: &[f64; 3]| {
            (0..3).map(|i| (0..3).map(|j| p[i] * self.compliance[i][j] * q[j]).sum::<f64>()).sum::<f64>()
        };
        let (soft, d_soft, dd_soft) =
            (form(&p, &p), 2.0 * form(&p, &dp), 2.0 * (form(&dp, &dp) + form(&p, &ddp)));
        let y = 1.0 / soft;
        let (dy, ddy) = (-d_soft * y * y, (2.0 * d_soft * d_soft * y - dd_soft) * y * y);
        let (strain, d_strain, dd_strain) = (along(&p), along(&dp), along(&ddp));
        Tension {
            energy: 0.5 * y * strain * strain,
            slope: (y * strain, p),
            stiffness: y,
            by_theta: [0, 1, 2].map(|k| (dy * strain + y * d_strain) * p[k] + y * strain * dp[k]),
            curvature: 0.5 * ddy * strain * strain
                + 2.0 * dy * strain * d_strain
                + y * (d_strain * d_strain + strain * dd_strain),
        }
    }

    /// Returns ∂φ/∂θ.
    fn turning(&self, e: &[f64; 3], theta: f64) -> f64 {
        // φ is homogeneous of degree two in e: φ_θ = ½ φ_θe·e.
        let by_theta = self.tension(e, theta).by_theta;
        0.5 * (0..3).map(|k| by_theta[k] * e[k]).sum::<f64>()
    }

    /// Returns the angle of greatest φ, or `None` if no direction is stretched. Takes the best of 32 angles, then
    /// bisects ∂φ/∂θ between its neighbours.
    fn tension_direction(&self, e: &[f64; 3]) -> Option<f64> {
        const COUNT: usize = 32;
        let width = std::f64::consts::PI / COUNT as f64;
        let value = |theta: f64| {
            let tension = self.tension(e, theta);
            if tension.slope.0 > 0.0 { tension.energy } else { 0.0 }
        };
        // Include the most stretched direction in the candidates: it may be the only one that is stretched.
        let stretched = 0.5 * e[2].atan2(e[0] - e[1]);
        let candidates = (0..COUNT).map(|k| stretched + k as f64 * width);
        let best = candidates.max_by(|&a, &b| value(a).total_cmp(&value(b)))?;
        if value(best) <= 0.0 {
            return None;
        }
        let (mut low, mut high) = (best - width, best + width);
        for _ in 0..60 {
            let middle = 0.5 * (low + high);
            // Left of the maximum φ rises. If the middle is not stretched, the maximum lies towards `best`.
            let rises = if value(middle) > 0.0 { self.turning(e, middle) > 0.0 } else { middle < best };
            if rises { low = middle } else { high = middle }
        }
        Some(0.5 * (low + high))
    }
}
