//! Preconditioned conjugate gradients for A = M + cK on nodal blocks (Hestenes, Stiefel 1952).
//!
//! Scalar products are sums of fixed pieces in a fixed order, so the bits are the same on any number of threads, and of
//! processes that share the rows (`share.rs`).

pub(crate) mod block;
mod coarse;
pub(crate) mod share;

use std::ops::Range;
use std::sync::Arc;

use rayon::prelude::*;

use crate::error::{NotPositiveDefinite, SolverError};
use crate::linear::factor::{Factor, FactorFacts};
use crate::linear::matrix::SymmetricMatrix;
use block::{BlockPreconditioner, Preconditioner};
use coarse::Coarse;
use share::Share;

/// Number of entries of a vector per task of an update.
const PIECE: usize = 8192;

/// Shorter vectors are handled on the calling thread.
const PARALLEL_LENGTH: usize = 4 * PIECE;

/// Conjugate gradients for A = M + cK.
pub struct Pcg {
    /// The matrix A.
    matrix: SymmetricMatrix,
    preconditioner: BlockPreconditioner,
    /// The coarse space; `None` for small or scattered matrices.
    coarse: Option<Coarse>,
    /// The rows that this process computes.
    share: Share,
    vectors: Vectors,
}

/// Vectors of rows · block entries, with zeros at prescribed coordinates.
struct Vectors {
    solution: Vec<f64>,
    residual: Vec<f64>,
    /// P⁻¹ residual.
    improved: Vec<f64>,
    direction: Vec<f64>,
    /// A times the direction; also scratch memory of the preconditioner.
    product: Vec<f64>,
}

/// Iterations and residual of a solve.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PcgReport {
    /// Number of iterations.
    pub iterations: u32,
    /// √(rᵀP⁻¹r) relative to its value at x = 0.
    pub residual: f64,
}

/// Cost of an iteration and of the preparation.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct PcgFacts {
    /// Bytes that one iteration moves.
    pub iteration_bytes: f64,
    /// Floating-point operations of one iteration.
    pub iteration_flops: f64,
    /// Bytes that the preparation moves.
    pub prepare_bytes: f64,
    /// Floating-point operations of the factor of the coarse matrix.
    pub coarse_flops: f64,
    /// Bytes of memory held.
    pub bytes: u64,
}

impl Pcg {
    /// Builds maps and buffers, once per pattern.
    pub fn new(pattern: &SymmetricMatrix, preconditioner: Preconditioner) -> Self {
        Self::shared(pattern, preconditioner, Share::whole(&pattern.pattern))
    }

    /// Builds maps and buffers for the rows of a process. All processes must call all methods with the same arguments
    /// apart from vectors, of which only the own rows count.
    pub(crate) fn shared(pattern: &SymmetricMatrix, preconditioner: Preconditioner, share: Share) -> Self {
        let matrix = SymmetricMatrix::zeros(Arc::clone(&pattern.pattern));
        let length = matrix.pattern.free_of.len();
        let zeros = || vec![0.0; length];
        Self {
            preconditioner: BlockPreconditioner::new(&matrix.pattern, preconditioner, &share),
            coarse: Coarse::new(&matrix.pattern, &share),
            share,
            matrix,
            vectors: Vectors {
                solution: zeros(),
                residual: zeros(),
                improved: zeros(),
                direction: zeros(),
                product: zeros(),
            },
        }
    }

    /// Takes A = M + cK (M = diag(mass), zero if empty) and builds the preconditioner; returns the kind that was
    /// built. The coarse space consists of the rigid motions at `positions` of the free coordinates, m.
    ///
    /// # Errors
    /// Returns an error if a diagonal block is not positive definite, or A is not positive definite on the coarse space.
    ///
    /// # Panics
    /// If k has another pattern, or `positions` has another length than its free coordinates.
    pub fn prepare(
        &mut self,
        mass: &[f64],
        c: f64,
        k: &SymmetricMatrix,
        positions: &[f64],
    ) -> Result<Preconditioner, NotPositiveDefinite> {
        assert_eq!(positions.len(), k.free_count(), "one position per free coordinate");
        self.set_matrix(mass, c, k);
        if let Some(coarse) = &mut self.coarse {
            coarse.prepare(&self.matrix, positions, &self.share)?;
        }
        self.preconditioner.prepare(&self.matrix, &self.share).map_err(|free| NotPositiveDefinite { free })
    }

