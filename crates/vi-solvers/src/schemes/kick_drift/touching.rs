//! A drift in which live terms act that list their pairs (`DiscreteGradient::acting`). It solves for the coordinates in
//! contact only:
//! ```text
//! R(y) = M (y − u) + ½h² G(x₀, y) = 0,   u = q₀ + h M⁻¹p₀,   p₁ = p₀ − h G.
//! ```
//! The impulses −h G are those of the linear model at the last iterate. They sum to zero over the pairs, so that p₁ has the momentum of p₀ to
//! round-off, and not only to the error and the resolution of y, divided by h.
//! The mass is diagonal and the pairs are few. So the system of a Newton step is small; it is not symmetric and is
//! solved iteratively, with an incomplete factor. If a correction would move pairs through each other, the nodes of these
//! pairs make only a part of it, and all others make the whole correction. Bodies with constraints, such as free rigid bodies,
//! stay on their manifold in all iterates; those that nothing touches are no part of the system (`constraint/middle.rs`).

mod iteration;
mod lists;
mod newton;
mod reduced;

use std::sync::Arc;

use vi_core::{
    Acting, DiscreteGradient, Impulse, Potential, State, StepEnergy, StepOutcome, StepSpan, System,
};

use crate::assemble::compliance::Compliance;
use crate::assemble::free_path::{FreePath, KEPT};
use crate::assemble::passage::{Passage, Remembered, check_narrowest};
use crate::assemble::stencil_forces::SeeForces;
use crate::error::SolverError;
use crate::index::free_of;
use crate::interrupt::Interrupt;
use crate::memory::StepperMemory;
use crate::schemes::constraint::middle::ConstrainedBodies;
use crate::schemes::kick_drift::touching::lists::{Kept, Lists};
use crate::schemes::kick_drift::touching::newton::Small;
use crate::vectors;
use crate::work::Work;

pub(super) struct Touching {
    lists: Lists,
    passage: Passage,
    tolerance: f64,
    /// Whether to evaluate the forces once more at the solution and book their work there; otherwise the work of the
    /// forces that the linear model gives there is booked.
    pub(super) ledger: bool,
    /// Looked at in every iteration.
    interrupt: Interrupt,
    /// The free coordinate of each coordinate, or [`NONE`].
    free_of: Vec<u32>,
    acting: Acting,
    compliance: Compliance,
    /// The bodies with constraints, if there are any.
    bodies: Option<ConstrainedBodies>,
    small: Small,
    /// The free coordinates at the end of the drift if no term acts, m; empty if that is `small.drifted`.
    inertial: Vec<f64>,
    /// The impulses of terms and constraints that lead to the end of the drift, N s per free coordinate.
    impulses: Vec<f64>,
    y: Vec<f64>,
    x_start: Vec<f64>,
    x_end: Vec<f64>,
    work: Work,
}

impl Touching {
    /// Returns the drift of a system. Returns `None` if the system has terms that do not list their pairs, or constraints with
    /// prescribed coordinates.
    pub(super) fn new(system: &System, tolerance: f64, interrupt: &Interrupt) -> Option<Self> {
        let coordinates = system.coordinates();
        let count = coordinates.dof_count();
        if !count.is_multiple_of(3) {
            return None;
        }
        let bodies = match system.constraints() {
            [] => None,
            _ => Some(ConstrainedBodies::new(system)?),
        };
        let clusters = bodies.as_ref().map_or(&[][..], ConstrainedBodies::nodes);
        let live = system.terms().live();
        if !live.iter().all(|term| term.lists_pairs()) {
            return None;
        }
        Some(Self {
            lists: Lists::new(live.to_vec(), system.terms().shared_coordinates()),
            passage: Passage::new(live.len()),
            tolerance,
            ledger: false,
            interrupt: interrupt.clone(),
            free_of: free_of(coordinates),
            acting: Acting::default(),
            compliance: Compliance::default(),
            small: Small::new(count / 3, clusters),
            bodies,
            inertial: Vec::new(),
            impulses: Vec::new(),
            y: Vec::new(),
            x_start: vec![0.0; count],
            x_end: vec![0.0; count],
            work: Work::default(),
        })
    }

