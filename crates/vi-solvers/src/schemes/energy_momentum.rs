//! The energy–momentum method: implicit midpoint with a discrete gradient G in place of ∂V/∂x at the midpoint (O.
//! Gonzalez, "Time integration and discrete Hamiltonian systems", J. Nonlinear Sci. 6 (1996) 449–467). G·Δx = ΔV
//! holds exactly, and G has no more net force or moment than ∂V/∂x.
//!
//! For every part of the body that is connected by its stencils
//! ```text
//! G = ∂V/∂x(x_m) + λ M d,   λ = Σ_s (V_s(x₁) − V_s(x₀) − ∂V_s/∂x(x_m)·Δx) / dᵀM d,
//! ```
//! Here x_m is the mean of x₀ and x₁, and d is Δx without its rigid part: it is orthogonal in M to those translations
//! and rotations about x_m under which V is invariant, so Σ M d = 0 and Σ x_m × M d = 0. The method has order 2 and is
//! symmetric. Energy, linear and angular momentum are conserved to the tolerance of the solver.
//!
//! If supports move, their coordinates are part of x_m, Δx and d like free ones. The numerator is then of third order
//! in d, and λ d vanishes with d. If instead x_m had the supports where their paths lead in the middle of the step, or
//! if d contained the free coordinates only, the numerator would be of second order besides d. Then the direction of
//! d, which is round-off if little moves, would determine the force.

use nalgebra::{Matrix3, Vector3};
use rayon::prelude::*;
use vi_core::{HessianKind, Potential, System};

use crate::index::NONE;
use crate::schemes::one_stage::rule::{Midpoint, MultiplierDirections, Rule, Trial};

/// Number of stencils evaluated at once.
const BATCH: usize = 512;
/// A part's energy defect of fewer units of its round-off counts as zero.
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
}

impl EnergyMomentum {
    pub(crate) fn new(system: &System) -> Self {
        let coordinates = system.coordinates();
        let count = coordinates.dof_count();
        let parts = Parts::new(system);
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
        }
    }

    /// Sums V_s(x₁) − V_s(x₀) − ∂V_s/∂x(x_m)·Δx over the stencils of each part.
    fn sum_defects(&mut self, trial: &Trial<'_>) {
        self.defects.fill([0.0; 2]);
        let (t, middle) = (trial.evaluator.time(), trial.evaluator.positions());
        for (term, part_of) in trial.system.potentials().iter().zip(&self.parts.of_stencils) {
            if part_of.is_empty() {
                continue;
            }
            self.excess.resize(part_of.len(), [0.0; 2]);
            let (start, end) = (&self.x_start, &self.x_end);
            let batch = |(index, excess): (usize, &mut [[f64; 2]])| {
                defects_of(term.as_ref(), index * BATCH, [start, middle, end], t, excess);
            };
            if part_of.len() > 4 * BATCH {
                self.excess.par_chunks_mut(BATCH).enumerate().for_each(batch);
            } else {
                self.excess.chunks_mut(BATCH).enumerate().for_each(batch);
            }
            for (excess, &part) in self.excess.iter().zip(part_of) {
                if part != NONE {
                    self.defects[part as usize][0] += excess[0];
                    self.defects[part as usize][1] += excess[1];
                }
            }
        }
    }
}

