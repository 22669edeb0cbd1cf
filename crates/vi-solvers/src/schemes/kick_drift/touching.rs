//! A drift in which live terms act that list their pairs (`DiscreteGradient::acting`). It solves for the coordinates in
//! contact only:
//! ```text
//! R(y) = M (y − u) + ½h² G(x₀, y) = 0,   u = q₀ + h M⁻¹p₀,   p₁ = M (2 (y − q₀)/h − M⁻¹p₀).
//! ```
//! The mass is diagonal and the pairs are few. So the system of a Newton step is small; it is not symmetric and is
//! solved iteratively, with an incomplete factor. If a correction would move pairs through each other, the nodes of these
//! pairs make only a part of it, and all others make the whole correction. Bodies with constraints, such as free rigid bodies,
//! stay on their manifold in all iterates; those that nothing touches are no part of the system (`constraint/middle.rs`).

mod lists;
mod newton;
mod reduced;

use std::sync::Arc;

use vi_core::{
    Acting, DiscreteGradient, Impulse, Potential, State, StepEnergy, StepOutcome, StepSpan, System,
};

use crate::assemble::compliance::Compliance;
use crate::assemble::free_path::{FreePath, KEPT, make_uniform};
use crate::assemble::passage::{Passage, Remembered, check_narrowest};
use crate::error::SolverError;
use crate::index::free_of;
use crate::interrupt::Interrupt;
use crate::memory::StepperMemory;
use crate::newton::soft_bristles::{self, Aim, Attempt, Frictional, Iteration, Progress, Verdict};
use crate::newton::start::Start;
use crate::schemes::constraint::middle::ConstrainedBodies;
use crate::schemes::kick_drift::touching::lists::{Kept, Lists};
use crate::schemes::kick_drift::touching::newton::Small;
use crate::vectors;
use crate::work::Work;

/// Largest number of Newton iterations of one series. Drifts that converge need three to ten.
const MOST_ITERATIONS: u32 = 40;
/// Largest length of a correction, as a multiple of the longest motion of a node in the free drift, or of the reach of the terms if
/// that is longer: nodes at rest in a layer have no free motion, and leave it. A much longer correction would make candidates of all
/// pairs.
const FARTHEST: f64 = 2.0;
/// Relative error below which Newton's method uses the tangents of directions too. Farther from the solution they are the tangents of
/// forces that are much too large. A cloth of 40 × 40 cells on a sphere takes 8955, 8660, 8409 and 7951 iterations and 3.2, 3.2, 3.3
/// and 3.7 s with 3e-3, 3e-2, .1 and .3.
const NEAR: f64 = 3e-2;
/// Relative error to which the linear systems are solved far from the solution. With 1e-4, a cloth on a sphere takes 2 % fewer
/// iterations, with 1e-3 1 % fewer, on which 6 % more pairs act.
const COARSE: f64 = 1e-5;
/// Near the solution, they are solved to this fraction of the relative error of the last iteration, to which Newton's method
/// reduces it, and at best to `FINE`. With `COARSE` for all iterations, the linear solves determine the last ones: errors decrease to
/// a few hundredths instead of thousandths, more than the iteration before predicts, so Newton's method ends too early, and nodes with
/// other numbers move differently by 1e-9 of the energy. With `FINE` for all, a folded cloth (`benches/layers.py folded --cells 50`)
/// takes 2.3 instead of 1.8 s for 60 steps, in equally many iterations.
const FORCING: f64 = 0.1;
const FINE: f64 = 1e-9;
/// Relative resolution of positions: forces of a stiff layer have several times the round-off of positions.
const RESOLUTION: f64 = 8.0 * f64::EPSILON;

pub(super) struct Touching {
    lists: Lists,
    passage: Passage,
    tolerance: f64,
    /// Whether the work of forces is that at the solution, for which they are evaluated once more; otherwise it is that of the
    /// forces before the last correction.
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
    /// The free coordinates at the end of the drift if no term acts, m, and the impulses of constraints that lead there, N s; both
    /// empty if that is `small.drifted`.
    inertial: Vec<f64>,
    impulses: Vec<f64>,
    y: Vec<f64>,
    x_start: Vec<f64>,
    x_end: Vec<f64>,
    work: Work,
}

