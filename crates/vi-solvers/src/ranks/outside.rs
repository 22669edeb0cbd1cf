//! Solves the linear systems of several ranks by a solver from outside, for example that of PETSc.

use vi_core::{BlockRows, RankSolver, SolverFacts};

use crate::index::NONE;
use crate::linear::matrix::SymmetricMatrix;
use crate::linear::pcg::Pcg;

/// Cost of an iteration and of a preparation, in iterations of conjugate gradients. P1 box of 55 488 tetrahedra, one rank,
/// PETSc 3.18 with algebraic multigrid against incomplete factors.
const ITERATION_COST: f64 = 5.0;
const PREPARATION_COST: f64 = 170.0;

/// A solver from outside, with the rows of this rank.
pub(super) struct Outside {
    solver: Box<dyn RankSolver>,
    rows: BlockRows,
    /// Whether the solver holds the last matrix, and has not failed with it.
    is_ready: bool,
    load: Vec<f64>,
    solution: Vec<f64>,
    /// The reasons for which the solver failed, and how many of them have been reported.
    failures: Vec<String>,
    told: usize,
}

impl Outside {
    pub(super) fn new(solver: Box<dyn RankSolver>) -> Self {
        let (load, solution) = (Vec::new(), Vec::new());
        Self {
            solver,
            rows: BlockRows::default(),
            is_ready: false,
            load,
            solution,
            failures: Vec::new(),
            told: 0,
        }
    }

    /// Returns its costs, given those of conjugate gradients.
    pub(super) fn facts(&self, pcg: SolverFacts) -> SolverFacts {
        let bytes = pcg.iteration_bytes;
        SolverFacts {
            iteration_bytes: ITERATION_COST * bytes,
            iteration_flops: ITERATION_COST * pcg.iteration_flops,
            prepare_bytes: pcg.prepare_bytes + PREPARATION_COST * bytes,
            ..pcg
        }
    }

    /// Takes the matrix that `pcg` holds; `numbers` are the numbers of its rows among those of all ranks, and `positions` (m)
    /// the coordinates of the nodes of its own rows.
    pub(super) fn prepare(&mut self, pcg: &Pcg, numbers: &[u32], positions: Vec<f64>) {
        copy(pcg, numbers, &mut self.rows);
        self.rows.positions = positions;
        self.solver.prepare(&self.rows);
        self.is_ready = true;
    }

    /// Drops the matrix, because another solver solves with it.
    pub(super) fn leave(&mut self) {
        self.is_ready = false;
    }

    /// Replaces `v`, the own free coordinates of the load, by those of the solution, and returns the number of iterations.
    /// Returns `None` and changes nothing if the solver fails; then it is not used before the next matrix.
    pub(super) fn solve(&mut self, pcg: &Pcg, v: &mut [f64], tolerance: f64, most: u32) -> Option<u32> {
        if !self.is_ready {
            return None;
        }
        let Self { solver, load, solution, .. } = self;
        let (pattern, own) = (&pcg.matrix().pattern, pcg.own_rows());
        let free_of = &pattern.free_of[own.start * pattern.block..own.end * pattern.block];
        load.clear();
        let mut rest = v.iter();
        load.extend(
            free_of.iter().map(|&free| if free == NONE { None } else { rest.next() }.unwrap_or(&0.0)),
        );
        solution.resize(load.len(), 0.0);
        match solver.solve(load, solution, tolerance, most) {
            Ok(iterations) => {
                let found = free_of.iter().zip(solution).filter(|(free, _)| **free != NONE);
                v.iter_mut().zip(found).for_each(|(v, (_, value))| *v = *value);
                Some(iterations)
            }
            Err(reason) => {
                self.is_ready = false;
                if !self.failures.contains(&reason) {
                    self.failures.push(reason);
                }
                None
            }
        }
    }

    /// Returns the reasons for which it failed since the last call, in words.
    pub(super) fn take_findings(&mut self) -> Vec<String> {
        let found = self.failures[self.told..].iter().map(|reason| {
            format!("a linear system was solved by \"pcg\", because \"petsc\" stopped with {reason}; this note appears once")
        });
        let found = found.collect();
        self.told = self.failures.len();
        found
    }
}

/// Copies the own rows of a matrix, with ones at prescribed coordinates, scaled as the diagonal of their block.
fn copy(pcg: &Pcg, numbers: &[u32], out: &mut BlockRows) {
    let (matrix, own): (&SymmetricMatrix, _) = (pcg.matrix(), pcg.own_rows());
    let pattern = &*matrix.pattern;
    let (block, area) = (pattern.block, pattern.block * pattern.block);
    out.block = block;
    out.starts.clear();
    out.starts.push(0);
    out.columns.clear();
    out.values.clear();
    for row in own {
        let lower = pattern.row(row).map(|entry| (pattern.columns[entry], pattern.places[entry], true));
        let upper = pattern.upper(row).map(|(column, place)| (column, place, false));
        let mut blocks: Vec<(u32, u32, bool)> = lower.chain(upper).collect();
        blocks.sort_unstable();
        let free = &pattern.free_of[row * block..(row + 1) * block];
        let diagonal = &matrix.values[pattern.diagonal_place(row) * area..][..area];
        let scale = (0..block).map(|k| diagonal[k * block + k]).fold(0.0, f64::max);
        for i in 0..block {
            for &(column, place, is_lower) in &blocks {
                let values = &matrix.values[place as usize * area..][..area];
                let value = |j: usize| if is_lower { values[i * block + j] } else { values[j * block + i] };
                out.values.extend((0..block).map(|j| {
                    let is_held = column as usize == row && i == j && free[i] == NONE;
                    if is_held { scale } else { value(j) }
                }));
            }
        }
        out.columns.extend(blocks.iter().map(|&(column, ..)| numbers[column as usize]));
        out.starts.push(out.columns.len() as u32);
    }
}
