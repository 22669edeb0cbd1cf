//! The energy–momentum method: implicit midpoint with a discrete gradient G in place of ∂V/∂x at the midpoint (O.
//! Gonzalez, "Time integration and discrete Hamiltonian systems", J. Nonlinear Sci. 6 (1996) 449–467). G·Δx = ΔV
//! holds exactly, and G has no more net force or moment than ∂V/∂x.
//!
//! For every part of the body that is connected by its stencils
//! ```text
//! G = ∂V/∂x(x_m) + λ M d,   λ = Σ_s (V_s(x₁) − V_s(x₀) − ∂V_s/∂x(x_m)·Δx) / dᵀM d.
//! ```
//! Terms with forces over a step of their own ([`Potential::gradients_over_step`]), as solids have, take these in place of ∂V/∂x(x_m),
//! and do not count in λ.
//!
//! Here x_m is the mean of x₀ and x₁, and d is Δx without its rigid part: it is orthogonal in M to those translations
//! and rotations about x_m under which V is invariant, so Σ M d = 0 and Σ x_m × M d = 0. The method has order 2 and is
//! symmetric. Energy, linear and angular momentum are conserved to the tolerance of the solver.
//!
//! If supports move, their coordinates are part of x_m, Δx and d like free ones. The numerator is then of third order
//! in d, and λ d vanishes with d. If instead x_m contained the prescribed positions of the supports at the middle of
//! the step, or if d contained the free coordinates only, the numerator would contain terms of second order that do not
//! vanish with d. Then the direction of d, which is round-off if little moves, would determine the force.

mod parts;
mod rigid;

use std::ops::Range;

use rayon::prelude::*;
use vi_core::{Potential, State, System};

use crate::assemble::evaluator::Evaluator;
use crate::assemble::inertia::Inertia;
use crate::error::SolverError;
use crate::index::NONE;
use crate::schemes::accounts;
use crate::schemes::one_stage::rule::{Midpoint, MultiplierDirections, Rule, Trial};
use crate::vectors;
use parts::Parts;

/// Number of stencils evaluated at once.
const BATCH: usize = 512;
/// An energy defect of a part counts as zero if it is below this many units of its round-off. A defect is of third order in d, so that
/// λ d would only be round-off then, divided by |d|: of a body at rest, it would be larger than all other forces.
const NOISE: f64 = 4.0;
/// A part whose deformation is below this fraction of its coordinates and motion counts as rigid. The defect, of
/// third order in the deformation, is then negligible, whereas the direction d would be round-off and λ unbounded.
const RIGID: f64 = 1e-12;

pub(crate) struct EnergyMomentum {
    midpoint: Midpoint,
    parts: Parts,
    x_start: Vec<f64>,
    x_end: Vec<f64>,
    dq: Vec<f64>,
    /// Change of all coordinates, in the nodes' own axes, if supports move.
    dx: Vec<f64>,
    prescribed_work: f64,
    /// The energy defect of each part and its round-off, J.
    defects: Vec<[f64; 2]>,
    excess: Vec<[f64; 2]>,
    /// Energy of each stencil at the start of the step, J; empty for affine terms.
    before: Vec<Vec<f64>>,
    /// Size of the change of each part's energy if its coordinates at the start change by their own size, J: the root of the sum of
    /// (Σ |∂V_s/∂x| |x|)² over its stencils. Times ε, it is the round-off of the energy, which for small strains is much larger than ε V.
    sensitivity: Vec<f64>,
    /// See [`Rule::corrected_energy`] and [`Rule::correction_noise`].
    corrected_energy: f64,
    correction_noise: f64,
    /// Gradient of the affine terms, if coordinates belong to one part each.
    affine: Vec<f64>,
    /// Whether each term has forces over a step.
    is_exact: Vec<bool>,
    /// The forces of these terms over the step, and their gradient at x_m, N.
    exact: [Vec<f64>; 2],
}

impl EnergyMomentum {
    pub(crate) fn new(system: &System) -> Self {
        let coordinates = system.coordinates();
        let count = coordinates.dof_count();
        let parts = Parts::new(system);
        let terms = system.potentials().iter();
        Self {
            midpoint: Midpoint::new(),
            defects: vec![[0.0; 2]; parts.count],
            parts,
            x_start: vec![0.0; count],
            x_end: vec![0.0; count],
            dq: vec![0.0; coordinates.free_count()],
            dx: Vec::new(),
            prescribed_work: 0.0,
            excess: Vec::new(),
            before: Vec::new(),
            sensitivity: Vec::new(),
            corrected_energy: 0.0,
            correction_noise: 0.0,
            affine: vec![0.0; count],
            is_exact: terms.map(|term| term.gradients_over_step(0..0, [&[]; 2], &mut [])).collect(),
            exact: [(); 2].map(|()| vec![0.0; count]),
        }
    }