/// A drift over h (s) that is being solved.
struct Drift<'a> {
    touching: &'a mut Touching,
    system: &'a System,
    state: &'a State,
    h: f64,
    /// Largest length of a correction, m.
    longest: f64,
    iterations: u32,
    /// Whether the start is the free drift, on a free path.
    is_free: bool,
    /// Whether it was found that no term acts along the free drift.
    acts: bool,
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
            lists: Lists::new(live.to_vec(), coordinates),
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

    /// Drifts `state` by h. Returns `None` and changes nothing if the drift is q += h M⁻¹p. If `may_divide`, attempts that are
    /// dearer than two drifts over h/2 are not made.
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
            return Ok(self.drift_freely(system, state, h));
        }
        self.passage.open(&self.x_start, StepSpan { duration: h, damps_end: false });
        let outcome = self.solve(system, state, h, may_divide);
        self.work.searches = self.lists.searches() - searches;
        match outcome? {
            true => self.close(system, state, h, may_divide).map(Some),
            false => Ok(self.drift_freely(system, state, h)),
        }
    }

    /// Drifts `state` by h without terms if there are bodies with constraints; otherwise the caller does.
    fn drift_freely(&mut self, system: &System, state: &mut State, h: f64) -> Option<StepEnergy> {
        self.bodies.as_ref()?;
        self.y.clone_from(&self.inertial);
        self.move_to_end(system, state, h);
        Some(StepEnergy::default())
    }

    /// Moves `state` to the end y of the drift.
    fn move_to_end(&self, system: &System, state: &mut State, h: f64) {
        let mass = system.free_mass();
        let is_inertial = |k: usize| self.inertial.get(k).is_some_and(|end| self.y[k] == *end);
        vectors::update_pair(&mut state.q, &mut state.p, |k, q, p| {
            if self.y[k] != self.small.drifted[k] {
                // Impulses are known to more digits than differences of positions.
                *p = match is_inertial(k) {
                    true => *p + self.impulses[k],
                    false => mass[k] * (2.0 * (self.y[k] - *q) / h) - *p,
                };
            }
            *q = self.y[k];
        });
        state.t += h;
    }

    /// Returns the terms over the open step.
    fn over_step(&self) -> Vec<Arc<dyn DiscreteGradient>> {
        let over = |(number, term): (usize, &Arc<dyn Potential>)| self.passage.over_step(number, term);
        self.lists.terms().iter().enumerate().filter_map(over).collect()
    }

    /// Solves for y. Returns false if no term acts along the free drift.
    fn solve(
        &mut self,
        system: &System,
        state: &State,
        h: f64,
        may_divide: bool,
    ) -> Result<bool, SolverError> {
        // The end of the step is still that of the free drift.
        let longest = FARTHEST * self.lists.farthest().max(self.lists.shortest_reach());
        let tolerance = self.tolerance;
        let mut drift =
            Drift { touching: self, system, state, h, longest, iterations: 0, is_free: false, acts: true };
        let (start, most) = (Start::Inertial, MOST_ITERATIONS);
        if let Err(failed) = soft_bristles::solve_plainly(&mut drift, start, tolerance, most) {
            let attempts = Attempt::after_plain(start, may_divide, drift.touching.acting.has_friction());
            drift.touching.work.softenings += u64::from(!attempts.is_empty());
            soft_bristles::solve_in_stages(&mut drift, &attempts, failed, tolerance, most)?;
        }
        if !drift.acts {
            // If the terms have a memory, only that must be closed.
            return Ok(self.passage.remembers());
        }
        system.coordinates().embed(&self.y, state.t + h, &mut self.x_end);
        self.lists.widen(&self.x_end);
        self.check_path().map(|()| true)
    }

    /// Projects the bodies of the small system onto their manifold at the iterate y.
    ///
    /// # Errors
    /// Returns [`SolverError::ConstraintDefect`] if that does not converge.
    fn project(&mut self) -> Result<(), SolverError> {
        let Self { bodies, small, y, .. } = self;
        let Some(bodies) = bodies else { return Ok(()) };
        small.clusters().try_for_each(|cluster| bodies.project(cluster, y))
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
            _ => small.clusters().collect(),
        };
        let place = |delta: &[f64]| {
            let mut to: Vec<f64> = from.iter().zip(delta).map(|(from, delta)| from + delta).collect();
            if let Some(bodies) = bodies {
                // An error shows again when the iterate itself is projected.
                clusters.iter().for_each(|&cluster| bodies.project(cluster, &mut to).unwrap_or_default());
            }
            let mut x = vec![0.0; x_start.len()];
            coordinates.embed(&to, t, &mut x);
            x
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
        if self.ledger {
            self.acting = Acting::default();
            self.over_step().iter().for_each(|term| {
                term.acting(&self.x_start, &self.x_end, &mut self.acting);
            });
            self.work.pair_forces += self.acting.count() as u64;
            self.small.load(system, &self.free_of, &self.acting, c, &self.y);
        }
        let numbered: Vec<(usize, Arc<dyn Potential>)> =
            self.lists.terms().iter().cloned().enumerate().collect();
        let outcome = self.passage.close(&numbered, &self.x_start, &self.x_end);
        if may_divide {
            check_narrowest(&outcome)?;
        }
        let StepOutcome { friction, damping, .. } = outcome;
        self.passage.accept(&self.x_start, &self.x_end);
        self.lists.end_step(&self.x_end);
        let mut energy =
            StepEnergy { friction: -friction, contact_damping: -damping, ..StepEnergy::default() };
        let force = &self.small;
        for (k, place) in self.small.coordinates() {
            let change = self.y[k] - state.q[k];
            let part = mass[k] * (self.y[k] - self.small.drifted[k]) * change / c;
            energy.residual += part + force.force(place) * change;
        }
        let mut motion: Vec<f64> =
            self.x_end.iter().zip(&self.x_start).map(|(end, start)| end - start).collect();
        coordinates.to_own_axes(&mut motion);
        for (dof, value) in self.small.prescribed(coordinates, &self.free_of, &self.acting) {
            energy.prescribed += value * motion[dof];
        }
        self.move_to_end(system, state, h);
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

impl Frictional for Drift<'_> {
    /// Begins with the free drift, as far as its path is free.
    fn begin(&mut self, _start: Start) {
        let Self { touching, system, state, h, is_free, .. } = self;
        touching.small.begin();
        touching.acting.restart();
        touching.acting.compliance = touching.compliance.over_step(system, 0.5 * *h * *h);
        let Touching { y, small, bodies, inertial, .. } = &mut **touching;
        y.clone_from(if bodies.is_some() { inertial } else { &small.drifted });
        let mut delta: Vec<f64> = y.iter().zip(&state.q).map(|(y, q)| y - q).collect();
        *is_free = touching.shorten(system, &state.q, &mut delta, state.t + *h, true);
        if !*is_free {
            vectors::update(&mut touching.y, |k, y| *y = state.q[k] + delta[k]);
            // An error shows again in the first iteration.
            touching.project().ok();
        }
    }

    fn unknowns(&self) -> Vec<f64> {
        self.touching.y.clone()
    }

    fn go_to(&mut self, unknowns: &[f64]) {
        self.touching.y.copy_from_slice(unknowns);
    }

    fn iterations(&self) -> u32 {
        self.iterations
    }

    fn iterate(&mut self, aim: Aim) -> Result<(), SolverError> {
        let Self { touching, system, state, h, longest, iterations, is_free, acts } = self;
        let (coordinates, mass) = (system.coordinates(), system.free_mass());
        let (c, t) = (0.5 * *h * *h, state.t + *h);
        // The lists are valid at all iterates, because they were made valid for the checks of the paths to them.
        let mut version = touching.lists.version();
        let mut terms = touching.over_step();
        let mut progress = Progress::towards(aim);
        let mut delta = vec![0.0; state.q.len()];
        let mut eta = f64::INFINITY;
        touching.acting.stiffness = aim.stiffness;
        loop {
            touching.interrupt.check()?;
            coordinates.embed(&touching.y, t, &mut touching.x_end);
            if touching.lists.version() != version {
                version = touching.lists.version();
                terms = touching.over_step();
            }
            touching.acting.clear();
            let is_near = eta < NEAR;
            touching.acting.turns = is_near;
            touching.acting.penalty = progress.penalty();
            for term in &terms {
                term.acting(&touching.x_start, &touching.x_end, &mut touching.acting);
            }
            touching.work.pair_forces += touching.acting.count() as u64;
            if std::mem::take(is_free) && touching.acting.count() == 0 {
                *acts = false;
                return Ok(());
            }
            let (small, acting) = (&mut touching.small, &touching.acting);
            small.load(system, &touching.free_of, acting, c, &touching.y);
            if let Some(bodies) = &mut touching.bodies {
                small.reduce(bodies, &state.q, &touching.y)?;
            }
            let size = small.size(mass);
            touching.work.newton_iterations += 1;
            *iterations += 1;
            let is_accurate = is_near && aim.stiffness == 1.0;
            let forcing = if is_accurate { (FORCING * eta).clamp(FINE, COARSE) } else { COARSE };
            let decrement = small.correct(mass, forcing)?;
            let scale = small.scale(mass, &state.q, &touching.y);
            // Pairs that do not push yet give no correction, and may touch no free coordinate.
            eta = if decrement == 0.0 { 0.0 } else { (decrement.abs() / scale).sqrt() };
            if !eta.is_finite() {
                break;
            }
            delta.fill(0.0);
            let bodies = touching.bodies.as_ref();
            let is_short = small.spread(&mut delta, *longest, mass, bodies);
            let mut whole = vec![0.0; if aim.is_uniform { delta.len() } else { 0 }];
            if aim.is_uniform {
                small.spread(&mut whole, f64::INFINITY, mass, bodies);
            }
            let is_at_resolution = small.is_at_resolution(mass, &state.q, RESOLUTION);
            let unlawful = acting.unlawful();
            let from = std::mem::take(&mut touching.y);
            let is_whole = touching.shorten(system, &from, &mut delta, t, false) && is_short;
            touching.y = from;
            if aim.is_uniform {
                make_uniform(&whole, &mut delta);
            }
            vectors::update(&mut touching.y, |k, y| *y += delta[k]);
            touching.project()?;
            let small = &touching.small;
            touching.acting.predict(|tangent| small.along(tangent, &delta));
            match progress.judge(&Iteration {
                eta,
                size,
                is_whole,
                unlawful,
                forces: 0.0,
                round_off: 0.0,
                is_at_resolution,
            }) {
                Verdict::Solved => return Ok(()),
                Verdict::Hopeless => break,
                Verdict::Continue => {}
            }
        }
        Err(SolverError::NoConvergence { iterations: *iterations, residual: eta, tolerance: aim.tolerance })
    }
}