    /// Takes A = M + cK for [`Pcg::solve_with`], without building a preconditioner.
    ///
    /// # Panics
    /// If k has another pattern.
    pub fn set_matrix(&mut self, mass: &[f64], c: f64, k: &SymmetricMatrix) {
        assert!(self.matrix.has_pattern_of(k), "conjugate gradients serve one pattern");
        self.matrix.set_shifted(mass, c, k);
    }

    /// Solves A x = b from x = 0 until √(rᵀP⁻¹r) is below `tolerance` times its first value, which estimates the
    /// relative error in the energy norm.
    ///
    /// # Errors
    /// Returns an error if the iteration does not converge within `max_iterations`, or A is not positive definite. Then
    /// `x` holds the last iterate, which is a descent direction.
    pub fn solve(
        &mut self,
        rhs: &[f64],
        x: &mut [f64],
        tolerance: f64,
        max_iterations: u32,
    ) -> Result<PcgReport, SolverError> {
        let Self { matrix, preconditioner, vectors, coarse, share } = self;
        let pattern = &matrix.pattern;
        let apply = |r: &[f64], z: &mut [f64], _: &mut [f64]| {
            preconditioner.apply((pattern, share), r, z);
            if let Some(coarse) = coarse {
                coarse.add_correction(r, z, share);
            }
        };
        iterate((matrix, share), vectors, apply, (rhs, x), tolerance, max_iterations)
    }

    /// Solves like [`Pcg::solve`], with the factor of an earlier A as preconditioner.
    ///
    /// # Errors
    /// Returns the errors of [`Pcg::solve`], and an empty factor.
    pub fn solve_with(
        &mut self,
        factor: &mut Factor,
        rhs: &[f64],
        x: &mut [f64],
        tolerance: f64,
        max_iterations: u32,
    ) -> Result<PcgReport, SolverError> {
        if !factor.is_factored() {
            return Err(SolverError::NotFactored);
        }
        let Self { matrix, vectors, share, .. } = self;
        let pattern = &matrix.pattern;
        let apply = |r: &[f64], z: &mut [f64], scratch: &mut [f64]| {
            let scratch = &mut scratch[..pattern.free_count];
            pattern.collect(r, scratch);
            factor.apply_inverse(scratch);
            pattern.spread(scratch, z);
        };
        iterate((matrix, share), vectors, apply, (rhs, x), tolerance, max_iterations)
    }

    /// Returns whether this solver is for matrices with the pattern of k.
    pub(crate) fn serves(&self, k: &SymmetricMatrix) -> bool {
        self.matrix.has_pattern_of(k)
    }

    /// Returns cost and size, of all processes together.
    pub fn facts(&self) -> PcgFacts {
        let (pattern, share) = (&self.matrix.pattern, &self.share);
        let (rows, block) = (share.row_count(), pattern.block);
        let own = &pattern.row_start[share.rows.start..=share.rows.end];
        let (entries, _) = share.sum((own[share.rows.len()] - own[0]) as usize);
        let (length, area) = ((rows * block) as f64, (block * block) as f64);
        let preconditioner = self.preconditioner.bytes(block, rows, entries);
        let (factor, motions) = match &self.coarse {
            Some(coarse) => (coarse.factor_facts(), coarse.bytes(block, rows)),
            None => (FactorFacts::default(), 0),
        };
        let vectors = 5 * 8 * rows * block;
        let bytes = 8 * entries * block * block + preconditioner + vectors + motions;
        let (entries, preconditioner) = (entries as f64, preconditioner as f64);
        let whole = 2.0 * entries - rows as f64;
        PcgFacts {
            iteration_bytes: whole * (8.0 * area + 8.0)
                + 2.0 * preconditioner
                + 12.0 * 8.0 * length
                + 2.0 * motions as f64
                + factor.solve_bytes,
            iteration_flops: 2.0 * area * whole
                + 0.5 * (preconditioner + motions as f64 + factor.solve_bytes)
                + 10.0 * length,
            prepare_bytes: 16.0 * area * entries + 3.0 * preconditioner + 4.0 * motions as f64,
            coarse_flops: factor.flops,
            bytes: bytes as u64 + factor.bytes,
        }
    }
}

