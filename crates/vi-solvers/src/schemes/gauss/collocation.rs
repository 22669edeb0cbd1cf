//! The coefficients of a Gauss method, and of the triangular splitting of T = A² that its solver iterates with.

use nalgebra::DMatrix;
use vi_core::{Quadrature, Scheme};

use crate::error::SolverError;

type Rows = Vec<Vec<f64>>;

/// Returns the error for a number of stages that no method has.
pub(crate) fn stages_outside_domain(stages: usize) -> SolverError {
    SolverError::Option { option: "stages", value: stages as f64, allowed: "must be from 1 to 5" }
}

/// The coefficients: all quantities of a step are linear combinations of the stage increments Z_j.
pub(crate) struct Collocation {
    pub(crate) c: Vec<f64>,
    pub(crate) b: Vec<f64>,
    /// Diagonal of the splitting.
    pub(crate) theta: f64,
    /// Contraction of the iteration with the splitting.
    pub(crate) rate: f64,
    pub(crate) l: Rows,
    /// (QᵀTQ − L)/θ, what the splitting omits.
    pub(crate) omitted: Rows,
    pub(crate) q: Rows,
    pub(crate) q_transposed: Rows,
    /// QᵀT.
    pub(crate) q_transposed_t: Rows,
    /// h² a_i = Σ (T⁻¹)_ij Z_j.
    pub(crate) acceleration: Rows,
    /// h (V_i − v₀) = Σ (A T⁻¹)_ij Z_j.
    pub(crate) stage_velocity: Rows,
    /// q₁ − q₀ − h v₀ = h² Σ b_i (1 − c_i) a_i.
    pub(crate) position: Vec<f64>,
    /// h (v₁ − v₀) = h² Σ b_i a_i.
    pub(crate) velocity: Vec<f64>,
    /// Z of the next step from Z of the last one: extrapolates the accelerations by their least-squares line.
    /// (Higher-order extrapolation is worse at large steps.)
    pub(crate) prediction: Rows,
}

impl Collocation {
    /// Returns the coefficients of degree s × Gauss–Legendre with s points, s from 2 to 5.
    ///
    /// The velocity of the trajectory, of degree s − 1, is the polynomial through its values at the s nodes. Hence
    /// Butcher's matrix is that of collocation at the nodes.
    pub(crate) fn new(scheme: &Scheme) -> Result<Self, SolverError> {
        let rule = &scheme.quadrature;
        let s = rule.nodes().len();
        let Some(splitting) = Splitting::of(s).filter(|_| scheme.interpolation.degree() == s) else {
            return Err(stages_outside_domain(s));
        };
        let (c, b) = (rule.nodes().to_vec(), rule.weights().to_vec());
        let a = butcher(rule);
        let t = &a * &a;
        let inverse = t.clone().try_inverse().expect("A of a Gauss method is regular");
        let q = DMatrix::from_fn(s, s, |i, j| splitting.q[i * s + j]);
        let row = |weights: Vec<f64>| {
            (DMatrix::from_row_slice(1, s, &weights) * &inverse).iter().copied().collect::<Vec<f64>>()
        };
        let position = row((0..s).map(|i| b[i] * (1.0 - c[i])).collect());
        let velocity = row(b.clone());
        let l = DMatrix::from_fn(s, s, |i, j| if j > i { 0.0 } else { splitting.l[i * (i + 1) / 2 + j] });
        let omitted = rows(&((q.transpose() * &t * &q - l) / splitting.theta));
        let prediction = rows(&(&t * line_extrapolation(&c) * &inverse));
        Ok(Self {
            theta: splitting.theta,
            rate: splitting.rate,
            omitted,
            l: (0..s).map(|i| splitting.l[i * (i + 1) / 2..][..i].to_vec()).collect(),
            q_transposed: rows(&q.transpose()),
            q_transposed_t: rows(&(q.transpose() * &t)),
            q: rows(&q),
            stage_velocity: rows(&(&a * &inverse)),
            acceleration: rows(&inverse),
            position,
            velocity,
            prediction,
            c,
            b,
        })
    }

