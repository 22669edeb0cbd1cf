//! Block preconditioners P = (I + L) D (I + L)ᵀ with a block diagonal D and a strictly lower L; the blocks are nodal.
//!
//! Block Jacobi has L = 0. Symmetric Gauss–Seidel (SSOR with ω = 1) takes D and LD from A. Incomplete Cholesky
//! corrects both so that P = A on the pattern of A (Meijerink, van der Vorst 1977, in blocks). The rows are cut into
//! domains (`share.rs`). Entries between domains are omitted from L, so that domains run in parallel.
//!
//! L has no unit and is stored in single precision: P is positive definite whatever L is, and the rounding changes the number
//! of iterations by less than one. D⁻¹ is stored in double precision.

mod triangular;

use std::ops::Range;

use crate::index::NONE;
use crate::linear::matrix::{Pattern, SymmetricMatrix};
use crate::linear::pcg::share::Share;

/// A pivot below this fraction of the diagonal of A counts as a breakdown.
const SMALLEST_PIVOT: f64 = 1e-3;

/// The approximation of A⁻¹.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Preconditioner {
    /// The inverse of the diagonal blocks.
    BlockJacobi,
    /// An incomplete Cholesky factor on the pattern of A; replaced by `Ssor` if a pivot fails.
    BlockIncompleteCholesky,
    /// Symmetric block Gauss–Seidel.
    Ssor,
}

pub(super) struct BlockPreconditioner {
    kind: Preconditioner,
    /// D⁻¹, one block per row.
    inverse: Vec<f64>,
    /// L, one block per entry of the pattern in row order, then numbers for loads of whole lanes; the diagonal's block is not
    /// used.
    lower: Vec<f32>,
    /// First entry of each row whose column lies in the domain of the row; zero for rows of other processes.
    first_inside: Vec<u32>,
    /// Scratch memory of a solve.
    padded: Vec<f64>,
}

/// Returns the number of lanes of a row of a block: a power of two, for vector instructions.
const fn lanes(block: usize) -> usize {
    block.next_power_of_two()
}

/// A row whose pivot is not positive.
struct Breakdown {
    row: usize,
}

type Block<const B: usize> = [[f64; B]; B];

impl BlockPreconditioner {
    pub(super) fn new(pattern: &Pattern, kind: Preconditioner, share: &Share) -> Self {
        let rows = pattern.row_count();
        let has_lower = kind != Preconditioner::BlockJacobi;
        let (area, lanes) = (pattern.block * pattern.block, lanes(pattern.block));
        let mut first_inside = vec![0; rows];
        for domain in &share.domains {
            for row in domain.clone() {
                let entries = pattern.row(row);
                let columns = &pattern.columns[entries.clone()];
                let before = columns.partition_point(|&column| (column as usize) < domain.start);
                first_inside[row] = (entries.start + before) as u32;
            }
        }
        Self {
            kind,
            first_inside,
            inverse: vec![0.0; rows * area],
            lower: vec![
                0.0;
                if has_lower { pattern.columns.len() * area + lanes - pattern.block } else { 0 }
            ],
            padded: vec![0.0; if has_lower { 2 * share.rows.len() * lanes } else { 0 }],
        }
    }

    /// Returns the number of bytes for a matrix of `rows` rows and `entries` entries in the lower triangle.
    pub(super) fn bytes(&self, block: usize, rows: usize, entries: usize) -> usize {
        let has_lower = usize::from(self.kind != Preconditioner::BlockJacobi);
        let lanes = lanes(block);
        8 * rows * (block * block + 2 * lanes * has_lower) + 4 * (entries * block * block * has_lower + rows)
    }

    /// Builds P for the rows of A that this process shares. Returns the kind that all built, or the first free coordinate
    /// whose diagonal block is not positive definite.
    pub(super) fn prepare(&mut self, a: &SymmetricMatrix, share: &Share) -> Result<Preconditioner, usize> {
        match a.pattern.block {
            3 => self.prepare_blocks::<3>(a, share),
            2 => self.prepare_blocks::<2>(a, share),
            _ => self.prepare_blocks::<1>(a, share),
        }
    }

