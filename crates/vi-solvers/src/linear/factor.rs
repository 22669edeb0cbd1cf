//! Sparse Cholesky factor of A = M + cK by a nodal multifrontal method.
//!
//! The tree of fronts is built once per pattern (`tree`). A factorisation visits it from the leaves: it sums the
//! entries of A and the updates of the children into each dense front, eliminates the columns of the front (`front`),
//! and passes its update on. Independent subtrees run in parallel. Sums have a fixed order, so the bits are the same
//! on any number of threads. All memory is laid out beforehand: the panels of L in postorder, and updates on two
//! stacks that alternate with the depth of the tree. Every solve is checked against the A that was factored.

mod front;
pub(crate) mod lu;
mod panel;
mod scalar;
mod solve;
mod tree;
mod walk;

use std::marker::PhantomData;
use std::sync::Arc;

use vi_core::binary_exponent;

use crate::error::{NotPositiveDefinite, SolverError};
use crate::linear::matrix::SymmetricMatrix;
use crate::vectors::per_unit;
use scalar::Scalar;
use solve::Factors;
use tree::Tree;
use walk::Walk;

/// Largest allowed backward error. The round-off of a valid factor stays far below it, however badly conditioned A
/// is.
const RESIDUAL_LIMIT: f64 = 1e-8;

/// A solve with a larger relative residual is refined once.
const REFINE_ABOVE: f64 = 1e-12;

/// Size and cost of a factor.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct FactorFacts {
    /// Number of entries of the factor, including stored zeros.
    pub nnz: u64,
    /// Floating-point operations of a factorisation (a multiplication with an addition counts as two).
    pub flops: f64,
    /// Bytes that one solve reads, including its residual.
    pub solve_bytes: f64,
    /// Bytes of memory held.
    pub bytes: u64,
    /// Number of dense column blocks.
    pub supernodes: usize,
}

/// A sparse Cholesky factor of A = M + cK in double precision.
pub type Factor = Cholesky<f64>;

/// A sparse Cholesky factor of A = M + cK in single precision: half the bytes and up to half the time. The errors of
/// its solutions are about 1e-7 times the condition number of A, and something else must correct them.
pub type SingleFactor = Cholesky<f32>;

/// A sparse Cholesky factor L Lᵀ = s S A S of A = M + cK in numbers of type `T`. In single precision s makes the largest
/// entry of s A one, and the diagonal matrix S holds powers of two that make all diagonal entries of s S A S one to four.
/// In double precision S is the unit matrix, and s is a power of two that makes the first entry of s A 1 to 2. Then solutions
/// have the same bits in units of mass that differ by a power of two, although the roots of such powers need not be
/// powers of two.
pub struct Cholesky<T> {
    tree: Tree,
    /// The panels of L in postorder.
    panels: Vec<T>,
    /// The two stacks of updates.
    stacks: [Vec<T>; 2],
    /// The matrix S A S that was factored, also for residuals.
    matrix: SymmetricMatrix,
    /// The diagonal of S; empty if S is the unit matrix.
    balance: Vec<f64>,
    rhs: Vec<f64>,
    residual: Vec<f64>,
    permuted: Vec<T>,
    shared: Vec<T>,
    /// Largest diagonal entry of A; no entry of a positive definite matrix is larger.
    largest: f64,
    /// The scale s.
    scale: f64,
    is_factored: bool,
}

impl<T: Scalar> Cholesky<T> {
    /// Computes ordering and layout, once per pattern. The first factorisation allocates the memory of the factor.
    ///
    /// # Errors
    /// Returns an error if the ordering failed, or a front exceeds the index type.
    pub fn new(pattern: &SymmetricMatrix) -> Result<Self, SolverError> {
        let matrix = SymmetricMatrix::zeros(Arc::clone(&pattern.pattern));
        Ok(Self::with_tree(Tree::new(&matrix.pattern)?, matrix))
    }

    fn with_tree(tree: Tree, matrix: SymmetricMatrix) -> Self {
        let n = matrix.free_count();
        Self {
            panels: Vec::new(),
            stacks: [Vec::new(), Vec::new()],
            shared: vec![T::default(); tree.vector_length],
            rhs: vec![0.0; n],
            residual: vec![0.0; n],
            permuted: vec![T::default(); n],
            tree,
            matrix,
            balance: Vec::new(),
            largest: 0.0,
            scale: 1.0,
            is_factored: false,
        }
    }

