//! The coarse space of conjugate gradients: the rigid motions of aggregates of neighbouring nodes.
//!
//! Incomplete factors and nodal blocks reduce errors that vary from node to node, but not long waves, so their number
//! of iterations grows with the number of nodes across a body. The coarse matrix A_c = Zᵀ A Z on the rigid motions Z of each
//! aggregate removes the long waves: the preconditioner is P⁻¹ + Z A_c⁻¹ Zᵀ (additive two-level Schwarz method with the
//! space of Nicolaides 1987; Toselli, Widlund 2005, chapter 3). Aggregates have a fixed number of nodes, so the
//! number of iterations stays bounded when a mesh is refined.

mod aggregates;
mod projection;
mod rigid_motions;

use std::sync::Arc;

use rayon::prelude::*;

use crate::error::NotPositiveDefinite;
use crate::linear::factor::{Factor, FactorFacts};
use crate::linear::matrix::{Pattern, SymmetricMatrix};
use crate::linear::pcg::share::Share;
use aggregates::Aggregates;

/// Smallest numbers of rows and of aggregates per task.
const ROWS_PER_TASK: usize = 2048;
const AGGREGATES_PER_TASK: usize = 16;

pub(super) struct Coarse {
    aggregates: Aggregates,
    /// Number of rigid motions per aggregate.
    motion_count: usize,
    /// Z: per coordinate of each row, the components of the rigid motions of its aggregate.
    motions: Vec<f64>,
    /// A_c, with the motions of each aggregate side by side.
    matrix: SymmetricMatrix,
    factor: Factor,
    /// Zᵀ r, then A_c⁻¹ Zᵀ r.
    load: Vec<f64>,
}

impl Coarse {
    /// Aggregates the rows of a pattern. Returns `None` if there are too few rows to gain by it, or if the rows are too
    /// scattered for aggregates.
    pub(super) fn new(pattern: &Pattern, share: &Share) -> Option<Self> {
        let aggregates = Aggregates::new(pattern, share)?;
        let motion_count = rigid_motions::count(pattern.block);
        let matrix = SymmetricMatrix::zeros(Arc::new(projection::pattern(pattern, &aggregates, share)));
        Some(Self {
            motions: vec![0.0; pattern.row_count() * pattern.block * motion_count],
            load: vec![0.0; aggregates.count() * motion_count],
            factor: Factor::new(&matrix).ok()?,
            aggregates,
            motion_count,
            matrix,
        })
    }

    pub(super) fn factor_facts(&self) -> FactorFacts {
        self.factor.facts()
    }

    /// Returns the number of bytes of Z at `rows` rows, and of A_c.
    pub(super) fn bytes(&self, block: usize, rows: usize) -> usize {
        8 * rows * block * self.motion_count + self.matrix.bytes() + 4 * (2 * rows + self.aggregates.count())
    }

    /// Builds Z at these positions of the free coordinates, m, and factors Zᵀ A Z.
    ///
    /// # Errors
    /// Returns an error if A is not positive definite on the coarse space.
    pub(super) fn prepare(
        &mut self,
        a: &SymmetricMatrix,
        positions: &[f64],
        share: &Share,
    ) -> Result<(), NotPositiveDefinite> {
        match a.pattern.block {
            3 => self.prepare_blocks::<3, 6>(a, positions, share),
            2 => self.prepare_blocks::<2, 3>(a, positions, share),
            _ => self.prepare_blocks::<1, 1>(a, positions, share),
        }
    }

    fn prepare_blocks<const B: usize, const M: usize>(
        &mut self,
        a: &SymmetricMatrix,
        positions: &[f64],
        share: &Share,
    ) -> Result<(), NotPositiveDefinite> {
        let (motions, _) = self.motions.as_chunks_mut::<M>();
        let own = self.aggregates.own();
        let dependent: Vec<[bool; M]> = own
            .clone()
            .map(|k| rigid_motions::write::<B, M>(&a.pattern, self.aggregates.rows(k), positions, motions))
            .collect();
        share.exchange_rows(B * M, &mut self.motions);
        let (motions, _) = self.motions.as_chunks::<M>();
        projection::project::<B, M>(a, &self.aggregates, motions, &dependent, share, &mut self.matrix);
        self.factor.factorize(&[], 1.0, &self.matrix).map_err(|error| {
            let aggregate = error.free / M;
            let row = own.contains(&aggregate).then(|| self.aggregates.rows(aggregate)[0] as usize);
            let free = row.and_then(|row| Share::free_in_row(&a.pattern, row));
            NotPositiveDefinite { free: share.first_free(free) }
        })
    }