fn iterate(
    (matrix, share): (&SymmetricMatrix, &Share),
    vectors: &mut Vectors,
    mut precondition: impl FnMut(&[f64], &mut [f64], &mut [f64]),
    (rhs, x): (&[f64], &mut [f64]),
    tolerance: f64,
    max_iterations: u32,
) -> Result<PcgReport, SolverError> {
    let Vectors { solution, residual, improved, direction, product } = vectors;
    let (block, own) = (matrix.pattern.block, share.entries(matrix.pattern.block));
    let dot = |a: &[f64], b: &[f64]| dot(a, b, block, share);
    matrix.pattern.spread(rhs, residual);
    solution.fill(0.0);
    precondition(residual, improved, product);
    direction.copy_from_slice(improved);
    let first = dot(residual, improved);
    let mut square = first;
    let mut iterations = 0;
    while square > tolerance * tolerance * first {
        if iterations == max_iterations {
            matrix.pattern.collect(solution, x);
            let residual = (square / first).sqrt();
            return Err(SolverError::ConjugateGradients { iterations, residual, tolerance });
        }
        iterations += 1;
        share.exchange_rows(block, direction);
        matrix.multiply_rows(share.rows.clone(), direction, product);
        let curvature = dot(direction, product);
        if curvature.is_nan() || curvature <= 0.0 {
            // Return the iterate, which minimises the energy on a smaller space; in the first iteration return the
            // preconditioned load.
            matrix.pattern.collect(if iterations == 1 { direction } else { solution }, x);
            return Err(SolverError::NegativeCurvature { iterations, curvature });
        }
        let step = square / curvature;
        add_scaled(&mut solution[own.clone()], step, &direction[own.clone()]);
        add_scaled(&mut residual[own.clone()], -step, &product[own.clone()]);
        precondition(residual, improved, product);
        let next = dot(residual, improved);
        scale_and_add(&mut direction[own.clone()], next / square, &improved[own.clone()]);
        square = next;
    }
    // The value is NaN, or the preconditioner is not positive definite.
    if square.is_nan() || square < 0.0 {
        return Err(SolverError::NegativeCurvature { iterations, curvature: square });
    }
    matrix.pattern.collect(solution, x);
    let residual = if first > 0.0 { (square / first).sqrt() } else { 0.0 };
    Ok(PcgReport { iterations, residual })
}

/// Returns the sum over the domains of all processes, in their order.
fn dot(a: &[f64], b: &[f64], block: usize, share: &Share) -> f64 {
    let product = |rows: &Range<usize>| {
        let entries = rows.start * block..rows.end * block;
        dot_piece(&a[entries.clone()], &b[entries])
    };
    let sums: Vec<f64> = if share.rows.len() * block >= PARALLEL_LENGTH {
        share.domains.par_iter().map(product).collect()
    } else {
        share.domains.iter().map(product).collect()
    };
    share.gather(&sums).iter().sum()
}

/// Uses several partial sums, which the compiler can keep in registers.
fn dot_piece(a: &[f64], b: &[f64]) -> f64 {
    const LANES: usize = 8;
    let (a_rows, a_rest) = a.as_chunks::<LANES>();
    let (b_rows, b_rest) = b.as_chunks::<LANES>();
    let mut lanes = [0.0; LANES];
    for (a, b) in a_rows.iter().zip(b_rows) {
        for lane in 0..LANES {
            lanes[lane] += a[lane] * b[lane];
        }
    }
    lanes.iter().sum::<f64>() + a_rest.iter().zip(b_rest).map(|(a, b)| a * b).sum::<f64>()
}

fn pairs(y: &mut [f64], x: &[f64], apply: impl Fn(&mut f64, f64) + Sync) {
    let piece = |(y, x): (&mut [f64], &[f64])| y.iter_mut().zip(x).for_each(|(y, &x)| apply(y, x));
    if y.len() >= PARALLEL_LENGTH {
        y.par_chunks_mut(PIECE).zip(x.par_chunks(PIECE)).for_each(piece);
    } else {
        piece((y, x));
    }
}

/// Computes y += a x.
fn add_scaled(y: &mut [f64], a: f64, x: &[f64]) {
    pairs(y, x, |y, x| *y += a * x);
}

/// Computes y = a y + x.
fn scale_and_add(y: &mut [f64], a: f64, x: &[f64]) {
    pairs(y, x, |y, x| *y = a * *y + x);
}
