//! One kernel for all explicit variational schemes: alternating kicks p −= b h ∂V/∂q and drifts q += a h M⁻¹p with
//! the coefficients b₀ a₁ b₁ … aₙ bₙ. Time advances with the drifts, so prescribed motion is evaluated at the time of
//! each kick.
//!
//! Forces without a potential join the kicks, p += b h (f(q, v) − ∂V/∂q). Forces that depend on velocity are
//! evaluated at the velocity before the kick; in the closing kick of a symmetric scheme, at the velocity that this
//! evaluation predicts (Heun). Then Störmer–Verlet keeps order 2 and the Euler schemes order 1. In the ledger the
//! work of such forces is f·v̄, where v̄ is the mean of the velocities before and after the kick, or that of the drift next to it
//! (`forced.rs`).
//!
//! With constraints, each drift projects q onto their manifold by multipliers along their gradients at its start, and
//! the step ends by projecting p onto the tangent space. For Störmer–Verlet this is RATTLE
//! (`constraint/manifold.rs`).

mod collisions;
mod drift;
mod filtered;
mod forced;
pub(crate) mod portion;
pub(crate) mod splitting;
mod touching;

use vi_core::{Impulse, State, StepEnergy, System};

use crate::assemble::evaluator::Evaluator;
use crate::assemble::filtered::FilteredDrift;
use crate::assemble::finite::{check_finite, check_state};
use crate::assemble::force_sum::ForceSum;
use crate::assemble::stencil_forces::SeeForces;
use crate::assemble::sweep::Sweep;
use crate::error::SolverError;
use crate::memory::{StepperMemory, expect_method};
use crate::options::SolverOptions;
use crate::schemes::accounts::{self, PotentialEnergies};
use crate::schemes::constraint::manifold::ConstraintManifold;
use crate::schemes::kick_drift::collisions::Collisions;
use crate::schemes::kick_drift::splitting::Splitting;
use crate::schemes::live_impulses::LiveImpulses;
use crate::schemes::resolution::Resolution;
use crate::schemes::stepper::{StepError, StepReport, Stepper};
use crate::vectors;
use crate::work::Work;

/// The stepper for a list of coefficients.
pub(crate) struct KickDrift {
    name: &'static str,
    coefficients: Splitting,
    evaluator: Evaluator,
    sweep: Sweep,
    potential_energies: PotentialEnergies,
    ledger: bool,
    q: Vec<f64>,
    p: Vec<f64>,
    x_dot: Vec<f64>,
    nonconservative: Option<ForceSum>,
    /// f − ∂V/∂x of all coordinates, if there are forces without a potential.
    net: Vec<f64>,
    /// The constraint manifold, if there are constraints.
    manifold: Option<ConstraintManifold>,
    /// The impulses of the multipliers in a drift, N s.
    impulses: Vec<f64>,
    /// The drift of a filtered mass, if it is filtered.
    filtered: Option<FilteredDrift>,
    /// The collisions in drifts, if there are live terms and no drift goes backwards in time.
    collisions: Option<Collisions>,
    /// The impulses of live terms that act in the kicks by their gradient.
    live_impulses: LiveImpulses,
}

impl KickDrift {
    pub(crate) fn new(
        name: &'static str,
        coefficients: Splitting,
        system: &System,
        options: &SolverOptions,
    ) -> Result<Self, SolverError> {
        let n = system.coordinates().free_count();
        // A drift backwards in time would meet obstacles that the body has already left. Schemes with such drifts resolve live terms
        // by their gradient instead.
        let takes_discrete = coefficients.drifts.iter().all(|&drift| drift >= 0.0);
        let collisions = if takes_discrete { Collisions::new(system, options)? } else { None };
        let mut evaluator = Self::evaluator(system, collisions.as_ref());
        Ok(Self {
            name,
            coefficients,
            sweep: Sweep::new(system, evaluator.assembler().gather()),
            evaluator,
            potential_energies: PotentialEnergies::new(),
            ledger: options.ledger,
            q: vec![0.0; n],
            p: vec![0.0; n],
            x_dot: Vec::new(),
            nonconservative: ForceSum::new(system),
            net: Vec::new(),
            impulses: Vec::new(),
            manifold: ConstraintManifold::new(system),
            filtered: system.filter().map(|_| FilteredDrift::new(system)),
            live_impulses: LiveImpulses::new(options.impulses && collisions.is_none()),
            collisions,
        })
    }

