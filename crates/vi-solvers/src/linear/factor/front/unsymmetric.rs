//! Dense operations on one front of a matrix that is not symmetric: P F₁₁ = L₁₁ U₁₁ with partial pivoting inside the front,
//! L₂₁ = F₂₁ U₁₁⁻¹, U₁₂ = L₁₁⁻¹ P F₁₂, and the update F₂₂ − L₂₁ U₁₂.
//!
//! The first side of a panel becomes [L₁₁; L₂₁] with the ones on its diagonal, and the second side [U₁₁ᵀ; U₁₂ᵀ], so that
//! substitutions through either side are those through a Cholesky factor.

use std::sync::atomic::{AtomicU32, Ordering};

use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::lu::partial_pivoting::factor::{lu_in_place, lu_in_place_scratch};
use faer::{Accum, MatMut, Par};

use super::{TILED_FLOPS, drop_negligible, solve_tiles, subtract_square, subtract_tiles};
use crate::linear::factor::scalar::{self, Scalar};
use crate::linear::factor::walk::Front;

/// Eliminates the columns of a front with two sides. Stores in `order` which row of the front stands in each row of P F₁₁.
///
/// # Errors
/// Returns the column whose pivot is zero or not finite.
pub(in crate::linear::factor) fn eliminate<T: Scalar>(
    front: Front<'_, T>,
    order: &[AtomicU32],
) -> Result<(), usize> {
    let Front { rows, columns, panel, update, is_fresh, .. } = front;
    let below = rows - columns;
    scalar::drop_below(T::NEGLIGIBLE, panel);
    let (lower, upper) = panel.split_at_mut(rows * columns);
    for j in 1..columns {
        for i in 0..j {
            lower[i + j * rows] = upper[j + i * rows];
        }
    }
    let (mut lower_diagonal, mut lower_below) =
        MatMut::from_column_major_slice_mut(lower, rows, columns).split_at_row_mut(columns);
    let rows_of = pivot(lower_diagonal.as_mut());
    for (place, &row) in order.iter().zip(&rows_of) {
        place.store(row, Ordering::Relaxed);
    }
    reorder_columns(upper, rows, &rows_of);
    let (mut upper_diagonal, mut upper_below) =
        MatMut::from_column_major_slice_mut(upper, rows, columns).split_at_row_mut(columns);
    for j in 0..columns {
        for i in 0..=j {
            upper_diagonal[(j, i)] = lower_diagonal[(i, j)];
        }
        let pivot = lower_diagonal[(j, j)].value();
        if pivot == 0.0 || !pivot.is_finite() {
            return Err(j);
        }
        lower_diagonal[(j, j)] = T::of(1.0);
    }
    if below == 0 {
        return Ok(());
    }
    drop_negligible(lower_diagonal.as_mut());
    drop_negligible(upper_diagonal.as_mut());
    solve_tiles(upper_diagonal.as_ref(), lower_below.as_mut());
    solve_tiles(lower_diagonal.as_ref(), upper_below.as_mut());
    let (lower, upper) = (lower_below.as_ref(), upper_below.as_ref());
    let (first, second) = update.split_at_mut(below * below);
    let accumulate = if is_fresh { Accum::Replace } else { Accum::Add };
    let (m, n) = (below as f64, columns as f64);
    for (update, left, right) in [(first, lower, upper), (second, upper, lower)] {
        let update = MatMut::from_column_major_slice_mut(update, below, below);
        match n * m * m > TILED_FLOPS {
            true => subtract_tiles(update, accumulate, left, right),
            false => subtract_square(update, accumulate, left, right),
        }
    }
    Ok(())
}

/// Factors a dense square matrix in place. Returns which of its rows stands in each row of L U.
fn pivot<T: Scalar>(mut factor: MatMut<'_, T>) -> Vec<u32> {
    let order = factor.nrows();
    let (mut rows_of, mut inverse) = (vec![0_u32; order], vec![0_u32; order]);
    let scratch = lu_in_place_scratch::<u32, T>(order, order, Par::Seq, Default::default());
    let mut memory = MemBuffer::new(scratch);
    let stack = MemStack::new(&mut memory);
    lu_in_place(factor.as_mut(), &mut rows_of, &mut inverse, Par::Seq, stack, Default::default());
    rows_of
}

/// Moves column `order[j]` of a column-major matrix with `rows` rows to column j, for all j.
fn reorder_columns<T>(matrix: &mut [T], rows: usize, order: &[u32]) {
    for j in 0..order.len() {
        // The columns before j are in place. What stood there has moved to where their own columns came from.
        let mut from = order[j] as usize;
        while from < j {
            from = order[from] as usize;
        }
        if from != j {
            let (left, right) = matrix.split_at_mut(from * rows);
            left[j * rows..][..rows].swap_with_slice(&mut right[..rows]);
        }
    }
}
