//! A drift in which live terms act that list their pairs (`DiscreteGradient::acting`). It solves for the coordinates in
//! contact only:
//! ```text
//! R(y) = M (y − u) + ½h² G(x₀, y) = 0,   u = q₀ + h M⁻¹p₀,   p₁ = M (2 (y − q₀)/h − M⁻¹p₀).
//! ```
//! The mass is diagonal and the pairs are few. So the system of a Newton step is small; it is not symmetric and is
//! solved iteratively, without a factor. If a correction would move pairs through each other, the nodes of these pairs
//! make only a part of it, and all others make the whole correction.

mod lists;
mod newton;

use std::sync::Arc;

use vi_core::{Acting, DiscreteGradient, Impulse, Potential, State, StepEnergy, StepOutcome, System};

use crate::assemble::free_path::shorten;
use crate::assemble::passage::{Passage, Remembered};
use crate::error::SolverError;
use crate::index::free_of;
use crate::memory::StepperMemory;
use crate::newton::attempt::is_within;
use crate::schemes::kick_drift::touching::lists::Lists;
use crate::schemes::kick_drift::touching::newton::Small;
use crate::vectors;
use crate::work::Work;

/// Largest number of Newton iterations of one drift. Drifts that converge need three to ten.
const MOST_ITERATIONS: u32 = 40;
/// If the contraction is above this, the next iterations use secants. Friction can alternate between sticking and
/// sliding in both directions; a few secant iterations find the right case.
const STALLED: f64 = 0.7;
/// Number of secant iterations, the first time.
const SECANTS: u32 = 3;
/// Number of iterations at the start in which friction sticks.
const STICKING: u32 = 2;
/// Smallest fraction of a correction that the line search tries.
const SHORTEST: f64 = 1.0 / 64.0;
/// Largest length of a correction, as a multiple of the longest motion of a node in the free drift. A much longer
/// correction would make candidates of all pairs.
const FARTHEST: f64 = 2.0;
/// Relative resolution of positions: forces of a stiff layer have several times the round-off of positions.
const RESOLUTION: f64 = 8.0 * f64::EPSILON;

pub(super) struct Touching {
    lists: Lists,
    passage: Passage,
    tolerance: f64,
    /// The free coordinate of each coordinate, or [`NONE`].
    free_of: Vec<u32>,
    acting: Acting,
    small: Small,
    y: Vec<f64>,
    x_start: Vec<f64>,
    x_end: Vec<f64>,
    x_trial: Vec<f64>,
    parts: Vec<f64>,
    work: Work,
}

/// A correction of which the line search tries a fraction.
struct Trial {
    base: Vec<f64>,
    delta: Vec<f64>,
    /// Size of the residual at `base`.
    size: f64,
    part: f64,
}

impl Touching {
    /// Returns the drift of a system. Returns `None` if the system has constraints, nodes with their own axes, or terms
    /// that do not list their pairs.
    pub(super) fn new(system: &System, tolerance: f64) -> Option<Self> {
        let coordinates = system.coordinates();
        let count = coordinates.dof_count();
        if !system.constraints().is_empty() || !coordinates.node_axes().is_empty() || !count.is_multiple_of(3)
        {
            return None;
        }
        if !system.terms().live().iter().all(|term| term.lists_pairs()) {
            return None;
        }
        Some(Self {
            lists: Lists::new(system.terms().live().to_vec()),
            passage: Passage::new(system.terms().live().len()),
            tolerance,
            free_of: free_of(coordinates),
            acting: Acting::default(),
            small: Small::new(count / 3),
            y: Vec::new(),
            x_start: vec![0.0; count],
            x_end: vec![0.0; count],
            x_trial: vec![0.0; count],
            parts: vec![1.0; count / 3],
            work: Work::default(),
        })
    }

    /// Drifts `state` by h. Returns `None` and changes nothing if no term acts along the free drift.
    ///
    /// # Errors
    /// Returns an error if the equations cannot be solved or the path is not free; nothing is then changed.
    pub(super) fn step(
        &mut self,
        system: &System,
        state: &mut State,
        h: f64,
    ) -> Result<Option<StepEnergy>, SolverError> {
        let (coordinates, mass) = (system.coordinates(), system.free_mass());
        let mut u = std::mem::take(&mut self.small.drifted);
        u.resize(mass.len(), 0.0);
        vectors::fill(&mut u, |k| state.q[k] + h * state.p[k] / mass[k]);
        coordinates.embed(&state.q, state.t, &mut self.x_start);
        coordinates.embed(&u, state.t + h, &mut self.x_end);
        self.small.drifted = u;
        let searches = self.lists.searches();
        self.lists.follow(&self.x_start, &self.x_end);
        self.work = Work { searches: self.lists.searches() - searches, ..Work::default() };
        if self.lists.is_empty() && !self.passage.remembers() {
            return Ok(None);
        }
        self.passage.open(&self.x_start, h);
        let acts = self.solve(system, state, h)?;
        self.work.searches = self.lists.searches() - searches;
        Ok(acts.then(|| self.close(system, state, h)))
    }

