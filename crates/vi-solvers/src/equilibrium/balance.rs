//! The equilibrium of a body at a load factor: residual, energy, tangent, and solves with it.

use std::cell::OnceCell;

use vi_core::{State, StepEnergy, System};

use crate::assemble::assembler::Assembler;
use crate::assemble::force_sum::ForceSum;
use crate::assemble::hessian::{HessianEvaluation, is_constant};
use crate::equilibrium::bond::Bond;
use crate::equilibrium::circulation::circulatory;
use crate::equilibrium::friction::{Friction, Rubbed};
use crate::equilibrium::tangent_solver::{ConstantTangent, Demand, TangentSolver};
use crate::equilibrium::work_done::WorkDone;
use crate::error::{NotPositiveDefinite, SolverError};
use crate::interrupt::Interrupt;
use crate::linear::matrix::SymmetricMatrix;
use crate::linear::matrix_sum::MatrixSum;
use crate::linear::minres::minimal_residual;
use crate::newton::free_translations::FreeTranslations;
use crate::options::LinearSolver;
use crate::vectors;
use crate::work::Work;

/// r(q, t) = ∂V/∂q − f(x, 0, t), its tangent K, and a solver for K + σM.
pub(crate) struct Balance<'a> {
    pub(crate) system: &'a System,
    pub(super) assembler: Assembler,
    forces: Option<ForceSum>,
    sum: Option<MatrixSum>,
    linear: LinearSolver,
    solver: Option<TangentSolver>,
    /// Whether K is the same everywhere, apart from friction.
    pub(super) is_linear: bool,
    /// Whether `solver` is a factor of that K.
    has_constant: bool,
    /// Whether a run that this one continues has made that factor. Then it is not counted again.
    was_made: bool,
    x: Vec<f64>,
    t: f64,
    still: Vec<f64>,
    gradient: Vec<f64>,
    shifted_mass: Vec<f64>,
    /// K of the last factorisation that had a shift.
    unshifted: Option<SymmetricMatrix>,
    /// Diagonal of the K of the last factorisation, N/m.
    pub(super) diagonal: Vec<f64>,
    /// Constant forces that are subtracted from the residual, N; empty for none.
    pub(crate) held: Vec<f64>,
    pub(crate) friction: Option<Friction>,
    /// A bond of the coordinates, which is part of V.
    pub(super) bond: Option<Bond>,
    /// The translations of bodies that nothing holds, once they are asked for.
    pub(super) translations: OnceCell<Option<FreeTranslations>>,
    /// The work of supports and loads since the search began.
    done: Option<WorkDone>,
    pub(crate) work: Work,
    /// Looked at before every factorisation and solve.
    pub(crate) interrupt: Interrupt,
}

impl<'a> Balance<'a> {
    pub(crate) fn new(system: &'a System, linear: LinearSolver, interrupt: &Interrupt) -> Self {
        let count = system.coordinates().dof_count();
        Self {
            system,
            assembler: Assembler::new(system),
            forces: ForceSum::new(system),
            sum: None,
            linear,
            solver: None,
            is_linear: is_constant(system),
            has_constant: false,
            was_made: false,
            x: vec![0.0; count],
            t: 0.0,
            still: vec![0.0; count],
            gradient: vec![0.0; count],
            shifted_mass: vec![0.0; system.coordinates().free_count()],
            unshifted: None,
            diagonal: vec![0.0; system.coordinates().free_count()],
            held: Vec::new(),
            friction: None,
            bond: None,
            translations: OnceCell::new(),
            done: None,
            work: Work::default(),
            interrupt: interrupt.clone(),
        }
    }

    /// Begins at the equilibrium `from`: sums work from there on, and adds the friction that acts from there on.
    /// `rubbed` is the state of friction that earlier equilibria left.
    ///
    /// # Errors
    /// Returns an error if the forces of friction cannot be summed.
    pub(crate) fn begin(&mut self, from: &State, rubbed: &Rubbed) -> Result<(), SolverError> {
        self.go_to(&from.q, from.t);
        self.friction = Friction::new(self.system, &self.assembler, &self.x, rubbed)?;
        self.begin_work(from);
        Ok(())
    }

