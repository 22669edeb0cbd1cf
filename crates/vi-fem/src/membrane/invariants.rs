//! Isotropic membranes: from derivatives in the invariants i = tr C, j = √det C (the area ratio) to
//! derivatives in the strain, and relaxation of compression. It must not know any law.

use crate::sheet_material::SheetResponse;

/// W(i, j) and its derivatives.
pub(super) struct Invariants {
    pub(super) energy: f64,
    /// W_i, W_j.
    pub(super) first: [f64; 2],
    /// W_ii, W_ij, W_jj.
    pub(super) second: [f64; 3],
}

/// The response of W(i, j) at the strain e = (E₁₁, E₂₂, 2E₁₂), C = I + 2E.
pub(super) fn from_invariants(strain: &[f64; 3], law: impl Fn(f64, f64) -> Invariants) -> SheetResponse {
    let (c11, c22, c12) = (1.0 + 2.0 * strain[0], 1.0 + 2.0 * strain[1], strain[2]);
    let (i, j) = (c11 + c22, (c11 * c22 - c12 * c12).max(0.0).sqrt());
    let Invariants { energy, first: [w_i, w_j], second: [w_ii, w_ij, w_jj] } = law(i, j);
    // ∂i/∂e and ∂j/∂e; ∂²(j²)/∂e² = 2 q qᵀ + 2 j ∂²j/∂e² is constant.
    let p = [2.0, 2.0, 0.0];
    let q = [c22 / j, c11 / j, -c12 / j];
    let half_square = [[0.0, 2.0, 0.0], [2.0, 0.0, 0.0], [0.0, 0.0, -1.0]];
    let tangent = |a: usize, b: usize| {
        w_ii * p[a] * p[b]
            + w_ij * (p[a] * q[b] + q[a] * p[b])
            + w_jj * q[a] * q[b]
            + w_j * (half_square[a][b] - q[a] * q[b]) / j
    };
    SheetResponse {
        energy,
        stress: [0, 1, 2].map(|a| w_i * p[a] + w_j * q[a]),
        tangent: [0, 1, 2].map(|a| [0, 1, 2].map(|b| tangent(a, b))),
    }
}

/// Uniaxial tension at the principal value c of C, free to contract across.
pub(super) struct Uniaxial {
    /// W, and its derivatives by c.
    pub(super) energy: f64,
    pub(super) first: f64,
    pub(super) second: f64,
    /// The other principal value of C that goes with it.
    pub(super) width: f64,
}

/// Relaxed energy of an isotropic membrane (Pipkin 1986; Steigmann 1990): slack (W = 0) where no
/// principal stretch exceeds 1; wrinkled, in uniaxial tension, where the sheet is narrower than its
/// natural width; else `taut`. W and its stress are continuous.
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
    // Here small < width < 1 < large: the principal directions n (large) and m are distinct.
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