    /// Returns the same order and layout for numbers of type `U`, without a factor.
    pub(crate) fn into_precision<U: Scalar>(self) -> Cholesky<U> {
        Cholesky::with_tree(self.tree, self.matrix)
    }

    /// Returns whether this factor is for matrices with the pattern of k.
    pub(crate) fn has_pattern_of(&self, k: &SymmetricMatrix) -> bool {
        self.matrix.has_pattern_of(k)
    }

    /// Factors A = M + cK with M = diag(mass) on the free coordinates; an empty mass means zero.
    ///
    /// # Errors
    /// Returns an error if a pivot is not positive; then the object holds no factor.
    ///
    /// # Panics
    /// If the pattern of k differs from that for which the factor was made.
    pub fn factorize(
        &mut self,
        mass: &[f64],
        c: f64,
        k: &SymmetricMatrix,
    ) -> Result<(), NotPositiveDefinite> {
        assert!(self.matrix.has_pattern_of(k), "a factor serves one pattern");
        self.matrix.set_shifted(mass, c, k);
        self.is_factored = false;
        self.panels.resize(self.tree.panel_length, T::default());
        for (stack, length) in self.stacks.iter_mut().zip(self.tree.stack) {
            stack.resize(length, T::default());
        }
        self.matrix.diagonal(&mut self.rhs);
        self.largest = self.rhs.iter().fold(0.0, |largest: f64, &entry| largest.max(entry));
        self.scale = match T::IS_SINGLE {
            true if self.largest > 0.0 => 1.0 / self.largest,
            true => 1.0,
            false => self.rhs.first().map_or(1.0, |&first| per_unit(first)),
        };
        if T::IS_SINGLE {
            self.balance.clear();
            self.balance.extend(self.rhs.iter().map(|&entry| per_root(entry * self.scale)));
            self.matrix.scale(&self.balance);
        }
        let (tree, matrix) = (&self.tree, &self.matrix);
        let walk = Walk {
            tree,
            sides: [&matrix.values],
            scale: self.scale,
            block: matrix.pattern.block,
            eliminate: front::eliminate::<T>,
            number: PhantomData,
        };
        walk.run(&mut self.panels, &mut self.stacks).map_err(|position| {
            let free = tree.permutation[position] as usize;
            NotPositiveDefinite { free }
        })?;
        self.is_factored = true;
        Ok(())
    }

    /// Solves A x = b in place and returns ‖Ax − b‖/‖b‖. The solution is judged by its backward error ‖Ax − b‖/(‖b‖ +
    /// max|a_ij| ‖x‖). If A is badly conditioned, round-off allows no more than an exact solution for a matrix close
    /// to A (Higham, Accuracy and Stability, §7.1).
    ///
    /// # Errors
    /// Returns an error if the backward error is above 1e-8 after one step of refinement, or nothing has been factored.
    pub fn solve(&mut self, rhs_to_solution: &mut [f64]) -> Result<f64, SolverError> {
        if !self.is_factored {
            return Err(SolverError::NotFactored);
        }
        self.rhs.copy_from_slice(rhs_to_solution);
        let norm = norm(&self.rhs);
        if norm == 0.0 {
            return Ok(0.0);
        }
        self.apply_inverse(rhs_to_solution);
        let mut residual = self.update_residual(rhs_to_solution) / norm;
        if residual > REFINE_ABOVE {
            let mut correction = std::mem::take(&mut self.residual);
            self.apply_inverse(&mut correction);
            for (x, d) in rhs_to_solution.iter_mut().zip(&correction) {
                *x += d;
            }
            self.residual = correction;
            residual = self.update_residual(rhs_to_solution) / norm;
        }
        let backward = residual * norm / (norm + self.largest * self::norm(rhs_to_solution));
        if backward <= RESIDUAL_LIMIT {
            Ok(residual)
        } else {
            Err(SolverError::Residual { residual: backward, limit: RESIDUAL_LIMIT })
        }
    }

    /// Solves A x = b in place and refines until ‖Ax − b‖ ≤ `tolerance` ‖b‖ or there is no more improvement. Returns
    /// the number of solves.
    ///
    /// # Errors
    /// Returns an error if nothing has been factored.
    pub(crate) fn solve_refined(
        &mut self,
        rhs_to_solution: &mut [f64],
        tolerance: f64,
    ) -> Result<u64, SolverError> {
        self.rhs.copy_from_slice(rhs_to_solution);
        let limit = tolerance * norm(&self.rhs);
        self.solve_unchecked(rhs_to_solution)?;
        let (mut solves, mut last) = (1, f64::INFINITY);
        loop {
            let residual = self.update_residual(rhs_to_solution);
            if residual <= limit || residual >= 0.5 * last {
                return Ok(solves);
            }
            last = residual;
            let mut correction = std::mem::take(&mut self.residual);
            self.apply_inverse(&mut correction);
            for (x, d) in rhs_to_solution.iter_mut().zip(&correction) {
                *x += d;
            }
            self.residual = correction;
            solves += 1;
        }
    }

