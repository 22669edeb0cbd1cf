//! Sums live terms. They are evaluated with the stencils near one configuration. When a node leaves the reach of
//! these stencils, new ones are requested (`stencils`).
//!
//! If a scheme uses discrete gradients, the terms that have one are kept apart from the others. They are summed from
//! an array that holds the end of the step followed by its start.

mod hessians;
mod lagged;
mod near;
mod paths;
mod state;
mod stencils;

use std::sync::Arc;

use vi_core::{Acting, EndForces, Impulse, Potential, StepOutcome, StepSpan, Terms, Tube};

use crate::assemble::energy::Energies;
use crate::assemble::fixed::FixedSum;
use crate::assemble::passage::Passage;
use crate::assemble::stencil_forces::{self, SeeForces};
use crate::error::{SolverError, TermFault};
use crate::linear::matrix_sum::MatrixSum;
use crate::vectors;

use near::Near;

pub(crate) use near::end_per_stage;
pub(crate) use state::LiveState;
pub(crate) use stencils::shortest_reach;

/// The sum of the live terms of a list.
pub(crate) struct LiveSum {
    terms: Terms,
    /// Whether terms with a discrete gradient are kept apart, because they act over steps.
    splits: bool,
    /// Number of coordinates per node of the matrix of the fixed terms; `None` if there are no fixed terms.
    block: Option<usize>,
    state: LiveState,
    near: Option<Near>,
    /// The lagged friction of the open step, while all terms act by potentials at its end (`lagged`).
    lagged: Option<FixedSum>,
    /// The sum of Hessians with lagged friction. It begins anew in each step, so that a continued run has the same pattern.
    lagged_union: Option<MatrixSum>,
    /// The region of the stencils, if it has a path.
    tube: Option<Tube>,
    union: Option<MatrixSum>,
    /// The fault of a live term whose stencils cannot be used.
    fault: Option<TermFault>,
    buffer: Vec<f64>,
    /// Positions at the end of a step, then at its start.
    pair: Vec<f64>,
    passage: Passage,
    /// The passage at the last mark.
    marked: Passage,
    renewals: u64,
    patterns: u64,
}

impl LiveSum {
    /// Returns the sum, or `None` if the list has no live terms.
    pub(crate) fn new(terms: &Terms, block: usize, splits: bool) -> Option<Self> {
        if terms.live().is_empty() {
            return None;
        }
        Some(Self {
            terms: terms.clone(),
            splits,
            block: (!terms.fixed().is_empty()).then_some(block),
            state: LiveState::default(),
            near: None,
            lagged: None,
            lagged_union: None,
            tube: None,
            union: None,
            fault: None,
            buffer: vec![0.0; terms.coordinates().dof_count()],
            pair: Vec::new(),
            passage: Passage::new(terms.live().len()),
            marked: Passage::new(terms.live().len()),
            renewals: 0,
            patterns: 0,
        })
    }

    /// Returns how often stencils were requested, and how often the pattern of the sum of Hessians was built.
    pub(crate) fn counts(&self) -> [u64; 2] {
        [self.renewals, self.patterns]
    }

    pub(crate) fn state(&self) -> LiveState {
        LiveState { step: self.passage.now().clone(), ..self.state.clone() }
    }

    /// Restores the stencils of a state.
    pub(crate) fn go_to(&mut self, state: &LiveState) {
        self.union = None;
        (self.near, self.tube) = (None, None);
        self.state = LiveState::default();
        self.passage.go_to(&state.step);
        if !state.region.about.is_empty() {
            self.renew(state.region.clone());
        }
        self.state = state.clone();
    }

    /// Keeps a copy of the memory of the terms, for [`LiveSum::return_to_mark`].
    pub(crate) fn mark(&mut self) {
        self.marked.clone_from(&self.passage);
    }

    /// Restores the memory of the terms at the last [`LiveSum::mark`].
    pub(crate) fn return_to_mark(&mut self) {
        self.passage.return_to(&self.marked);
    }

