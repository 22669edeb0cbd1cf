//! The memory that live terms with a discrete gradient carry from step to step, for forces that dissipate, such as
//! dry friction. It belongs to the positions where the last step ended. A repeated step begins with the memory with
//! which it began before.

use std::ops::Range;
use std::sync::Arc;

use vi_core::{
    Account, Acting, DiscreteGradient, EndForces, HessianKind, Impulse, Potential, Stencils, StepOutcome,
    StepSpan, Traits,
};

use crate::assemble::stencil_forces::{ActingTerms, SeeForces};
use crate::error::SolverError;
use crate::memory::StepperMemory;

/// The memory of all live terms at one configuration, and the duration of the current step.
#[derive(Debug, Clone, Default, PartialEq)]
pub(crate) struct Remembered {
    /// The memory of each term.
    memories: Vec<Vec<f64>>,
    /// Energy stored in the terms besides V, J.
    stored: f64,
    /// The step that begins with it.
    span: StepSpan,
}

impl Remembered {
    fn new(terms: usize) -> Self {
        Self { memories: vec![Vec::new(); terms], ..Self::default() }
    }

    /// Returns a term over a step that begins with this memory, if the term has a special discrete gradient for it.
    fn over_step(&self, number: usize, term: &Arc<dyn Potential>) -> Option<Arc<dyn DiscreteGradient>> {
        term.discrete_gradient()?.over_step(self.span, &self.memories[number])
    }

    pub(crate) fn remember(&self, name: &str, memory: &mut StepperMemory) {
        memory.counts.push((format!("{name}.terms"), self.memories.len() as u64));
        for (number, values) in self.memories.iter().enumerate() {
            memory.arrays.push((format!("{name}.memory.{number}"), values.clone()));
        }
        let StepSpan { duration, acts_at_end, damps_end } = self.span;
        let [acts_at_end, damps_end] = [acts_at_end, damps_end].map(|flag| f64::from(u8::from(flag)));
        let numbers = vec![self.stored, duration, acts_at_end, damps_end];
        memory.arrays.push((format!("{name}.stored_span"), numbers));
    }

    /// Returns the memory that [`Remembered::remember`] recorded; `None` if there is no record of this name.
    pub(crate) fn recall(name: &str, memory: &StepperMemory) -> Option<Self> {
        let array = |part: &str| {
            let found = memory.arrays.iter().find(|(key, _)| *key == format!("{name}.{part}"));
            found.map(|(_, values)| values.clone())
        };
        let terms = memory.counts.iter().find(|(key, _)| *key == format!("{name}.terms"))?.1;
        let memories = (0..terms).map(|number| array(&format!("memory.{number}"))).collect::<Option<_>>()?;
        let &[stored, duration, acts_at_end, damps_end] = array("stored_span")?.as_slice() else {
            return None;
        };
        let [acts_at_end, damps_end] = [acts_at_end, damps_end].map(|flag| flag != 0.0);
        Some(Self { memories, stored, span: StepSpan { duration, acts_at_end, damps_end } })
    }
}

/// The memory of live terms over the steps.
#[derive(Clone, Default)]
pub(crate) struct Passage {
    /// The current memory, and the positions of all coordinates to which it belongs, m. Empty positions mean
    /// anywhere.
    now: Remembered,
    x: Vec<f64>,
    /// The memory and the positions before the last step.
    before: Remembered,
    x_before: Vec<f64>,
    /// The memory at the end of the step that was closed last.
    next: Remembered,
    next_impulses: Vec<Impulse>,
    /// Impulses of the last step, and the sum of all earlier ones that were not yet taken, N s.
    impulses: Vec<Impulse>,
    earlier: Vec<Impulse>,
    /// Duration of the steps whose impulses were not yet taken, s.
    elapsed: f64,
    /// The smallest gap of the step that was closed last, and that of all accepted steps since the last call of
    /// [`Passage::take_smallest_gap`], m.
    next_gap: Option<f64>,
    smallest_gap: Option<f64>,
    /// Whether any term acts in the open step with a memory.
    opened_with_memory: bool,
    /// The terms that act in the step that was closed last (`next_acting`) and in the last accepted step (`acting`);
    /// `None` if they are not known.
    next_acting: Option<ActingTerms>,
    acting: Option<ActingTerms>,
}