    fn prepare_blocks<const B: usize>(
        &mut self,
        a: &SymmetricMatrix,
        share: &Share,
    ) -> Result<Preconditioner, usize> {
        let kinds = match self.kind {
            Preconditioner::BlockIncompleteCholesky => {
                [Preconditioner::BlockIncompleteCholesky, Preconditioner::Ssor].as_slice()
            }
            Preconditioner::BlockJacobi => &[Preconditioner::BlockJacobi],
            Preconditioner::Ssor => &[Preconditioner::Ssor],
        };
        let mut broken = None;
        let first_row = share.rows.start;
        let first_entry = a.pattern.row_start[first_row] as usize;
        for &kind in kinds {
            let (inverse, _) = self.inverse.as_chunks_mut::<B>();
            let (lower, _) = self.lower.as_chunks_mut::<B>();
            let lower = if lower.is_empty() { lower } else { &mut lower[first_entry * B..] };
            let domains = (&share.domains[..], &self.first_inside[..]);
            let made = make_domains(a, kind, domains, &mut inverse[first_row * B..], lower);
            if !share.any(made.is_err()) {
                return Ok(kind);
            }
            broken = made.err();
        }
        Err(share.first_free(broken.and_then(|Breakdown { row }| Share::free_in_row(&a.pattern, row))))
    }

    /// Computes z = P⁻¹ r at the rows that this process shares.
    pub(super) fn apply(&mut self, (pattern, share): (&Pattern, &Share), r: &[f64], z: &mut [f64]) {
        let z = &mut z[share.entries(pattern.block)];
        match pattern.block {
            3 => self.apply_blocks::<3, 4>((pattern, share), r, z),
            2 => self.apply_blocks::<2, 2>((pattern, share), r, z),
            _ => self.apply_blocks::<1, 1>((pattern, share), r, z),
        }
    }

    fn apply_blocks<const B: usize, const W: usize>(
        &mut self,
        (pattern, share): (&Pattern, &Share),
        r: &[f64],
        z: &mut [f64],
    ) {
        let solve = triangular::Solve::<B, W> {
            pattern,
            inverse: self.inverse.as_chunks::<B>().0,
            lower: &self.lower,
            first_inside: &self.first_inside,
            r: r.as_chunks::<B>().0,
        };
        let (padded, _) = self.padded.as_chunks_mut::<W>();
        let (y, sums) = padded.split_at_mut(padded.len() / 2);
        solve.domains(&share.domains, z.as_chunks_mut::<B>().0, [y, sums]);
    }
}

fn block<const B: usize>(values: &[[f64; B]], place: usize) -> Block<B> {
    std::array::from_fn(|i| values[place * B + i])
}

fn multiply<const B: usize>(a: &Block<B>, b: &Block<B>) -> Block<B> {
    std::array::from_fn(|i| std::array::from_fn(|j| (0..B).map(|k| a[i][k] * b[k][j]).sum()))
}

fn subtract_product_transposed<const B: usize>(c: &mut Block<B>, a: &Block<B>, b: &Block<B>) {
    for i in 0..B {
        for j in 0..B {
            c[i][j] -= (0..B).map(|k| a[i][k] * b[j][k]).sum::<f64>();
        }
    }
}

/// Returns the inverse of a symmetric block by LDLᵀ; `None` if a pivot is below `smallest`[i].
fn invert<const B: usize>(a: &Block<B>, smallest: [f64; B]) -> Option<Block<B>> {
    let mut l = [[0.0; B]; B];
    let mut d = [0.0; B];
    for j in 0..B {
        d[j] = a[j][j] - (0..j).map(|k| l[j][k] * l[j][k] * d[k]).sum::<f64>();
        if d[j].is_nan() || d[j] <= smallest[j] {
            return None;
        }
        l[j][j] = 1.0;
        for i in j + 1..B {
            l[i][j] = (a[i][j] - (0..j).map(|k| l[i][k] * l[j][k] * d[k]).sum::<f64>()) / d[j];
        }
    }
    let mut inverse = [[0.0; B]; B];
    for column in 0..B {
        let mut x = [0.0; B];
        for i in 0..B {
            let unit = if i == column { 1.0 } else { 0.0 };
            x[i] = unit - (0..i).map(|k| l[i][k] * x[k]).sum::<f64>();
        }
        for i in (0..B).rev() {
            x[i] = x[i] / d[i] - (i + 1..B).map(|k| l[k][i] * x[k]).sum::<f64>();
        }
        for i in 0..B {
            inverse[i][column] = x[i];
        }
    }
    Some(inverse)
}

