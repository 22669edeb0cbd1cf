//! Small oscillations about an equilibrium of any Lagrangian, including gyroscopic terms: rotating frames, spinning
//! bodies, magnetic fields.
//!
//! To second order in η = q − q₀, with C = ∂²L/∂v∂q at (q₀, 0),
//! ```text
//! M η̈ + (C − Cᵀ) η̇ + K η = 0,   M = ∂²L/∂v²,   K = −∂²L/∂q²;   η = a e^{λt}
//! ```
//! The λ come in groups of four: ±λ and their conjugates. An equilibrium is stable to this order only if all of them
//! are imaginary. Gyroscopic terms can achieve this even if V has no minimum (E. T. Whittaker, Analytical Dynamics,
//! §84).

use nalgebra::{Complex, DMatrix, DVector};

use crate::error::CoreError;
use crate::theory::lagrange::expansion::Expand;

/// One motion a e^{λt} of the linearised system, with Im λ ≥ 0; its conjugate is another motion.
#[derive(Debug, Clone, PartialEq)]
pub struct Oscillation {
    /// λ, 1/s: growth rate and frequency (rad/s).
    pub rate: Complex<f64>,
    /// a, of norm 1; its phases give the order in which the coordinates follow each other.
    pub shape: DVector<Complex<f64>>,
}

impl Oscillation {
    /// Returns Im λ, rad/s.
    pub fn frequency(&self) -> f64 {
        self.rate.im
    }
}

/// Returns the motions about the equilibrium q₀ at time t in order of increasing frequency, starting with those that
/// do not oscillate. For a double λ the two shapes may coincide.
///
/// # Errors
/// Returns [`CoreError::SingularMass`] if M has no inverse; [`CoreError::Convergence`] if q₀ is not an equilibrium:
/// |∂L/∂q| above 1e-8 of |K| (1 + |q₀|).
pub fn oscillations<L: Expand>(lagrangian: &L, t: f64, q: &[f64]) -> Result<Vec<Oscillation>, CoreError> {
    let n = lagrangian.coordinate_count();
    let at = lagrangian.expansion(t, q, &vec![0.0; n]);
    let size = at.qq.amax() * (1.0 + q.iter().fold(0.0_f64, |size, q| size.max(q.abs())));
    if at.d_q.amax() > 1e-8 * size {
        return Err(CoreError::Convergence { iterations: 0, residual: at.d_q.amax() });
    }
    let gyroscopic = &at.vq - at.vq.transpose();
    let mass = at.vv.clone().lu();
    let singular = CoreError::SingularMass { t };
    let stiffness = mass.solve(&at.qq).ok_or(singular.clone())?;
    let turning = mass.solve(&gyroscopic).ok_or(singular)?;
    // (η, η̇)˙ = (η̇, M⁻¹ (∂²L/∂q² η − (C − Cᵀ) η̇)).
    let mut matrix = DMatrix::zeros(2 * n, 2 * n);
    matrix.view_mut((0, n), (n, n)).fill_with_identity();
    matrix.view_mut((n, 0), (n, n)).copy_from(&stiffness);
    matrix.view_mut((n, n), (n, n)).copy_from(&(-turning));
    let mut rates: Vec<Complex<f64>> = matrix.complex_eigenvalues().iter().copied().collect();
    let scale = rates.iter().fold(0.0_f64, |scale, rate| scale.max(rate.norm()));
    rates.retain(|rate| rate.im >= -1e-12 * scale);
    rates.sort_by(|a, b| a.im.total_cmp(&b.im).then(a.re.total_cmp(&b.re)));
    Ok(rates
        .into_iter()
        .map(|rate| Oscillation { rate, shape: shape(&at.vv, &gyroscopic, &at.qq, rate) })
        .collect())
}

/// Returns whether no motion grows faster than `tolerance` times the largest |λ|.
pub fn is_spectrally_stable(oscillations: &[Oscillation], tolerance: f64) -> bool {
    let scale = oscillations.iter().fold(0.0_f64, |scale, motion| scale.max(motion.rate.norm()));
    oscillations.iter().all(|motion| motion.rate.re.abs() <= tolerance * scale)
}

/// Returns a with (λ²M + λG − ∂²L/∂q²) a = 0: the right singular vector of the smallest singular value.
fn shape(m: &DMatrix<f64>, g: &DMatrix<f64>, qq: &DMatrix<f64>, rate: Complex<f64>) -> DVector<Complex<f64>> {
    let matrix = DMatrix::from_fn(m.nrows(), m.ncols(), |i, j| {
        rate * rate * m[(i, j)] + rate * g[(i, j)] - Complex::from(qq[(i, j)])
    });
    let svd = matrix.svd(false, true);
    let least = svd.singular_values.imin();
    match svd.v_t {
        Some(v) => v.row(least).adjoint(),
        None => DVector::zeros(m.nrows()),
    }
}
