//! The energy defects of the parts of a body: by how much the work of the gradients in the middle of a step misses the change of energy.

use rayon::prelude::*;
use vi_core::{HessianKind, Potential, System};

use super::over_step::has_forces_over_step;
use super::parts::Parts;
use crate::index::NONE;
use crate::schemes::accounts;
use crate::schemes::one_stage::rule::Trial;

/// Number of stencils evaluated at once.
const BATCH: usize = 512;

/// The energy defects of the terms that have no forces over a step of their own.
pub(super) struct Defects {
    /// The energy defect of each part and its round-off, J.
    pub(super) of_parts: Vec<[f64; 2]>,
    /// Size of the change of each part's energy if its coordinates at the start change by their own size, J: the root of the sum of
    /// (Σ |∂V_s/∂x| |x|)² over its stencils. Times ε, it is the round-off of the energy, which for small strains is much larger than ε V.
    pub(super) sensitivity: Vec<f64>,
    excess: Vec<[f64; 2]>,
    /// Whether each term has a defect.
    has_defect: Vec<bool>,
    /// Energy of each stencil at the start of the step, J; empty for terms without a defect.
    before: Vec<Vec<f64>>,
    /// Gradient of the affine terms, if `sums_works` is false.
    affine: Vec<f64>,
    /// Whether works are summed stencil by stencil. If not, the work of a part is its part of the gradient times Δx.
    sums_works: bool,
}

impl Defects {
    /// Returns the parts of a body and their defects; `None` if no term has a defect.
    pub(super) fn of(system: &System) -> Option<(Parts, Self)> {
        let terms = system.potentials();
        let is_exact: Vec<bool> = terms.iter().map(|term| has_forces_over_step(term.as_ref())).collect();
        let kinds = || terms.iter().map(|term| term.traits().hessian).zip(&is_exact);
        // The gradient of a quadratic energy in the middle of a step is exact.
        if !kinds().any(|(kind, is_exact)| kind == HessianKind::Varying && !is_exact) {
            return None;
        }
        let parts = Parts::new(system);
        let has_defect = kinds().map(|(kind, is_exact)| kind != HessianKind::Zero && !is_exact).collect();
        let sums_works = parts.share_coordinates || is_exact.contains(&true);
        let defects = Self {
            of_parts: vec![[0.0; 2]; parts.count],
            sensitivity: Vec::new(),
            excess: Vec::new(),
            before: vec![Vec::new(); terms.len()],
            affine: vec![0.0; system.coordinates().dof_count()],
            has_defect,
            sums_works,
        };
        Some((parts, defects))
    }

    /// Evaluates the energies at the start of the step and the gradient of the affine terms, at the time t of the stage.
    pub(super) fn evaluate_start(&mut self, system: &System, parts: &Parts, start: &[f64], t: f64) {
        self.affine.fill(0.0);
        self.sensitivity.clear();
        self.sensitivity.resize(parts.count, 0.0);
        let mut squares = Vec::new();
        let terms = system.potentials().iter().zip(&parts.of_stencils);
        for (((term, part_of), before), has_defect) in terms.zip(&mut self.before).zip(&self.has_defect) {
            if *has_defect {
                before.resize(part_of.len(), 0.0);
                in_batches(before, |first, out| term.energies(first..first + out.len(), start, t, out));
                squares.resize(part_of.len(), 0.0);
                in_batches(&mut squares, |first, out| {
                    squares_of_sensitivity(term.as_ref(), first, start, t, out)
                });
                for (square, part) in squares.iter().zip(part_of).filter(|(_, part)| **part != NONE) {
                    self.sensitivity[*part as usize] += square;
                }
            } else if !self.sums_works {
                accounts::add_gradient(term.as_ref(), start, t, &mut self.affine);
            }
        }
        self.sensitivity.iter_mut().for_each(|sum| *sum = sum.sqrt());
    }