    /// Returns Σ V of the live terms by account, J; infinite if a term cannot be used.
    pub(crate) fn energies(&mut self, x: &[f64], t: f64) -> Energies {
        self.follow(x, None);
        let lagged = self.lagged.as_mut().map(|lagged| lagged.energies(x, t));
        let mut energies = match &mut self.near {
            Some(near) => {
                let terms = near.whole.terms().fixed();
                let of = |term: &Arc<dyn Potential>| Some((term.account(), term.energy(x, t)?));
                match terms.iter().map(of).collect::<Option<Vec<_>>>() {
                    Some(parts) => parts.into_iter().fold(Energies::default(), Energies::with),
                    None => near.whole.energies(x, t),
                }
            }
            None => Energies { contact: f64::INFINITY, ..Energies::default() },
        };
        if let Some(lagged) = lagged {
            energies += lagged;
        }
        energies
    }

    /// Adds ∂V/∂x of the terms that act by their gradient.
    pub(crate) fn add_gradient(&mut self, x: &[f64], t: f64, out: &mut [f64]) {
        self.follow(x, None);
        let Self { near, buffer, lagged, .. } = self;
        let Some(near) = near else { return out.fill(f64::NAN) };
        let assembler = match &mut near.parts {
            Some([plain, _]) if lagged.is_none() => plain,
            _ => &mut near.whole,
        };
        assembler.gradient(x, t, buffer);
        vectors::update(out, |k, out| *out += buffer[k]);
        self.add_lagged_gradient(x, t, out);
    }

    /// Opens a step from positions `x` (m). Terms that dissipate continue from the memory that they
    /// have there.
    pub(crate) fn open_step(&mut self, x: &[f64], span: StepSpan) -> Result<(), SolverError> {
        self.lagged_union = None;
        if self.splits && self.passage.open(x, span) {
            self.exchange()?;
        }
        Ok(())
    }

    /// Gives the current step to the terms with a discrete gradient.
    fn exchange(&mut self) -> Result<(), SolverError> {
        let Self { near: Some(near), passage, .. } = self else { return Ok(()) };
        if let Some([_, discrete]) = &mut near.parts {
            discrete.exchange(passage.paired(&near.discrete))?;
            near.over = passage.over_each(&near.discrete);
            near.close = None;
        }
        Ok(())
    }

    /// Returns the effects of the terms' forces without a potential, over the step from `start` to `end`.
    pub(crate) fn close_step(&mut self, start: &[f64], end: &[f64]) -> StepOutcome {
        self.follow(start, Some(end));
        let near = self.near.as_ref().filter(|near| near.parts.is_some());
        self.passage.close(near.map_or(&[], |near| &near.discrete), start, end)
    }

    /// Returns what acts at the end of the step that was closed last; see [`Passage::end_forces`].
    pub(crate) fn end_forces(&self, x: &[f64], velocity: &[f64]) -> EndForces {
        let near = self.near.as_ref().filter(|near| near.parts.is_some());
        self.passage.end_forces(near.map_or(&[], |near| &near.discrete), x, velocity)
    }

    /// See [`Passage::add_impulses`].
    pub(crate) fn add_impulses(&mut self, impulses: &[Impulse]) {
        self.passage.add_impulses(impulses);
    }

    /// See [`Passage::add_at_end`].
    pub(crate) fn add_at_end(&mut self, nodal: impl Iterator<Item = (Vec<u32>, Vec<f64>)>) {
        self.passage.add_at_end(nodal);
    }

    /// See [`Passage::see_forces`].
    pub(crate) fn see_forces(&self, see: &mut SeeForces<'_>) -> bool {
        self.passage.see_forces(see)
    }

    /// Calls `see` with ∂V/∂x of the terms at positions x and time t, stencil by stencil.
    pub(crate) fn see_gradients(&mut self, x: &[f64], t: f64, see: &mut SeeForces<'_>) {
        self.follow(x, None);
        let near = self.near.iter().flat_map(|near| near.whole.terms().fixed());
        near.for_each(|term| stencil_forces::at(term.as_ref(), x, t, see));
    }

    /// Accepts the step that was closed last.
    pub(crate) fn accept_step(&mut self, start: &[f64], end: &[f64]) {
        self.passage.accept(start, end);
    }

    /// Returns whether any term has a memory between steps.
    pub(crate) fn remembers(&self) -> bool {
        self.passage.remembers()
    }

    /// Returns the energy that the terms store between steps besides V, J.
    pub(crate) fn stored(&self) -> f64 {
        self.passage.stored()
    }

    /// Returns the impulses between parts since the last call, N s.
    pub(crate) fn take_impulses(&mut self) -> Vec<Impulse> {
        self.passage.take_impulses()
    }

