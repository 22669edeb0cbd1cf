//! Block preconditioners P = (D + L) D⁻¹ (D + L)ᵀ with a block diagonal D and a strictly lower L; the blocks are
//! nodal.
//!
//! Block Jacobi has L = 0. Symmetric Gauss–Seidel (SSOR with ω = 1) takes D and L from A. Incomplete Cholesky
//! corrects both so that P = A on the pattern of A (Meijerink, van der Vorst 1977, in blocks). The rows are cut into
//! domains, whose number depends on the size alone. Entries between domains are omitted from L, so that domains run
//! in parallel.

use std::ops::Range;

use crate::index::NONE;
use crate::linear::matrix::{Pattern, SymmetricMatrix};

/// Number of rows per domain: a smaller number gives more parallelism and more iterations.
const ROWS_PER_DOMAIN: usize = 2500;
const LARGEST_DOMAIN_COUNT: usize = 8;

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
    /// Row ranges of the domains.
    domains: Vec<Range<usize>>,
    /// D⁻¹, one block per row.
    inverse: Vec<f64>,
    /// L, one block per entry of the pattern in row order; the diagonal's block is not used.
    lower: Vec<f64>,
}

/// A row whose pivot is not positive.
struct Breakdown {
    row: usize,
}

type Block<const B: usize> = [[f64; B]; B];

impl BlockPreconditioner {
    pub(super) fn new(pattern: &Pattern, kind: Preconditioner) -> Self {
        let rows = pattern.row_count();
        let count = (rows / ROWS_PER_DOMAIN).clamp(1, LARGEST_DOMAIN_COUNT);
        let area = pattern.block * pattern.block;
        let has_lower = kind != Preconditioner::BlockJacobi;
        Self {
            kind,
            domains: (0..count).map(|d| rows * d / count..rows * (d + 1) / count).collect(),
            inverse: vec![0.0; rows * area],
            lower: vec![0.0; if has_lower { pattern.columns.len() * area } else { 0 }],
        }
    }

    pub(super) fn bytes(&self) -> usize {
        8 * (self.inverse.len() + self.lower.len())
    }

    /// Builds P for A. Returns the kind that was built, or the first row whose diagonal block is not positive
    /// definite.
    pub(super) fn prepare(&mut self, a: &SymmetricMatrix) -> Result<Preconditioner, usize> {
        match a.pattern.block {
            3 => self.prepare_blocks::<3>(a),
            2 => self.prepare_blocks::<2>(a),
            _ => self.prepare_blocks::<1>(a),
        }
    }

    fn prepare_blocks<const B: usize>(&mut self, a: &SymmetricMatrix) -> Result<Preconditioner, usize> {
        let kinds = match self.kind {
            Preconditioner::BlockIncompleteCholesky => {
                [Preconditioner::BlockIncompleteCholesky, Preconditioner::Ssor].as_slice()
            }
            Preconditioner::BlockJacobi => &[Preconditioner::BlockJacobi],
            Preconditioner::Ssor => &[Preconditioner::Ssor],
        };
        let mut broken = 0;
        for &kind in kinds {
            let (inverse, _) = self.inverse.as_chunks_mut::<B>();
            let (lower, _) = self.lower.as_chunks_mut::<B>();
            match make_domains(a, kind, &self.domains, inverse, lower) {
                Ok(()) => return Ok(kind),
                Err(breakdown) => broken = breakdown.row,
            }
        }
        Err(broken)
    }

    /// Computes z = P⁻¹ r; `sums` is scratch memory of the same size.
    pub(super) fn apply(&self, pattern: &Pattern, r: &[f64], z: &mut [f64], sums: &mut [f64]) {
        match pattern.block {
            3 => self.apply_blocks::<3>(pattern, r, z, sums),
            2 => self.apply_blocks::<2>(pattern, r, z, sums),
            _ => self.apply_blocks::<1>(pattern, r, z, sums),
        }
    }

