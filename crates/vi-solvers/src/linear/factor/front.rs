//! Dense operations on one front: eliminates its columns and updates the rest.
//!
//! They use the dense kernels of faer with one thread each. Large fronts are cut into tiles of fixed size, which
//! threads share; so the bits depend on the front alone.
//!
//! Entries of L decay with the distance between nodes, the faster the more the mass dominates. In single precision their
//! products soon are subnormal numbers, with which many processors compute a hundred times as slowly. Negligible entries are
//! therefore set to zero as soon as some columns are eliminated ([`Scalar::NEGLIGIBLE`]).

pub(super) mod unsymmetric;

use std::cell::RefCell;

use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::cholesky::llt::factor::{LltError, cholesky_in_place, cholesky_in_place_scratch};
use faer::linalg::matmul::triangular::{BlockStructure, matmul};
use faer::linalg::triangular_solve::solve_lower_triangular_in_place;
use faer::{Accum, MatMut, MatRef, Par};

use super::scalar::{self, Scalar};
use super::walk::Front;

/// Fronts with more operations than this are cut into tiles.
const TILED_FLOPS: f64 = 3e7;

/// Number of rows or columns of a tile.
const TILE: usize = 256;

thread_local! {
    static MEMORY: RefCell<Option<(usize, MemBuffer)>> = const { RefCell::new(None) };
}

/// Eliminates the columns of a front with one side (lower triangle on top) and subtracts L₂₁L₂₁ᵀ from the lower triangle of
/// the update.
///
/// # Errors
/// Returns the column whose pivot is not positive.
pub(super) fn eliminate<T: Scalar>(front: Front<'_, T>) -> Result<(), usize> {
    let Front { rows, columns, panel, update, is_fresh, .. } = front;
    let below = rows - columns;
    scalar::drop_below(T::NEGLIGIBLE, panel);
    let (m, n) = (below as f64, columns as f64);
    let tiled = n * n * n / 3.0 + n * n * m + n * m * m > TILED_FLOPS || (T::IS_SINGLE && columns > T::PANEL);
    let panel = MatMut::from_column_major_slice_mut(panel, rows, columns);
    let update = MatMut::from_column_major_slice_mut(update, below, below);
    let accumulate = if is_fresh { Accum::Replace } else { Accum::Add };
    if tiled {
        eliminate_tiled(panel, update, accumulate)
    } else {
        eliminate_whole(panel, update, accumulate)
    }
}

fn eliminate_whole<T: Scalar>(
    panel: MatMut<'_, T>,
    update: MatMut<'_, T>,
    accumulate: Accum,
) -> Result<(), usize> {
    let columns = panel.ncols();
    let (mut diagonal, mut below) = panel.split_at_row_mut(columns);
    cholesky(diagonal.as_mut())?;
    if below.nrows() > 0 {
        solve_lower_triangular_in_place(diagonal.as_ref(), below.as_mut().transpose_mut(), Par::Seq);
        drop_negligible(below.as_mut());
        subtract_square(update, accumulate, below.as_ref(), below.as_ref());
    }
    Ok(())
}

fn eliminate_tiled<T: Scalar>(
    mut panel: MatMut<'_, T>,
    update: MatMut<'_, T>,
    accumulate: Accum,
) -> Result<(), usize> {
    let (rows, columns) = (panel.nrows(), panel.ncols());
    for first in (0..columns).step_by(T::PANEL) {
        let width = T::PANEL.min(columns - first);
        let rest = panel.as_mut().submatrix_mut(first, first, rows - first, columns - first);
        let (left, right) = rest.split_at_col_mut(width);
        let (mut diagonal, mut below) = left.split_at_row_mut(width);
        cholesky(diagonal.as_mut()).map_err(|index| first + index)?;
        solve_tiles(diagonal.as_ref(), below.as_mut());
        let trailing = right.split_at_row_mut(width).1;
        subtract_tiles(trailing, Accum::Add, below.as_ref(), below.as_ref());
    }
    let below = panel.as_ref().split_at_row(columns).1;
    subtract_tiles(update, accumulate, below, below);
    Ok(())
}

fn cholesky<T: Scalar>(mut factor: MatMut<'_, T>) -> Result<(), usize> {
    let order = factor.nrows();
    let mut memory = MEMORY.take();
    if memory.as_ref().is_none_or(|(capacity, _)| *capacity < order) {
        let capacity = order.next_power_of_two();
        // Request enough scratch memory for numbers of either size.
        let request = cholesky_in_place_scratch::<f64>(capacity, Par::Seq, Default::default())
            .or(cholesky_in_place_scratch::<f32>(capacity, Par::Seq, Default::default()));
        memory = Some((capacity, MemBuffer::new(request)));
    }
    let result = match &mut memory {
        Some((_, buffer)) => {
            let stack = MemStack::new(buffer);
            cholesky_in_place(factor.as_mut(), Default::default(), Par::Seq, stack, Default::default())
        }
        None => return Err(0),
    };
    MEMORY.set(memory);
    drop_negligible(factor);
    result.map(|_| ()).map_err(|LltError::NonPositivePivot { index }| index)
}

/// Sets the entries of L that are negligible to zero.
fn drop_negligible<T: Scalar>(factor: MatMut<'_, T>) {
    if T::IS_SINGLE {
        for column in factor.col_iter_mut() {
            if let Some(column) = column.try_as_col_major_mut() {
                scalar::drop_below(T::NEGLIGIBLE, column.as_slice_mut());
            }
        }
    }
}

