//! Sparse LU factors of a matrix whose pattern is symmetric, by the multifrontal method of the Cholesky factors: the same
//! trees of nested dissection, with two sides per front.
//!
//! Rows change their order only inside a front, so that the pattern of the factors is known beforehand. That suffices for
//! tangents of motion, whose symmetric part is dominated by the mass or nearly positive definite. Where it does not
//! suffice, the backward error of the solution shows it ([`Lu::solve`]).

use std::marker::PhantomData;
use std::sync::atomic::{AtomicU32, Ordering};

use crate::error::SolverError;
use crate::linear::factor::front::unsymmetric;
use crate::linear::factor::solve::{self, Factors};
use crate::linear::factor::tree::Tree;
use crate::linear::factor::walk::{Front, Walk};
use crate::linear::factor::{REFINE_ABOVE, RESIDUAL_LIMIT};
use crate::linear::matrix::Pattern;
use crate::linear::nodal_matrix::NodalMatrix;
use crate::vectors::norm;

/// LU factors of a [`NodalMatrix`].
pub(crate) struct Lu {
    tree: Tree,
    /// The panels of L and Uᵀ in postorder.
    panels: Vec<f64>,
    /// The two stacks of updates.
    stacks: [Vec<f64>; 2],
    /// Which row of its front stands at each position of the elimination order.
    order: Vec<u32>,
    /// Size of the largest entry of the matrix.
    largest: f64,
    is_factored: bool,
}

impl Lu {
    /// Computes ordering and layout for the matrices of a pattern.
    ///
    /// # Errors
    /// Returns an error if the ordering failed, or a front exceeds the index type.
    pub(crate) fn new(pattern: &Pattern) -> Result<Self, SolverError> {
        let (panels, stacks) = (Vec::new(), [Vec::new(), Vec::new()]);
        Ok(Self {
            tree: Tree::new(pattern)?,
            panels,
            stacks,
            order: Vec::new(),
            largest: 0.0,
            is_factored: false,
        })
    }