    fn apply_blocks<const B: usize>(&self, pattern: &Pattern, r: &[f64], z: &mut [f64], sums: &mut [f64]) {
        let solve = Apply {
            pattern,
            inverse: self.inverse.as_chunks::<B>().0,
            lower: self.lower.as_chunks::<B>().0,
            r: r.as_chunks::<B>().0,
        };
        solve.domains(&self.domains, z.as_chunks_mut::<B>().0, sums.as_chunks_mut::<B>().0);
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

/// Computes D⁻¹ and L of some domains, each on its own part of the arrays.
fn make_domains<const B: usize>(
    a: &SymmetricMatrix,
    kind: Preconditioner,
    domains: &[Range<usize>],
    inverse: &mut [[f64; B]],
    lower: &mut [[f64; B]],
) -> Result<(), Breakdown> {
    match domains {
        [] => Ok(()),
        [rows] => make_domain(a, kind, rows.clone(), inverse, lower),
        _ => {
            let (left, right) = domains.split_at(domains.len() / 2);
            let rows = right[0].start - left[0].start;
            let entries = a.pattern.row(right[0].start).start - a.pattern.row(left[0].start).start;
            let (left_inverse, right_inverse) = inverse.split_at_mut(rows * B);
            let (left_lower, right_lower) =
                lower.split_at_mut(if kind == Preconditioner::BlockJacobi { 0 } else { entries * B });
            let (on_left, on_right) = rayon::join(
                || make_domains(a, kind, left, left_inverse, left_lower),
                || make_domains(a, kind, right, right_inverse, right_lower),
            );
            on_left.and(on_right)
        }
    }
}

fn make_domain<const B: usize>(
    a: &SymmetricMatrix,
    kind: Preconditioner,
    rows: Range<usize>,
    inverse: &mut [[f64; B]],
    lower: &mut [[f64; B]],
) -> Result<(), Breakdown> {
    let pattern = &*a.pattern;
    let (values, _) = a.values.as_chunks::<B>();
    let first_entry = pattern.row(rows.start).start;
    let below = |row: usize| {
        let entries = pattern.row(row);
        let skipped =
            pattern.columns[entries.clone()].partition_point(|&column| (column as usize) < rows.start);
        entries.start + skipped..entries.end - 1
    };
    let store = |array: &mut [[f64; B]], place: usize, value: &Block<B>| {
        array[place * B..(place + 1) * B].copy_from_slice(value);
    };
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
                            let inverse = block(inverse, l as usize - rows.start);
                            let scaled = multiply(&block(lower, left - first_entry), &inverse);
                            let other = block(lower, right.start - first_entry);
                            subtract_product_transposed(&mut value, &scaled, &other);
                        }
                        left += usize::from(l <= r);
                        right.start += usize::from(r <= l);
                    }
                    let scaled = multiply(&value, &block(inverse, column - rows.start));
                    subtract_product_transposed(&mut diagonal, &scaled, &value);
                }
                store(lower, entry - first_entry, &value);
            }
        }
        let inverted = invert(&diagonal, smallest).ok_or(Breakdown { row })?;
        store(inverse, row - rows.start, &inverted);
    }
    Ok(())
}

/// Computes z = P⁻¹ r.
struct Apply<'a, const B: usize> {
    pattern: &'a Pattern,
    inverse: &'a [[f64; B]],
    lower: &'a [[f64; B]],
    r: &'a [[f64; B]],
}

impl<const B: usize> Apply<'_, B> {
    fn domains(&self, domains: &[Range<usize>], z: &mut [[f64; B]], sums: &mut [[f64; B]]) {
        match domains {
            [] => {}
            [rows] => self.domain(rows.clone(), z, sums),
            _ => {
                let (left, right) = domains.split_at(domains.len() / 2);
                let rows = right[0].start - left[0].start;
                let (left_z, right_z) = z.split_at_mut(rows);
                let (left_sums, right_sums) = sums.split_at_mut(rows);
                rayon::join(
                    || self.domains(left, left_z, left_sums),
                    || self.domains(right, right_z, right_sums),
                );
            }
        }
    }

    fn times_inverse(&self, row: usize, x: &[f64; B]) -> [f64; B] {
        let inverse = &self.inverse[row * B..(row + 1) * B];
        std::array::from_fn(|i| (0..B).map(|j| inverse[i][j] * x[j]).sum())
    }

    fn domain(&self, rows: Range<usize>, z: &mut [[f64; B]], sums: &mut [[f64; B]]) {
        let first = rows.start;
        if self.lower.is_empty() {
            for row in rows {
                z[row - first] = self.times_inverse(row, &self.r[row]);
            }
            return;
        }
        let pattern = self.pattern;
        let inside = |row: usize| {
            let entries = pattern.row(row);
            (entries.start..entries.end - 1).rev().take_while(move |&e| pattern.columns[e] as usize >= first)
        };
        for row in rows.clone() {
            let mut x = self.r[row];
            for entry in inside(row) {
                let (l, y) =
                    (&self.lower[entry * B..(entry + 1) * B], &z[pattern.columns[entry] as usize - first]);
                for i in 0..B {
                    for j in 0..B {
                        x[i] -= l[i][j] * y[j];
                    }
                }
            }
            z[row - first] = self.times_inverse(row, &x);
        }
        sums.fill([0.0; B]);
        for row in rows.rev() {
            let correction = self.times_inverse(row, &sums[row - first]);
            let x: [f64; B] = std::array::from_fn(|k| z[row - first][k] - correction[k]);
            z[row - first] = x;
            for entry in inside(row) {
                let l = &self.lower[entry * B..(entry + 1) * B];
                let sum = &mut sums[pattern.columns[entry] as usize - first];
                for i in 0..B {
                    for j in 0..B {
                        sum[j] += l[i][j] * x[i];
                    }
                }
            }
        }
    }
}