    /// Drifts `state` by h. Returns `None` and changes nothing if the drift is q += h M⁻¹p. If `may_divide`, omits
    /// attempts that cost more than two drifts over h/2.
    ///
    /// # Errors
    /// Returns an error if the equations cannot be solved or the path is not free; nothing is then changed.
    pub(super) fn step(
        &mut self,
        system: &System,
        state: &mut State,
        h: f64,
        may_divide: bool,
    ) -> Result<Option<StepEnergy>, SolverError> {
        let (coordinates, mass) = (system.coordinates(), system.free_mass());
        let mut u = std::mem::take(&mut self.small.drifted);
        u.resize(mass.len(), 0.0);
        vectors::fill(&mut u, |k| state.q[k] + h * state.p[k] / mass[k]);
        coordinates.embed(&state.q, state.t, &mut self.x_start);
        if let Some(bodies) = &mut self.bodies {
            self.inertial.clone_from(&u);
            self.impulses.clear();
            self.impulses.resize(mass.len(), 0.0);
            bodies.drift(&state.q, &mut self.inertial, h, &mut self.impulses)?;
        }
        self.small.drifted = u;
        let free_end = if self.bodies.is_some() { &self.inertial } else { &self.small.drifted };
        coordinates.embed(free_end, state.t + h, &mut self.x_end);
        let searches = self.lists.searches();
        self.lists.follow(&self.x_start, &self.x_end);
        self.work = Work { searches: self.lists.searches() - searches, ..Work::default() };
        if self.lists.is_empty() && !self.passage.remembers() {
            return Ok(self.drift_freely(state, h));
        }
        self.passage.open(&self.x_start, StepSpan { duration: h, acts_at_end: false, damps_end: false });
        let outcome = self.solve(system, state, h, may_divide);
        self.work.searches = self.lists.searches() - searches;
        match outcome? {
            true => self.close(system, state, h, may_divide).map(Some),
            false => Ok(self.drift_freely(state, h)),
        }
    }

    /// Drifts `state` by h without terms if there are bodies with constraints; otherwise the caller does.
    fn drift_freely(&mut self, state: &mut State, h: f64) -> Option<StepEnergy> {
        self.passage.pass_freely();
        self.bodies.as_ref()?;
        self.y.clone_from(&self.inertial);
        self.move_to_end(state, h);
        Some(StepEnergy::default())
    }

    /// Moves `state` to the end y of the drift.
    fn move_to_end(&self, state: &mut State, h: f64) {
        vectors::update_pair(&mut state.q, &mut state.p, |k, q, p| {
            *p += self.impulses[k];
            *q = self.y[k];
        });
        state.t += h;
    }

    /// Sets the impulses of the coordinates of the small system: those of the terms, and those of constraints that balance them.
    fn set_impulses(&mut self, mass: &[f64], q: &[f64], h: f64) -> Result<(), SolverError> {
        let Self { small, bodies, impulses, y, .. } = self;
        if bodies.is_none() {
            // Otherwise the free drift has set the impulses of all coordinates.
            impulses.clear();
            impulses.resize(mass.len(), 0.0);
        }
        for (k, place) in small.coordinates() {
            impulses[k] = -h * small.force(place);
        }
        let Some(bodies) = bodies else { return Ok(()) };
        for (cluster, first) in small.clusters() {
            let reactions = bodies.reactions(cluster, [q, y], &small.residual_of(cluster, first))?;
            for (&k, reaction) in bodies.free(cluster).iter().zip(&reactions) {
                impulses[k as usize] -= h * reaction;
            }
        }
        Ok(())
    }

    /// Returns the terms over the open step.
    fn over_step(&self) -> Vec<Arc<dyn DiscreteGradient>> {
        let over = |(number, term): (usize, &Arc<dyn Potential>)| self.passage.over_step(number, term);
        self.lists.terms().iter().enumerate().filter_map(over).collect()
    }

    /// Evaluates the forces of these terms from `x_start` to `x_end`, pair by pair.
    fn evaluate(&mut self, terms: &[Arc<dyn DiscreteGradient>]) {
        self.acting.clear();
        terms.iter().for_each(|term| term.acting(&self.x_start, &self.x_end, &mut self.acting));
        self.work.pair_forces += self.acting.count() as u64;
    }

    /// Projects the bodies of the small system onto their manifold at the iterate y.
    ///
    /// # Errors
    /// Returns [`SolverError::ConstraintDefect`] if that does not converge.
    fn project(&mut self) -> Result<(), SolverError> {
        let Self { bodies, small, y, .. } = self;
        let Some(bodies) = bodies else { return Ok(()) };
        small.clusters().try_for_each(|(cluster, _)| bodies.project(cluster, y))
    }

    /// Checks that the straight path from the start to the end is free.
    fn check_path(&mut self) -> Result<(), SolverError> {
        self.work.path_checks += self.lists.count();
        let terms = self.lists.terms().iter();
        match terms.flat_map(|term| term.meetings(&self.x_start, &self.x_end, 0.0)).next() {
            Some(meeting) => Err(SolverError::Crossing { nodes: meeting.nodes }),
            None => Ok(()),
        }
    }