/// A step that can be divided fails if its smallest gap at the end is below the fraction `NARROW` of the distance below
/// which pairs act, and below the fraction `CLOSES` of the gap at the start.
///
/// An impact over many times the layer in one step ends with the energy of the whole body in the layer, because the force that
/// stops the body does its work over the whole way. From a gap g, bodies that turn with the radius r in a step move no farther
/// than about √(8 r g), or the straight path of the step would pass through them: at 1e-4 of the layer, the next step fails,
/// however short. Of ten scenes of `stress --contact --seed 1` that failed by name (4, 41, 46, 122, 155, 161, 164, 172, 174, 196),
/// seven run to their end with 1e-3. With 1e-2, 46 takes 1987 iterations instead of 1665, and 174 takes 214 instead of 186.
const NARROW: f64 = 1e-3;
const CLOSES: f64 = 0.5;

/// Checks that a step with this outcome does not end with a gap from which the next step would fail.
///
/// # Errors
/// Returns [`SolverError::Narrow`] if it does.
pub(crate) fn check_narrowest(outcome: &StepOutcome) -> Result<(), SolverError> {
    match outcome.narrowest {
        Some([start, end]) if end < NARROW && end < CLOSES * start => Err(SolverError::Narrow { gap: end }),
        _ => Ok(()),
    }
}

/// Returns the smaller one of two gaps, either of which may be missing.
fn smaller(a: Option<f64>, b: Option<f64>) -> Option<f64> {
    a.into_iter().chain(b).reduce(f64::min)
}

impl Passage {
    pub(crate) fn new(terms: usize) -> Self {
        Self { now: Remembered::new(terms), ..Self::default() }
    }

    pub(crate) fn now(&self) -> &Remembered {
        &self.now
    }

    pub(crate) fn go_to(&mut self, now: &Remembered) {
        if now.memories.len() == self.now.memories.len() {
            *self = Self { now: now.clone(), ..Self::default() };
        }
    }

    /// Goes back to an earlier passage of the same terms. The next step evaluates them anew.
    pub(crate) fn return_to(&mut self, earlier: &Self) {
        self.clone_from(earlier);
        self.now.span = StepSpan::default();
    }

    /// Opens a step from positions x. Returns false if the terms act as they did over the last step.
    pub(crate) fn open(&mut self, x: &[f64], span: StepSpan) -> bool {
        if self.x != x && self.x_before == x {
            // The last step was rejected: return to the memory before it.
            self.now = self.before.clone();
            self.x = x.to_vec();
            self.impulses.clear();
            self.elapsed -= self.now.span.duration;
            self.acting = None;
        }
        let remembers = self.remembers();
        let is_same = self.now.span == span && !remembers && !self.opened_with_memory;
        self.now.span = span;
        self.opened_with_memory = remembers;
        !is_same
    }

    /// Returns the duration of the open step and how terms act in it.
    pub(crate) fn span(&self) -> StepSpan {
        self.now.span
    }

    /// Returns the friction of the terms over the open step; see [`Potential::lagged_friction`].
    pub(crate) fn lagged(
        &self,
        discrete: &[(usize, Arc<dyn Potential>)],
        places: [&[f64]; 2],
        acting: &Acting,
    ) -> Vec<Arc<dyn Potential>> {
        let Remembered { memories, span, .. } = &self.now;
        let of = |(number, term): &(usize, Arc<dyn Potential>)| {
            term.lagged_friction(*span, &memories[*number], places, acting)
        };
        discrete.iter().filter_map(of).collect()
    }

    /// Returns the terms over the open step, as potentials of its end.
    pub(crate) fn paired(&self, discrete: &[(usize, Arc<dyn Potential>)]) -> Vec<Arc<dyn Potential>> {
        let of = |(number, term): &(usize, Arc<dyn Potential>)| {
            let (term, over) = (Arc::clone(term), self.over_step(*number, term));
            Arc::new(Paired { term, over }) as Arc<dyn Potential>
        };
        discrete.iter().map(of).collect()
    }

