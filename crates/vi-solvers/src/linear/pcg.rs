//! Preconditioned conjugate gradients for A = M + cK on nodal blocks (Hestenes, Stiefel 1952).
//!
//! Scalar products are sums of fixed pieces in a fixed order, so the bits are the same on any number of threads, and of
//! processes that share the rows (`share.rs`).

pub(crate) mod block;
mod coarse;
pub(crate) mod share;
mod single;

use std::ops::Range;
use std::sync::Arc;

use rayon::prelude::*;
use vi_core::SolverFacts;

use crate::error::{NotPositiveDefinite, SolverError};
use crate::index::NONE;
use crate::interrupt::Interrupt;
use crate::linear::factor::{Factor, FactorFacts};
use crate::linear::matrix::{Pattern, SymmetricMatrix};
use block::{BlockPreconditioner, Preconditioner};
use coarse::Coarse;
use share::Share;
use single::SingleRows;

/// Number of entries of a vector per task of an update.
const PIECE: usize = 8192;

/// Shorter vectors are handled on the calling thread.
const PARALLEL_LENGTH: usize = 4 * PIECE;

/// Solves to this relative tolerance and looser ones may use A in single precision.
const LOOSE: f64 = 1e-2;

/// Largest ratio of a diagonal entry of A to its mass with which loose solves use single precision. The rounding perturbs an
/// entry by 6e-8 of itself, so A on smooth vectors by about 1e-7 times this ratio.
const LARGEST_SINGLE: f64 = 1e4;

/// Smallest ratio of a diagonal entry of A to its mass with which a coarse space costs less than it saves. P1 by
/// implicit midpoint, iterations without and with it: n16, ratio about 16, 301 and 349; ratio 98, 351 and 232; n32,
/// ratio 16, 161 and 159; ratio 64, 156 and 112.
const SMALLEST_COARSE: f64 = 40.0;

/// Time per byte of a product with A in double precision, in the order of the assembly, relative to one that reads in order:
/// P1 n16, one thread, 38 MB in 4.7 ms and 10.5 MB in 1.0 ms.
const SCATTERED: f64 = 1.7;