/// Writes the energy defects of the stencils from `first` on, and the sizes of the numbers that they are differences
/// of.
fn defects_of(term: &dyn Potential, first: usize, x: [&[f64]; 3], t: f64, out: &mut [[f64; 2]]) {
    let [start, middle, end] = x;
    let stencils = term.stencils();
    let (size, block) = (stencils.size(), stencils.block);
    let range = first..first + out.len();
    let mut before = vec![0.0; out.len()];
    let mut after = vec![0.0; out.len()];
    let mut gradients = vec![0.0; out.len() * size];
    term.energies(range.clone(), start, t, &mut before);
    term.energies(range.clone(), end, t, &mut after);
    term.gradients(range.clone(), middle, t, &mut gradients);
    for (k, stencil) in range.enumerate() {
        let mut work = 0.0;
        for (local, gradient) in gradients[k * size..(k + 1) * size].iter().enumerate() {
            let dof = stencils.of(stencil)[local / block] as usize * block + local % block;
            work += gradient * (end[dof] - start[dof]);
        }
        out[k] = [(after[k] - before[k]) - work, before[k].abs().max(after[k].abs())];
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
        Some(MultiplierDirections::Middle)
    }
    fn tolerance(&self, tolerance: f64) -> f64 {
        // The energy error is the work of the residual, which is linear in the residual; for other schemes it is
        // quadratic. With this tolerance, the default makes the errors of thousands of steps sum to less than 1e-8.
        (1e-5 * tolerance).max(1e-14)
    }
    fn has_correction(&self) -> bool {
        true
    }

    fn prescribed_work(&self) -> f64 {
        self.prescribed_work
    }

    fn takes_mean_of_ends(&self) -> bool {
        true
    }

    fn correction(&mut self, trial: &Trial<'_>, out: &mut [f64]) {
        let coordinates = trial.system.coordinates();
        let (t0, t1) = (trial.start_t, trial.start_t + trial.h);
        for (k, dq) in self.dq.iter_mut().enumerate() {
            *dq = 2.0 * trial.increment(k);
        }
        for (k, end) in out.iter_mut().enumerate() {
            *end = trial.start_q[k] + self.dq[k];
        }
        coordinates.embed(trial.start_q, t0, &mut self.x_start);
        coordinates.embed(out, t1, &mut self.x_end);
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
            let has_defect = defect.abs() > NOISE * f64::EPSILON * size;
            if has_defect && norm > RIGID * RIGID * place[part] { defect / norm } else { 0.0 }
        };
        for (k, out) in out.iter_mut().enumerate() {
            let part = self.parts.of_free[k];
            *out = if part == NONE { 0.0 } else { factor(part as usize) * mass[k] * self.dq[k] };
        }
        self.prescribed_work = prescribed.iter().map(|&(part, square)| factor(part) * square).sum();
    }
}

/// The parts of a body that are connected by stencils of terms that are not affine.
struct Parts {
    count: usize,
    /// The part of each free coordinate, or [`NONE`] if only affine terms act on it.
    of_free: Vec<u32>,
    /// The part of each stencil, per term; empty for affine terms.
    of_stencils: Vec<Vec<u32>>,
    /// For each part, the translations under which V is invariant, and whether it is invariant under rotations.
    translations: Vec<[bool; 3]>,
    rotations: Vec<bool>,
    /// Each part with each prescribed coordinate that its stencils touch; empty where no support moves.
    prescribed: Vec<(u32, u32)>,
}