    fn evaluator(system: &System, collisions: Option<&Collisions>) -> Evaluator {
        let evaluator = Evaluator::new(system);
        match collisions {
            // All live terms act in the drift only, and exchange their energy there.
            Some(collisions) if collisions.is_exact() => evaluator.without_live(),
            Some(_) => evaluator.over_steps(),
            None => evaluator,
        }
    }

    /// Computes p −= b h ∂V/∂q, then q += a h M⁻¹p. With a ledger, books the work that the kick does on the kinetic
    /// energy and on the prescribed coordinates, and returns minus their sum.
    fn kick_drift(&mut self, system: &System, t: f64, kick: f64, drift: f64, energy: &mut StepEnergy) -> f64 {
        if let Some(filter) = system.filter() {
            return self.filtered_kick_drift(system, filter, kick, drift);
        }
        let mass = system.free_mass();
        let inverse_mass = self.sweep.inverse_mass();
        let free = system.coordinates().free();
        let gradient = self.evaluator.gradient();
        let mut work = 0.0;
        if self.ledger && kick != 0.0 {
            let p = &self.p;
            let half = 0.5 * kick;
            let mean_velocity = |k: usize| (p[k] - half * gradient[free[k] as usize]) / mass[k];
            work -= kick * accounts::free_work(system, gradient, mean_velocity);
            if !self.defers_work() && PotentialEnergies::counts_work(system, &self.evaluator) {
                let mean: Vec<f64> = (0..p.len()).map(mean_velocity).collect();
                self.x_dot.resize(gradient.len(), 0.0);
                system.coordinates().embed_velocity(&mean, t, &mut self.x_dot);
                self.potential_energies.add_work(system, &self.evaluator, kick, &self.x_dot);
            }
            if system.coordinates().is_moving() {
                self.x_dot.resize(gradient.len(), 0.0);
                // Only the prescribed entries are read, so any free velocity will do.
                system.coordinates().embed_velocity(&self.p, t, &mut self.x_dot);
                system.coordinates().to_own_axes(&mut self.x_dot);
                let done = kick * accounts::prescribed_work(system, gradient, &self.x_dot);
                energy.prescribed += done;
                work -= done;
            }
        }
        vectors::update_pair(&mut self.q, &mut self.p, |k, q, p| {
            if kick != 0.0 {
                *p -= kick * gradient[free[k] as usize];
            }
            *q += drift * (*p * inverse_mass[k]);
        });
        work
    }

    /// Returns the checks of a step in which live terms act in the kicks by their gradient.
    fn resolution(&self, system: &System, h: f64) -> Option<Resolution> {
        let is_needed = self.collisions.is_none() && !system.terms().live().is_empty();
        is_needed.then_some(Resolution { scheme: self.name, h })
    }

    /// Returns whether only q and p are needed.
    fn is_plain(&self, system: &System) -> bool {
        !self.ledger
            && self.evaluator.can_sweep()
            && self.nonconservative.is_none()
            && system.coordinates().is_plain()
            && system.constraints().is_empty()
            && system.terms().live().is_empty()
    }

    /// Returns whether the state has as many coordinates as the system.
    fn fits(&self, state: &State) -> bool {
        state.q.len() == self.q.len() && state.p.len() == self.p.len()
    }

    /// Makes plain steps with one pass over the coordinates per force: the last kick of a step and the first kick of
    /// the next use the same force. If `count` is above one, no term and no prescribed coordinate may depend on time.
    /// Returns false if a number is not finite.
    fn advance_swept(
        &mut self,
        system: &System,
        state: &State,
        h: f64,
        count: u32,
    ) -> Result<bool, SolverError> {
        if let Some(filter) = system.filter() {
            return self.advance_filtered(system, filter, state, (h, count));
        }
        let Splitting { kicks, drifts } = &self.coefficients;
        // A rank of several does not stop, because others wait for its sums.
        let (mut is_sound, is_shared) = (true, self.evaluator.is_shared());
        if kicks[0] != 0.0 && !self.evaluator.knows_gradient_of(state.t) {
            match self.evaluator.evaluate(system, &state.q, state.t, true) {
                Err(error) if !is_shared => return Err(error),
                evaluated => is_sound = evaluated.is_ok(),
            }
        }
        if self.evaluator.is_blank() {
            self.evaluator.go_to(system, &state.q, state.t);
        }
        let last = h * kicks[drifts.len()];
        let (mut from, mut closing) = (Some(state), 0.0);
        for _ in 0..count {
            let mut elapsed = 0.0;
            for (kick, drift) in kicks.iter().zip(drifts) {
                let kick = kick * h;
                let sums = from.is_none() && (closing != 0.0 || kick != 0.0);
                if sums {
                    self.evaluator.sum_chunks(system, state.t + elapsed * h);
                }
                let arrays = (&mut self.q[..], &mut self.p[..]);
                is_sound &=
                    self.evaluator.sweep(&self.sweep, from.take(), sums, [closing, kick], drift * h, arrays);
                if !is_sound && !is_shared {
                    return Ok(false);
                }
                elapsed += drift;
                closing = 0.0;
            }
            closing = last;
        }
        let sums = last != 0.0;
        if sums {
            self.evaluator.sum_chunks(system, state.t + h);
        }
        let arrays = (&mut self.q[..], &mut self.p[..]);
        Ok(self.evaluator.sweep(&self.sweep, None, sums, [0.0, last], 0.0, arrays) && is_sound)
    }