    /// Takes over the factor that an earlier search made of the same K; or, if `was_made`, makes it without counting it.
    pub(super) fn take_over(&mut self, tangent: Option<ConstantTangent>, was_made: bool) {
        self.was_made = was_made && tangent.is_none();
        if let Some(ConstantTangent { solver, diagonal }) = tangent {
            (self.solver, self.diagonal, self.has_constant) = (Some(solver), diagonal, true);
        }
    }

    /// Returns the factor for later searches, if K is the same everywhere.
    pub(super) fn hand_over(&mut self) -> Option<ConstantTangent> {
        let solver = self.solver.take_if(|_| self.has_constant)?;
        self.has_constant = false;
        Some(ConstantTangent { solver, diagonal: std::mem::take(&mut self.diagonal) })
    }

    /// Begins to sum work at the equilibrium `from`.
    pub(crate) fn begin_work(&mut self, from: &State) {
        self.go_to(&from.q, from.t);
        let forces = self.balance_forces();
        self.done = Some(WorkDone::begin(&self.x, from.t, &self.gradient, forces));
    }

    /// Writes ∂V/∂x − f at the current configuration to `gradient`, N, where f includes friction. Returns f without
    /// friction; empty if there are no such forces.
    fn balance_forces(&mut self) -> Vec<f64> {
        let Self { assembler, forces, friction, gradient, x, still, t, .. } = self;
        assembler.gradient(x, *t, gradient);
        let mut own = Vec::new();
        if let Some(forces) = forces {
            forces.evaluate(x, still, *t);
            own.extend((0..x.len()).map(|dof| forces.total(dof)));
            gradient.iter_mut().zip(&own).for_each(|(gradient, force)| *gradient -= force);
        }
        if let Some(friction) = friction {
            friction.add_gradient(self.system.coordinates(), x, gradient);
        }
        own
    }

    /// Returns the work of prescribed motion and of forces since the begin, J.
    pub(crate) fn work_done(&self) -> StepEnergy {
        self.done.as_ref().map(WorkDone::energy).unwrap_or_default()
    }

    /// Accepts the equilibrium (q, t): adds the work up to it, and lets friction act from it to the next one.
    ///
    /// # Errors
    /// Returns an error if the forces of friction cannot be summed.
    pub(crate) fn accept(&mut self, q: &[f64], t: f64) -> Result<(), SolverError> {
        self.go_to(q, t);
        let forces = self.balance_forces();
        if let Some(done) = &mut self.done {
            done.go_to(self.system, (&self.x, t), &self.gradient, forces);
        }
        self.friction.as_mut().map_or(Ok(()), |friction| friction.accept(&self.x, t))
    }

    /// Returns whether all forces have a potential, so that equilibria are stationary points of V.
    pub(crate) fn is_conservative(&self) -> bool {
        self.forces.is_none() && self.friction.as_ref().is_none_or(Friction::is_lagged)
    }

    /// Returns whether all forces but friction have a potential.
    pub(crate) fn only_friction_dissipates(&self) -> bool {
        self.forces.is_none()
    }

    /// Returns whether the stability of an equilibrium is that of the symmetric part of K: all forces but damping have a potential.
    pub(crate) fn judges_stability(&self) -> bool {
        circulatory(self.system).is_none()
    }

    pub(super) fn go_to(&mut self, q: &[f64], t: f64) {
        self.system.coordinates().embed(q, t, &mut self.x);
        self.t = t;
    }

    /// Writes r(q, t), N.
    ///
    /// # Errors
    /// Returns [`SolverError::Term`] or [`SolverError::NotFinite`] outside the domain of a term.
    pub(crate) fn residual(&mut self, q: &[f64], t: f64, out: &mut [f64]) -> Result<(), SolverError> {
        self.go_to(q, t);
        self.work.gradients += 1;
        self.assembler.gradient(&self.x, t, &mut self.gradient);
        self.work.searches = self.assembler.work().live_renewals;
        if let Some(forces) = &mut self.forces {
            forces.evaluate(&self.x, &self.still, t);
            for (dof, gradient) in self.gradient.iter_mut().enumerate() {
                *gradient -= forces.total(dof);
            }
        }
        if let Some(friction) = &mut self.friction {
            friction.add_gradient(self.system.coordinates(), &self.x, &mut self.gradient);
        }
        let gradient = &self.gradient;
        if !vectors::all_finite(gradient) {
            return Err(match self.assembler.fault(&self.x, t) {
                Some(term) => SolverError::Term { term, at_start: false },
                None => {
                    let dof = gradient.iter().position(|g| !g.is_finite()).unwrap_or(0);
                    SolverError::NotFinite { what: "force", dof, at_start: false }
                }
            });
        }
        self.system.coordinates().restrict(&self.gradient, out);
        out.iter_mut().zip(&self.held).for_each(|(out, held)| *out -= held);
        if let Some(bond) = &self.bond {
            bond.add_gradient(self.system.free_mass(), q, out);
        }
        Ok(())
    }

