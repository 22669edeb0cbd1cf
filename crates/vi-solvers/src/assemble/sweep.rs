//! Makes one pass over the coordinates of a body for everything that an explicit step does to them: the nodal sums of
//! a gradient, a kick, a drift and the new positions. It works on cache-sized pieces, on all cores.

use pulp::{Arch, Simd, WithSimd};
use vi_core::{State, System};

use crate::assemble::gather::Gather;

/// Number of coordinates per task.
const TASK: usize = 2048;
/// Number of coordinates that are processed together, so that each part of the pass finds the output of the previous
/// one in cache.
const TILE: usize = 384;
/// Number of coordinates by which the block size of a system may lengthen a tile.
const MARGIN: usize = 3;

/// A run of consecutive free coordinates.
struct Run {
    /// Index of the first in x.
    dof: usize,
    /// Index of the first in q.
    free: usize,
    length: usize,
}

/// The maps of the passes over a system.
pub(crate) struct Sweep {
    runs: Vec<Run>,
    /// 1/m of every free coordinate, 1/kg.
    inverse_mass: Vec<f64>,
    /// Number of coordinates per task and per tile, and the multiple at which tasks are cut; all contain whole nodes.
    task: usize,
    tile: usize,
    grain: usize,
    parallel: bool,
    arch: Arch,
}

/// The arrays that a pass changes, from coordinate `first` on.
pub(crate) struct Arrays<'a> {
    /// ∂V/∂x of all coordinates. A gradient that the pass itself sums before it drifts is not stored here.
    pub(crate) gradient: &'a mut [f64],
    /// x of all coordinates, or v if the pass sets it.
    pub(crate) x: &'a mut [f64],
    /// q of the free coordinates; written by a pass that does not drift.
    pub(crate) q: &'a mut [f64],
    /// p of the free coordinates.
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

/// The operations of a pass: p −= closing ∂V/∂q, then p −= kick ∂V/∂q, then x += drift M⁻¹p at the free coordinates.
#[derive(Clone, Copy)]
pub(crate) struct Pass<'a> {
    /// If set, read q and p from this state; otherwise update x and p in place. Before a kick, x must be that of this
    /// state.
    pub(crate) from: Option<&'a State>,
    /// If set, first sum these chunks into the gradient; otherwise the gradient is already valid.
    pub(crate) sums: Option<&'a Gather>,
    /// b h of the kick that ends the previous step, s; no kick if it is zero.
    pub(crate) closing: f64,
    /// b h of the kick before the drift, s.
    pub(crate) kick: f64,
    /// a h of the drift, s; no drift if it is zero.
    pub(crate) drift: f64,
    /// If set, x = drift M⁻¹p instead of x += drift M⁻¹p.
    pub(crate) sets: bool,
}

impl Sweep {
    /// Prepares passes in which `gather` sums the gradient; without it only 1/m is used.
    pub(crate) fn new(system: &System, gather: Option<&Gather>) -> Self {
        let mut runs: Vec<Run> = Vec::new();
        for (free, &dof) in system.coordinates().free().iter().enumerate().filter(|_| gather.is_some()) {
            let dof = dof as usize;
            match runs.last_mut() {
                Some(run) if run.dof + run.length == dof => run.length += 1,
                _ => runs.push(Run { dof, free, length: 1 }),
            }
        }
        let block = gather.map_or(1, Gather::block);
        Self {
            runs,
            inverse_mass: system.free_mass().iter().map(|m| 1.0 / m).collect(),
            task: TASK.next_multiple_of(block),
            tile: TILE.next_multiple_of(block),
            // Cut at multiples of whole vectors, near the middle, so that the halves of the nodes match those of the
            // elements.
            grain: 8 * block,
            parallel: gather.is_some_and(Gather::is_parallel),
            arch: Arch::new(),
        }
    }

    /// Returns 1/m of every free coordinate, 1/kg.
    pub(crate) fn inverse_mass(&self) -> &[f64] {
        &self.inverse_mass
    }

    /// Makes a pass. Returns false if a number that it wrote is not finite, or if x was not that of the state; then
    /// the arrays must not be used.
    pub(crate) fn pass(&self, pass: Pass<'_>, arrays: Arrays<'_>) -> bool {
        self.task(pass, 0, 0, arrays)
    }

    /// Returns the number of free coordinates before coordinate `dof`.
    fn free_before(&self, dof: usize) -> usize {
        let after = self.runs.partition_point(|run| run.dof < dof);
        match after.checked_sub(1).map(|k| &self.runs[k]) {
            Some(run) => run.free + run.length.min(dof - run.dof),
            None => 0,
        }
    }