    fn advance(&mut self, system: &System, state: &State, h: f64) -> Result<StepEnergy, SolverError> {
        if self.is_plain(system) && self.fits(state) {
            // Try a second time from the start, in case the state is not where the last step ended.
            for _ in 0..2 {
                if self.advance_swept(system, state, h, 1)? {
                    return Ok(StepEnergy::default());
                }
                self.evaluator.forget();
            }
            // A value is not finite: the ordinary path finds which one.
        }
        check_state(state, system)?;
        self.q.copy_from_slice(&state.q);
        self.p.copy_from_slice(&state.p);
        self.live_impulses.open();
        let mut energy = StepEnergy::default();
        if self.ledger {
            self.potential_energies.open(system, &mut self.evaluator, &state.q, state.t);
        }
        let drifts = self.coefficients.drifts.len();
        let resolution = self.resolution(system, h);
        if let Some(resolution) = resolution {
            let mass = system.free_mass();
            resolution.open(system, &mut self.evaluator, (&state.q, state.t), |k| state.p[k] / mass[k]);
        }
        let mut before = Vec::new();
        // The work of a kick that waits for its drift, and the mean velocity of the last drift.
        let (mut deferred, mut drift_velocity) = (None, Vec::new());
        let (mut t, mut elapsed, mut kicked) = (state.t, 0.0, 0.0);
        for i in 0..=drifts {
            let kick = self.coefficients.kicks[i] * h;
            let drift = if i < drifts { self.coefficients.drifts[i] } else { 0.0 };
            if kick != 0.0 {
                self.evaluator.evaluate(system, &self.q, t, i == 0)?;
                if let Some(resolution) = resolution {
                    resolution.check_forces(system, &mut self.evaluator, (&self.q, t))?;
                }
                self.live_impulses.add(&mut self.evaluator, kick);
                let closes = i == drifts && self.coefficients.kicks[0] != 0.0;
                self.evaluate_nonconservative(system, t, kick, closes)?;
                if self.defers_work() {
                    deferred = Some(self.defer_work(system, kick));
                }
            }
            let started_at =
                if self.defers_work() { system.coordinates().positions(&self.q, t) } else { Vec::new() };
            if drift != 0.0
                && self.collisions.is_none()
                && let Some(manifold) = &mut self.manifold
            {
                manifold.set_directions(system, &self.q, t);
            }
            let free_drift = if self.collisions.is_some() { 0.0 } else { drift * h };
            if resolution.is_some() {
                before.clone_from(&self.q);
            }
            let started = t;
            kicked += if self.nonconservative.is_some() {
                self.forced_kick_drift(system, t, kick, free_drift, &mut energy)
            } else {
                self.kick_drift(system, t, kick, free_drift, &mut energy)
            };
            if drift != 0.0 && self.collisions.is_some() {
                kicked += self.drift_past(system, t, drift * h, &mut energy)?;
            }
            elapsed += drift;
            t = if i + 1 >= drifts { state.t + h } else { state.t + elapsed * h };
            if drift != 0.0
                && let Some(resolution) = resolution
            {
                resolution.check_path(system, &mut self.evaluator, (&before, started), (&self.q, t))?;
            }
            // A drift with collisions satisfies the constraints by itself.
            if drift != 0.0 && self.manifold.is_some() && self.collisions.is_none() {
                kicked += self.project_positions(system, t, drift * h, &mut energy)?;
            }
            if self.defers_work() && drift != 0.0 {
                drift_velocity = system.coordinates().positions(&self.q, t);
                vectors::update(&mut drift_velocity, |k, x| *x = (*x - started_at[k]) / (drift * h));
            }
            if let Some(deferred) = deferred.take() {
                kicked += self.book_work(system, &deferred, &drift_velocity, &mut energy);
            }
        }
        if let Some(manifold) = &mut self.manifold {
            let [change, done] = manifold.project_momenta(system, &self.q, &mut self.p, t)?;
            energy.prescribed += done;
            kicked += change - done;
        }
        check_finite(&self.q, &self.p, system)?;
        if self.ledger {
            let (change, loads) =
                self.potential_energies.close_with_work(system, &mut self.evaluator, &self.q, t);
            energy.force += loads;
            energy.scheme = change - loads + kicked;
        }
        Ok(energy)
    }
}