    /// Returns whether the terms limit the length of steps.
    pub(crate) fn limits_steps(&self) -> bool {
        self.assembler.limits_steps()
    }

    /// Returns the largest fraction of the change `dq` from (q, t) that the terms allow, in (0, 1]. Of a change that is longer than bodies
    /// may move, only a part is examined.
    pub(crate) fn largest_step(&mut self, q: &[f64], t: f64, dq: &[f64]) -> f64 {
        if !self.assembler.limits_steps() {
            return 1.0;
        }
        self.go_to(q, t);
        let part = self.sensible_part(dq);
        let dq: Vec<f64> = dq.iter().map(|dq| part * dq).collect();
        let mut dx = vec![0.0; self.x.len()];
        self.system.coordinates().embed_change(&dq, &mut dx);
        part * self.assembler.largest_step(&self.x, &dx, None)
    }

    /// Returns V(q, t), J; infinite outside the domain of a term.
    pub(crate) fn energy(&mut self, q: &[f64], t: f64) -> f64 {
        self.go_to(q, t);
        self.work.energies += 1;
        let held = vectors::sum(self.held.len(), |k| self.held[k] * q[k]);
        let friction = self.friction.as_mut().map_or(0.0, |friction| friction.energy(&self.x));
        let bond = self.bond.as_ref().map_or(0.0, |bond| bond.energy(self.system.free_mass(), q));
        self.assembler.energies(&self.x, t).total() - held + friction + bond
    }

    /// Returns whether V at (`to`, t) is at most that at (`from`, t); true if forces have no potential. A prediction by an
    /// almost singular tangent goes much too far, and a solve from there has no scale of energy.
    pub(crate) fn lowers_energy(&mut self, from: &[f64], to: &[f64], t: f64) -> bool {
        if self.check_distance(from, to, t).is_err() {
            return false;
        }
        if !self.is_conservative() {
            return true;
        }
        let before = self.energy(from, t);
        self.energy(to, t) <= before
    }

    /// Returns Σ |V| over the accounts at (q, t), J, as a scale of energy.
    pub(crate) fn energy_scale(&mut self, q: &[f64], t: f64) -> f64 {
        self.go_to(q, t);
        self.work.energies += 1;
        let energies = self.assembler.energies(&self.x, t);
        energies.elastic.abs() + energies.gravity.abs() + energies.load.abs() + energies.contact.abs()
    }

    /// Returns K at (q, t).
    ///
    /// # Errors
    /// Returns an error if the matrices of terms and forces cannot be summed into one.
    pub(crate) fn tangent(
        &mut self,
        q: &[f64],
        t: f64,
        kind: HessianEvaluation,
    ) -> Result<&SymmetricMatrix, SolverError> {
        self.go_to(q, t);
        self.count_tangent(kind);
        let Self { system, assembler, forces, friction, sum, x, still, .. } = self;
        tangent(system, assembler, (forces, friction, sum), (x, still, t), kind)
    }

    fn count_tangent(&mut self, kind: HessianEvaluation) {
        self.work.hessians += 1;
        self.work.projections += u64::from(kind == HessianEvaluation::Projected);
    }