/// Conjugate gradients for A = M + cK.
pub struct Pcg {
    /// The matrix A.
    matrix: SymmetricMatrix,
    single: SingleRows,
    /// Whether `single` holds A.
    is_copied: bool,
    /// Largest ratio of a diagonal entry of A to the mass at its coordinate, of all processes.
    ratio: f64,
    /// Whether a coarse space has been tried.
    has_tried_coarse: bool,
    preconditioner: BlockPreconditioner,
    /// The coarse space; `None` for small or scattered matrices.
    coarse: Option<Coarse>,
    /// The rows that this process computes.
    share: Share,
    vectors: Vectors,
    interrupt: Interrupt,
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
            coarse: None,
            single: SingleRows::default(),
            is_copied: false,
            ratio: 0.0,
            has_tried_coarse: false,
            share,
            matrix,
            vectors: Vectors {
                solution: zeros(),
                residual: zeros(),
                improved: zeros(),
                direction: zeros(),
                product: zeros(),
            },
            interrupt: Interrupt::NEVER,
        }
    }

    /// Returns the solver with a request that ends its solves.
    #[must_use]
    pub fn interruptible(self, interrupt: Interrupt) -> Self {
        Self { interrupt, ..self }
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
        let needs_coarse = self.needs_coarse();
        if needs_coarse && !self.has_tried_coarse {
            self.has_tried_coarse = true;
            self.coarse = Coarse::new(&self.matrix.pattern, &self.share);
        }
        if let Some(coarse) = self.coarse.as_mut().filter(|_| needs_coarse) {
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
        let ratio = largest_ratio(&self.matrix, mass, self.share.rows.clone());
        self.ratio = self.share.gather(&[ratio]).into_iter().fold(0.0, f64::max);
        self.is_copied = false;
    }

    /// Returns whether A needs a coarse space.
    fn needs_coarse(&self) -> bool {
        self.ratio > SMALLEST_COARSE
    }

    /// Returns whether loose solves use single precision.
    fn may_be_single(&self) -> bool {
        self.ratio <= LARGEST_SINGLE
    }

    /// Returns the matrix A.
    pub(crate) fn matrix(&self) -> &SymmetricMatrix {
        &self.matrix
    }

    /// Returns the rows that this process computes.
    pub(crate) fn own_rows(&self) -> Range<usize> {
        self.share.rows.clone()
    }

    /// Solves A x = b from x = 0 until √(rᵀP⁻¹r) is below `tolerance` times its first value, which estimates the
    /// relative error in the energy norm.
    ///
    /// # Errors
    /// Returns an error if the iteration does not converge within `max_iterations`, or A is not positive definite. Then
    /// `x` holds the last iterate, which is a descent direction. Returns [`SolverError::Interrupted`] on request.
    pub fn solve(
        &mut self,
        rhs: &[f64],
        x: &mut [f64],
        tolerance: f64,
        max_iterations: u32,
    ) -> Result<PcgReport, SolverError> {
        let (is_single, needs_coarse) = (self.may_be_single() && tolerance >= LOOSE, self.needs_coarse());
        if is_single && !self.is_copied {
            self.single.copy(&self.matrix, self.share.rows.clone());
            self.is_copied = true;
        }
        let Self { matrix, preconditioner, vectors, coarse, share, single, interrupt, .. } = self;
        let mut coarse = coarse.as_mut().filter(|_| needs_coarse);
        let pattern = &*matrix.pattern;
        let multiply = |x: &[f64], y: &mut [f64]| match is_single {
            true => single.multiply(pattern.block, x, &mut y[share.entries(pattern.block)]),
            false => matrix.multiply_rows(share.rows.clone(), x, y),
        };
        let apply = |r: &[f64], z: &mut [f64], _: &mut [f64]| {
            preconditioner.apply((pattern, share), r, z);
            if let Some(coarse) = &mut coarse {
                coarse.add_correction(r, z, share);
            }
        };
        iterate((pattern, share, interrupt), vectors, multiply, apply, (rhs, x), tolerance, max_iterations)
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
        let Self { matrix, vectors, share, interrupt, .. } = self;
        let pattern = &*matrix.pattern;
        let multiply = |x: &[f64], y: &mut [f64]| matrix.multiply_rows(share.rows.clone(), x, y);
        let apply = |r: &[f64], z: &mut [f64], scratch: &mut [f64]| {
            let scratch = &mut scratch[..pattern.free_count];
            pattern.collect(r, scratch);
            factor.apply_inverse(scratch);
            pattern.spread(scratch, z);
        };
        iterate((pattern, share, interrupt), vectors, multiply, apply, (rhs, x), tolerance, max_iterations)
    }

    /// Returns whether this solver is for matrices with the pattern of k.
    pub(crate) fn has_pattern_of(&self, k: &SymmetricMatrix) -> bool {
        self.matrix.has_pattern_of(k)
    }

    /// Returns cost and size, of all processes together. Before the first matrix, assume that loose solves use single
    /// precision.
    pub fn facts(&self) -> SolverFacts {
        let (pattern, share) = (&self.matrix.pattern, &self.share);
        let (rows, block) = (share.row_count(), pattern.block);
        let own = &pattern.row_start[share.rows.start..=share.rows.end];
        let (entries, _) = share.sum((own[share.rows.len()] - own[0]) as usize);
        let (length, area) = ((rows * block) as f64, (block * block) as f64);
        let preconditioner = self.preconditioner.bytes(block, rows, entries);
        let (factor, motions) = match &self.coarse {
            Some(coarse) if self.needs_coarse() => (coarse.factor_facts(), coarse.bytes(block, rows)),
            _ => (FactorFacts::default(), 0),
        };
        let vectors = 5 * 8 * rows * block;
        let single = if self.may_be_single() { SingleRows::bytes(block, rows, entries) } else { 0 };
        let bytes = 8 * entries * block * block + single + preconditioner + vectors + motions;
        let (entries, preconditioner) = (entries as f64, preconditioner as f64);
        let whole = 2.0 * entries - rows as f64;
        let product =
            if self.may_be_single() { single as f64 } else { SCATTERED * whole * (8.0 * area + 8.0) };
        SolverFacts {
            iteration_bytes: product
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

/// Returns the iterations of a solve by conjugate gradients whose solution can be used. A partial solution is a descent direction:
/// Newton's method continues from it (Steihaug 1983). If the solution must be exact, it is an error.
pub(crate) fn usable(made: Result<u32, SolverError>, is_exact: bool) -> Result<u32, SolverError> {
    match made {
        Err(
            SolverError::NegativeCurvature { iterations, .. }
            | SolverError::ConjugateGradients { iterations, .. },
        ) if !is_exact => Ok(iterations),
        other => other,
    }
}

/// Returns the largest ratio of a diagonal entry of A to the mass at its coordinate, in some rows; infinity without masses.
fn largest_ratio(a: &SymmetricMatrix, mass: &[f64], rows: Range<usize>) -> f64 {
    // A process without rows has no masses either.
    if mass.is_empty() && !rows.is_empty() {
        return f64::INFINITY;
    }
    let pattern = &*a.pattern;
    let block = pattern.block;
    let mut largest = 0.0_f64;
    for row in rows {
        let diagonal = &a.values[pattern.diagonal_place(row) * block * block..][..block * block];
        for (k, &free) in pattern.free_of[row * block..(row + 1) * block].iter().enumerate() {
            if free != NONE {
                largest = largest.max(diagonal[k * block + k] / mass[free as usize]);
            }
        }
    }
    largest
}

fn iterate(
    (pattern, share, interrupt): (&Pattern, &Share, &Interrupt),
    vectors: &mut Vectors,
    multiply: impl Fn(&[f64], &mut [f64]),
    mut precondition: impl FnMut(&[f64], &mut [f64], &mut [f64]),
    (rhs, x): (&[f64], &mut [f64]),
    tolerance: f64,
    max_iterations: u32,
) -> Result<PcgReport, SolverError> {
    let Vectors { solution, residual, improved, direction, product } = vectors;
    let (block, own) = (pattern.block, share.entries(pattern.block));
    let dot = |a: &[f64], b: &[f64]| dot(a, b, block, share);
    pattern.spread(rhs, residual);
    solution.fill(0.0);
    precondition(residual, improved, product);
    direction.copy_from_slice(improved);
    let first = dot(residual, improved);
    let mut square = first;
    let mut iterations = 0;
    while square > tolerance * tolerance * first {
        interrupt.check()?;
        if iterations == max_iterations {
            pattern.collect(solution, x);
            let residual = (square / first).sqrt();
            return Err(SolverError::ConjugateGradients { iterations, residual, tolerance });
        }
        iterations += 1;
        share.exchange_rows(block, direction);
        multiply(direction, product);
        let curvature = dot(direction, product);
        if curvature.is_nan() || curvature <= 0.0 {
            // Return the iterate, which minimises the energy on a smaller space; in the first iteration return the
            // preconditioned load.
            pattern.collect(if iterations == 1 { direction } else { solution }, x);
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
    pattern.collect(solution, x);
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