    /// Sums V_s(x₁) − V_s(x₀) − ∂V_s/∂x(x_m)·Δx over the stencils of each part. `ends` hold x₀ and x₁, and `dq` is Δx of the free
    /// coordinates.
    pub(super) fn sum(&mut self, trial: &Trial<'_>, parts: &Parts, [start, end]: [&[f64]; 2], dq: &[f64]) {
        self.of_parts.fill([0.0; 2]);
        let t = trial.evaluator.time();
        let middle = if self.sums_works { Some(trial.evaluator.positions()) } else { None };
        let terms = trial.system.potentials().iter().zip(&parts.of_stencils);
        for (((term, part_of), before), has_defect) in terms.zip(&self.before).zip(&self.has_defect) {
            if !has_defect {
                continue;
            }
            self.excess.resize(part_of.len(), [0.0; 2]);
            in_batches(&mut self.excess, |first, excess| {
                let before = &before[first..first + excess.len()];
                changes_of(term.as_ref(), first, before, (end, t), excess);
                if let Some(middle) = middle {
                    subtract_work(term.as_ref(), first, [start, middle, end], t, excess);
                }
            });
            for (excess, &part) in self.excess.iter().zip(part_of) {
                if part != NONE {
                    self.of_parts[part as usize][0] += excess[0];
                    self.of_parts[part as usize][1] += excess[1];
                }
            }
        }
        if middle.is_none() {
            let (gradient, free) = (trial.evaluator.gradient(), trial.system.coordinates().free());
            let work = parts.sums(|k| {
                let dof = free[k] as usize;
                (gradient[dof] - self.affine[dof]) * dq[k]
            });
            self.of_parts.iter_mut().zip(work).for_each(|(defect, work)| defect[0] -= work);
        }
    }
}

/// Calls `batch` with consecutive parts of `out` and the index of the first entry of each.
fn in_batches<T: Send>(out: &mut [T], batch: impl Fn(usize, &mut [T]) + Sync + Send) {
    let each = |(index, out): (usize, &mut [T])| batch(index * BATCH, out);
    if out.len() > 4 * BATCH {
        out.par_chunks_mut(BATCH).enumerate().for_each(each);
    } else {
        out.chunks_mut(BATCH).enumerate().for_each(each);
    }
}

/// Writes the changes of energy of the stencils from `first` on, from `before` to that at the positions of `end` and
/// its time, and the sizes of the numbers that they are differences of.
fn changes_of(
    term: &dyn Potential,
    first: usize,
    before: &[f64],
    (end, t): (&[f64], f64),
    out: &mut [[f64; 2]],
) {
    let mut after = vec![0.0; out.len()];
    term.energies(first..first + out.len(), end, t, &mut after);
    for ((out, &before), &after) in out.iter_mut().zip(before).zip(&after) {
        *out = [after - before, before.abs().max(after.abs())];
    }
}

/// Writes (Σ |∂V_s/∂x| |x|)² of the stencils from `first` on.
fn squares_of_sensitivity(term: &dyn Potential, first: usize, x: &[f64], t: f64, out: &mut [f64]) {
    let stencils = term.stencils();
    let (size, block) = (stencils.size(), stencils.block);
    let range = first..first + out.len();
    let mut gradients = vec![0.0; out.len() * size];
    term.gradients(range.clone(), x, t, &mut gradients);
    for ((stencil, gradients), out) in range.zip(gradients.chunks_exact(size)).zip(out) {
        let nodes = stencils.of(stencil);
        let sizes = gradients.iter().enumerate().map(|(local, gradient)| {
            (gradient * x[nodes[local / block] as usize * block + local % block]).abs()
        });
        *out = sizes.sum::<f64>().powi(2);
    }
}

/// Subtracts the work ∂V_s/∂x(x_m)·Δx of each stencil from `first` on.
fn subtract_work(term: &dyn Potential, first: usize, x: [&[f64]; 3], t: f64, out: &mut [[f64; 2]]) {
    let [start, middle, end] = x;
    let stencils = term.stencils();
    let (size, block) = (stencils.size(), stencils.block);
    let range = first..first + out.len();
    let mut gradients = vec![0.0; out.len() * size];
    term.gradients(range.clone(), middle, t, &mut gradients);
    for (k, stencil) in range.enumerate() {
        let nodes = stencils.of(stencil);
        for (local, gradient) in gradients[k * size..(k + 1) * size].iter().enumerate() {
            let dof = nodes[local / block] as usize * block + local % block;
            out[k][0] -= gradient * (end[dof] - start[dof]);
        }
    }
}