    /// Returns [`Passage::over_step`] of each term.
    pub(crate) fn over_each(
        &self,
        discrete: &[(usize, Arc<dyn Potential>)],
    ) -> Vec<Option<Arc<dyn DiscreteGradient>>> {
        discrete.iter().map(|(number, term)| self.over_step(*number, term)).collect()
    }

    /// Returns the discrete gradient over the open step, if the term has a special one for it.
    pub(crate) fn over_step(
        &self,
        number: usize,
        term: &Arc<dyn Potential>,
    ) -> Option<Arc<dyn DiscreteGradient>> {
        self.now.over_step(number, term)
    }

    /// Returns the dampers and the friction that act at the end of the step that was closed last, at the positions and
    /// velocities of all coordinates.
    pub(crate) fn end_forces(
        &self,
        discrete: &[(usize, Arc<dyn Potential>)],
        x: &[f64],
        velocity: &[f64],
    ) -> EndForces {
        let mut forces = EndForces::default();
        for (number, term) in discrete {
            if let Some(over) = self.next.over_step(*number, term) {
                over.end_forces(x, velocity, &mut forces);
            }
        }
        forces
    }

    /// Adds impulses (N s) at the end of the step that was closed last.
    pub(crate) fn add_impulses(&mut self, impulses: &[Impulse]) {
        add_impulses(&mut self.next_impulses, impulses);
    }

    /// Adds impulses on nodes at the end of the step that was closed last: the nodes, and impulses with the sign of a
    /// gradient, N s.
    pub(crate) fn add_at_end(&mut self, nodal: impl Iterator<Item = (Vec<u32>, Vec<f64>)>) {
        if let Some(acting) = &mut self.next_acting {
            acting.add_at_end(nodal);
        }
    }

    /// Calls `see` with the mean forces over the last step, or those at its end if that is where terms act. Returns false if they
    /// are not known.
    pub(crate) fn see_forces(&self, see: &mut SeeForces<'_>) -> bool {
        let Self { acting: Some(acting), before, x_before, x, .. } = self else { return false };
        acting.see(|number, term| before.over_step(number, term), before.span, [x_before, x], see);
        true
    }

    /// Notes that nothing acted in the last step.
    pub(crate) fn pass_freely(&mut self) {
        self.acting = Some(ActingTerms::default());
    }

    /// Closes the step and returns the effects of all terms together. [`Passage::accept`] makes the change permanent.
    pub(crate) fn close(
        &mut self,
        discrete: &[(usize, Arc<dyn Potential>)],
        start: &[f64],
        end: &[f64],
    ) -> StepOutcome {
        let mut sum = StepOutcome::default();
        self.next = Remembered { span: self.now.span, ..Remembered::new(self.now.memories.len()) };
        for (number, term) in discrete {
            let over = self.over_step(*number, term);
            let Some(discrete) = over.as_deref().or(term.discrete_gradient()) else { continue };
            let outcome = discrete.outcome(start, end);
            sum.stored += outcome.stored;
            sum.friction += outcome.friction;
            sum.damping += outcome.damping;
            sum.has_dampers |= outcome.has_dampers;
            sum.impulses.extend(outcome.impulses);
            sum.smallest_gap = smaller(sum.smallest_gap, outcome.smallest_gap);
            let both = sum.narrowest.into_iter().chain(outcome.narrowest);
            sum.narrowest = both.reduce(|[a, b], [c, d]| [a.min(c), b.min(d)]);
            self.next.memories[*number] = outcome.memory;
        }
        self.next.stored = sum.stored;
        self.next_impulses.clone_from(&sum.impulses);
        self.next_gap = sum.smallest_gap;
        self.next_acting = Some(ActingTerms::new(discrete));
        sum
    }

