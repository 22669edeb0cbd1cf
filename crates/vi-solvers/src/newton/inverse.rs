//! The inverse of A = M + cK for Newton's method: a factor, or a preconditioned matrix. It is made at one
//! configuration and used at later ones, rotated with the material.

use std::sync::Arc;

use vi_core::System;

use crate::assemble::evaluator::Evaluator;
use crate::assemble::hessian::{HessianEvaluation, is_constant};
use crate::assemble::inertia::Inertia;
use crate::assemble::live::LiveState;
use crate::error::SolverError;
use crate::linear::choice::ChosenSolver;
use crate::linear::cost::UnitCosts;
use crate::linear::matrix::SymmetricMatrix;
use crate::linear::matrix_sum::MatrixSum;
use crate::linear::model::Model;
use crate::memory::StepperMemory;
use crate::newton::free_translations::FreeTranslations;
use crate::newton::rotated_factor::RotatedFactor;
use crate::options::SolverOptions;
use crate::vectors;
use crate::work::Work;

/// The reason why a factor is made.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Reason {
    /// There was no factor, or h has changed.
    New,
    /// The old factor had become more expensive than a new one.
    Stale,
    /// The step converges too slowly.
    Slow,
    /// Full Newton iterations need one.
    Newton,
}

/// The point and the coefficient for which the current factor was computed: sufficient to compute it again.
#[derive(Debug, Clone, PartialEq)]
struct Origin {
    c: f64,
    x: Vec<f64>,
    t: f64,
    projected: bool,
    /// ẋ and ∂ẋ/∂q, if forces depend on them.
    rates: Option<(Vec<f64>, f64)>,
    /// The stencils of live terms, and the ends of the step.
    live: Option<LiveState>,
    ends: Option<[Vec<f64>; 2]>,
    /// The ends of the step, if terms act by forces over it.
    step: Option<[Vec<f64>; 2]>,
}

/// Names of the stored ends of a step, for live terms and for forces over a step.
const ENDS: [&str; 2] = ["factor.start", "factor.end"];
const STEP: [&str; 2] = ["factor.step_start", "factor.step_end"];

/// A mass M that is not lumped, and M + cK once K is known.
struct Summed {
    mass: Arc<SymmetricMatrix>,
    sum: Option<MatrixSum>,
}

pub(crate) struct Inverse {
    linear: ChosenSolver,
    /// The sum with the mass, if the mass is consistent.
    summed: Option<Summed>,
    origin: Option<Origin>,
    rotated: Option<RotatedFactor>,
    free_translations: Option<FreeTranslations>,
    /// The tangents of discrete gradients in the factor, and their factors in K.
    tangents: Vec<(f64, SymmetricMatrix)>,
    /// Whether the factor belongs to simplified equations.
    is_simplified: bool,
    /// Whether all Hessians are constant. Then a factor is never stale.
    is_linear: bool,
}

impl Inverse {
    pub(crate) fn new(system: &System, inertia: &Inertia, options: &SolverOptions) -> Self {
        let is_linear = is_constant(system);
        let rotated = if is_linear { None } else { RotatedFactor::new(system) };
        let summed = inertia.matrix().map(|mass| Summed { mass: Arc::clone(mass), sum: None });
        let free_translations = if summed.is_some() { None } else { FreeTranslations::new(system) };
        Self {
            linear: ChosenSolver::new(options, is_linear),
            summed,
            origin: None,
            rotated,
            free_translations,
            tangents: Vec::new(),
            is_simplified: false,
            is_linear,
        }
    }

    /// Returns whether K is the same everywhere.
    pub(crate) fn is_linear(&self) -> bool {
        self.is_linear
    }

    /// Forgets a factor of simplified equations: a run that continues this one could not make it again.
    pub(crate) fn forget_simplified(&mut self) {
        if self.is_simplified {
            self.origin = None;
        }
    }

    /// Returns whether there is a factor for this c.
    pub(crate) fn is_for(&self, c: f64) -> bool {
        self.origin.as_ref().is_some_and(|origin| (origin.c / c - 1.0).abs() < 1e-9)
    }

    /// Returns the costs of the chosen linear solver, or those of an explicit step before one is chosen.
    pub(crate) fn unit_costs(&self, system: &System) -> UnitCosts {
        if self.linear.is_ready() { *self.linear.costs() } else { UnitCosts::explicit(system) }
    }

    /// Returns whether another linear solver is cheaper and waits for a new matrix.
    pub(crate) fn has_cheaper_solver(&self) -> bool {
        self.linear.has_cheaper_solver()
    }

    /// Returns the cost of a factor of A, also if A is solved by conjugate gradients; `None` if it is not known.
    pub(crate) fn factor_cost(&self) -> Option<f64> {
        self.linear.factor_cost()
    }

    pub(crate) fn costs(&self) -> &UnitCosts {
        self.linear.costs()
    }

    /// Tightens the tolerance while solutions are differenced.
    pub(crate) fn tighten(&mut self, tight: bool) {
        self.linear.tighten(tight);
    }