    /// Factors a matrix, whose pattern is that of [`Lu::new`].
    ///
    /// # Errors
    /// Returns [`SolverError::Singular`] if a pivot is zero or not finite; then the object holds no factors.
    pub(crate) fn factorize(&mut self, matrix: &NodalMatrix) -> Result<(), SolverError> {
        let Self { tree, panels, stacks, order, largest, is_factored } = self;
        *is_factored = false;
        *largest = matrix.largest();
        panels.resize(2 * tree.panel_length, 0.0);
        for (stack, length) in stacks.iter_mut().zip(tree.stack) {
            stack.resize(2 * length, 0.0);
        }
        let rows_of: Vec<AtomicU32> = (0..tree.permutation.len()).map(|_| AtomicU32::new(0)).collect();
        let walk = Walk {
            tree,
            sides: matrix.sides(),
            scale: 1.0,
            block: matrix.pattern().block,
            eliminate: |front: Front<'_, f64>| {
                let own = &rows_of[front.first..][..front.columns];
                unsymmetric::eliminate(front, own)
            },
            number: PhantomData,
        };
        let outcome = walk.run(panels, stacks);
        order.clear();
        order.extend(rows_of.iter().map(|row| row.load(Ordering::Relaxed)));
        outcome.map_err(|_| SolverError::Singular { rows: order.len() })?;
        *is_factored = true;
        Ok(())
    }

    /// Replaces b by the solution of A x = b with the matrix that was factored last.
    ///
    /// # Errors
    /// Returns [`SolverError::Residual`] if the backward error ‖A x − b‖/(‖b‖ + max|a_ij| ‖x‖) after one refinement is above 1e-8 or is
    /// not finite, and
    /// [`SolverError::NotFactored`] if there are no factors.
    pub(crate) fn solve(&self, matrix: &NodalMatrix, b: &mut [f64]) -> Result<(), SolverError> {
        if !self.is_factored {
            return Err(SolverError::NotFactored);
        }
        let rhs = b.to_vec();
        let size = norm(&rhs);
        if size == 0.0 {
            return Ok(());
        }
        self.apply_inverse(b);
        let residual = |x: &[f64]| {
            let mut residual = vec![0.0; x.len()];
            matrix.multiply(x, &mut residual);
            residual.iter_mut().zip(&rhs).for_each(|(value, b)| *value = b - *value);
            residual
        };
        let mut rest = residual(b);
        // The comparison is false for values that are not numbers, which the last one finds.
        if norm(&rest) > REFINE_ABOVE * size {
            self.apply_inverse(&mut rest);
            b.iter_mut().zip(&rest).for_each(|(x, change)| *x += change);
            rest = residual(b);
        }
        let backward = norm(&rest) / (size + self.largest * norm(b));
        match backward <= RESIDUAL_LIMIT {
            true => Ok(()),
            false => Err(SolverError::Residual { residual: backward, limit: RESIDUAL_LIMIT }),
        }
    }

    /// Computes x ← (LU)⁻¹P x without a check.
    fn apply_inverse(&self, x: &mut [f64]) {
        let Self { tree, panels, order, .. } = self;
        let mut permuted: Vec<f64> = tree.permutation.iter().map(|&free| x[free as usize]).collect();
        let mut shared = vec![0.0; tree.vector_length];
        solve::solve(Factors { tree, panels, sides: 2, order }, &mut permuted, &mut shared);
        for (value, &free) in permuted.iter().zip(&tree.permutation) {
            x[free as usize] = *value;
        }
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use crate::index::NONE;
    use crate::linear::matrix::SymmetricMatrix;
    use crate::linear::nodal_matrix::Covector;

    /// Returns the matrix of a grid of `side` × `side` nodes with three coordinates each, of which the first one of the first
    /// node is not free, with `diagonal` on its diagonal and an outer product over distant nodes; and the dense matrix.
    fn grid(side: u32, diagonal: f64) -> (NodalMatrix, Vec<Vec<f64>>) {
        let node_count = side * side;
        let mut entries = Vec::new();
        for node in 0..node_count {
            if node >= side {
                entries.push((node, node - side));
            }
            if node % side > 0 {
                entries.push((node, node - 1));
            }
            entries.push((node, node));
        }
        let free_of: Vec<u32> = std::iter::once(NONE).chain(0..3 * node_count - 1).collect();
        let places = (0..entries.len() as u32).collect();
        let pattern = Arc::new(Pattern::new(3, &entries, places, free_of));
        let mut symmetric = SymmetricMatrix::zeros(pattern);
        for (k, value) in symmetric.values.iter_mut().enumerate() {
            *value = (k as f64).sin();
        }
        // The upper part of the blocks on the diagonal is that of the lower part.
        for row in 0..node_count as usize {
            let place = 9 * symmetric.pattern.diagonal_place(row);
            for (i, j) in [(0, 1), (0, 2), (1, 2)] {
                symmetric.values[place + 3 * i + j] = symmetric.values[place + 3 * j + i];
            }
        }
        let size = 3 * node_count - 1;
        let a: Vec<(u32, f64)> =
            [0, 1, size / 2, size - 2, size - 1].map(|k| (k, f64::from(k).cos())).to_vec();
        let b: Vec<(u32, f64)> = [0, 1, size / 3, size - 4].map(|k| (k, f64::from(k + 1).cos())).to_vec();
        let couplings = |each: &mut dyn FnMut(&Covector, &Covector)| each(&a, &b);
        let (mut matrix, is_new) = NodalMatrix::covering(None, &[&symmetric], couplings, false).unwrap();
        assert!(is_new);
        matrix.add_symmetric(0.5, 0, &symmetric);
        matrix.add_diagonal(&vec![diagonal; size as usize]);
        matrix.add_outer(2.0, &a, &b);
        let mut dense = vec![vec![0.0; size as usize]; size as usize];
        for (i, j, value) in symmetric.lower_triangle() {
            dense[i][j] = 0.5 * value;
            dense[j][i] = 0.5 * value;
        }
        (0..size as usize).for_each(|k| dense[k][k] += diagonal);
        for &(i, a) in &a {
            b.iter().for_each(|&(j, b)| dense[i as usize][j as usize] += 2.0 * a * b);
        }
        (matrix, dense)
    }

    #[test]
    fn products_and_solutions_are_those_of_the_dense_matrix() {
        for side in [2, 7, 30] {
            let (matrix, dense) = grid(side, 3.0);
            let x: Vec<f64> = (0..dense.len()).map(|k| (k as f64).cos()).collect();
            let product = |row: &Vec<f64>| row.iter().zip(&x).map(|(a, x)| a * x).sum::<f64>();
            let mut b: Vec<f64> = dense.iter().map(product).collect();
            let mut y = vec![0.0; b.len()];
            matrix.multiply(&x, &mut y);
            let error =
                |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
            assert!(error(&y, &b) < 1e-13, "{side}: {:e}", error(&y, &b));
            let mut factors = Lu::new(matrix.pattern()).unwrap();
            factors.factorize(&matrix).unwrap();
            factors.solve(&matrix, &mut b).unwrap();
            assert!(error(&x, &b) < 1e-11, "{side}: {:e}", error(&x, &b));
        }
    }

    /// The diagonal is all that keeps pivots from zero: without it, and with one that nearly cancels the blocks, rows must be exchanged
    /// between fronts.
    #[test]
    fn inaccurate_solutions_are_errors() {
        for diagonal in [0.0, 1e-14, -0.4, 0.1, -0.1] {
            let (matrix, dense) = grid(30, diagonal);
            let mut factors = Lu::new(matrix.pattern()).unwrap();
            let b: Vec<f64> = (0..dense.len()).map(|k| (k as f64).sin()).collect();
            let mut x = b.clone();
            let outcome = factors.factorize(&matrix).and_then(|()| factors.solve(&matrix, &mut x));
            if outcome.is_ok() {
                let mut rest = vec![0.0; b.len()];
                matrix.multiply(&x, &mut rest);
                rest.iter_mut().zip(&b).for_each(|(value, b)| *value -= b);
                let backward = norm(&rest) / (norm(&b) + matrix.largest() * norm(&x));
                assert!(backward < 1e-8, "{diagonal}: {backward:e}");
            }
        }
    }

    #[test]
    fn a_singular_matrix_is_an_error() {
        let none = SymmetricMatrix::zeros(Arc::new(Pattern::new(3, &[(0, 0)], vec![0], vec![0, 1, 2])));
        let (zero, _) = NodalMatrix::covering(None, &[&none], |_| (), false).unwrap();
        let mut factors = Lu::new(zero.pattern()).unwrap();
        assert!(matches!(factors.factorize(&zero), Err(SolverError::Singular { rows: 3 })));
        assert!(matches!(factors.solve(&zero, &mut [1.0; 3]), Err(SolverError::NotFactored)));
    }
}