    /// Evaluates the energies at the start of the step and the gradient of the affine terms, at the time t of the stage.
    fn evaluate_start(&mut self, system: &System, t: f64) {
        self.before.resize_with(system.potentials().len(), Vec::new);
        self.affine.fill(0.0);
        self.sensitivity.clear();
        self.sensitivity.resize(self.parts.count, 0.0);
        let (start, mut squares) = (&self.x_start, Vec::new());
        for (((term, part_of), before), is_exact) in
            system.potentials().iter().zip(&self.parts.of_stencils).zip(&mut self.before).zip(&self.is_exact)
        {
            if *is_exact {
                continue;
            }
            if !part_of.is_empty() {
                before.resize(part_of.len(), 0.0);
                in_batches(before, |first, out| term.energies(first..first + out.len(), start, t, out));
                squares.resize(part_of.len(), 0.0);
                in_batches(&mut squares, |first, out| {
                    squares_of_sensitivity(term.as_ref(), first, start, t, out)
                });
                for (square, part) in squares.iter().zip(part_of).filter(|(_, part)| **part != NONE) {
                    self.sensitivity[*part as usize] += square;
                }
            } else if !self.parts.share_coordinates {
                accounts::add_gradient(term.as_ref(), start, t, &mut self.affine);
            }
        }
        self.sensitivity.iter_mut().for_each(|sum| *sum = sum.sqrt());
    }

    /// Evaluates the terms that have forces over a step.
    fn evaluate_exact(&mut self, trial: &Trial<'_>) {
        let (middle, t) = (trial.evaluator.positions(), trial.evaluator.time());
        let ends = [&self.x_start[..], &self.x_end];
        self.exact.iter_mut().for_each(|sum| sum.fill(0.0));
        let mut gradients = Vec::new();
        for (term, _) in
            trial.system.potentials().iter().zip(&self.is_exact).filter(|(_, is_exact)| **is_exact)
        {
            let stencils = term.stencils();
            let size = stencils.size();
            gradients.resize(stencils.count() * size, 0.0);
            for (of_middle, sum) in [false, true].into_iter().zip(&mut self.exact) {
                in_blocks(&mut gradients, size, |range, out| {
                    if of_middle {
                        term.gradients(range, middle, t, out);
                    } else {
                        term.gradients_over_step(range, ends, out);
                    }
                });
                let gradients = gradients.chunks_exact(stencils.block);
                for (&node, gradient) in stencils.nodes.iter().zip(gradients) {
                    let dof = node as usize * stencils.block;
                    sum[dof..dof + stencils.block].iter_mut().zip(gradient).for_each(|(sum, g)| *sum += g);
                }
            }
        }
    }