    /// Computes z ← z + Z A_c⁻¹ Zᵀ r, in vectors of rows · block entries.
    pub(super) fn add_correction(&mut self, r: &[f64], z: &mut [f64], share: &Share) {
        match self.motion_count {
            6 => self.correct::<3, 6>(r, z, share),
            3 => self.correct::<2, 3>(r, z, share),
            _ => self.correct::<1, 1>(r, z, share),
        }
    }

    fn correct<const B: usize, const M: usize>(&mut self, r: &[f64], z: &mut [f64], share: &Share) {
        let aggregates = &self.aggregates;
        let own = aggregates.own();
        let (motions, _) = self.motions.as_chunks::<M>();
        let (r, _) = r.as_chunks::<B>();
        let (loads, _) = self.load.as_chunks_mut::<M>();
        let loads = loads[own.clone()].par_iter_mut().zip(own.clone()).with_min_len(AGGREGATES_PER_TASK);
        loads.for_each(|(load, k)| {
            *load = [0.0; M];
            for row in aggregates.rows(k).iter().map(|&row| row as usize) {
                for (motion, r) in motions[row * B..(row + 1) * B].iter().zip(&r[row]) {
                    load.iter_mut().zip(motion).for_each(|(load, motion)| *load += motion * r);
                }
            }
        });
        self.load = share.gather(&self.load[own.start * M..own.end * M]);
        self.factor.apply_inverse(&mut self.load);
        let (solution, _) = self.load.as_chunks::<M>();
        let (z, _) = z[share.entries(B)].as_chunks_mut::<B>();
        z.par_iter_mut().zip(share.rows.clone()).with_min_len(ROWS_PER_TASK).for_each(|(z, row)| {
            let solution = &solution[aggregates.of(row)];
            for (z, motion) in z.iter_mut().zip(&motions[row * B..(row + 1) * B]) {
                *z += (0..M).map(|m| motion[m] * solution[m]).sum::<f64>();
            }
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns a chain of `count` nodes in space, each joined to the next three by springs that resist any relative motion.
    fn chain(count: usize) -> (SymmetricMatrix, Vec<f64>) {
        let mut entries = Vec::new();
        for row in 0..count {
            entries.extend((row.saturating_sub(3)..=row).map(|column| (row as u32, column as u32)));
        }
        let places = (0..entries.len() as u32).collect();
        let free_of = (0..3 * count as u32).collect();
        let mut matrix = SymmetricMatrix::zeros(Arc::new(Pattern::new(3, &entries, places, free_of)));
        for (entry, &(row, column)) in entries.iter().enumerate() {
            for k in 0..3 {
                matrix.values[9 * entry + 4 * k] = if row == column { 6.5 } else { -1.0 };
            }
        }
        let positions = (0..3 * count).map(|k| (0.37 * k as f64).sin() + k as f64).collect();
        (matrix, positions)
    }

    #[test]
    fn the_correction_is_exact_for_rigid_motions_of_the_whole_body() {
        let (matrix, positions) = chain(2000);
        let share = Share::whole(&matrix.pattern);
        let mut coarse = Coarse::new(&matrix.pattern, &share).expect("enough rows");
        coarse.prepare(&matrix, &positions, &share).expect("a positive definite matrix");
        // A translation with a turn about the third axis.
        let motion: Vec<f64> = (0..2000)
            .flat_map(|node| [0.3 - 0.01 * positions[3 * node + 1], 0.7 + 0.01 * positions[3 * node], -0.2])
            .collect();
        let mut load = vec![0.0; motion.len()];
        matrix.multiply(&motion, &mut load);
        let mut solution = vec![0.0; motion.len()];
        coarse.add_correction(&load, &mut solution, &share);
        let largest = motion.iter().fold(0.0_f64, |most, value| most.max(value.abs()));
        for (found, expected) in solution.iter().zip(&motion) {
            assert!((found - expected).abs() < 1e-10 * largest, "{found} {expected}");
        }
    }

    #[test]
    fn turns_of_nodes_on_a_line_about_the_line_are_left_out() {
        let (matrix, _) = chain(2000);
        let positions: Vec<f64> = (0..6000).map(|k| if k % 3 == 0 { k as f64 } else { 0.0 }).collect();
        let share = Share::whole(&matrix.pattern);
        let mut coarse = Coarse::new(&matrix.pattern, &share).expect("enough rows");
        coarse.prepare(&matrix, &positions, &share).expect("a positive definite matrix");
        assert!(coarse.motions.iter().all(|value| value.is_finite()));
    }

    #[test]
    fn few_rows_have_no_coarse_space() {
        let pattern = chain(100).0.pattern;
        assert!(Coarse::new(&pattern, &Share::whole(&pattern)).is_none());
    }
}