    pub(crate) fn stages(&self) -> usize {
        self.c.len()
    }
}

/// Returns Σ_j row_j z_j for coordinate k of stage vectors of length n, which are stored one after another.
pub(super) fn combine(row: &[f64], vectors: &[f64], n: usize, k: usize) -> f64 {
    row.iter().enumerate().map(|(j, a)| a * vectors[j * n + k]).sum()
}

fn rows(matrix: &DMatrix<f64>) -> Rows {
    matrix.row_iter().map(|row| row.iter().copied().collect()).collect()
}

/// Returns A_ij = ∫₀^{c_i} ℓ_j, computed exactly by the rule itself on [0, c_i].
fn butcher(rule: &Quadrature) -> DMatrix<f64> {
    let (c, b) = (rule.nodes(), rule.weights());
    let s = c.len();
    let lagrange = |j: usize, x: f64| -> f64 {
        (0..s).filter(|&k| k != j).map(|k| (x - c[k]) / (c[j] - c[k])).product()
    };
    DMatrix::from_fn(s, s, |i, j| (0..s).map(|k| c[i] * b[k] * lagrange(j, c[i] * c[k])).sum())
}

/// Returns the values at 1 + c_i of the least-squares line through values at c_j.
fn line_extrapolation(c: &[f64]) -> DMatrix<f64> {
    let s = c.len();
    // The nodes are symmetric about ½.
    let spread: f64 = c.iter().map(|c| (c - 0.5) * (c - 0.5)).sum();
    DMatrix::from_fn(s, s, |i, j| 1.0 / s as f64 + (c[i] + 0.5) * (c[j] - 0.5) / spread)
}

/// The splitting QᵀTQ ≈ L with a lower triangular L of constant diagonal θ and an orthogonal Q.
///
/// On the test equation with κ = h²λ the iteration has the matrix κ(1 + κL)⁻¹(L − QᵀTQ). Q, L and θ minimise its
/// largest spectral radius over κ > 0. They were found by direct search; a test checks the rates below. Compare P. J.
/// van der Houwen, J. J. B. de Swart, "Triangularly implicit iteration methods for ODE-IVP solvers", SIAM J. Sci.
/// Comput. 18 (1997) 41–55.
struct Splitting {
    theta: f64,
    /// Q by rows.
    q: &'static [f64],
    /// The lower triangle of L by rows, including the diagonal.
    l: &'static [f64],
    /// Largest spectral radius.
    rate: f64,
}