    /// Solves A x = b in place without a check, for callers whose own residual is a check.
    ///
    /// # Errors
    /// Returns an error if nothing has been factored.
    pub(crate) fn solve_unchecked(&mut self, rhs_to_solution: &mut [f64]) -> Result<(), SolverError> {
        if !self.is_factored {
            return Err(SolverError::NotFactored);
        }
        self.apply_inverse(rhs_to_solution);
        Ok(())
    }

    /// Returns whether a factor is present: something has been factored, and the last attempt succeeded.
    pub fn is_factored(&self) -> bool {
        self.is_factored
    }

    /// Returns ‖A x − b‖/‖b‖ for the x that the factor gives. If the load b excites modes of all frequencies, this is
    /// about the relative error of a solve.
    ///
    /// # Errors
    /// Returns an error if nothing has been factored.
    pub(crate) fn relative_residual(&mut self, load: &[f64]) -> Result<f64, SolverError> {
        let mut x = load.to_vec();
        self.solve_unchecked(&mut x)?;
        self.rhs.copy_from_slice(load);
        Ok(self.update_residual(&x) / norm(load))
    }

    /// Computes x ← s S (LLᵀ)⁻¹ S x without a check. It is a preconditioner if A has changed since the factorisation.
    pub(crate) fn apply_inverse(&mut self, x: &mut [f64]) {
        // In single precision scale the numbers to about 1.
        let unit = match T::IS_SINGLE {
            true => x.iter().fold(0.0, |largest: f64, value| largest.max(value.abs())),
            false => 1.0,
        };
        if unit == 0.0 {
            return;
        }
        let inverse = 1.0 / unit;
        let balance = |free: u32| self.balance.get(free as usize).copied().unwrap_or(1.0);
        for (value, &free) in self.permuted.iter_mut().zip(&self.tree.permutation) {
            *value = T::of(x[free as usize] * inverse * balance(free));
        }
        let factors = Factors { tree: &self.tree, panels: &self.panels, sides: 1, order: &[] };
        solve::solve(factors, &mut self.permuted, &mut self.shared);
        let unit = unit * self.scale;
        for (value, &free) in self.permuted.iter().zip(&self.tree.permutation) {
            x[free as usize] = value.value() * unit * balance(free);
        }
    }

    /// Returns size and cost.
    pub fn facts(&self) -> FactorFacts {
        let stacks: usize = self.tree.stack.iter().sum();
        let vectors = 4 * self.rhs.len() + self.shared.len();
        FactorFacts {
            nnz: self.tree.panel_length as u64,
            flops: self.tree.flops,
            solve_bytes: (2 * size_of::<T>() * self.tree.panel_length + self.matrix.bytes()) as f64,
            bytes: (size_of::<T>() * (self.tree.panel_length + stacks)
                + 8 * vectors
                + self.matrix.bytes()
                + self.tree.bytes()) as u64,
            supernodes: self.tree.supernodes.len(),
        }
    }

    /// Sets residual = b − Ax and returns its norm.
    fn update_residual(&mut self, x: &[f64]) -> f64 {
        if self.balance.is_empty() {
            self.matrix.multiply(x, &mut self.residual);
        } else {
            let x: Vec<f64> = x.iter().zip(&self.balance).map(|(x, factor)| x / factor).collect();
            self.matrix.multiply(&x, &mut self.residual);
            self.residual.iter_mut().zip(&self.balance).for_each(|(value, factor)| *value /= factor);
        }
        for (r, b) in self.residual.iter_mut().zip(&self.rhs) {
            *r = b - *r;
        }
        norm(&self.residual)
    }
}

/// Returns the power of two whose square times this diagonal entry is at least one and less than four.
fn per_root(entry: f64) -> f64 {
    match entry.is_normal() {
        true => 2.0_f64.powi(-binary_exponent(entry).div_euclid(2)),
        false => 1.0,
    }
}

fn norm(x: &[f64]) -> f64 {
    x.iter().map(|x| x * x).sum::<f64>().sqrt()
}
