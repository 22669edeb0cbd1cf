//! A sparse matrix on the free coordinates, in dense nodal blocks, whose pattern is symmetric but whose values are not.

use std::sync::Arc;

use crate::error::SolverError;
use crate::index::NONE;
use crate::linear::matrix::{Pattern, SymmetricMatrix};
use crate::linear::matrix_sum::{check_nodes, places_in};

/// A vector with few entries: free coordinates and values. The coordinates of a node follow each other.
pub(crate) type Covector = [(u32, f64)];

/// A square matrix A = D + Σ c_k S_k + Σ a ⊗ b of a diagonal matrix, symmetric matrices and outer products.
pub(crate) struct NodalMatrix {
    pattern: Arc<Pattern>,
    /// The lower triangles of A and of Aᵀ: block × block numbers per place, row-major.
    sides: [Vec<f64>; 2],
    /// The patterns of the matrices S_k, and where their entries (in row order) lie.
    parts: Vec<(Arc<Pattern>, Vec<u32>)>,
    nodes: Nodes,
    /// The blocks of the last outer product. Most outer products of a pair have the same nodes, so that its blocks are sought once.
    last: Blocks,
}

/// The nodal blocks of an outer product.
#[derive(Default)]
struct Blocks {
    rows: Vec<u32>,
    columns: Vec<u32>,
    /// The entry of the pattern of each block, row by row.
    entries: Vec<u32>,
}

/// The nodes of free coordinates.
struct Nodes {
    /// Number of coordinates per node.
    block: usize,
    /// The row and the axis of each free coordinate. Divisions to find them took half of the time of [`NodalMatrix::add_outer`].
    places: Vec<[u32; 2]>,
}

impl Nodes {
    fn new(pattern: &Pattern) -> Self {
        let mut places = vec![[0, 0]; pattern.free_count];
        for (row, free_of) in (0..).zip(pattern.free_of.chunks_exact(pattern.block)) {
            for (axis, &free) in (0..).zip(free_of).filter(|(_, free)| **free != NONE) {
                places[free as usize] = [row, axis];
            }
        }
        Self { block: pattern.block, places }
    }

    /// Returns the axis of a free coordinate.
    fn axis(&self, free: u32) -> usize {
        self.places[free as usize][1] as usize
    }

    /// Adds factor · a ⊗ b to a block, where a and b belong to one node each.
    fn add_block(&self, values: &mut [f64], factor: f64, a: &Covector, b: &Covector) {
        if let (3, Ok(a), Ok(b)) = (self.block, <&[_; 3]>::try_from(a), <&[_; 3]>::try_from(b)) {
            // All coordinates of both nodes are free, so that entry k belongs to axis k.
            for i in 0..3 {
                for j in 0..3 {
                    values[3 * i + j] += factor * (a[i].1 * b[j].1);
                }
            }
            return;
        }
        for &(i, a) in a {
            let line = &mut values[self.axis(i) * self.block..][..self.block];
            b.iter().for_each(|&(j, b)| line[self.axis(j)] += factor * (a * b));
        }
    }

    /// Returns the entries of a covector by nodes, with the row of each node.
    fn split<'a>(&self, a: &'a Covector) -> impl Iterator<Item = (u32, &'a Covector)> {
        let row = |entry: &(u32, f64)| self.places[entry.0 as usize][0];
        a.chunk_by(move |a, b| row(a) == row(b)).map(move |chunk| (row(&chunk[0]), chunk))
    }
}

impl Blocks {
    /// Finds the blocks of a ⊗ b; returns false if the pattern lacks some of them.
    fn find(&mut self, pattern: &Pattern, nodes: &Nodes, a: &Covector, b: &Covector) -> bool {
        let is_same = |kept: &[u32], covector: &Covector| {
            nodes.split(covector).map(|(row, _)| row).eq(kept.iter().copied())
        };
        if is_same(&self.rows, a) && is_same(&self.columns, b) {
            return true;
        }
        let Self { rows, columns, entries } = self;
        for (kept, covector) in [(&mut *rows, a), (&mut *columns, b)] {
            kept.clear();
            kept.extend(nodes.split(covector).map(|(row, _)| row));
        }
        entries.clear();
        for &row in &*rows {
            for &column in &*columns {
                match pattern.entry(row.max(column) as usize, row.min(column) as usize) {
                    Some(entry) => entries.push(entry as u32),
                    None => {
                        rows.clear();
                        columns.clear();
                        return false;
                    }
                }
            }
        }
        true
    }
}