impl Parts {
    fn new(system: &System) -> Self {
        let coordinates = system.coordinates();
        let mut free_of = vec![NONE; coordinates.dof_count()];
        for (k, &dof) in coordinates.free().iter().enumerate() {
            free_of[dof as usize] = k as u32;
        }
        let mut sets = Sets((0..coordinates.free_count() as u32).collect());
        let terms: Vec<_> =
            system.potentials().iter().map(|term| (term, is_internal(term.as_ref()))).collect();
        let is_affine = |term: &dyn Potential| term.traits().hessian == HessianKind::Zero;
        let dofs = |term: &dyn Potential, stencil: usize| {
            let stencils = term.stencils();
            let block = stencils.block;
            let mut dofs = Vec::new();
            for &node in stencils.of(stencil) {
                // A tied node stands for the nodes to which it is tied.
                match coordinates.combination(node * block as u32 / 3) {
                    Some(terms) => {
                        dofs.extend(terms.iter().flat_map(|&(k, _)| 3 * k as usize..3 * k as usize + 3));
                    }
                    None => dofs.extend(node as usize * block..(node as usize + 1) * block),
                }
            }
            dofs
        };
        for (term, _) in terms.iter().filter(|(term, _)| !is_affine(term.as_ref())) {
            for stencil in 0..term.stencils().count() {
                let mut free = dofs(term.as_ref(), stencil).into_iter().map(|dof| free_of[dof]);
                let mut free = free.by_ref().filter(|&k| k != NONE);
                if let Some(first) = free.next() {
                    free.for_each(|k| sets.join(first, k));
                }
            }
        }
        // Number the parts in the order of their first coordinate.
        let mut number = vec![NONE; coordinates.free_count()];
        let mut count = 0;
        let mut of_stencils = Vec::new();
        let (mut translations, mut rotations): (Vec<[bool; 3]>, Vec<bool>) = (Vec::new(), Vec::new());
        let is_moving = coordinates.is_moving();
        let mut prescribed = Vec::new();
        for (term, internal) in &terms {
            let mut of_term = Vec::new();
            if !is_affine(term.as_ref()) {
                for stencil in 0..term.stencils().count() {
                    let dofs = dofs(term.as_ref(), stencil);
                    let first = dofs.iter().map(|&dof| free_of[dof]).find(|&k| k != NONE);
                    let Some(first) = first else {
                        of_term.push(NONE);
                        continue;
                    };
                    let root = sets.root(first) as usize;
                    if number[root] == NONE {
                        number[root] = count;
                        count += 1;
                        translations.push([true; 3]);
                        rotations.push(true);
                    }
                    let part = number[root] as usize;
                    of_term.push(part as u32);
                    // A fixed coordinate, or a term that depends on absolute position, breaks the symmetry.
                    for dof in dofs {
                        let node = dof as u32 / 3;
                        let has_own_axes = coordinates.axes_of(node).is_some();
                        if free_of[dof] == NONE && is_moving {
                            prescribed.push((part as u32, dof as u32));
                        }
                        if free_of[dof] == NONE || has_own_axes {
                            rotations[part] = false;
                            // A fixed director does not change under translations.
                            if has_own_axes {
                                translations[part] = [false; 3];
                            } else if !coordinates.is_director(node) {
                                translations[part][dof % 3] = false;
                            }
                        }
                    }
                    if !internal {
                        translations[part] = [false; 3];
                        rotations[part] = false;
                    }
                }
            }
            of_stencils.push(of_term);
        }
        let of_free = (0..coordinates.free_count() as u32).map(|k| number[sets.root(k) as usize]).collect();
        prescribed.sort_unstable();
        prescribed.dedup();
        Self { count: count as usize, of_free, of_stencils, translations, rotations, prescribed }
    }

    /// Returns the sums over the free coordinates of each part.
    fn sums(&self, term: impl Fn(usize) -> f64) -> Vec<f64> {
        let mut sums = vec![0.0; self.count];
        for (k, &part) in self.of_free.iter().enumerate() {
            if part != NONE {
                sums[part as usize] += term(k);
            }
        }
        sums
    }