    /// Shortens the change `delta` of the coordinates `from`, node by node, until no pair meets on the path. Returns true
    /// if it did not have to be shortened. Prescribed coordinates have their values at time t, the end of the step. The path
    /// begins at the start of the step if `from_start`, and otherwise at `x_end`, the positions for `from`.
    fn shorten(
        &mut self,
        system: &System,
        from: &[f64],
        delta: &mut [f64],
        t: f64,
        from_start: bool,
    ) -> bool {
        let coordinates = system.coordinates();
        let Self { lists, bodies, small, work, x_start, x_end, .. } = self;
        // Corrections move only the bodies of the small system.
        let clusters: Vec<usize> = match bodies {
            Some(bodies) if from_start => (0..bodies.nodes().len()).collect(),
            _ => small.clusters().map(|(cluster, _)| cluster).collect(),
        };
        let place = |delta: &[f64]| {
            let mut to: Vec<f64> = from.iter().zip(delta).map(|(from, delta)| from + delta).collect();
            if let Some(bodies) = bodies {
                // An error shows again when the iterate itself is projected.
                clusters.iter().for_each(|&cluster| bodies.project(cluster, &mut to).unwrap_or_default());
            }
            coordinates.positions(&to, t)
        };
        let before = if from_start { x_start.clone() } else { x_end.clone() };
        let meetings = |from: &[f64], to: &[f64]| {
            lists.widen(to);
            work.path_checks += lists.count();
            lists.terms().iter().flat_map(|term| term.meetings(from, to, KEPT)).collect()
        };
        let mut path = FreePath { coordinates, from: &before, place, meetings };
        let touch = |node| {
            small.touch(node);
        };
        match from_start && coordinates.is_moving() {
            true => path.shorten_past_obstacles(delta, touch),
            false => path.shorten(delta, touch),
        }
    }

    /// Closes the step at y.
    ///
    /// # Errors
    /// Returns an error, and changes nothing, if the drift may be divided and would end with too small a gap.
    fn close(
        &mut self,
        system: &System,
        state: &mut State,
        h: f64,
        may_divide: bool,
    ) -> Result<StepEnergy, SolverError> {
        let (coordinates, mass) = (system.coordinates(), system.free_mass());
        let c = 0.5 * h * h;
        let numbered: Vec<(usize, Arc<dyn Potential>)> =
            self.lists.terms().iter().cloned().enumerate().collect();
        let outcome = self.passage.close(&numbered, &self.x_start, &self.x_end);
        if may_divide {
            check_narrowest(&outcome)?;
        }
        self.set_impulses(mass, &state.q, h)?;
        if self.ledger {
            self.acting = Acting::default();
            self.evaluate(&self.over_step());
            self.small.load(system, &self.free_of, &self.acting, c, &self.y);
        }
        let StepOutcome { friction, damping, .. } = outcome;
        self.passage.accept(&self.x_start, &self.x_end);
        self.lists.end_step(&self.x_end);
        let mut energy =
            StepEnergy { friction: -friction, contact_damping: -damping, ..StepEnergy::default() };
        for (k, place) in self.small.coordinates() {
            let impulse = self.impulses[k];
            let kinetic = impulse * (state.p[k] + 0.5 * impulse) / mass[k];
            energy.residual += kinetic + self.small.force(place) * (self.y[k] - state.q[k]);
        }
        let mut motion: Vec<f64> =
            self.x_end.iter().zip(&self.x_start).map(|(end, start)| end - start).collect();
        coordinates.to_own_axes(&mut motion);
        for (dof, value) in self.small.prescribed(coordinates, &self.free_of, &self.acting) {
            energy.prescribed += value * motion[dof];
        }
        self.move_to_end(state, h);
        Ok(energy)
    }

    /// Returns the work of the last step, even if it failed.
    pub(super) fn work(&self) -> Work {
        self.work
    }

    pub(super) fn stored(&self) -> f64 {
        self.passage.stored()
    }

    pub(super) fn take_impulses(&mut self) -> Vec<Impulse> {
        self.passage.take_impulses()
    }

    pub(super) fn see_forces(&self, see: &mut SeeForces<'_>) -> bool {
        self.passage.see_forces(see)
    }

    pub(super) fn take_smallest_gap(&mut self) -> Option<f64> {
        self.passage.take_smallest_gap()
    }

    /// Returns the memory of the terms and of the lists, for a return to this point.
    pub(super) fn keep(&self) -> (Passage, Kept) {
        (self.passage.clone(), self.lists.keep())
    }

    pub(super) fn go_to(&mut self, (passage, lists): (Passage, Kept)) {
        self.passage = passage;
        self.lists.go_to(lists);
    }

    pub(super) fn save(&self, memory: &mut StepperMemory) {
        self.lists.save(memory);
        self.passage.now().remember("touching", memory);
    }

    pub(super) fn restore(&mut self, memory: &StepperMemory) {
        self.lists.restore(memory);
        if let Some(now) = Remembered::recall("touching", memory) {
            self.passage.go_to(&now);
        }
    }
}