    /// See [`Passage::take_last_forces`].
    pub(crate) fn take_last_forces(&mut self) -> Vec<Impulse> {
        self.passage.take_last_forces()
    }

    /// Returns the smallest gap of the pairs that acted in the steps since the last call, m.
    pub(crate) fn take_smallest_gap(&mut self) -> Option<f64> {
        self.passage.take_smallest_gap()
    }

    /// Returns the forces between parts of the terms at positions x, N; see [`Potential::forces_between`].
    pub(crate) fn forces_between(&mut self, x: &[f64]) -> Vec<Impulse> {
        self.follow(x, None);
        let near = self.near.iter().flat_map(|near| near.whole.terms().fixed());
        near.flat_map(|term| term.forces_between(x)).collect()
    }

    /// Adds G(start, end) of the terms that act by a discrete gradient.
    pub(crate) fn add_discrete_gradient(&mut self, start: &[f64], end: &[f64], out: &mut [f64]) {
        if !self.splits || self.lagged.is_some() {
            return;
        }
        self.follow(start, Some(end));
        self.place(start, end);
        let Self { near, buffer, pair, .. } = self;
        let Some(near) = near else { return out.fill(f64::NAN) };
        if let Some([_, discrete]) = &mut near.parts {
            discrete.gradient(pair, 0.0, buffer);
            vectors::update(out, |k, out| *out += buffer[k]);
        }
    }

    /// Returns whether terms with a discrete gradient act over steps, and not by the gradient at one place.
    pub(crate) fn acts_over_steps(&self) -> bool {
        self.splits
    }

    /// Returns whether all terms list the forces of their pairs.
    pub(crate) fn lists_pairs(&self) -> bool {
        self.splits && self.terms.live().iter().all(|term| term.lists_pairs())
    }

    /// Returns whether any pair is near a step from `start` to `end`.
    pub(crate) fn has_candidates(&mut self, start: &[f64], end: &[f64]) -> bool {
        self.follow(start, Some(end));
        self.has_pairs_near()
    }

    /// Returns the number of stencils near the last configuration.
    pub(crate) fn candidate_count(&self) -> usize {
        let terms = self.near.iter().flat_map(|near| near.whole.terms().fixed());
        terms.map(|term| term.stencil_count()).sum()
    }

    /// Returns whether any pair is near the last configuration.
    pub(crate) fn has_pairs_near(&self) -> bool {
        let near = self.near.as_ref();
        near.is_some_and(|near| near.discrete.iter().any(|(_, term)| term.stencil_count() > 0))
    }

    /// Appends the forces of the pairs over the open step to `out`. Returns false if a term cannot be used.
    pub(crate) fn list_pairs(&mut self, start: &[f64], end: &[f64], out: &mut Acting) -> bool {
        self.follow(start, Some(end));
        let Self { near: Some(near), passage, terms, .. } = self else { return false };
        let [begun, goal] = [start, end].map(|x| terms.coordinates().places(x));
        near.choose(&begun, &[&goal], passage);
        let (terms, over) = near.of_step();
        for ((_, term), over) in terms.iter().zip(over) {
            if let Some(discrete) = over.as_deref().or(term.discrete_gradient()) {
                discrete.acting(start, end, out);
            }
        }
        true
    }

    /// Returns whether any term dissipates energy over the open step near positions x.
    pub(crate) fn dissipates(&mut self, x: &[f64]) -> bool {
        self.follow(x, None);
        self.near.as_ref().is_some_and(|near| near.over.iter().any(Option::is_some))
    }

    /// Returns ∂x₁/∂x of the stage x of the open step.
    fn end_per_stage(&self) -> f64 {
        end_per_stage(self.passage.span().acts_at_end)
    }

    fn place(&mut self, start: &[f64], end: &[f64]) {
        self.pair.clear();
        self.pair.extend_from_slice(end);
        self.pair.extend_from_slice(start);
    }

    /// Returns whether any terms act by a discrete gradient.
    pub(crate) fn has_discrete(&self) -> bool {
        self.lagged.is_none() && self.near.as_ref().is_some_and(|near| near.parts.is_some())
    }

    /// Returns the first stencil without a finite value.
    pub(crate) fn fault(&self, x: &[f64], t: f64) -> Option<TermFault> {
        self.fault.clone().or_else(|| self.near.as_ref()?.whole.fault(x, t))
    }
}
