//! One pass over the coordinates of a body for everything that an explicit step does to them: the sums
//! of a gradient, a kick, a drift and the new positions, a cacheful at a time, on all cores. It must not
//! know which scheme kicks.

use vi_core::{State, System};

use crate::gather::Gather;

/// Coordinates that one task works through.
const TASK: usize = 2048;
/// Coordinates that are worked on together, so that what one part writes the next finds in cache.
const TILE: usize = 384;

/// Free coordinates that follow each other.
struct Run {
    /// The first in x.
    dof: usize,
    /// The first in q.
    free: usize,
    length: usize,
}

/// The maps of the passes over a system.
pub(crate) struct Sweep {
    runs: Vec<Run>,
    /// 1/m of every free coordinate, 1/kg.
    inverse_mass: Vec<f64>,
    /// Coordinates a task and a tile, in whole nodes.
    task: usize,
    tile: usize,
    parallel: bool,
}

/// The arrays that a pass changes, of coordinates `first` and on.
pub(crate) struct Arrays<'a> {
    /// ∂V/∂x and x of all coordinates.
    pub(crate) gradient: &'a mut [f64],
    pub(crate) x: &'a mut [f64],
    /// q and p of the free ones.
    pub(crate) q: &'a mut [f64],
    pub(crate) p: &'a mut [f64],
}

impl<'a> Arrays<'a> {
    fn split_at(self, dofs: usize, free: usize) -> (Self, Self) {
        let (gradient, later_gradient) = self.gradient.split_at_mut(dofs);
        let (x, later_x) = self.x.split_at_mut(dofs);
        let (q, later_q) = self.q.split_at_mut(free);
        let (p, later_p) = self.p.split_at_mut(free);
        (Self { gradient, x, q, p }, Self { gradient: later_gradient, x: later_x, q: later_q, p: later_p })
    }
}

/// What a pass does: p −= kick ∂V/∂q, then q += drift M⁻¹p and x = q.
#[derive(Clone, Copy)]
pub(crate) struct Pass<'a> {
    /// Where q and p are read from; in place where none. Before a kick, x must be of this state.
    pub(crate) from: Option<&'a State>,
    /// Whose chunks are summed to the gradient first; it is known where none.
    pub(crate) sums: Option<&'a Gather>,
    /// b h, s.
    pub(crate) kick: f64,
    /// a h, s; nothing moves where it is zero.
    pub(crate) drift: f64,
}

/// What a pass found.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) enum Found {
    /// Everything that it wrote is finite.
    Sound,
    /// Something is not finite, or x was not that of the state. What was written is worth nothing.
    Unsound,
}

impl Sweep {
    pub(crate) fn new(system: &System, gather: &Gather) -> Self {
        let mut runs: Vec<Run> = Vec::new();
        for (free, &dof) in system.coordinates().free().iter().enumerate() {
            let dof = dof as usize;
            match runs.last_mut() {
                Some(run) if run.dof + run.length == dof => run.length += 1,
                _ => runs.push(Run { dof, free, length: 1 }),
            }
        }
        let block = gather.block();
        Self {
            runs,
            inverse_mass: system.free_mass().iter().map(|m| 1.0 / m).collect(),
            task: TASK.next_multiple_of(block),
            tile: TILE.next_multiple_of(block),
            parallel: gather.is_parallel(),
        }
    }

    /// 1/m of every free coordinate, 1/kg.
    pub(crate) fn inverse_mass(&self) -> &[f64] {
        &self.inverse_mass
    }

    /// Makes a pass.
    pub(crate) fn pass(&self, pass: Pass<'_>, arrays: Arrays<'_>) -> Found {
        if self.task(pass, 0, 0, arrays) { Found::Sound } else { Found::Unsound }
    }

    /// The free coordinates before coordinate `dof`.
    fn free_before(&self, dof: usize) -> usize {
        let after = self.runs.partition_point(|run| run.dof < dof);
        match after.checked_sub(1).map(|k| &self.runs[k]) {
            Some(run) => run.free + run.length.min(dof - run.dof),
            None => 0,
        }
    }

    /// Coordinates `first` and on, of which q begins with number `free`: halved until small.
    fn task(&self, pass: Pass<'_>, first: usize, free: usize, arrays: Arrays<'_>) -> bool {
        let length = arrays.x.len();
        if length <= self.task {
            return self.tiles(pass, first, free, arrays);
        }
        let middle = (length / 2).next_multiple_of(self.tile);
        let free_middle = self.free_before(first + middle);
        let (left, right) = arrays.split_at(middle, free_middle - free);
        let on_left = || self.task(pass, first, free, left);
        let on_right = || self.task(pass, first + middle, free_middle, right);
        let (a, b) = if self.parallel { rayon::join(on_left, on_right) } else { (on_left(), on_right()) };
        a && b
    }

    fn tiles(&self, pass: Pass<'_>, first: usize, first_free: usize, arrays: Arrays<'_>) -> bool {
        let Arrays { gradient, x, q, p } = arrays;
        let mut run = self.runs.partition_point(|run| run.dof + run.length <= first);
        let mut sound = true;
        for (tile, (gradient, x)) in gradient.chunks_mut(self.tile).zip(x.chunks_mut(self.tile)).enumerate() {
            let start = first + tile * self.tile;
            let end = start + x.len();
            if let Some(gather) = pass.sums {
                gather.sum_nodes(start / gather.block(), gradient);
                sound &= all_finite(gradient);
            }
            while let Some(Run { dof, free, length }) = self.runs.get(run) {
                let (low, high) = (start.max(*dof), end.min(dof + length));
                if low >= high {
                    break;
                }
                let (k, n) = (free + low - dof, high - low);
                let (q, p) = (&mut q[k - first_free..][..n], &mut p[k - first_free..][..n]);
                let x = &mut x[low - start..][..n];
                if let Some(state) = pass.from {
                    q.copy_from_slice(&state.q[k..k + n]);
                    p.copy_from_slice(&state.p[k..k + n]);
                    sound &= pass.kick == 0.0 || x == q;
                }
                for (p, g) in p.iter_mut().zip(&gradient[low - start..]) {
                    *p -= pass.kick * g;
                }
                if pass.drift != 0.0 {
                    let mass = &self.inverse_mass[k..k + n];
                    for (((q, p), x), inverse) in q.iter_mut().zip(&*p).zip(&mut *x).zip(mass) {
                        *q += pass.drift * (p * inverse);
                        *x = *q;
                    }
                }
                sound &= all_finite(p) && (pass.drift == 0.0 || all_finite(q));
                if dof + length > end {
                    break;
                }
                run += 1;
            }
        }
        sound
    }
}

/// Are all numbers finite? Eight sums of zeros side by side.
fn all_finite(values: &[f64]) -> bool {
    let (eights, rest) = values.as_chunks::<8>();
    let mut zeros = [0.0; 8];
    for eight in eights {
        for k in 0..8 {
            zeros[k] += 0.0 * eight[k];
        }
    }
    zeros.iter().chain(rest).map(|value| 0.0 * value).sum::<f64>() == 0.0
}