    /// Returns the terms over the open step.
    fn over_step(&self) -> Vec<Arc<dyn DiscreteGradient>> {
        let over = |(number, term): (usize, &Arc<dyn Potential>)| self.passage.over_step(number, term);
        self.lists.terms().iter().enumerate().filter_map(over).collect()
    }

    /// Solves for y. Returns false if no term acts along the free drift.
    fn solve(&mut self, system: &System, state: &State, h: f64) -> Result<bool, SolverError> {
        let (coordinates, mass) = (system.coordinates(), system.free_mass());
        let c = 0.5 * h * h;
        let t = state.t + h;
        self.y.clone_from(&self.small.drifted);
        self.small.begin();
        self.acting.restart();
        let mut terms = self.over_step();
        // The end of the step is still that of the free drift.
        let longest = FARTHEST * self.farthest();
        // Begin with the free drift, as far as its path is free.
        let mut delta: Vec<f64> = self.y.iter().zip(&state.q).map(|(y, q)| y - q).collect();
        let mut is_whole = self.shorten(system, &state.q, &mut delta, t, true);
        vectors::update(&mut self.y, |k, y| *y = state.q[k] + delta[k]);
        if is_whole {
            self.y.clone_from(&self.small.drifted);
        }
        let mut last: Option<f64> = None;
        // The number of secant iterations left, and the number for the next time that they are needed.
        let (mut secants, mut patience) = (0, SECANTS);
        let (mut searches, mut trial): (bool, Option<Trial>) = (false, None);
        for iteration in 1..=MOST_ITERATIONS {
            coordinates.embed(&self.y, t, &mut self.x_end);
            if self.lists.widen(&self.x_end) {
                terms = self.over_step();
            }
            self.acting.clear();
            self.acting.by_secants = secants > 0;
            self.acting.sticks = iteration <= STICKING;
            for term in &terms {
                term.acting(&self.x_start, &self.x_end, &mut self.acting);
            }
            self.work.pair_forces += self.acting.count() as u64;
            if iteration == 1 && is_whole && self.acting.count() == 0 {
                // If the terms have a memory, only that must be closed.
                return Ok(self.passage.remembers());
            }
            self.small.load(system, &self.free_of, &self.acting, c, &self.y);
            let size = self.small.size(mass);
            if let Some(Trial { base, delta, size: before, part }) = &mut trial {
                if size > (1.0 - 1e-4 * *part) * *before && *part > SHORTEST {
                    *part *= 0.5;
                    vectors::update(&mut self.y, |k, y| *y = base[k] + *part * delta[k]);
                    continue;
                }
                trial = None;
            }
            self.work.newton_iterations += 1;
            let decrement = self.small.correct(mass)?;
            let scale = self.small.scale(mass, &state.q);
            // Pairs that do not push yet give no correction, and may touch no free coordinate.
            let eta = if decrement == 0.0 { 0.0 } else { (decrement.abs() / scale).sqrt() };
            if !eta.is_finite() {
                return Err(stuck(iteration, eta, self.tolerance));
            }
            delta.fill(0.0);
            let is_short = self.small.spread(&mut delta, longest);
            let from = std::mem::take(&mut self.y);
            is_whole = self.shorten(system, &from, &mut delta, t, false) && is_short;
            self.y = from;
            if searches && secants == 0 {
                trial = Some(Trial { base: self.y.clone(), delta: delta.clone(), size, part: 1.0 });
            }
            vectors::update(&mut self.y, |k, y| *y += delta[k]);
            let contraction = last.map(|last| eta / last);
            let reverses = self.acting.reversals() > 0;
            let is_close = is_within(self.tolerance, eta, contraction);
            let is_close = is_close && secants == 0 && iteration > STICKING && !reverses;
            let is_exact =
                !reverses && iteration > STICKING && self.small.is_at_resolution(mass, &state.q, RESOLUTION);
            if is_whole && (is_close || is_exact) {
                coordinates.embed(&self.y, t, &mut self.x_end);
                if self.lists.widen(&self.x_end) {
                    terms = self.over_step();
                }
                drop(terms);
                return self.check_path().map(|()| true);
            }
            if secants > 0 {
                secants -= 1;
                last = None;
                continue;
            }
            if iteration > STICKING + 1 && contraction.is_some_and(|theta| theta > STALLED) {
                // The iteration alternates across a kink.
                (secants, patience) = (patience, 2 * patience);
                searches = true;
            }
            last = (is_whole && !reverses).then_some(eta);
        }
        Err(stuck(MOST_ITERATIONS, last.unwrap_or(1.0), self.tolerance))
    }

