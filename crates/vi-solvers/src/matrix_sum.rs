//! Linear combinations of symmetric matrices whose entries lie in different places.
//! It must not know what the matrices stand for.

use std::sync::Arc;

use crate::SolverError;
use crate::matrix::{Pattern, SymmetricMatrix};

/// Σ c_k A_k on the union of the patterns, with the maps made once.
pub(crate) struct MatrixSum {
    matrix: SymmetricMatrix,
    /// Entry e of part k (in row order) is added to this place of the sum.
    places: Vec<Vec<u32>>,
}

impl MatrixSum {
    /// The union of the patterns of these matrices, which all stand on the same free coordinates.
    ///
    /// # Errors
    /// [`SolverError::Symbolic`] where their nodes have different numbers of coordinates.
    pub(crate) fn new(parts: &[&SymmetricMatrix]) -> Result<Self, SolverError> {
        let first = &parts[0].pattern;
        if parts.iter().any(|part| part.pattern.block != first.block || part.pattern.free_of != first.free_of)
        {
            let reason = "terms and forces with different numbers of coordinates a node";
            return Err(SolverError::Symbolic { dofs: first.free_count, reason });
        }
        let entries_of = |part: &SymmetricMatrix| -> Vec<(u32, u32)> {
            let pattern = &part.pattern;
            (0..pattern.row_count())
                .flat_map(|row| pattern.row(row).map(move |entry| (row as u32, entry)))
                .map(|(row, entry)| (row, pattern.columns[entry]))
                .collect()
        };
        let lists: Vec<_> = parts.iter().map(|part| entries_of(part)).collect();
        let mut union: Vec<(u32, u32)> = lists.iter().flatten().copied().collect();
        union.sort_unstable();
        union.dedup();
        // Every row has its diagonal, for every part does.
        let find = |entry: &(u32, u32)| union.partition_point(|other| other < entry) as u32;
        let places = lists.iter().map(|list| list.iter().map(find).collect()).collect();
        let own = (0..union.len() as u32).collect();
        let pattern = Pattern::new(first.block, &union, own, first.free_of.clone());
        Ok(Self { matrix: SymmetricMatrix::zeros(Arc::new(pattern)), places })
    }

    /// Σ c_k A_k, with the parts in the order that they were given to [`MatrixSum::new`].
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

    /// The sum as it was last made.
    pub(crate) fn matrix(&self) -> &SymmetricMatrix {
        &self.matrix
    }
}