impl NodalMatrix {
    /// Returns a zero matrix with the pattern of a sum of these symmetric matrices and of the outer products a ⊗ b that
    /// `couplings` passes on, and whether it has another pattern than `kept`.
    ///
    /// If `widens`, a pattern that has more entries is kept, and one that lacks some is widened. Otherwise the pattern has the entries
    /// of the sum alone, so that it does not depend on earlier sums.
    ///
    /// # Errors
    /// Returns [`SolverError::Symbolic`] if the nodes of the matrices have different numbers of coordinates.
    pub(crate) fn covering(
        kept: Option<Self>,
        parts: &[&SymmetricMatrix],
        couplings: impl Fn(&mut dyn FnMut(&Covector, &Covector)),
        widens: bool,
    ) -> Result<(Self, bool), SolverError> {
        check_nodes(parts)?;
        let first = &parts[0].pattern;
        let mut kept = kept.filter(|kept| kept.pattern.free_of == first.free_of);
        if let Some(mut admitting) = kept.take_if(|kept| widens && kept.admits(parts, &couplings)) {
            admitting.sides.iter_mut().for_each(|side| side.fill(0.0));
            return Ok((admitting, false));
        }
        let nodes = Nodes::new(first);
        let widened = kept.iter().filter(|_| widens).map(|kept| &kept.pattern);
        let patterns = parts.iter().map(|part| &part.pattern).chain(widened);
        let mut entries: Vec<(u32, u32)> =
            patterns.flat_map(|pattern| pattern.entries()).map(|(row, column, _)| (row, column)).collect();
        couplings(&mut |a, b| {
            for (row, _) in nodes.split(a) {
                entries.extend(nodes.split(b).map(|(column, _)| (row.max(column), row.min(column))));
            }
        });
        entries.sort_unstable();
        entries.dedup();
        let is_same = |kept: &Self| {
            kept.pattern.entries().map(|(row, column, _)| (row, column)).eq(entries.iter().copied())
        };
        let (pattern, is_new) = match kept.filter(is_same) {
            Some(kept) => (kept.pattern, false),
            None => {
                let places = (0..entries.len() as u32).collect();
                (Arc::new(Pattern::new(first.block, &entries, places, first.free_of.clone())), true)
            }
        };
        let length = pattern.columns.len() * pattern.block * pattern.block;
        let sides = [vec![0.0; length], vec![0.0; length]];
        let mut matrix = Self { pattern, sides, parts: Vec::new(), nodes, last: Blocks::default() };
        matrix.find(parts);
        Ok((matrix, is_new))
    }

    /// Returns whether the pattern has all entries of a sum; finds those of the symmetric matrices.
    fn admits(
        &mut self,
        parts: &[&SymmetricMatrix],
        couplings: &impl Fn(&mut dyn FnMut(&Covector, &Covector)),
    ) -> bool {
        let mut has_all = self.find(parts);
        if has_all {
            let Self { pattern, nodes, last, .. } = self;
            couplings(&mut |a, b| has_all &= last.find(pattern, nodes, a, b));
        }
        has_all
    }

    /// Finds the entries of the symmetric matrices; returns whether the pattern has all of them.
    fn find(&mut self, parts: &[&SymmetricMatrix]) -> bool {
        let known = self.parts.iter().zip(parts);
        if self.parts.len() == parts.len() && known.into_iter().all(|(a, b)| Arc::ptr_eq(&a.0, &b.pattern)) {
            return true;
        }
        let places = |part: &&SymmetricMatrix| {
            Some((Arc::clone(&part.pattern), places_in(&self.pattern, &part.pattern)?))
        };
        let found: Option<Vec<_>> = parts.iter().map(places).collect();
        let has_all = found.is_some();
        self.parts = found.unwrap_or_default();
        has_all
    }

    /// Adds factor · S_k, with the matrices in the order in which [`NodalMatrix::covering`] received them.
    pub(crate) fn add_symmetric(&mut self, factor: f64, k: usize, matrix: &SymmetricMatrix) {
        let area = self.nodes.block * self.nodes.block;
        for (&from, &to) in matrix.pattern.places.iter().zip(&self.parts[k].1) {
            let source = &matrix.values[from as usize * area..][..area];
            for side in &mut self.sides {
                let target = &mut side[to as usize * area..][..area];
                target.iter_mut().zip(source).for_each(|(target, value)| *target += factor * value);
            }
        }
    }

    /// Adds a diagonal matrix.
    pub(crate) fn add_diagonal(&mut self, diagonal: &[f64]) {
        for (place, free) in self.pattern.free_diagonal() {
            self.sides.iter_mut().for_each(|side| side[place] += diagonal[free]);
        }
    }

    /// Returns the diagonal on the free coordinates.
    pub(crate) fn diagonal(&self) -> Vec<f64> {
        let mut diagonal = vec![0.0; self.pattern.free_count];
        self.pattern.free_diagonal().for_each(|(place, free)| diagonal[free] = self.sides[0][place]);
        diagonal
    }

