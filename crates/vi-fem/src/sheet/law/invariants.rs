//! Isotropic membranes: converts derivatives by the invariants i = tr C and j = √det C (the area ratio) to
//! derivatives by the strain, and relaxes compression.

use crate::lanes::real::Real;
use crate::sheet::material::SheetResponse;
use crate::small::tensor::{mat3, vec3};

/// W(i, j) and its derivatives.
pub(super) struct Invariants<R> {
    pub(super) energy: R,
    /// W_i, W_j.
    pub(super) first: [R; 2],
    /// W_ii, W_ij, W_jj.
    pub(super) second: [R; 3],
}

/// Returns (i, j) at the strain e = (E₁₁, E₂₂, 2E₁₂), with C = I + 2E.
#[inline(always)]
pub(super) fn invariants<R: Real>(strain: &[R; 3]) -> (R, R) {
    let (c11, c22, c12) = (strain[0] * 2.0 + 1.0, strain[1] * 2.0 + 1.0, strain[2]);
    let square = c11 * c22 - c12 * c12;
    (c11 + c22, square.if_positive(square, square.constant(0.0)).sqrt())
}

/// Returns t and q with i = 2 + t and j² = 1 + t + q: t is of first and q of second order in the strain.
#[inline(always)]
pub(super) fn small_invariants<R: Real>(strain: &[R; 3]) -> [R; 2] {
    let trace = (strain[0] + strain[1]) * 2.0;
    [trace, strain[0] * strain[1] * 4.0 - strain[2] * strain[2]]
}

/// Returns the response of W(i, j) at that strain.
#[inline(always)]
pub(super) fn from_invariants<R: Real>(strain: &[R; 3], j: R, law: Invariants<R>) -> SheetResponse<R> {
    let (c11, c22, c12) = (strain[0] * 2.0 + 1.0, strain[1] * 2.0 + 1.0, strain[2]);
    let Invariants { energy, first: [w_i, w_j], second: [w_ii, w_ij, w_jj] } = law;
    // p = ∂i/∂e and q = ∂j/∂e; ∂²(j²)/∂e² = 2 q qᵀ + 2 j ∂²j/∂e² is constant.
    let (zero, two) = (j.constant(0.0), j.constant(2.0));
    let p = [two, two, zero];
    let q = [c22 / j, c11 / j, -c12 / j];
    let half_square = [[zero, two, zero], [two, zero, zero], [zero, zero, j.constant(-1.0)]];
    let by_j = w_j / j;
    SheetResponse {
        energy,
        stress: vec3!(a => w_i * p[a] + w_j * q[a]),
        tangent: mat3!(a b => w_ii * p[a] * p[b]
            + w_ij * (p[a] * q[b] + q[a] * p[b])
            + w_jj * q[a] * q[b]
            + by_j * (half_square[a][b] - q[a] * q[b])),
    }
}

/// Uniaxial tension at the principal value c of C, with free transverse contraction.
pub(super) struct Uniaxial {
    /// The energy density W and its first and second derivatives by c, J/m³.
    pub(super) energy: f64,
    pub(super) first: f64,
    pub(super) second: f64,
    /// The other principal value of C, which leaves the sheet without stress across the tension.
    pub(super) width: f64,
}

/// Returns the relaxed energy of an isotropic membrane (Pipkin 1986; Steigmann 1990). The sheet is slack (W = 0) if
/// no principal stretch exceeds 1. It is wrinkled, in uniaxial tension, if it is narrower than its natural width.
/// Otherwise the response is `taut`. W and its stress are continuous.
pub(super) fn relaxed(
    strain: &[f64; 3],
    uniaxial: impl Fn(f64) -> Uniaxial,
    taut: impl Fn() -> SheetResponse,
) -> SheetResponse {
    let (c11, c22, c12) = (1.0 + 2.0 * strain[0], 1.0 + 2.0 * strain[1], strain[2]);
    let half_difference = 0.5 * (c11 - c22);
    let radius = half_difference.hypot(c12);
    let mean = 0.5 * (c11 + c22);
    let (large, small) = (mean + radius, mean - radius);
    if large <= 1.0 {
        return SheetResponse::default();
    }
    let Uniaxial { energy, first, second, width } = uniaxial(large);
    if small >= width {
        return taut();
    }
    // Here small < width < 1 < large, so the principal directions n (large) and m are distinct.
    let angle = 0.5 * c12.atan2(half_difference);
    let (n, m) = ([angle.cos(), angle.sin()], [-angle.sin(), angle.cos()]);
    let p = [2.0 * n[0] * n[0], 2.0 * n[1] * n[1], 2.0 * n[0] * n[1]];
    let turn = [2.0 * n[0] * m[0], 2.0 * n[1] * m[1], n[0] * m[1] + n[1] * m[0]];
    let turning = first * 2.0 / (large - small);
    SheetResponse {
        energy,
        stress: p.map(|p| first * p),
        tangent: [0, 1, 2].map(|a| [0, 1, 2].map(|b| second * p[a] * p[b] + turning * turn[a] * turn[b])),
    }
}