/// Computes below ← below · L⁻ᵀ, with tiles of rows in parallel.
fn solve_tiles<T: Scalar>(diagonal: MatRef<'_, T>, mut below: MatMut<'_, T>) {
    let rows = below.nrows();
    if rows <= TILE {
        if rows > 0 {
            solve_lower_triangular_in_place(diagonal, below.as_mut().transpose_mut(), Par::Seq);
            drop_negligible(below);
        }
        return;
    }
    let (top, bottom) = below.split_at_row_mut(half(rows));
    rayon::join(|| solve_tiles(diagonal, top), || solve_tiles(diagonal, bottom));
}

/// Computes (lower trapezoid of `target`) −= left · (first rows of `right`)ᵀ, with tiles of columns in parallel.
fn subtract_tiles<T: Scalar>(
    target: MatMut<'_, T>,
    accumulate: Accum,
    left: MatRef<'_, T>,
    right: MatRef<'_, T>,
) {
    let columns = target.ncols();
    if columns <= TILE {
        let (square, rest) = target.split_at_row_mut(columns);
        let (top, bottom) = left.split_at_row(columns);
        let right = right.split_at_row(columns).0;
        rayon::join(
            || subtract_square(square, accumulate, top, right),
            || subtract_rows(rest, accumulate, bottom, right),
        );
        return;
    }
    let middle = half(columns);
    let (first, second) = target.split_at_col_mut(middle);
    let second = second.split_at_row_mut(middle).1;
    let (second_left, second_right) = (left.split_at_row(middle).1, right.split_at_row(middle).1);
    rayon::join(
        || subtract_tiles(first, accumulate, left, right),
        || subtract_tiles(second, accumulate, second_left, second_right),
    );
}

/// Computes target −= left · rightᵀ, with tiles of rows in parallel.
fn subtract_rows<T: Scalar>(
    target: MatMut<'_, T>,
    accumulate: Accum,
    left: MatRef<'_, T>,
    right: MatRef<'_, T>,
) {
    let rows = target.nrows();
    if rows <= 2 * TILE {
        if rows > 0 && target.ncols() > 0 {
            let rectangular = BlockStructure::Rectangular;
            let product = right.transpose();
            matmul(
                target,
                rectangular,
                accumulate,
                left,
                rectangular,
                product,
                rectangular,
                T::of(-1.0),
                Par::Seq,
            );
        }
        return;
    }
    let middle = half(rows);
    let (top, bottom) = target.split_at_row_mut(middle);
    let (left_top, left_bottom) = left.split_at_row(middle);
    rayon::join(
        || subtract_rows(top, accumulate, left_top, right),
        || subtract_rows(bottom, accumulate, left_bottom, right),
    );
}

/// Computes (lower triangle of target) −= left · rightᵀ.
fn subtract_square<T: Scalar>(
    target: MatMut<'_, T>,
    accumulate: Accum,
    left: MatRef<'_, T>,
    right: MatRef<'_, T>,
) {
    if target.nrows() > 0 {
        let (lower, rectangular) = (BlockStructure::TriangularLower, BlockStructure::Rectangular);
        matmul(
            target,
            lower,
            accumulate,
            left,
            rectangular,
            right.transpose(),
            rectangular,
            T::of(-1.0),
            Par::Seq,
        );
    }
}

/// Returns a multiple of `TILE` near the middle.
fn half(length: usize) -> usize {
    (length / 2).next_multiple_of(TILE).min(length - 1)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns the front of a chain of nodes in which each entry of L is a hundredth of the one before.
    fn front<T: Scalar>(rows: usize, columns: usize) -> Vec<T> {
        let entry = |k: usize| match (k % rows).checked_sub(k / rows) {
            Some(0) => T::of(1.0),
            Some(1) => T::of(-0.01),
            Some(_) if k % rows >= columns => T::of(-1e-9),
            _ => T::default(),
        };
        (0..rows * columns).map(entry).collect()
    }

    /// The least normal number in single precision is 1e-38, which the entries reach after 19 nodes.
    #[test]
    fn factors_in_single_precision_have_no_subnormal_numbers() -> Result<(), usize> {
        let (rows, columns) = (150, 100);
        let below = rows - columns;
        let [mut single, mut single_update] = [front::<f32>(rows, columns), vec![0.0; below * below]];
        let [mut double, mut double_update] = [front::<f64>(rows, columns), vec![0.0; below * below]];
        eliminate(Front {
            first: 0,
            rows,
            columns,
            panel: &mut single,
            update: &mut single_update,
            is_fresh: true,
        })?;
        eliminate(Front {
            first: 0,
            rows,
            columns,
            panel: &mut double,
            update: &mut double_update,
            is_fresh: true,
        })?;
        let lower = |order: usize| (0..order).flat_map(move |j| (j..order).map(move |i| (i, j)));
        let mut zeros = 0;
        for (i, j) in lower(rows).filter(|(_, j)| *j < columns) {
            let (single, double) = (single[i + j * rows], double[i + j * rows]);
            assert!(single == 0.0 || single.is_normal(), "row {i}, column {j}: {single:e}");
            assert!((f64::from(single) - double).abs() < 2e-7, "row {i}, column {j}: {single:e}");
            zeros += usize::from(single == 0.0);
        }
        assert!(zeros > 0, "the front is too small to decay");
        for (i, j) in lower(below) {
            let (single, double) = (single_update[i + j * below], double_update[i + j * below]);
            assert!(single == 0.0 || single.is_normal(), "row {i}, column {j} of the update: {single:e}");
            assert!(
                (f64::from(single) - double).abs() < 2e-7,
                "row {i}, column {j} of the update: {single:e}"
            );
        }
        Ok(())
    }
}