    /// Factors K + σM at (q, t), σ in 1/s², or prepares conjugate gradients for it.
    ///
    /// # Errors
    /// The outer error is fatal, or [`SolverError::Interrupted`]; the inner one means that the matrix is not positive definite.
    pub(crate) fn factorize(
        &mut self,
        q: &[f64],
        t: f64,
        kind: HessianEvaluation,
        shift: f64,
    ) -> Result<Result<(), NotPositiveDefinite>, SolverError> {
        self.interrupt.check()?;
        self.go_to(q, t);
        if self.has_constant && shift == 0.0 {
            self.unshifted = None;
            return Ok(Ok(()));
        }
        let shift = shift + self.bond.as_ref().map_or(0.0, |bond| bond.shift);
        let lasts = self.is_linear && self.friction.is_none() && shift == 0.0;
        let counted = self.work;
        self.count_tangent(kind);
        let Self {
            system, assembler, forces, friction, sum, solver, linear, x, still, work, interrupt, ..
        } = self;
        let mass = system.free_mass();
        if let Some(shared) = system.terms().shared().filter(|shared| shared.solves())
            && linear.is_shared()
        {
            let is_projected = kind == HessianEvaluation::Projected;
            let (_, indefinite) = shared.prepare(x, t, [shift, 1.0], is_projected);
            shared.diagonal(&mut self.diagonal);
            *solver = Some(TangentSolver::shared(shared, *linear));
            work.factorizations += 1;
            work.factorizations_newton += 1;
            return Ok(indefinite.map_or(Ok(()), |free| Err(NotPositiveDefinite { free })));
        }
        for (out, mass) in self.shifted_mass.iter_mut().zip(mass) {
            *out = shift * mass;
        }
        let demand = match friction {
            Some(_) => Demand::WITH_FRICTION,
            None if lasts => Demand::CONSTANT,
            None => Demand::CORRECTION,
        };
        let k = tangent(system, assembler, (forces, friction, sum), (x, still, t), kind)?;
        k.diagonal(&mut self.diagonal);
        let made = match solver {
            Some(solver) if solver.has_pattern_of(k) => solver,
            other => {
                let new = TangentSolver::new((*linear, demand), k, mass, q, work)?;
                other.insert(new.interruptible(interrupt))
            }
        };
        let result = made.prepare(if shift == 0.0 { &[] } else { &self.shifted_mass }, k, q);
        self.unshifted = (shift != 0.0).then(|| k.clone());
        work.factorizations += 1;
        work.factorizations_newton += 1;
        self.has_constant = lasts && result.is_ok() && made.factor().is_some();
        if std::mem::take(&mut self.was_made) && self.has_constant {
            self.work = counted;
        }
        Ok(result)
    }

    /// Returns whether K at (q, t) is positive definite, and leaves a solver for it.
    ///
    /// # Errors
    /// Returns the errors of [`Balance::factorize`] and of the search for negative curvature.
    pub(crate) fn is_stable(&mut self, q: &[f64], t: f64) -> Result<bool, SolverError> {
        if self.factorize(q, t, HessianEvaluation::Exact, 0.0)?.is_err() {
            return Ok(false);
        }
        let mass = self.system.free_mass();
        self.solver.as_mut().ok_or(SolverError::NotFactored)?.is_definite(mass, &mut self.work)
    }

    /// Returns the linear solver that was chosen and the reason, once there is one.
    pub(crate) fn linear_solver(&self) -> Option<(LinearSolver, &str)> {
        self.solver.as_ref().map(TangentSolver::choice)
    }

    /// Returns whether solves are made with factors.
    pub(crate) fn has_factor(&mut self) -> bool {
        self.solver.as_mut().is_some_and(|solver| solver.factor().is_some())
    }

    /// Returns whether r is no larger than the round-off of positions, |r_i| ≤ 16 ε K_ii max |x|, with the K of the
    /// last factorisation.
    pub(crate) fn is_round_off(&self, r: &[f64]) -> bool {
        let [_, reach] = self.system.coordinates().extent_and_reach(&self.x);
        let noise = 16.0 * f64::EPSILON * reach;
        r.iter().zip(&self.diagonal).all(|(r, k)| r.abs() <= noise * k.abs())
    }

    /// Returns the positions of all coordinates at (q, t), m.
    pub(crate) fn positions(&mut self, q: &[f64], t: f64) -> Vec<f64> {
        self.go_to(q, t);
        self.x.clone()
    }

    /// Returns the extent of the bodies at the last configuration, m.
    pub(crate) fn extent(&self) -> f64 {
        self.system.coordinates().extent_and_reach(&self.x)[0]
    }