impl Stepper for KickDrift {
    fn step(&mut self, system: &System, state: &mut State, h: f64) -> Result<StepReport, StepError> {
        let (before, searches) = (self.evaluator.work, self.evaluator.searches());
        let advanced = self.advance(system, state, h);
        self.evaluator.work.searches += self.evaluator.searches() - searches;
        let energy = advanced.map_err(|cause| StepError { t: state.t, h, cause })?;
        self.live_impulses.accept();
        std::mem::swap(&mut state.q, &mut self.q);
        std::mem::swap(&mut state.p, &mut self.p);
        state.t += h;
        self.evaluator.work.steps += 1;
        Ok(StepReport { iterations: 0, energy, work: self.evaluator.work - before })
    }

    fn joins_steps(&self, system: &System) -> bool {
        self.evaluator.is_autonomous() && self.is_plain(system)
    }

    fn steps(&mut self, system: &System, state: &mut State, h: f64, count: u32) -> Option<StepReport> {
        if !self.joins_steps(system) || !self.fits(state) {
            return None;
        }
        let (before, knew) = (self.evaluator.work, self.evaluator.knows_gradient_of(state.t));
        let found = self.advance_swept(system, state, h, count);
        if !found.unwrap_or(false) {
            // Restore the evaluator to its state before the attempt.
            self.evaluator.forget();
            if knew {
                self.evaluator.evaluate(system, &state.q, state.t, true).ok();
            }
            self.evaluator.work = before;
            return None;
        }
        std::mem::swap(&mut state.q, &mut self.q);
        std::mem::swap(&mut state.p, &mut self.p);
        state.t += f64::from(count) * h;
        self.evaluator.work.steps += u64::from(count);
        let work = self.evaluator.work - before;
        Some(StepReport { iterations: 0, energy: StepEnergy::default(), work })
    }

    fn work(&self) -> Work {
        self.evaluator.work
    }

    fn stored_energy(&self) -> f64 {
        self.collisions.as_ref().map_or(0.0, Collisions::stored)
    }

    fn take_impulses(&mut self) -> Option<Vec<Impulse>> {
        match &mut self.collisions {
            Some(collisions) => Some(collisions.take_impulses()),
            None => self.live_impulses.take(),
        }
    }

    fn see_live_forces(&self, see: &mut SeeForces<'_>) -> bool {
        self.collisions.as_ref().is_some_and(|collisions| collisions.see_forces(see))
    }

    fn take_smallest_gap(&mut self) -> Option<f64> {
        self.collisions.as_mut().and_then(Collisions::take_smallest_gap)
    }

    fn memory(&self) -> StepperMemory {
        // The last force is evaluated again at the same place, to the same bits.
        let mut memory = StepperMemory { method: self.name.to_owned(), ..Default::default() };
        self.evaluator.save(&mut memory);
        self.potential_energies.save(&mut memory);
        if let Some(collisions) = &self.collisions {
            collisions.save(&mut memory);
        }
        memory
    }

    fn analyses(&self) -> u64 {
        self.collisions.as_ref().map_or(0, Collisions::analyses)
    }

    fn restore(&mut self, system: &System, memory: &StepperMemory) -> Result<(), SolverError> {
        expect_method(memory, self.name)?;
        self.evaluator = Self::evaluator(system, self.collisions.as_ref());
        self.potential_energies = PotentialEnergies::restore(memory);
        self.live_impulses.clear();
        if let Some(collisions) = &mut self.collisions {
            collisions.restore(memory)?;
        }
        self.evaluator.restore(memory)
    }

    fn gradient(&self) -> Option<&[f64]> {
        self.coefficients.kicks.last().is_some_and(|&b| b != 0.0).then(|| self.evaluator.known_gradient())?
    }
}