    /// Scales A_ij ← s_i A_ij s_j.
    pub(crate) fn scale(&mut self, scales: &[f64]) {
        let Self { pattern, sides, nodes: Nodes { block, .. }, .. } = self;
        let (block, area) = (*block, *block * *block);
        let mut padded = vec![0.0; pattern.free_of.len()];
        pattern.spread(scales, &mut padded);
        for (row, column, entry) in pattern.entries() {
            let [rows, columns] = [row, column].map(|node| &padded[node as usize * block..][..block]);
            for side in &mut *sides {
                for (line, row) in side[entry * area..][..area].chunks_exact_mut(block).zip(rows) {
                    line.iter_mut().zip(columns).for_each(|(value, column)| *value *= row * column);
                }
            }
        }
    }

    /// Adds factor · a ⊗ b, one of the outer products for which the pattern was made.
    pub(crate) fn add_outer(&mut self, factor: f64, a: &Covector, b: &Covector) {
        let Self { pattern, sides: [lower, upper], nodes, last, .. } = self;
        if !last.find(pattern, nodes, a, b) {
            return;
        }
        let area = nodes.block * nodes.block;
        let mut entries = last.entries.iter();
        for (row, a) in nodes.split(a) {
            for ((column, b), &entry) in nodes.split(b).zip(&mut entries) {
                let values = entry as usize * area..(entry as usize + 1) * area;
                if row >= column {
                    nodes.add_block(&mut lower[values.clone()], factor, a, b);
                }
                if row <= column {
                    nodes.add_block(&mut upper[values], factor, b, a);
                }
            }
        }
    }

    /// Computes y = A x.
    pub(crate) fn multiply(&self, x: &[f64], y: &mut [f64]) {
        let Self { pattern, sides: [lower, upper], .. } = self;
        let (block, length) = (pattern.block, pattern.free_of.len());
        let (mut x_padded, mut y_padded) = (vec![0.0; length], vec![0.0; length]);
        pattern.spread(x, &mut x_padded);
        for (row, column, entry) in pattern.entries() {
            let (row, column) = (row as usize * block, column as usize * block);
            let values = entry * block * block..(entry + 1) * block * block;
            let lines = lower[values.clone()].chunks_exact(block).zip(upper[values].chunks_exact(block));
            for (i, (lower, upper)) in lines.enumerate() {
                let x_row = x_padded[row + i];
                let mut sum = 0.0;
                for j in 0..block {
                    sum += lower[j] * x_padded[column + j];
                    if row != column {
                        y_padded[column + j] += upper[j] * x_row;
                    }
                }
                y_padded[row + i] += sum;
            }
        }
        pattern.collect(&y_padded, y);
    }

    pub(crate) fn pattern(&self) -> &Pattern {
        &self.pattern
    }

    /// Returns the values of the lower triangles of A and of Aᵀ.
    pub(crate) fn sides(&self) -> [&[f64]; 2] {
        self.sides.each_ref().map(Vec::as_slice)
    }

    /// Returns the size of the largest entry.
    pub(crate) fn largest(&self) -> f64 {
        self.sides.iter().flatten().fold(0.0, |largest: f64, value| largest.max(value.abs()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Patterns that may be wider keep their entries; others do not depend on earlier ones.
    #[test]
    fn patterns_are_widened_within_a_step_alone() {
        let entries = [(0, 0), (1, 1), (2, 2)];
        let pattern = Pattern::new(3, &entries, vec![0, 1, 2], (0..9).collect());
        let diagonal = SymmetricMatrix::zeros(Arc::new(pattern));
        let near = |each: &mut dyn FnMut(&Covector, &Covector)| each(&[(0, 1.0)], &[(4, 1.0)]);
        let far = |each: &mut dyn FnMut(&Covector, &Covector)| each(&[(8, 1.0)], &[(1, 1.0)]);
        let count = |matrix: &NodalMatrix| matrix.pattern().entries().count();
        let (first, is_new) = NodalMatrix::covering(None, &[&diagonal], near, false).unwrap();
        assert!(is_new && count(&first) == 4);
        let (wider, is_new) = NodalMatrix::covering(Some(first), &[&diagonal], far, true).unwrap();
        assert!(is_new && count(&wider) == 5);
        let (kept, is_new) = NodalMatrix::covering(Some(wider), &[&diagonal], near, true).unwrap();
        assert!(!is_new && count(&kept) == 5);
        let (next, is_new) = NodalMatrix::covering(Some(kept), &[&diagonal], far, false).unwrap();
        assert!(is_new && count(&next) == 4);
        let (same, is_new) = NodalMatrix::covering(Some(next), &[&diagonal], far, false).unwrap();
        assert!(!is_new && count(&same) == 4);
    }
}