    /// Returns an error if the step in progress is to be abandoned.
    pub(crate) fn check_interrupt(&self) -> Result<(), SolverError> {
        self.linear.check_interrupt()
    }

    /// Returns the chosen linear solver and the reason for it, once it is chosen.
    pub(crate) fn reason(&self) -> Option<&str> {
        Some(self.linear.reason()).filter(|reason| !reason.is_empty())
    }

    /// Factors A = M + cK at the last configuration of `evaluator`, starting with a Hessian of this kind. If A is not
    /// positive definite because K is indefinite, the Hessians of the terms are projected.
    pub(crate) fn make(
        &mut self,
        system: &System,
        evaluator: &mut Evaluator,
        c: f64,
        reason: Reason,
        kind: HessianEvaluation,
    ) -> Result<(), SolverError> {
        let first = self.factorize(system, evaluator, c, kind, reason);
        let projected = match first {
            Err(SolverError::NotPositiveDefinite(_))
                if !self.is_linear && kind == HessianEvaluation::Exact =>
            {
                let projected = self.factorize(system, evaluator, c, HessianEvaluation::Projected, reason);
                match projected {
                    // The projected A is positive definite by construction, so round-off caused the failure.
                    Err(SolverError::NotPositiveDefinite(_))
                        if self.linear.double("a pivot failed in single precision") =>
                    {
                        return self.make(system, evaluator, c, reason, kind);
                    }
                    other => other?,
                }
                true
            }
            Err(SolverError::NotPositiveDefinite(_))
                if kind == HessianEvaluation::Projected
                    && self.linear.double("a pivot failed in single precision") =>
            {
                return self.make(system, evaluator, c, reason, kind);
            }
            other => {
                other?;
                kind == HessianEvaluation::Projected
            }
        };
        let (x, t, rates) = (evaluator.positions().to_vec(), evaluator.time(), evaluator.velocities());
        if let Some(rotated) = &mut self.rotated {
            rotated.set_origin(evaluator.assembler(), &x);
        }
        let (live, ends) = (evaluator.live_state(), evaluator.ends().cloned());
        let step = evaluator.step().map(|ends| ends.map(<[f64]>::to_vec));
        self.origin = Some(Origin { c, x, t, projected, rates, live, ends, step });
        Ok(())
    }

    fn factorize(
        &mut self,
        system: &System,
        evaluator: &mut Evaluator,
        c: f64,
        kind: HessianEvaluation,
        reason: Reason,
    ) -> Result<(), SolverError> {
        self.origin = None;
        let count = &mut evaluator.work;
        count.factorizations += 1;
        match reason {
            Reason::New => count.factorizations_new += 1,
            Reason::Stale => count.factorizations_stale += 1,
            Reason::Slow => count.factorizations_slow += 1,
            Reason::Newton => count.factorizations_newton += 1,
        }
        if let Some(shared) = system.terms().shared().filter(|shared| shared.solves()) {
            let is_projected = kind == HessianEvaluation::Projected;
            evaluator.work.hessians += 1;
            evaluator.work.projections += u64::from(is_projected);
            let place = (evaluator.positions(), evaluator.time());
            return self.linear.make_shared((system, shared), place, c, is_projected);
        }
        let mut work = Work::default();
        let mut positions = vec![0.0; system.coordinates().free_count()];
        system.coordinates().coordinates_of(evaluator.positions(), &mut positions);
        let hessian = evaluator.hessian(system, kind)?;
        let positions = &positions[..];
        let model = match &mut self.summed {
            None => Model { mass: system.free_mass(), c, k: hessian, positions },
            Some(Summed { mass, sum }) => {
                let k = MatrixSum::of(sum, &[(1.0, mass), (c, hessian)])?;
                Model { mass: &[], c: 1.0, k, positions }
            }
        };
        let made = self.linear.make(system, model, &mut work);
        evaluator.work += work;
        // Without a pair that acts there is nothing to multiply by.
        let tangents = evaluator.last_tangents().into_iter().filter(|(_, matrix)| !matrix.is_zero());
        self.tangents = tangents.map(|(factor, matrix)| (factor, matrix.clone())).collect();
        self.is_simplified = evaluator.is_simplified();
        made
    }

    /// Computes out = S v with the part S of K that comes from the tangents of discrete gradients. Returns false, and
    /// changes nothing, if there is no such part.
    pub(crate) fn multiply_tangents(&self, v: &[f64], out: &mut [f64]) -> bool {
        if self.tangents.is_empty() {
            return false;
        }
        let mut at_origin = v.to_vec();
        if let Some(rotated) = &self.rotated {
            rotated.to_origin(&mut at_origin);
        }
        let mut product = vec![0.0; v.len()];
        out.fill(0.0);
        for (factor, matrix) in &self.tangents {
            matrix.multiply(&at_origin, &mut product);
            vectors::update(out, |k, value| *value += factor * product[k]);
        }
        if let Some(rotated) = &self.rotated {
            rotated.to_now(out);
        }
        true
    }