    /// Removes the rigid part about positions x from dq, part by part.
    fn deform(&self, system: &System, x: &[f64], dq: &mut [f64]) {
        let (mass, free) = (system.free_mass(), system.coordinates().free());
        let mut rigid = vec![Rigid::default(); self.count];
        // Directors rotate about the origin and are not translated.
        let is_director = |k: usize| system.coordinates().is_director(free[k] / 3);
        let arm_of = |rigid: &Rigid, k: usize| match is_director(k) {
            true => place(x, free[k] as usize),
            false => place(x, free[k] as usize) - rigid.centre,
        };
        let each = || {
            let parts = self.of_free.iter().enumerate().filter(|&(_, &part)| part != NONE);
            parts.map(|(k, &part)| (k, part as usize, free[k] as usize % 3))
        };
        for (k, part, axis) in each().filter(|&(k, ..)| !is_director(k)) {
            rigid[part].mass[axis] += mass[k];
            rigid[part].momentum[axis] += mass[k] * dq[k];
            rigid[part].centre[axis] += mass[k] * x[free[k] as usize];
        }
        for (part, rigid) in rigid.iter_mut().enumerate() {
            for axis in 0..3 {
                if rigid.mass[axis] > 0.0 {
                    rigid.centre[axis] /= rigid.mass[axis];
                    rigid.velocity[axis] = rigid.momentum[axis] / rigid.mass[axis];
                }
                if !self.translations[part][axis] {
                    rigid.velocity[axis] = 0.0;
                }
            }
        }
        for (k, part, axis) in each() {
            if !is_director(k) {
                dq[k] -= rigid[part].velocity[axis];
            }
            if self.rotations[part] {
                let arm = arm_of(&rigid[part], k);
                rigid[part].spin += mass[k] * dq[k] * arm.cross(&Vector3::ith(axis, 1.0));
                let direction = arm.cross(&Vector3::ith(axis, 1.0));
                rigid[part].inertia += mass[k] * direction * direction.transpose();
            }
        }
        for (part, rigid) in rigid.iter_mut().enumerate() {
            if self.rotations[part] {
                // A straight or single part has no inertia about some axes; rotations about these are no motion.
                let size = rigid.inertia.trace();
                if let Ok(inverse) = rigid.inertia.pseudo_inverse(1e-12 * size) {
                    rigid.rotation = inverse * rigid.spin;
                }
            }
        }
        for (k, part, axis) in each() {
            if self.rotations[part] {
                dq[k] -= rigid[part].rotation.cross(&arm_of(&rigid[part], k))[axis];
            }
        }
    }
}

/// The rigid part of a motion.
#[derive(Clone, Default)]
struct Rigid {
    mass: Vector3<f64>,
    momentum: Vector3<f64>,
    centre: Vector3<f64>,
    velocity: Vector3<f64>,
    spin: Vector3<f64>,
    inertia: Matrix3<f64>,
    rotation: Vector3<f64>,
}

/// Returns the position of the node to which a coordinate belongs.
fn place(x: &[f64], dof: usize) -> Vector3<f64> {
    let node = dof - dof % 3;
    Vector3::new(x[node], x[node + 1], x[node + 2])
}

/// Returns whether all stencils of a term depend on shape alone: no net force and no net moment at a configuration
/// without symmetry.
fn is_internal(term: &dyn Potential) -> bool {
    let stencils = term.stencils();
    if stencils.block != 3 || stencils.arity < 2 || stencils.count() == 0 {
        return false;
    }
    // A few stencils are enough, because all have the same form of energy.
    let highest = stencils.nodes.iter().max().map_or(0, |&node| node as usize);
    let x: Vec<f64> =
        (0..3 * (highest + 1)).map(|k| (1.7 * k as f64 + 0.3).sin() + 0.01 * k as f64).collect();
    let mut gradient = vec![0.0; stencils.size()];
    (0..stencils.count()).step_by(stencils.count().div_ceil(16)).all(|stencil| {
        term.gradients(stencil..stencil + 1, &x, 0.0, &mut gradient);
        let (mut force, mut torque, mut size) = (Vector3::zeros(), Vector3::zeros(), 0.0_f64);
        for (&node, g) in stencils.of(stencil).iter().zip(gradient.chunks_exact(3)) {
            let g = Vector3::new(g[0], g[1], g[2]);
            let at = Vector3::from_column_slice(&x[3 * node as usize..3 * node as usize + 3]);
            force += g;
            torque += at.cross(&g);
            size += g.norm() * (1.0 + at.norm());
        }
        // Outside its domain a term gives no answer; hyperelastic terms are internal.
        !size.is_finite() || force.norm() + torque.norm() <= 1e-9 * size
    })
}

/// Disjoint sets.
struct Sets(Vec<u32>);

impl Sets {
    fn root(&mut self, mut k: u32) -> u32 {
        while self.0[k as usize] != k {
            self.0[k as usize] = self.0[self.0[k as usize] as usize];
            k = self.0[k as usize];
        }
        k
    }

    fn join(&mut self, a: u32, b: u32) {
        let (a, b) = (self.root(a), self.root(b));
        self.0[a.max(b) as usize] = a.min(b);
    }
}