    /// Accepts the step that was closed last, from positions `start` to `end`.
    pub(crate) fn accept(&mut self, start: &[f64], end: &[f64]) {
        self.before = std::mem::replace(&mut self.now, std::mem::take(&mut self.next));
        self.x_before.clear();
        self.x_before.extend_from_slice(start);
        self.x.clear();
        self.x.extend_from_slice(end);
        let last = std::mem::replace(&mut self.impulses, std::mem::take(&mut self.next_impulses));
        add_impulses(&mut self.earlier, &last);
        self.elapsed += self.before.span.duration;
        self.smallest_gap = smaller(self.smallest_gap, self.next_gap.take());
        self.acting = self.next_acting.take();
    }

    /// Returns the impulses since the last call.
    pub(crate) fn take_impulses(&mut self) -> Vec<Impulse> {
        self.elapsed = 0.0;
        let mut all = std::mem::take(&mut self.earlier);
        add_impulses(&mut all, &std::mem::take(&mut self.impulses));
        all
    }

    /// Returns the impulses of the forces of the last step over the duration of all steps since the last call.
    pub(crate) fn take_last_forces(&mut self) -> Vec<Impulse> {
        self.earlier.clear();
        let mut last = std::mem::take(&mut self.impulses);
        let ratio = std::mem::take(&mut self.elapsed) / self.before.span.duration;
        last.iter_mut().flat_map(|impulse| &mut impulse.value).for_each(|value| *value *= ratio);
        last
    }

    /// Returns the smallest gap of the pairs that acted since the last call, m.
    pub(crate) fn take_smallest_gap(&mut self) -> Option<f64> {
        self.smallest_gap.take()
    }

    /// Returns whether any term has a memory.
    pub(crate) fn remembers(&self) -> bool {
        self.now.memories.iter().any(|memory| !memory.is_empty())
    }

    /// Returns the energy stored besides V, J.
    pub(crate) fn stored(&self) -> f64 {
        self.now.stored
    }
}

/// Adds impulses to the sums of the same parts.
pub(crate) fn add_impulses(sums: &mut Vec<Impulse>, more: &[Impulse]) {
    for impulse in more {
        match sums.iter_mut().find(|sum| sum.between == impulse.between) {
            Some(sum) => (0..3).for_each(|k| sum.value[k] += impulse.value[k]),
            None => sums.push(*impulse),
        }
    }
}

/// A term with a discrete gradient as a potential of the end of a step; the start follows the end in one array.
struct Paired {
    term: Arc<dyn Potential>,
    /// The discrete gradient over the open step, if it differs from that of the term.
    over: Option<Arc<dyn DiscreteGradient>>,
}

impl Paired {
    fn discrete(&self) -> Option<&dyn DiscreteGradient> {
        self.over.as_deref().or(self.term.discrete_gradient())
    }
}

impl Potential for Paired {
    fn name(&self) -> &str {
        self.term.name()
    }

    fn account(&self) -> Account {
        self.term.account()
    }

    fn stencils(&self) -> Stencils<'_> {
        self.term.stencils()
    }

    /// Declares time dependence, so that nothing is cached as constant: the start changes without notice.
    fn traits(&self) -> Traits {
        Traits { hessian: HessianKind::Varying, time_dependent: true }
    }

    fn energies(&self, range: Range<usize>, x: &[f64], t: f64, out: &mut [f64]) {
        self.term.energies(range, &x[..x.len() / 2], t, out);
    }

    fn gradients(&self, range: Range<usize>, x: &[f64], t: f64, out: &mut [f64]) {
        let (end, start) = x.split_at(x.len() / 2);
        match self.discrete() {
            Some(discrete) => discrete.gradients(range, start, end, out),
            None => self.term.gradients(range, end, t, out),
        }
    }

    fn hessians(&self, range: Range<usize>, x: &[f64], t: f64, out: &mut [f64]) {
        let (end, start) = x.split_at(x.len() / 2);
        match self.discrete() {
            Some(discrete) => discrete.tangents(range, start, end, out),
            None => self.term.hessians(range, end, t, out),
        }
    }

    fn limits_steps(&self) -> bool {
        self.term.limits_steps()
    }

    fn largest_step(&self, x: &[f64], dx: &[f64]) -> f64 {
        self.term.largest_step(x, dx)
    }
}