    /// Processes the coordinates from `first` on, whose first free coordinate is number `free`; halves them until
    /// they are few enough.
    fn task(&self, pass: Pass<'_>, first: usize, free: usize, arrays: Arrays<'_>) -> bool {
        let length = arrays.x.len();
        if length <= self.task {
            return self.tiles(pass, first, free, arrays);
        }
        let middle = (length / 2).next_multiple_of(self.grain);
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
        let mut is_sound = true;
        // Sums that nobody reads after the drift stay in cache.
        let mut passing = [0.0; TILE + MARGIN];
        for (tile, (gradient, x)) in gradient.chunks_mut(self.tile).zip(x.chunks_mut(self.tile)).enumerate() {
            let start = first + tile * self.tile;
            let end = start + x.len();
            let gradient = match pass.sums {
                Some(_) if pass.drift != 0.0 => &mut passing[..x.len()],
                _ => gradient,
            };
            if let Some(gather) = pass.sums {
                gather.sum_nodes(start / gather.block(), gradient);
                is_sound &= self.arch.dispatch(AreFinite(gradient));
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
                    let q = &state.q[k..k + n];
                    p.copy_from_slice(&state.p[k..k + n]);
                    is_sound &= pass.kick == 0.0 || self.arch.dispatch(AreEqual { a: x, b: q });
                    x.copy_from_slice(q);
                }
                let (kick, gradient) = (pass.kick, &gradient[low - start..][..n]);
                if pass.closing != 0.0 {
                    is_sound &= self.arch.dispatch(KickRun { kick: pass.closing, gradient, p });
                }
                is_sound &= if pass.drift == 0.0 {
                    q.copy_from_slice(x);
                    self.arch.dispatch(KickRun { kick, gradient, p })
                } else {
                    let inverse_mass = &self.inverse_mass[k..k + n];
                    if pass.sets {
                        x.fill(0.0);
                    }
                    let drift = pass.drift;
                    self.arch.dispatch(KickDriftRun { kick, drift, gradient, inverse_mass, p, x })
                };
                if dof + length > end {
                    break;
                }
                run += 1;
            }
        }
        is_sound
    }
}

// Operations on the coordinates of a run with the vector instructions of the machine. Each also sums 0 · (result),
// which is zero if all numbers are finite. No product is fused with a sum, so that every machine gives the same bits.

/// Returns whether all numbers are finite.
struct AreFinite<'a>(&'a [f64]);

impl WithSimd for AreFinite<'_> {
    type Output = bool;
    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> bool {
        let (whole, rest) = S::as_simd_f64s(self.0);
        let zero = simd.splat_f64s(0.0);
        let mut zeros = zero;
        for value in whole {
            zeros = simd.add_f64s(zeros, simd.mul_f64s(zero, *value));
        }
        let mut sum = simd.reduce_sum_f64s(zeros);
        for value in rest {
            sum += 0.0 * value;
        }
        sum == 0.0
    }
}

/// Returns whether a equals b and both are finite.
struct AreEqual<'a> {
    a: &'a [f64],
    b: &'a [f64],
}

impl WithSimd for AreEqual<'_> {
    type Output = bool;
    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> bool {
        let ((a, a_rest), (b, b_rest)) = (S::as_simd_f64s(self.a), S::as_simd_f64s(self.b));
        let mut distances = simd.splat_f64s(0.0);
        for (a, b) in a.iter().zip(b) {
            distances = simd.add_f64s(distances, simd.abs_f64s(simd.sub_f64s(*a, *b)));
        }
        let mut sum = simd.reduce_sum_f64s(distances);
        for (a, b) in a_rest.iter().zip(b_rest) {
            sum += (a - b).abs();
        }
        sum == 0.0
    }
}

/// Computes p −= kick g; returns whether p is finite.
struct KickRun<'a> {
    kick: f64,
    gradient: &'a [f64],
    p: &'a mut [f64],
}

impl WithSimd for KickRun<'_> {
    type Output = bool;
    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> bool {
        let Self { kick, gradient, p } = self;
        let ((g, g_rest), (p, p_rest)) = (S::as_simd_f64s(gradient), S::as_mut_simd_f64s(p));
        let (zero, b) = (simd.splat_f64s(0.0), simd.splat_f64s(kick));
        let mut zeros = zero;
        for (p, g) in p.iter_mut().zip(g) {
            *p = simd.sub_f64s(*p, simd.mul_f64s(b, *g));
            zeros = simd.add_f64s(zeros, simd.mul_f64s(zero, *p));
        }
        let mut sum = simd.reduce_sum_f64s(zeros);
        for (p, g) in p_rest.iter_mut().zip(g_rest) {
            *p -= kick * g;
            sum += 0.0 * *p;
        }
        sum == 0.0
    }
}

/// Computes p −= kick g, then x += drift p/m; returns whether p and x are finite.
struct KickDriftRun<'a> {
    kick: f64,
    drift: f64,
    gradient: &'a [f64],
    inverse_mass: &'a [f64],
    p: &'a mut [f64],
    x: &'a mut [f64],
}

impl WithSimd for KickDriftRun<'_> {
    type Output = bool;
    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> bool {
        let Self { kick, drift, gradient, inverse_mass, p, x } = self;
        let ((g, g_rest), (m, m_rest)) = (S::as_simd_f64s(gradient), S::as_simd_f64s(inverse_mass));
        let ((p, p_rest), (x, x_rest)) = (S::as_mut_simd_f64s(p), S::as_mut_simd_f64s(x));
        let (zero, b, a) = (simd.splat_f64s(0.0), simd.splat_f64s(kick), simd.splat_f64s(drift));
        let mut zeros = zero;
        let length = p.len();
        let (g, m, x) = (&g[..length], &m[..length], &mut x[..length]);
        for k in 0..length {
            let kicked = simd.sub_f64s(p[k], simd.mul_f64s(b, g[k]));
            let moved = simd.add_f64s(x[k], simd.mul_f64s(a, simd.mul_f64s(kicked, m[k])));
            (p[k], x[k]) = (kicked, moved);
            zeros = simd.add_f64s(zeros, simd.mul_f64s(zero, simd.add_f64s(kicked, moved)));
        }
        let mut sum = simd.reduce_sum_f64s(zeros);
        for k in 0..p_rest.len() {
            p_rest[k] -= kick * g_rest[k];
            x_rest[k] += drift * (p_rest[k] * m_rest[k]);
            sum += 0.0 * (p_rest[k] + x_rest[k]);
        }
        sum == 0.0
    }
}