    /// Rotates the factor with the material to the last configuration of `evaluator`.
    pub(crate) fn rotate(&mut self, evaluator: &mut Evaluator) {
        if let (Some(rotated), Some(_)) = (&mut self.rotated, &self.origin) {
            let x = evaluator.positions().to_vec();
            rotated.rotate_to(evaluator.assembler(), &x);
        }
    }

    /// Computes v ← A⁻¹v.
    pub(crate) fn apply(&mut self, evaluator: &mut Evaluator, v: &mut [f64]) -> Result<(), SolverError> {
        let Self { linear, rotated, free_translations, .. } = self;
        evaluator.work.solves += 1;
        let resultants = free_translations.as_ref().map(|free| free.resultants(v));
        match rotated {
            Some(rotated) => {
                rotated.to_origin(v);
                linear.apply(v, &mut evaluator.work)?;
                rotated.to_now(v);
            }
            None => linear.apply(v, &mut evaluator.work)?,
        }
        if let (Some(free), Some(resultants)) = (free_translations, resultants) {
            free.correct(resultants, v);
        }
        Ok(())
    }

    /// Writes the translations of free bodies in the solution of A Δ = r to `delta`, and zero elsewhere. Returns false if no body is free.
    pub(crate) fn translate(&self, r: &[f64], delta: &mut [f64]) -> bool {
        delta.fill(0.0);
        let Some(free) = &self.free_translations else { return false };
        free.correct(free.resultants(r), delta);
        true
    }

    pub(crate) fn save(&self, memory: &mut StepperMemory) {
        if let Some(origin) = &self.origin {
            memory.arrays.push(("factor.x".into(), origin.x.clone()));
            memory.arrays.push(("factor.c_t".into(), vec![origin.c, origin.t]));
            memory.counts.push(("factor.projected".into(), u64::from(origin.projected)));
            if let Some((x_dot, rate)) = &origin.rates {
                memory.arrays.push(("factor.x_dot".into(), x_dot.clone()));
                memory.arrays.push(("factor.rate".into(), vec![*rate]));
            }
            if let Some(live) = &origin.live {
                live.save("factor.live", memory);
            }
            for ([of_start, of_end], ends) in [(ENDS, &origin.ends), (STEP, &origin.step)] {
                if let Some([start, end]) = ends {
                    memory.arrays.push((of_start.into(), start.clone()));
                    memory.arrays.push((of_end.into(), end.clone()));
                }
            }
        }
        if self.linear.is_chosen() {
            self.linear.save(memory);
        }
    }

    /// Returns the number of times that ordering and layout were computed.
    pub(crate) fn analyses(&self) -> u64 {
        self.linear.analyses()
    }

    /// Makes the factor that `memory` describes.
    pub(crate) fn restore(
        &mut self,
        system: &System,
        evaluator: &mut Evaluator,
        memory: &StepperMemory,
    ) -> Result<(), SolverError> {
        self.origin = None;
        // The current ordering and layout belong to the pattern that the forces had before.
        self.linear.forget();
        if let Some(summed) = &mut self.summed {
            summed.sum = None;
        }
        let Ok(x) = memory.array("factor.x") else {
            return if ChosenSolver::is_in(memory) { self.linear.restore(memory) } else { Ok(()) };
        };
        let &[c, t] = memory.array("factor.c_t")? else {
            return Err(SolverError::Memory { missing: "factor.c_t" });
        };
        if x.len() != system.coordinates().dof_count() {
            return Err(SolverError::Memory { missing: "factor.x" });
        }
        let projected = memory.count("factor.projected")? == 1;
        let kind = if projected { HessianEvaluation::Projected } else { HessianEvaluation::Exact };
        let rates = match (memory.array("factor.x_dot"), memory.array("factor.rate")) {
            (Ok(x_dot), Ok(&[rate])) if x_dot.len() == x.len() => Some((x_dot.to_vec(), rate)),
            _ => None,
        };
        let live = LiveState::restore("factor.live", memory, x.len());
        let [ends, step] = [ENDS, STEP].map(|names| match names.map(|name| memory.array(name)) {
            [Ok(start), Ok(end)] if start.len() == x.len() && end.len() == x.len() => {
                Some([start.to_vec(), end.to_vec()])
            }
            _ => None,
        });
        self.linear.restore(memory)?;
        evaluator.go_to_live(&live, &ends);
        evaluator.set_step(step.as_ref().map(|[start, end]| [&start[..], &end[..]]));
        evaluator.go_to_positions(x, t);
        evaluator.go_to_velocities(&rates);
        self.factorize(system, evaluator, c, kind, Reason::New)?;
        if let Some(rotated) = &mut self.rotated {
            rotated.set_origin(evaluator.assembler(), x);
        }
        self.origin = Some(Origin { c, x: x.to_vec(), t, projected, rates, live, ends, step });
        Ok(())
    }
}
