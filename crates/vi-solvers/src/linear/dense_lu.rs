//! The complete LU factor of a small matrix of 3 × 3 blocks, with partial pivoting, on one thread. Rows are scaled first, because
//! nodes and bodies have different units.

use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::lu::partial_pivoting::factor::{lu_in_place, lu_in_place_scratch};
use faer::linalg::lu::partial_pivoting::solve::{solve_in_place, solve_in_place_scratch};
use faer::{Mat, MatMut, Par};

use crate::linear::block_rows::BlockRows;

/// Solves A x = b. Returns false, and leaves x as it is, if A is singular.
pub(crate) fn solve(matrix: &BlockRows, b: &[f64], x: &mut [f64]) -> bool {
    let n = b.len();
    let mut factor = Mat::<f64>::zeros(n, n);
    matrix.for_each(|row, column, block| {
        for (i, j) in (0..3).flat_map(|i| (0..3).map(move |j| (i, j))) {
            factor[(3 * row + i, 3 * column + j)] = block[(i, j)];
        }
    });
    let largest = |i: usize| (0..n).map(|j| factor[(i, j)].abs()).fold(0.0, f64::max);
    let scales: Vec<f64> = (0..n).map(|i| 1.0 / largest(i)).collect();
    for j in 0..n {
        factor.col_mut(j).iter_mut().zip(&scales).for_each(|(value, scale)| *value *= *scale);
    }
    let (mut order, mut inverse) = (vec![0_u32; n], vec![0_u32; n]);
    let scratch = lu_in_place_scratch::<u32, f64>(n, n, Par::Seq, Default::default());
    let mut memory = MemBuffer::new(scratch.or(solve_in_place_scratch::<u32, f64>(n, 1, Par::Seq)));
    let stack = MemStack::new(&mut memory);
    let (_, order) =
        lu_in_place(factor.as_mut(), &mut order, &mut inverse, Par::Seq, stack, Default::default());
    let solve = |r: &mut [f64], stack: &mut MemStack| {
        r.iter_mut().zip(&scales).for_each(|(value, scale)| *value *= scale);
        let (factor, rhs) = (factor.as_ref(), MatMut::from_column_major_slice_mut(r, n, 1));
        solve_in_place(factor, factor, order, rhs, Par::Seq, stack);
    };
    let mut solution = b.to_vec();
    solve(&mut solution, stack);
    // One refinement makes the residual of every row small relative to its own entries.
    let mut residual = vec![0.0; n];
    matrix.apply(&solution, &mut residual);
    residual.iter_mut().zip(b).for_each(|(r, b)| *r = b - *r);
    solve(&mut residual, stack);
    solution.iter_mut().zip(&residual).for_each(|(x, change)| *x += change);
    let is_finite = solution.iter().all(|value| value.is_finite());
    if is_finite {
        x.copy_from_slice(&solution);
    }
    is_finite
}
