//! The energy–momentum method: implicit midpoint with a discrete gradient G in place of ∂V/∂x at the midpoint (O.
//! Gonzalez, "Time integration and discrete Hamiltonian systems", J. Nonlinear Sci. 6 (1996) 449–467). G·Δx = ΔV
//! holds exactly, and G has no more net force or moment than ∂V/∂x.
//!
//! For every part of the body that is connected by its stencils
//! ```text
//! G = ∂V/∂x(x_m) + λ M d,   λ = Σ_s (V_s(x₁) − V_s(x₀) − ∂V_s/∂x(x_m)·Δx) / dᵀM d.
//! ```
//! Terms with forces over a step of their own, as solids have, take these in place of ∂V/∂x(x_m) (`over_step.rs`), and do not count in λ.
//! If all other energies are quadratic, no λ is needed.
//!
//! Here x_m is the mean of x₀ and x₁, and d is Δx without its rigid part: it is orthogonal in M to those translations
//! and rotations about x_m under which V is invariant, so Σ M d = 0 and Σ x_m × M d = 0. The method has order 2 and is
//! symmetric. Energy, linear and angular momentum are conserved to the tolerance of the solver.
//!
//! If supports move, their coordinates are part of x_m, Δx and d like free ones. The numerator is then of third order
//! in d, and λ d vanishes with d. If instead x_m contained the prescribed positions of the supports at the middle of
//! the step, or if d contained the free coordinates only, the numerator would contain terms of second order that do not
//! vanish with d. Then the direction of d, which is round-off if little moves, would determine the force.

mod defects;
mod over_step;
mod parts;
mod rigid;

use vi_core::{State, System};

use crate::assemble::evaluator::Evaluator;
use crate::assemble::inertia::Inertia;
use crate::error::SolverError;
use crate::index::NONE;
use crate::schemes::accounts;
use crate::schemes::one_stage::rule::{Midpoint, MultiplierDirections, Rule, Trial};
use crate::vectors;
use defects::Defects;
use over_step::Corrections;
use parts::Parts;

/// An energy defect of a part counts as zero if it is below this many units of its round-off. A defect is of third order in d, so that
/// λ d would only be round-off then, divided by |d|: of a body at rest, it would be larger than all other forces.
const NOISE: f64 = 4.0;
/// A part whose deformation is below this fraction of its coordinates and motion counts as rigid. The defect, of
/// third order in the deformation, is then negligible, whereas the direction d would be round-off and λ unbounded.
const RIGID: f64 = 1e-12;

pub(crate) struct EnergyMomentum {
    midpoint: Midpoint,
    /// The parts of the body and the energy defects that λ corrects.
    defects: Option<(Parts, Defects)>,
    /// The terms that have forces over a step.
    corrections: Option<Corrections>,
    x_start: Vec<f64>,
    x_end: Vec<f64>,
    dq: Vec<f64>,
    /// Change of all coordinates, in the nodes' own axes, if supports move.
    dx: Vec<f64>,
    /// See the methods of [`Rule`] of these names.
    prescribed_work: f64,
    corrected_energy: f64,
    correction_noise: f64,
}

impl EnergyMomentum {
    pub(crate) fn new(system: &System) -> Self {
        let coordinates = system.coordinates();
        let count = coordinates.dof_count();
        Self {
            midpoint: Midpoint::new(),
            defects: Defects::of(system),
            corrections: Corrections::new(system),
            x_start: vec![0.0; count],
            x_end: vec![0.0; count],
            dq: vec![0.0; coordinates.free_count()],
            dx: Vec::new(),
            prescribed_work: 0.0,
            corrected_energy: 0.0,
            correction_noise: 0.0,
        }
    }

    /// Writes λ M d of the free coordinates to `out`, N: the forces that remove the energy defects of ∂V/∂x(x_m).
    fn remove_defects(&mut self, trial: &Trial<'_>, out: &mut [f64]) {
        let Some((parts, defects)) = &mut self.defects else { return };
        defects.sum(trial, parts, [&self.x_start, &self.x_end], &self.dq);
        let (mass, x) = (trial.system.free_mass(), trial.evaluator.positions());
        let free = trial.system.coordinates().free();
        let place = parts.sums(|k| mass[k] * (x[free[k] as usize].powi(2) + self.dq[k] * self.dq[k]));
        // Remove the rigid part twice: after a large rigid motion, the remainder of one removal is not small compared
        // with a small deformation.
        parts.deform(trial.system, x, &mut self.dq);
        parts.deform(trial.system, x, &mut self.dq);
        let mut norms = parts.sums(|k| mass[k] * self.dq[k] * self.dq[k]);
        let (all, dx) = (trial.system.mass(), &self.dx);
        let square = |dof: u32| all[dof as usize] * dx[dof as usize] * dx[dof as usize];
        for &(part, dof) in &parts.prescribed {
            norms[part as usize] += square(dof);
        }
        let factor = |part: usize| {
            let ([defect, size], norm) = (defects.of_parts[part], norms[part]);
            let has_defect = defect.abs() > NOISE * f64::EPSILON * (size + defects.sensitivity[part]);
            if has_defect && norm > RIGID * RIGID * place[part] { defect / norm } else { 0.0 }
        };
        let change = self.midpoint.coefficient(trial.h) * f64::EPSILON;
        let corrected = || (0..parts.count).filter(|&part| factor(part) != 0.0);
        self.corrected_energy = corrected().map(|part| defects.of_parts[part][0].abs()).sum();
        self.correction_noise =
            corrected().map(|part| (change * defects.sensitivity[part]).powi(2) / norms[part]).sum();
        for (k, out) in out.iter_mut().enumerate() {
            let part = parts.of_free[k];
            *out = if part == NONE { 0.0 } else { factor(part as usize) * mass[k] * self.dq[k] };
        }
        let works = parts.prescribed.iter().map(|&(part, dof)| factor(part as usize) * square(dof));
        self.prescribed_work = works.sum();
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
        self.corrections.is_some() || self.defects.is_some()
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
        if let Some((parts, defects)) = &mut self.defects {
            defects.evaluate_start(system, parts, &self.x_start, state.t + self.midpoint.time() * h);
            evaluator.work.energies += 1;
        }
        Ok(())
    }

    fn step(&self) -> Option<[&[f64]; 2]> {
        self.corrections.as_ref().map(|_| [&self.x_start[..], &self.x_end])
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
        for (k, (end, dq)) in out.iter_mut().zip(&mut self.dq).enumerate() {
            *dq = 2.0 * trial.increment(k);
            *end = trial.start_q[k] + *dq;
        }
        coordinates.embed(out, trial.start_t + trial.h, &mut self.x_end);
        out.fill(0.0);
        self.prescribed_work = 0.0;
        self.dx.clear();
        if coordinates.is_moving() {
            self.dx.extend(self.x_end.iter().zip(&self.x_start).map(|(end, start)| end - start));
            coordinates.to_own_axes(&mut self.dx);
        }
        self.remove_defects(trial, out);
        let (ends, free) = ([&self.x_start[..], &self.x_end], coordinates.free());
        if let Some(corrections) = &mut self.corrections {
            let over = corrections.evaluate(ends, trial.evaluator.time());
            vectors::update(out, |k, out| *out += over[free[k] as usize]);
            if coordinates.is_moving() {
                self.prescribed_work += accounts::prescribed_work(trial.system, over, &self.dx);
            }
        }
    }
}
