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
    /// Contraction of the iteration with the splitting after its first step, at worst.
    pub(crate) rate: f64,
    pub(crate) l: Rows,
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
        let prediction = rows(&(&t * line_extrapolation(&c) * &inverse));
        Ok(Self {
            theta: splitting.theta,
            rate: splitting.rate,
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
/// On the test equation with κ = h²λ the iteration has the matrix E = κ(1 + κL)⁻¹(L − QᵀTQ). Q, L and θ minimise the product of the
/// largest norms ‖Eᵏ‖ over κ > 0, k = 1 … 8. They were found by direct search (covariance matrix adaptation); a test checks the norms.
/// Coefficients of least spectral radius, .145 and .255 for two and three stages, make errors of stiff motions grow first: ‖E²‖ is 1.4
/// and 17, here .08 and .4. Compare P. J. van der Houwen, J. J. B. de Swart, "Triangularly implicit iteration methods
/// for ODE-IVP solvers", SIAM J. Sci. Comput. 18 (1997) 41–55.
struct Splitting {
    theta: f64,
    /// Q by rows.
    q: &'static [f64],
    /// The lower triangle of L by rows, including the diagonal.
    l: &'static [f64],
    /// Ratio of the largest norms, ‖E²‖/‖E‖; later ratios are at most equal.
    rate: f64,
}

impl Splitting {
    fn of(s: usize) -> Option<Self> {
        Some(match s {
            2 => Self {
                theta: 0.07496162651602434,
                q: &[0.9919599688101854, -0.126552045728608, 0.126552045728608, 0.9919599688101856],
                l: &[0.07496162651602434, 0.2661392151802965, 0.07496162651602434],
                rate: 0.203,
            },
            3 => Self {
                theta: 0.03654709452281215,
                q: &[
                    0.9773107688435163,
                    -0.21052778842763956,
                    0.02327469446120198,
                    0.21124154456090294,
                    0.9607352608735773,
                    -0.1799021077300215,
                    0.0155135732189367,
                    0.1807368496293634,
                    0.9834091316598773,
                ],
                l: &[
                    0.03654709452281215,
                    0.11952543655822416,
                    0.03654709452281215,
                    0.1436460027150871,
                    0.10709839536409586,
                    0.03654709452281215,
                ],
                rate: 0.365,
            },
            4 => Self {
                theta: 0.020813195582812437,
                q: &[
                    -0.910369279314809,
                    0.4085753167143157,
                    -0.04116316904884017,
                    0.05098607030835477,
                    -0.1507637352303209,
                    -0.4477211318048357,
                    -0.8575470791602464,
                    0.20354137490576257,
                    -0.36194996995057965,
                    -0.7735559990079703,
                    0.50085654418881,
                    0.14052066678890535,
                    0.13225086265129374,
                    0.18499490562168183,
                    0.10982405328901781,
                    0.9675873456909123,
                ],
                l: &[
                    0.020813195582812437,
                    0.055394559741062444,
                    0.020813195582812437,
                    -0.03596709348528668,
                    -0.06283650055624705,
                    0.020813195582812437,
                    -0.1668393569234535,
                    -0.20836867678277615,
                    0.09487582278129558,
                    0.020813195582812437,
                ],
                rate: 0.448,
            },
            5 => Self {
                theta: 0.015039479025626355,
                q: &[
                    0.9066289151260816,
                    -0.3874871960222027,
                    0.16403759975672874,
                    -0.030826927516986492,
                    0.004364582691307644,
                    0.40824709062497094,
                    0.7061769108741022,
                    -0.5669891907662565,
                    0.11440061073726367,
                    0.009178309306347852,
                    0.10645818755809451,
                    0.5922115225732517,
                    0.7761761404458312,
                    -0.1865354706133442,
                    -0.026594812257051563,
                    0.001579519326210446,
                    0.01707557619955556,
                    0.21672575273775385,
                    0.9710389301737327,
                    -0.09909224996667354,
                    -0.004741589827795029,
                    0.012719304072352371,
                    0.04685584833447831,
                    0.09083014418635564,
                    0.994670875724107,
                ],
                l: &[
                    0.015039479025626355,
                    0.04359506102609277,
                    0.015039479025626355,
                    0.03447166741970672,
                    0.0394306891796252,
                    0.015039479025626355,
                    0.03453808691499045,
                    0.06510364153834995,
                    0.04881393862836249,
                    0.015039479025626355,
                    0.01717835860655157,
                    0.06299304337987835,
                    0.08093377212654716,
                    0.050799356973107314,
                    0.015039479025626355,
                ],
                rate: 0.622,
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

    /// Returns the matrix E of the iteration with s stages for the test equation.
    fn iteration(s: usize, kappa: f64) -> DMatrix<f64> {
        let splitting = Splitting::of(s).unwrap();
        let q = DMatrix::from_row_slice(s, s, splitting.q);
        let a = butcher(&Quadrature::gauss_legendre(s).unwrap());
        let rotated = q.transpose() * &a * &a * &q;
        let l = DMatrix::from_fn(s, s, |i, j| if j > i { 0.0 } else { splitting.l[i * (i + 1) / 2 + j] });
        let left = DMatrix::identity(s, s) + kappa * &l;
        left.try_inverse().unwrap() * (&l - &rotated) * kappa
    }

    #[test]
    fn splittings_are_triangular_after_a_rotation() {
        for s in 2..=5 {
            let splitting = Splitting::of(s).unwrap();
            let q = DMatrix::from_row_slice(s, s, splitting.q);
            assert!((q.transpose() * &q - DMatrix::identity(s, s)).norm() < 1e-14);
            assert!((0..s).all(|i| splitting.l[i * (i + 3) / 2] == splitting.theta));
        }
    }

    /// No error grows much before it decreases, and errors decrease at the rate of the splitting, whatever the stiffness.
    #[test]
    fn errors_of_the_splittings_do_not_grow_first() {
        for (s, largest) in [(2, 0.41), (3, 1.08), (4, 1.46), (5, 1.70)] {
            let mut norms = [0.0_f64; 8];
            for exponent in -20..=120 {
                let step = iteration(s, 10.0_f64.powf(f64::from(exponent) / 10.0));
                let mut power = step.clone();
                for norm in &mut norms {
                    *norm = norm.max(power.singular_values().max());
                    power = &power * &step;
                }
            }
            let rate = Splitting::of(s).unwrap().rate;
            assert!(norms[0] <= largest, "{s}: {norms:?}");
            assert!((norms[1] / norms[0] - rate).abs() < 1e-3, "{s}: {norms:?}");
            for pair in norms.windows(2) {
                assert!(pair[1] <= (rate + 1e-3) * pair[0], "{s}: {norms:?}");
            }
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