    /// Returns √Σ r_i²/|K_ii| of a residual, √J, with the K of the last factorisation.
    pub(crate) fn scaled_norm(&self, r: &[f64]) -> f64 {
        let stiffest = self.diagonal.iter().fold(0.0, |most: f64, k| most.max(k.abs()));
        let least = 1e-12 * stiffest;
        r.iter().zip(&self.diagonal).map(|(r, k)| r * r / k.abs().max(least)).sum::<f64>().sqrt()
    }

    /// Returns the shortest distance that nodes move before pairs of live terms are searched again, m; infinite without
    /// live terms.
    pub(crate) fn reach(&self) -> f64 {
        self.assembler.shared_live().map_or(f64::INFINITY, |live| live.shortest_reach())
    }

    /// Solves with the last matrix, in place; conjugate gradients to the relative `accuracy` in the energy norm.
    ///
    /// # Errors
    /// Returns [`SolverError::Residual`] if the matrix is too close to singular; [`SolverError::NegativeCurvature`] if
    /// conjugate gradients find that it is not positive definite, or [`SolverError::ConjugateGradients`], or
    /// [`SolverError::Interrupted`].
    pub(crate) fn solve(&mut self, rhs_to_solution: &mut [f64], accuracy: f64) -> Result<(), SolverError> {
        self.interrupt.check()?;
        self.solver.as_mut().ok_or(SolverError::NotFactored)?.solve(rhs_to_solution, accuracy, &mut self.work)
    }

    /// Solves K x = b by minimal residuals, with the K of the last factorisation that had a shift.
    ///
    /// # Errors
    /// Returns [`SolverError::NoConvergence`] after `max_iterations`, or [`SolverError::Interrupted`].
    pub(crate) fn solve_indefinite(
        &mut self,
        b: &[f64],
        tolerance: f64,
        max_iterations: u32,
    ) -> Result<Vec<f64>, SolverError> {
        let factor = self.solver.as_mut().and_then(TangentSolver::factor);
        let (Some(k), Some(factor)) = (&self.unshifted, factor) else {
            return Err(SolverError::NotFactored);
        };
        let count = (&self.interrupt, &mut self.work.solves);
        minimal_residual(k, factor, b, tolerance, max_iterations, count)
    }

    /// Returns max K_ii/M_ii of the tangent at (q, t), 1/s²: a scale of the highest ω².
    pub(crate) fn stiffest(&mut self, q: &[f64], t: f64) -> Result<f64, SolverError> {
        let mut diagonal = vec![0.0; q.len()];
        self.tangent(q, t, HessianEvaluation::Exact)?.diagonal(&mut diagonal);
        let mass = self.system.free_mass();
        Ok(diagonal.iter().zip(mass).map(|(k, m)| (k / m).abs()).fold(0.0, f64::max))
    }
}

/// Returns K of the terms, the forces and the model of friction at positions x and time t; `still` are zero velocities.
fn tangent<'a>(
    system: &System,
    assembler: &'a mut Assembler,
    (forces, friction, sum): (&'a mut Option<ForceSum>, &'a mut Option<Friction>, &'a mut Option<MatrixSum>),
    (x, still, t): (&[f64], &[f64], f64),
    kind: HessianEvaluation,
) -> Result<&'a SymmetricMatrix, SolverError> {
    let k = assembler.hessian(x, t, kind)?;
    let mut parts = vec![(1.0, k)];
    if let Some(forces) = forces {
        forces.evaluate(x, still, t);
        parts.extend(forces.stiffness(system).map(|load| (1.0, load)));
    }
    if let Some(friction) = friction {
        parts.extend(friction.model(x).map(|model| (1.0, model)));
    }
    if parts.len() == 1 { Ok(k) } else { MatrixSum::of(sum, &parts) }
}

/// Refuses constraints in an analysis that does not support them.
///
/// # Errors
/// Returns [`SolverError::ConstrainedAnalysis`].
pub(crate) fn refuse_constraints(analysis: &'static str, system: &System) -> Result<(), SolverError> {
    match system.constraints().first() {
        Some(constraint) => {
            let constraint = constraint.name().to_owned();
            Err(SolverError::ConstrainedAnalysis { analysis, constraint })
        }
        None => Ok(()),
    }
}
