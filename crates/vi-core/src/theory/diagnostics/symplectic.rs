//! The derivative of a map of phase space by finite differences, and its deviation from symplecticity.

use nalgebra::DMatrix;

/// Returns DΦ at z by central differences of order 6 with step `delta`. The error is about delta⁶ + 1e-16/delta; 1e-3
/// times the size of z is a good choice.
pub fn map_derivative(map: impl Fn(&[f64]) -> Vec<f64>, z: &[f64], delta: f64) -> DMatrix<f64> {
    const WEIGHTS: [(f64, f64); 3] = [(1.0, 45.0), (2.0, -9.0), (3.0, 1.0)];
    let mut out = DMatrix::zeros(z.len(), z.len());
    let mut point = z.to_vec();
    for j in 0..z.len() {
        for (reach, weight) in WEIGHTS {
            for sign in [1.0, -1.0] {
                point[j] = z[j] + sign * reach * delta;
                for (i, value) in map(&point).iter().enumerate() {
                    out[(i, j)] += sign * weight * value / (60.0 * delta);
                }
            }
        }
        point[j] = z[j];
    }
    out
}

/// Returns the largest entry of DΦᵀ J DΦ − J for a map of z = (q, p). It is zero if and only if the map is
/// symplectic.
pub fn symplecticity_defect(derivative: &DMatrix<f64>) -> f64 {
    let n = derivative.nrows() / 2;
    let unit = DMatrix::from_fn(2 * n, 2 * n, |i, j| match () {
        () if j == i + n => 1.0,
        () if i == j + n => -1.0,
        () => 0.0,
    });
    (derivative.transpose() * &unit * derivative - unit).amax()
}

/// Returns det DΦ: the factor by which the map changes phase volume (area for one coordinate).
pub fn area_factor(derivative: &DMatrix<f64>) -> f64 {
    derivative.determinant()
}

/// Runs the map forwards and back with reversed momenta, and returns the distance from the start: the largest entry
/// of R Φᵏ R Φᵏ(z) − z with R(q, p) = (q, −p), for `steps` applications of the map in each direction.
pub fn reversal_defect(map: impl Fn(&[f64]) -> Vec<f64>, z: &[f64], steps: usize) -> f64 {
    let n = z.len() / 2;
    let mut point = z.to_vec();
    for _ in 0..2 {
        for _ in 0..steps {
            point = map(&point);
        }
        point[n..].iter_mut().for_each(|p| *p = -*p);
    }
    point.iter().zip(z).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}