    /// Sums V_s(x₁) − V_s(x₀) − ∂V_s/∂x(x_m)·Δx over the stencils of each part.
    fn sum_defects(&mut self, trial: &Trial<'_>) {
        self.defects.fill([0.0; 2]);
        let t = trial.evaluator.time();
        // The sum of ∂V_s/∂x·Δx over a part is its part of the gradient times Δx, if no coordinate belongs to two parts.
        let middle = if self.parts.share_coordinates { Some(trial.evaluator.positions()) } else { None };
        let terms = trial.system.potentials().iter().zip(&self.parts.of_stencils);
        for (((term, part_of), before), is_exact) in terms.zip(&self.before).zip(&self.is_exact) {
            if part_of.is_empty() || *is_exact {
                continue;
            }
            self.excess.resize(part_of.len(), [0.0; 2]);
            let (start, end) = (&self.x_start, &self.x_end);
            in_batches(&mut self.excess, |first, excess| {
                let before = &before[first..first + excess.len()];
                changes_of(term.as_ref(), first, before, (end, t), excess);
                if let Some(middle) = middle {
                    subtract_work(term.as_ref(), first, [start, middle, end], t, excess);
                }
            });
            for (excess, &part) in self.excess.iter().zip(part_of) {
                if part != NONE {
                    self.defects[part as usize][0] += excess[0];
                    self.defects[part as usize][1] += excess[1];
                }
            }
        }
        if middle.is_none() {
            let (gradient, free) = (trial.evaluator.gradient(), trial.system.coordinates().free());
            let work = self.parts.sums(|k| {
                let dof = free[k] as usize;
                (gradient[dof] - self.affine[dof] - self.exact[1][dof]) * self.dq[k]
            });
            self.defects.iter_mut().zip(work).for_each(|(defect, work)| defect[0] -= work);
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

/// Calls `block` with ranges of stencils and the numbers of `out` that belong to them, `size` for each.
fn in_blocks(out: &mut [f64], size: usize, block: impl Fn(Range<usize>, &mut [f64]) + Sync + Send) {
    let each = |(index, out): (usize, &mut [f64])| {
        block(index * BATCH..index * BATCH + out.len() / size, out);
    };
    if out.len() > 4 * BATCH * size {
        out.par_chunks_mut(BATCH * size).enumerate().for_each(each);
    } else {
        out.chunks_mut(BATCH * size).enumerate().for_each(each);
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

impl Rule for EnergyMomentum {
    fn name(&self) -> &'static str {
        "energy-momentum"
    }
    fn works_on_mean_velocity(&self) -> bool {
        true
    }
    fn coefficient(&self, h: f64) -> f64 {
        self.midpoint.coefficient(h)
    }
    fn time(&self) -> f64 {
        self.midpoint.time()
    }
    fn offset(&self, k: usize, v: f64, h: f64) -> f64 {
        self.midpoint.offset(k, v, h)
    }
    fn change(&self, k: usize, v: f64, w: f64, h: f64) -> (f64, f64) {
        self.midpoint.change(k, v, w, h)
    }
    fn takes_discrete_gradients(&self) -> bool {
        true
    }
    fn multiplier_directions(&self) -> Option<MultiplierDirections> {
        Some(MultiplierDirections::Stage)
    }
    fn tolerance(&self, tolerance: f64) -> f64 {
        // The energy error is the work of the residual, which is linear in the residual; for other schemes it is
        // quadratic. With this tolerance, the default makes the errors of thousands of steps sum to less than 1e-8.
        (1e-5 * tolerance).max(1e-14)
    }
    fn has_correction(&self) -> bool {
        true
    }

    fn open(
        &mut self,
        system: &System,
        evaluator: &mut Evaluator,
        _: &Inertia,
        state: &State,
        h: f64,
    ) -> Result<(), SolverError> {
        system.coordinates().embed(&state.q, state.t, &mut self.x_start);
        self.evaluate_start(system, state.t + self.time() * h);
        evaluator.work.energies += 1;
        Ok(())
    }

    fn correction_noise(&self) -> f64 {
        self.correction_noise
    }

    fn corrected_energy(&self) -> f64 {
        self.corrected_energy
    }

    fn prescribed_work(&self) -> f64 {
        self.prescribed_work
    }

    fn takes_mean_of_ends(&self) -> bool {
        true
    }

    fn correction(&mut self, trial: &Trial<'_>, out: &mut [f64]) {
        let coordinates = trial.system.coordinates();
        let t1 = trial.start_t + trial.h;
        for (k, dq) in self.dq.iter_mut().enumerate() {
            *dq = 2.0 * trial.increment(k);
        }
        for (k, end) in out.iter_mut().enumerate() {
            *end = trial.start_q[k] + self.dq[k];
        }
        coordinates.embed(out, t1, &mut self.x_end);
        self.evaluate_exact(trial);
        self.sum_defects(trial);
        let (mass, x) = (trial.system.free_mass(), trial.evaluator.positions());
        let free = coordinates.free();
        let place = self.parts.sums(|k| mass[k] * (x[free[k] as usize].powi(2) + self.dq[k] * self.dq[k]));
        // Remove the rigid part twice: after a large rigid motion, the remainder of one removal is not small compared
        // with a small deformation.
        self.parts.deform(trial.system, x, &mut self.dq);
        self.parts.deform(trial.system, x, &mut self.dq);
        let mut norms = self.parts.sums(|k| mass[k] * self.dq[k] * self.dq[k]);
        self.dx.clear();
        self.dx.extend(self.x_end.iter().zip(&self.x_start).map(|(end, start)| end - start));
        coordinates.to_own_axes(&mut self.dx);
        let all = trial.system.mass();
        let prescribed = |part: usize, dof: usize| (part, all[dof] * self.dx[dof] * self.dx[dof]);
        let prescribed: Vec<(usize, f64)> = self
            .parts
            .prescribed
            .iter()
            .map(|&(part, dof)| prescribed(part as usize, dof as usize))
            .collect();
        prescribed.iter().for_each(|&(part, square)| norms[part] += square);
        let factor = |part: usize| {
            let ([defect, size], norm) = (self.defects[part], norms[part]);
            let has_defect = defect.abs() > NOISE * f64::EPSILON * (size + self.sensitivity[part]);
            if has_defect && norm > RIGID * RIGID * place[part] { defect / norm } else { 0.0 }
        };
        let change = self.coefficient(trial.h) * f64::EPSILON;
        let corrected = || (0..self.parts.count).filter(|&part| factor(part) != 0.0);
        self.corrected_energy = corrected().map(|part| self.defects[part][0].abs()).sum();
        self.correction_noise =
            corrected().map(|part| (change * self.sensitivity[part]).powi(2) / norms[part]).sum();
        for (k, out) in out.iter_mut().enumerate() {
            let part = self.parts.of_free[k];
            *out = if part == NONE { 0.0 } else { factor(part as usize) * mass[k] * self.dq[k] };
        }
        self.prescribed_work = prescribed.iter().map(|&(part, square)| factor(part) * square).sum();
        let [over, middle] = &mut self.exact;
        vectors::update(over, |dof, over| *over -= middle[dof]);
        coordinates.pull_back(over);
        vectors::update(out, |k, out| *out += over[free[k] as usize]);
        if coordinates.is_moving() {
            self.prescribed_work += accounts::prescribed_work(trial.system, over, &self.dx);
        }
    }
}