/// Computes D⁻¹ and L of some domains, each on its own part of the arrays. `inside` are the domains and the first entries
/// of rows inside them.
fn make_domains<const B: usize>(
    a: &SymmetricMatrix,
    kind: Preconditioner,
    (domains, first_inside): (&[Range<usize>], &[u32]),
    inverse: &mut [[f64; B]],
    lower: &mut [[f32; B]],
) -> Result<(), Breakdown> {
    match domains {
        [] => Ok(()),
        [rows] => make_domain(a, kind, (rows.clone(), first_inside), inverse, lower),
        _ => {
            let (left, right) = domains.split_at(domains.len() / 2);
            let rows = right[0].start - left[0].start;
            let entries = a.pattern.row(right[0].start).start - a.pattern.row(left[0].start).start;
            let (left_inverse, right_inverse) = inverse.split_at_mut(rows * B);
            let (left_lower, right_lower) =
                lower.split_at_mut(if kind == Preconditioner::BlockJacobi { 0 } else { entries * B });
            let (on_left, on_right) = rayon::join(
                || make_domains(a, kind, (left, first_inside), left_inverse, left_lower),
                || make_domains(a, kind, (right, first_inside), right_inverse, right_lower),
            );
            on_left.and(on_right)
        }
    }
}

fn make_domain<const B: usize>(
    a: &SymmetricMatrix,
    kind: Preconditioner,
    (rows, first_inside): (Range<usize>, &[u32]),
    inverse: &mut [[f64; B]],
    lower: &mut [[f32; B]],
) -> Result<(), Breakdown> {
    let pattern = &*a.pattern;
    let (values, _) = a.values.as_chunks::<B>();
    let first_entry = pattern.row(rows.start).start;
    let below = |row: usize| first_inside[row] as usize..pattern.row(row).end - 1;
    // LD in double precision, for the sums of the rows that follow.
    let entry_count = pattern.row(rows.end - 1).end - first_entry;
    let mut products = vec![[[0.0; B]; B]; if lower.is_empty() { 0 } else { entry_count }];
    for row in rows.clone() {
        let mut diagonal = block(values, pattern.diagonal_place(row));
        for k in 0..B {
            if pattern.free_of[row * B + k] == NONE {
                diagonal[k][k] = 1.0;
            }
        }
        let smallest = std::array::from_fn(|k| SMALLEST_PIVOT * diagonal[k][k].max(0.0));
        if kind != Preconditioner::BlockJacobi {
            for entry in below(row) {
                let column = pattern.columns[entry] as usize;
                let mut value = block(values, pattern.places[entry] as usize);
                if kind == Preconditioner::BlockIncompleteCholesky {
                    // Find the common columns of both rows; both are ascending.
                    let (mut left, mut right) = (below(row).start, below(column));
                    while left < entry && right.start < right.end {
                        let (l, r) = (pattern.columns[left], pattern.columns[right.start]);
                        if l == r {
                            let scaled = multiply(
                                &products[left - first_entry],
                                &block(inverse, l as usize - rows.start),
                            );
                            let other = &products[right.start - first_entry];
                            subtract_product_transposed(&mut value, &scaled, other);
                        }
                        left += usize::from(l <= r);
                        right.start += usize::from(r <= l);
                    }
                }
                let scaled = multiply(&value, &block(inverse, column - rows.start));
                if kind == Preconditioner::BlockIncompleteCholesky {
                    subtract_product_transposed(&mut diagonal, &scaled, &value);
                }
                products[entry - first_entry] = value;
                for (i, scaled) in scaled.iter().enumerate() {
                    for (out, value) in lower[(entry - first_entry) * B + i].iter_mut().zip(scaled) {
                        *out = *value as f32;
                    }
                }
            }
        }
        let inverted = invert(&diagonal, smallest).ok_or(Breakdown { row })?;
        let place = (row - rows.start) * B;
        inverse[place..place + B].copy_from_slice(&inverted);
    }
    Ok(())
}