impl Splitting {
    fn of(s: usize) -> Option<Self> {
        Some(match s {
            2 => Self {
                theta: 0.07292380408065152,
                q: &[0.9511645499252452, 0.3086843030759837, -0.3086843030759837, 0.9511645499252452],
                l: &[0.07292380408065152, 0.14080433362459546, 0.07292380408065152],
                rate: 0.145,
            },
            3 => Self {
                theta: 0.03783675699794215,
                q: &[
                    0.9593713022543919,
                    -0.10557333021416315,
                    0.2616504851098185,
                    -0.06669328958706361,
                    0.8162220593367255,
                    0.5738759055546512,
                    -0.2741508882618624,
                    -0.568010406418409,
                    0.7760189873099921,
                ],
                l: &[
                    0.03783675699794215,
                    0.027953547218819937,
                    0.03783675699794215,
                    0.06461567829821936,
                    -0.04576433328498563,
                    0.03783675699794215,
                ],
                rate: 0.255,
            },
            4 => Self {
                theta: 0.01821402296128097,
                q: &[
                    0.12242781034918772,
                    0.17058867486643392,
                    -0.38171679325599667,
                    0.9001128957007432,
                    0.08551735472336125,
                    0.06110277426741365,
                    0.9236692189384336,
                    0.368494785585372,
                    0.7419151267507387,
                    0.6300733548868603,
                    -0.019221862561414532,
                    -0.22847326355554604,
                    0.6536514040317339,
                    -0.7550983528294546,
                    -0.027531504348535574,
                    0.04252453209493342,
                ],
                l: &[
                    0.01821402296128097,
                    -0.0019858585367044444,
                    0.01821402296128097,
                    0.0,
                    0.0,
                    0.01821402296128097,
                    0.0,
                    0.0,
                    -0.026977062814991185,
                    0.01821402296128097,
                ],
                rate: 0.504,
            },
            5 => Self {
                theta: 0.011682623442838344,
                q: &[
                    -0.00903062744591673,
                    0.3294037382592427,
                    -0.16506638885201252,
                    0.46280096947047833,
                    -0.8062133557051204,
                    0.002767887556223948,
                    -0.03396839837078275,
                    -0.08240429714439997,
                    -0.8650856321233803,
                    -0.4936343460664263,
                    -0.04269776796938605,
                    0.6266670070530108,
                    -0.6959503648434224,
                    -0.14020823569326654,
                    0.3185280257681302,
                    -0.24484872919813805,
                    -0.6906174009704111,
                    -0.6645488403146805,
                    0.12914337430903838,
                    -0.06923534498665417,
                    -0.9685746161173635,
                    0.1437894046202883,
                    0.19997636758930867,
                    -0.03325283847632445,
                    0.00956667502832143,
                ],
                l: &[
                    0.011682623442838344,
                    0.0,
                    0.011682623442838344,
                    0.0,
                    -0.007655051087726759,
                    0.011682623442838344,
                    0.0,
                    0.0,
                    0.0,
                    0.011682623442838344,
                    0.0,
                    0.0,
                    0.0,
                    -0.021751421743363704,
                    0.011682623442838344,
                ],
                rate: 0.612,
            },
            _ => return None,
        })
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::DMatrix;
    use vi_core::Quadrature;

    use super::*;

    #[test]
    fn butcher_matrix_integrates_polynomials() {
        for s in 2..=5 {
            let rule = Quadrature::gauss_legendre(s).unwrap();
            let (a, c) = (butcher(&rule), rule.nodes());
            for power in 0..s as i32 {
                for i in 0..s {
                    let sum: f64 = (0..s).map(|j| a[(i, j)] * c[j].powi(power)).sum();
                    assert!((sum - c[i].powi(power + 1) / f64::from(power + 1)).abs() < 1e-15);
                }
            }
        }
    }

    #[test]
    fn rates_of_the_splittings() {
        for s in 2..=5 {
            let splitting = Splitting::of(s).unwrap();
            let q = DMatrix::from_row_slice(s, s, splitting.q);
            assert!((q.transpose() * &q - DMatrix::identity(s, s)).norm() < 1e-14);
            let a = butcher(&Quadrature::gauss_legendre(s).unwrap());
            let rotated = q.transpose() * &a * &a * &q;
            let l = DMatrix::from_fn(s, s, |i, j| if j > i { 0.0 } else { splitting.l[i * (i + 1) / 2 + j] });
            assert!((0..s).all(|i| l[(i, i)] == splitting.theta));
            let rate = |kappa: f64| {
                let left = DMatrix::identity(s, s) + kappa * &l;
                let step = left.try_inverse().unwrap() * (&l - &rotated) * kappa;
                step.complex_eigenvalues().iter().map(|z| z.norm()).fold(0.0, f64::max)
            };
            let worst = (-20..=120).map(|k| rate(10.0_f64.powf(f64::from(k) / 10.0))).fold(0.0, f64::max);
            assert!(worst <= splitting.rate && worst > splitting.rate - 0.01, "{s}: {worst}");
        }
    }

    #[test]
    fn straight_lines_are_extrapolated_exactly() {
        let c = Quadrature::gauss_legendre(4).unwrap().nodes().to_vec();
        let e = line_extrapolation(&c);
        for i in 0..4 {
            let value: f64 = (0..4).map(|j| e[(i, j)] * (2.0 - 3.0 * c[j])).sum();
            assert!((value - (2.0 - 3.0 * (1.0 + c[i]))).abs() < 1e-14);
        }
    }
}
