//! Linear combinations of symmetric matrices with different patterns.

use std::sync::Arc;

use crate::error::SolverError;
use crate::linear::matrix::{Pattern, SymmetricMatrix};

/// Σ c_k A_k on the union of the patterns; the maps are computed once.
pub(crate) struct MatrixSum {
    matrix: SymmetricMatrix,
    /// The patterns of the summands.
    parts: Vec<Arc<Pattern>>,
    /// The place in the sum of entry e of summand k (in row order).
    places: Vec<Vec<u32>>,
}

impl MatrixSum {
    /// Builds the union of the patterns of these matrices, which all have the same free coordinates.
    ///
    /// # Errors
    /// Returns [`SolverError::Symbolic`] if their nodes have different numbers of coordinates.
    pub(crate) fn new(parts: &[&SymmetricMatrix]) -> Result<Self, SolverError> {
        check_nodes(parts)?;
        let first = &parts[0].pattern;
        let entries_of = |part: &SymmetricMatrix| -> Vec<(u32, u32)> {
            part.pattern.entries().map(|(row, column, _)| (row, column)).collect()
        };
        let lists: Vec<_> = parts.iter().map(|part| entries_of(part)).collect();
        let mut union: Vec<(u32, u32)> = lists.iter().flatten().copied().collect();
        union.sort_unstable();
        union.dedup();
        // Every row has its diagonal, because it has it in every summand.
        let find = |entry: &(u32, u32)| union.partition_point(|other| other < entry) as u32;
        let places = lists.iter().map(|list| list.iter().map(find).collect()).collect();
        let own = (0..union.len() as u32).collect();
        let pattern = Pattern::new(first.block, &union, own, first.free_of.clone());
        let parts = parts.iter().map(|part| Arc::clone(&part.pattern)).collect();
        Ok(Self { matrix: SymmetricMatrix::zeros(Arc::new(pattern)), parts, places })
    }

    /// Accepts these summands if they are those from before, or if all their entries lie in the pattern of the sum.
    /// In the latter case the sum uses them from now on, and keeps its pattern and everything that was built from it.
    pub(crate) fn admit(&mut self, parts: &[&SymmetricMatrix]) -> bool {
        if parts.len() != self.parts.len() {
            return false;
        }
        let mut changed = Vec::new();
        for (k, part) in parts.iter().enumerate() {
            if Arc::ptr_eq(&part.pattern, &self.parts[k]) {
                continue;
            }
            match places_in(&self.matrix.pattern, &part.pattern) {
                Some(places) => changed.push((k, places)),
                None => return false,
            }
        }
        for (k, places) in changed {
            self.parts[k] = Arc::clone(&parts[k].pattern);
            self.places[k] = places;
        }
        true
    }

    /// Returns a sum for these summands, and whether it is new: the present one if it [admits](MatrixSum::admit) them.
    ///
    /// # Errors
    /// Returns the errors of [`MatrixSum::new`].
    pub(crate) fn covering<'a>(
        sum: &'a mut Option<Self>,
        parts: &[&SymmetricMatrix],
    ) -> Result<(&'a mut Self, bool), SolverError> {
        let kept = sum.take().and_then(|mut kept| kept.admit(parts).then_some(kept));
        let is_new = kept.is_none();
        let made = match kept {
            Some(kept) => kept,
            None => Self::new(parts)?,
        };
        Ok((sum.insert(made), is_new))
    }

    /// Returns the sum of these matrices. Builds the maps again if a summand has another pattern than before.
    ///
    /// # Errors
    /// Returns the errors of [`MatrixSum::new`].
    pub(crate) fn of<'a>(
        sum: &'a mut Option<Self>,
        parts: &[(f64, &SymmetricMatrix)],
    ) -> Result<&'a SymmetricMatrix, SolverError> {
        let is_same = |sum: &Self| {
            let known = sum.parts.iter().zip(parts);
            sum.parts.len() == parts.len() && known.into_iter().all(|(a, b)| Arc::ptr_eq(a, &b.1.pattern))
        };
        let kept = sum.take().filter(is_same);
        let made = match kept {
            Some(kept) => kept,
            None => Self::new(&parts.iter().map(|part| part.1).collect::<Vec<_>>())?,
        };
        Ok(sum.insert(made).combine(parts))
    }

    /// Returns Σ c_k A_k, with the summands in the order in which [`MatrixSum::new`] received them.
    pub(crate) fn combine(&mut self, parts: &[(f64, &SymmetricMatrix)]) -> &SymmetricMatrix {
        let area = self.matrix.pattern.block * self.matrix.pattern.block;
        self.matrix.values.fill(0.0);
        for ((factor, part), places) in parts.iter().zip(&self.places) {
            for (&from, &to) in part.pattern.places.iter().zip(places) {
                let (from, to) = (from as usize * area, to as usize * area);
                for k in 0..area {
                    self.matrix.values[to + k] += factor * part.values[from + k];
                }
            }
        }
        &self.matrix
    }

    /// Returns the last sum.
    pub(crate) fn matrix(&self) -> &SymmetricMatrix {
        &self.matrix
    }
}

/// Checks that the nodes of some matrices, at least one, have the same coordinates.
///
/// # Errors
/// Returns [`SolverError::Symbolic`] if they have not.
pub(super) fn check_nodes(parts: &[&SymmetricMatrix]) -> Result<(), SolverError> {
    let first = &parts[0].pattern;
    if parts.iter().all(|part| part.pattern.block == first.block && part.pattern.free_of == first.free_of) {
        return Ok(());
    }
    let reason = "terms and forces have different numbers of coordinates per node";
    Err(SolverError::Symbolic { dofs: first.free_count, reason })
}

/// Returns the places of the entries of `part` in `whole`, whose entries are in row order; `None` if an entry is
/// missing.
pub(super) fn places_in(whole: &Pattern, part: &Pattern) -> Option<Vec<u32>> {
    if part.block != whole.block || part.free_of != whole.free_of {
        return None;
    }
    let mut places = Vec::with_capacity(part.columns.len());
    for row in 0..part.row_count() {
        let range = whole.row(row);
        let columns = &whole.columns[range.clone()];
        for entry in part.row(row) {
            let found = columns.binary_search(&part.columns[entry]).ok()?;
            places.push((range.start + found) as u32);
        }
    }
    Some(places)
}
