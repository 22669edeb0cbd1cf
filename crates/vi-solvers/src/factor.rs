//! Sparse Cholesky factor of A = M + cK by faer's supernodal kernel on a nodal order.
//! Only the rooms `factor*` know faer.

use std::sync::Arc;

use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::cholesky::llt::factor::LltError;
use faer::perm::PermRef;
use faer::sparse::linalg::SupernodalThreshold;
use faer::sparse::linalg::cholesky::{
    CholeskySymbolicParams, LltRef, SymbolicCholesky, SymmetricOrdering, factorize_symbolic_cholesky,
};
use faer::sparse::{SparseColMatRef, SymbolicSparseColMatRef};
use faer::{Conj, MatMut, Par, Side};

use crate::matrix::{NONE, SymmetricMatrix};
use crate::ordering::Ordering;
use crate::{NotPositiveDefinite, SolverError};

/// A relative residual above this is an error: round-off of a sound factor stays far below.
const RESIDUAL_LIMIT: f64 = 1e-8;

/// A residual above this is refined once.
const REFINE_ABOVE: f64 = 1e-12;

/// Size and cost of a factor.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct FactorFacts {
    /// Entries of the factor.
    pub nnz: u64,
    /// Floating-point operations of a factorisation.
    pub flops: f64,
    /// Bytes read by one solve.
    pub solve_bytes: f64,
    /// Bytes held.
    pub bytes: u64,
    /// Dense column blocks.
    pub supernodes: usize,
}

/// Sparse Cholesky factor L Lᵀ = A = M + cK.
pub struct Factor {
    symbolic: SymbolicCholesky<usize>,
    /// The lower triangle of A by columns of free coordinates, and where its values are in `matrix`.
    column_start: Vec<usize>,
    row_index: Vec<usize>,
    sources: Vec<u32>,
    column_values: Vec<f64>,
    factor_values: Vec<f64>,
    memory: MemBuffer,
    /// A as it was factored, for residuals.
    matrix: SymmetricMatrix,
    rhs: Vec<f64>,
    residual: Vec<f64>,
    is_factored: bool,
}

impl Factor {
    /// Ordering and symbolic factorisation, once a pattern.
    ///
    /// # Errors
    /// Where the ordering fails or the factor does not fit in memory.
    pub fn new(pattern: &SymmetricMatrix) -> Result<Self, SolverError> {
        let matrix = SymmetricMatrix::zeros(Arc::clone(&pattern.pattern));
        let pattern = &*matrix.pattern;
        let (block, n) = (pattern.block, pattern.free_count);
        let ordering = Ordering::new(&pattern.graph())?;
        let free = |row: u32, k: usize| pattern.free_of[row as usize * block + k];
        let forward: Vec<usize> = ordering
            .order
            .iter()
            .flat_map(|&row| (0..block).map(move |k| free(row, k)))
            .filter(|&k| k != NONE)
            .map(|k| k as usize)
            .collect();
        let mut backward = vec![0; n];
        for (k, &dof) in forward.iter().enumerate() {
            backward[dof] = k;
        }
        let mut entries: Vec<(usize, usize, u32)> = Vec::new();
        for row in 0..pattern.row_count() as u32 {
            for entry in pattern.row(row as usize) {
                let (column, place) = (pattern.columns[entry], pattern.places[entry] as usize);
                for (i, j) in (0..block).flat_map(|i| (0..block).map(move |j| (i, j))) {
                    let (a, b) = (free(row, i), free(column, j));
                    if a != NONE && b != NONE && a >= b {
                        let source = (place * block + i) * block + j;
                        entries.push((b as usize, a as usize, source as u32));
                    }
                }
            }
        }
        entries.sort_unstable();
        let mut column_start = vec![0; n + 1];
        for entry in &entries {
            column_start[entry.0 + 1] += 1;
        }
        for k in 0..n {
            column_start[k + 1] += column_start[k];
        }
        let row_index: Vec<usize> = entries.iter().map(|entry| entry.1).collect();
        let sources: Vec<u32> = entries.iter().map(|entry| entry.2).collect();
        let too_large = |_| SolverError::Symbolic { dofs: n, reason: "out of memory" };
        let symbolic = factorize_symbolic_cholesky(
            SymbolicSparseColMatRef::new_checked(n, n, &column_start, None, &row_index),
            Side::Lower,
            SymmetricOrdering::Custom(PermRef::new_checked(&forward, &backward, n)),
            CholeskySymbolicParams {
                supernodal_flop_ratio_threshold: SupernodalThreshold::AUTO,
                ..Default::default()
            },
        )
        .map_err(too_large)?;
        let numeric = symbolic.factorize_numeric_llt_scratch::<f64>(Par::Seq, Default::default());
        let solve = symbolic.solve_in_place_scratch::<f64>(1, Par::Seq);
        let memory = MemBuffer::try_new(numeric.or(solve))
            .map_err(|_| SolverError::Symbolic { dofs: n, reason: "out of memory" })?;
        Ok(Self {
            column_values: vec![0.0; row_index.len()],
            factor_values: vec![0.0; symbolic.len_val()],
            memory,
            symbolic,
            column_start,
            row_index,
            sources,
            rhs: vec![0.0; n],
            residual: vec![0.0; n],
            matrix,
            is_factored: false,
        })
    }