    /// Returns the longest motion of a node from the start to the end, m.
    fn farthest(&self) -> f64 {
        let nodes = self.x_start.chunks_exact(3).zip(self.x_end.chunks_exact(3));
        let square = |(a, b): (&[f64], &[f64])| (0..3).map(|k| (a[k] - b[k]).powi(2)).sum::<f64>();
        nodes.map(square).fold(0.0, f64::max).sqrt()
    }

    /// Checks that the straight path from the start to the end is free.
    fn check_path(&mut self) -> Result<(), SolverError> {
        self.parts.fill(1.0);
        self.work.path_checks += self.lists.count();
        for term in self.lists.terms() {
            term.limit_nodes(&self.x_start, &self.x_end, &mut self.parts);
        }
        if self.parts.iter().any(|part| *part < 1.0) { Err(SolverError::Crossing) } else { Ok(()) }
    }

    /// Shortens the change `delta` of the coordinates `from`, node by node, until no pair meets on the path. Returns true
    /// if it did not have to be shortened. Prescribed coordinates have their values at time t, the end of the step; if
    /// `from_start`, the path begins with their values at the start of the step.
    fn shorten(
        &mut self,
        system: &System,
        from: &[f64],
        delta: &mut [f64],
        t: f64,
        from_start: bool,
    ) -> bool {
        let coordinates = system.coordinates();
        let Self { lists, parts, small, work, x_start, x_trial, .. } = self;
        let mut to = vec![0.0; from.len()];
        let mut before = Vec::new();
        if !from_start {
            before = vec![0.0; x_start.len()];
            coordinates.embed(from, t, &mut before);
        }
        let start = if from_start { &*x_start } else { &before };
        let limit = |delta: &[f64], parts: &mut [f64]| {
            vectors::fill(&mut to, |k| from[k] + delta[k]);
            coordinates.embed(&to, t, x_trial);
            lists.widen(x_trial);
            work.path_checks += lists.count();
            lists.terms().iter().for_each(|term| term.limit_nodes(start, x_trial, parts));
        };
        shorten(coordinates, delta, parts, limit, |node| {
            small.touch(node);
        })
    }

    /// Closes the step at y.
    fn close(&mut self, system: &System, state: &mut State, h: f64) -> StepEnergy {
        let (coordinates, mass) = (system.coordinates(), system.free_mass());
        let c = 0.5 * h * h;
        let numbered: Vec<(usize, Arc<dyn Potential>)> =
            self.lists.terms().iter().cloned().enumerate().collect();
        let StepOutcome { friction, damping, .. } = self.passage.close(&numbered, &self.x_start, &self.x_end);
        self.passage.accept(&self.x_start, &self.x_end);
        let mut energy =
            StepEnergy { friction: -friction, contact_damping: -damping, ..StepEnergy::default() };
        // The force is that of the last iteration, before the last correction.
        let force = &self.small;
        for (k, place) in self.small.coordinates() {
            let change = self.y[k] - state.q[k];
            let part = mass[k] * (self.y[k] - self.small.drifted[k]) * change / c;
            energy.residual += part + force.force(place) * change;
        }
        for (dof, value) in self.small.prescribed(coordinates, &self.free_of, &self.acting) {
            energy.prescribed += value * (self.x_end[dof] - self.x_start[dof]);
        }
        vectors::update_pair(&mut state.q, &mut state.p, |k, q, p| {
            if self.y[k] == self.small.drifted[k] {
                *q = self.y[k];
            } else {
                *p = mass[k] * (2.0 * (self.y[k] - *q) / h) - *p;
                *q = self.y[k];
            }
        });
        state.t += h;
        energy
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

    /// Returns the memory of the terms, for a return to this point.
    pub(super) fn passage(&self) -> Passage {
        self.passage.clone()
    }

    pub(super) fn go_to(&mut self, passage: Passage) {
        self.passage = passage;
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

fn stuck(iterations: u32, residual: f64, tolerance: f64) -> SolverError {
    SolverError::NoConvergence { iterations, residual, tolerance }
}
