//! Hamilton's principle for a whole discrete path with fixed ends. It solves a boundary value problem for all
//! interior points at once, while marching solves an initial value problem. Both find the same path.

use nalgebra::{DMatrix, DVector};

use crate::error::CoreError;
use crate::theory::discrete::hermite::{HermiteLagrangian, HermiteState};
use crate::theory::discrete::lagrangian::{DiscreteLagrangian, Polynomial};
use crate::theory::lagrange::expansion::Expand;
use crate::theory::lagrange::higher::HigherLagrangian;
use crate::theory::newton;

/// Returns the path of `step_count` steps from `first` at time t to `last` that makes the discrete action Σ L_d
/// stationary: q_0 … q_N, N + 1 positions. The search starts from `guess(τ)`, τ from 0 to 1; there may be several
/// stationary paths.
///
/// # Errors
/// Returns [`CoreError::Length`], [`CoreError::SingularStep`] (conjugate points: the ends do not determine the path),
/// [`CoreError::Convergence`].
pub fn stationary_path<L: Expand>(
    discrete: &DiscreteLagrangian<'_, L>,
    t: f64,
    first: &[f64],
    last: &[f64],
    step_count: usize,
    guess: impl Fn(f64) -> Vec<f64>,
) -> Result<Vec<DVector<f64>>, CoreError> {
    let n = first.len();
    let s = discrete.degree();
    if last.len() != n {
        return Err(CoreError::Length { what: "last position", expected: n, found: last.len() });
    }
    if step_count == 0 {
        return Err(CoreError::Points { what: "path", count: 0, allowed: "it needs at least 1 step" });
    }
    // All control points in sequence; those shared by two steps appear once.
    let count = step_count * s + 1;
    let whole = |interior: &DVector<f64>| {
        let mut all = DVector::zeros(count * n);
        all.rows_mut(0, n).copy_from_slice(first);
        all.rows_mut(n, interior.len()).copy_from(interior);
        all.rows_mut((count - 1) * n, n).copy_from_slice(last);
        all
    };
    let piece = |all: &DVector<f64>, k: usize| {
        let start = all.rows(k * s * n, n).into_owned();
        let increments = DVector::from_fn(s * n, |i, _| all[k * s * n + n + i] - start[i % n]);
        Polynomial { t: t + k as f64 * discrete.step_size(), start, increments }
    };
    let rows = (count - 2) * n;
    let residual = |interior: &DVector<f64>| {
        let all = whole(interior);
        let mut sum = DVector::zeros(count * n);
        for k in 0..step_count {
            let mut part = sum.rows_mut(k * s * n, (s + 1) * n);
            part += discrete.gradient(&piece(&all, k));
        }
        sum.rows(n, rows).into_owned()
    };
    let jacobian = |interior: &DVector<f64>| {
        let all = whole(interior);
        let mut sum = DMatrix::zeros(count * n, count * n);
        for k in 0..step_count {
            let size = (s + 1) * n;
            let mut part = sum.view_mut((k * s * n, k * s * n), (size, size));
            part += discrete.hessian(&piece(&all, k));
        }
        sum.view((n, n), (rows, rows)).into_owned()
    };
    let begin: Vec<f64> = (1..count - 1).flat_map(|i| guess(i as f64 / (count - 1) as f64)).collect();
    if begin.len() != rows {
        return Err(CoreError::Length { what: "guess of the path", expected: rows, found: begin.len() });
    }
    let singular = CoreError::SingularStep { h: discrete.step_size() };
    let extent = DVector::from_column_slice(first).amax() + DVector::from_column_slice(last).amax();
    let interior = newton::solve(DVector::from_vec(begin), extent, singular, residual, jacobian)?;
    let all = whole(&interior);
    Ok((0..=step_count).map(|k| all.rows(k * s * n, n).into_owned()).collect())
}

/// Returns the path of piecewise cubics with continuous velocity, from (q, v) = `first` at time t to `last`, that
/// makes the discrete action stationary for fixed positions and velocities at both ends: N + 1 pairs (q, v).
///
/// # Errors
/// Returns the errors of [`stationary_path`].
pub fn stationary_hermite_path<L: HigherLagrangian>(
    discrete: &HermiteLagrangian<'_, L>,
    t: f64,
    first: &HermiteState,
    last: &HermiteState,
    step_count: usize,
) -> Result<Vec<HermiteState>, CoreError> {
    let h = discrete.step_size();
    let n = first.q.len();
    let (begin, end) = (first.stacked(), last.stacked());
    let size = begin.len();
    let rows = step_count.saturating_sub(1) * size;
    let node = |interior: &DVector<f64>, k: usize| match k {
        0 => begin.clone(),
        _ if k == step_count => end.clone(),
        _ => interior.rows((k - 1) * size, size).into_owned(),
    };
    // The unknowns of node k start at row (k − 1) · size; the two ends have no unknowns.
    let interior_nodes =
        |k: usize| [k, k + 1].into_iter().enumerate().filter(|&(_, node)| node > 0 && node < step_count);
    let residual = |interior: &DVector<f64>| {
        let mut sum = DVector::zeros(rows);
        for k in 0..step_count {
            let gradient = discrete.gradient(t + k as f64 * h, &node(interior, k), &node(interior, k + 1));
            for (side, node) in interior_nodes(k) {
                let mut part = sum.rows_mut((node - 1) * size, size);
                part += gradient.rows(side * size, size);
            }
        }
        sum
    };
    let jacobian = |interior: &DVector<f64>| {
        let mut sum = DMatrix::zeros(rows, rows);
        for k in 0..step_count {
            let hessian = discrete.hessian(t + k as f64 * h, &node(interior, k), &node(interior, k + 1));
            for (row_side, row) in interior_nodes(k) {
                for (column_side, column) in interior_nodes(k) {
                    let corner = ((row - 1) * size, (column - 1) * size);
                    let mut part = sum.view_mut(corner, (size, size));
                    part += hessian.view((row_side * size, column_side * size), (size, size));
                }
            }
        }
        sum
    };
    // The initial guess is the straight line between the ends.
    let guess = DVector::from_fn(rows, |i, _| {
        let (fraction, entry) = ((i / size + 1) as f64 / step_count as f64, i % size);
        if entry < n {
            begin[entry] + fraction * (end[entry] - begin[entry])
        } else {
            (end[entry - n] - begin[entry - n]) / (h * step_count as f64)
        }
    });
    let singular = CoreError::SingularStep { h };
    let extent = begin.amax() + end.amax();
    let interior = newton::solve(guess, extent, singular, residual, jacobian)?;
    Ok((0..=step_count).map(|k| HermiteState::from_stacked(&node(&interior, k))).collect())
}