    /// Factors A = M + cK with M = diag(mass) on the free coordinates; an empty mass is zero.
    ///
    /// # Errors
    /// Where a pivot is not positive; the factor then holds nothing.
    pub fn factorize(
        &mut self,
        mass: &[f64],
        c: f64,
        k: &SymmetricMatrix,
    ) -> Result<(), NotPositiveDefinite> {
        self.matrix.set_shifted(mass, c, k);
        for (value, &source) in self.column_values.iter_mut().zip(&self.sources) {
            *value = self.matrix.values[source as usize];
        }
        let n = self.rhs.len();
        let symbolic = SymbolicSparseColMatRef::new_checked(n, n, &self.column_start, None, &self.row_index);
        let result = self.symbolic.factorize_numeric_llt(
            &mut self.factor_values,
            SparseColMatRef::new(symbolic, &self.column_values),
            Side::Lower,
            Default::default(),
            Par::Seq,
            MemStack::new(&mut self.memory),
            Default::default(),
        );
        self.is_factored = result.is_ok();
        match result {
            Ok(_) => Ok(()),
            Err(LltError::NonPositivePivot { index }) => {
                let free = self.symbolic.perm().map_or(index, |perm| perm.arrays().0[index.min(n - 1)]);
                Err(NotPositiveDefinite { free, pivot: f64::NAN })
            }
        }
    }

    /// Solves A x = b in place and returns ‖Ax − b‖/‖b‖.
    ///
    /// # Errors
    /// Where the residual is above 1e-8 after refinement.
    pub fn solve(&mut self, rhs_to_solution: &mut [f64]) -> Result<f64, SolverError> {
        if !self.is_factored {
            return Err(SolverError::NotFactored);
        }
        self.rhs.copy_from_slice(rhs_to_solution);
        let norm = norm(&self.rhs);
        if norm == 0.0 {
            return Ok(0.0);
        }
        self.apply(rhs_to_solution);
        let mut residual = self.update_residual(rhs_to_solution) / norm;
        if residual > REFINE_ABOVE {
            let mut correction = std::mem::take(&mut self.residual);
            self.apply(&mut correction);
            for (x, d) in rhs_to_solution.iter_mut().zip(&correction) {
                *x += d;
            }
            self.residual = correction;
            residual = self.update_residual(rhs_to_solution) / norm;
        }
        if residual <= RESIDUAL_LIMIT {
            Ok(residual)
        } else {
            Err(SolverError::Residual { residual, limit: RESIDUAL_LIMIT })
        }
    }

    /// Size and cost.
    pub fn facts(&self) -> FactorFacts {
        let nnz = self.factor_values.len() as u64;
        FactorFacts {
            nnz,
            flops: (nnz as f64).powi(2) / self.rhs.len().max(1) as f64,
            solve_bytes: 16.0 * nnz as f64,
            bytes: 8 * nnz + self.matrix.bytes() as u64,
            supernodes: 0,
        }
    }

    fn apply(&mut self, x: &mut [f64]) {
        let rows = x.len();
        LltRef::new(&self.symbolic, &self.factor_values).solve_in_place_with_conj(
            Conj::No,
            MatMut::from_column_major_slice_mut(x, rows, 1),
            Par::Seq,
            MemStack::new(&mut self.memory),
        );
    }

    /// residual = b − Ax; returns its norm.
    fn update_residual(&mut self, x: &[f64]) -> f64 {
        self.matrix.multiply(x, &mut self.residual);
        for (r, b) in self.residual.iter_mut().zip(&self.rhs) {
            *r = b - *r;
        }
        norm(&self.residual)
    }
}

fn norm(x: &[f64]) -> f64 {
    x.iter().map(|x| x * x).sum::<f64>().sqrt()
}
