//! The live terms of an evaluator: they act between the ends of a step, and may remember earlier steps.

use vi_core::{EndForces, Impulse, Meeting, StepOutcome, StepSpan, System};

use super::Evaluator;
use crate::assemble::free_path::KEPT;
use crate::assemble::live::LiveState;
use crate::assemble::pairs::Pairs;
use crate::assemble::stencil_forces::SeeForces;
use crate::error::SolverError;
use crate::linear::matrix::SymmetricMatrix;
use crate::vectors;

impl Evaluator {
    /// Makes live terms that have a discrete gradient act over steps: between the two ends that [`Evaluator::set_ends`]
    /// sets, or at the second end if the span of [`Evaluator::open_step`] says so.
    #[must_use]
    pub(crate) fn over_steps(mut self) -> Self {
        self.assembler.split_live();
        self
    }

    /// Returns the evaluator without the live terms, for a scheme that treats them separately.
    #[must_use]
    pub(crate) fn without_live(mut self) -> Self {
        self.assembler.drop_live();
        self
    }

    /// Sets the ends of the step, (q, t) each, for the next evaluations.
    pub(crate) fn set_ends(&mut self, system: &System, start: (&[f64], f64), end: (&[f64], f64)) {
        if self.assembler.live().is_none() {
            return;
        }
        let count = self.x.len();
        let [x_start, x_end] = self.ends.get_or_insert_with(|| [vec![0.0; count], vec![0.0; count]]);
        system.coordinates().embed(start.0, start.1, x_start);
        system.coordinates().embed(end.0, end.1, x_end);
        self.gradient_is_of_x = false;
    }

    /// Adds the discrete gradients between the ends of the step to the gradient, pair by pair if that was requested.
    pub(super) fn add_discrete_gradient(&mut self, system: &System) {
        let Self { ends: Some([start, end]), assembler, gradient, lists_pairs, pairs, work, .. } = self
        else {
            return;
        };
        let Some(live) = assembler.live() else { return };
        match pairs {
            Some(pairs) if *lists_pairs => {
                let acting = pairs.open();
                if live.list_pairs(start, end, acting) {
                    work.pair_forces += acting.count() as u64;
                    pairs.close(system.coordinates(), gradient);
                } else {
                    gradient.fill(f64::NAN);
                }
            }
            _ => live.add_discrete_gradient(start, end, gradient),
        }
    }

    /// Returns whether live terms list the forces of pairs, and pairs are near a step between these ends, (q, t) each.
    pub(crate) fn meets_pairs(&mut self, system: &System, start: (&[f64], f64), end: (&[f64], f64)) -> bool {
        let is_in_space = self.x.len().is_multiple_of(3);
        if !is_in_space || !self.assembler.live().is_some_and(|live| live.lists_pairs()) {
            return false;
        }
        self.set_ends(system, start, end);
        let (Some([start, end]), Some(live)) = (&self.ends, self.assembler.live()) else { return false };
        live.has_candidates(start, end)
    }

    /// Makes further evaluations list the forces of live terms pair by pair. A unit force moves a free coordinate of mass m by
    /// `per_mass`/m at the end of the step.
    pub(crate) fn begin_pairs(&mut self, system: &System, per_mass: f64) {
        self.lists_pairs = true;
        self.gradient_is_of_x = false;
        self.pairs.get_or_insert_with(|| Pairs::new(system.coordinates())).begin(system, per_mass);
    }

    /// Predicts the tractions of friction after a change of the free coordinates at the end of the step by factor · `delta`.
    pub(crate) fn predict_tractions(&mut self, factor: f64, delta: &[f64]) {
        if let Some(pairs) = &mut self.pairs {
            pairs.predict(factor, delta);
        }
    }

    /// Makes further evaluations sum the forces of live terms as usual.
    pub(crate) fn end_pairs(&mut self) {
        self.lists_pairs = false;
        self.gradient_is_of_x = false;
    }

    /// Returns the shortest distance that nodes move before stencils of live terms are requested again, m; zero without
    /// live terms.
    pub(crate) fn reach(&self) -> f64 {
        self.assembler.shared_live().map_or(0.0, |live| live.shortest_reach())
    }

    /// Sets the fraction of their stiffness with which bristles of friction resist slip, if pairs are listed.
    pub(crate) fn set_bristle_stiffness(&mut self, fraction: f64) {
        self.gradient_is_of_x = false;
        if let Some(pairs) = &mut self.pairs {
            pairs.set_stiffness(fraction);
        }
    }

    /// Makes the tangents of pairs include those of the directions of their forces.
    pub(crate) fn set_turns(&mut self, turns: bool) {
        if let Some(pairs) = &mut self.pairs {
            pairs.set_turns(turns);
        }
    }

    /// Bounds the stiffness of bristles that stick, as a multiple of the inertia of the nodes of their pairs.
    pub(crate) fn set_penalty(&mut self, penalty: f64) {
        if let Some(pairs) = &mut self.pairs {
            pairs.set_penalty(penalty);
        }
    }

    /// Returns the forces of pairs at the last evaluation that listed them.
    pub(crate) fn pairs(&self) -> Option<&Pairs> {
        self.pairs.as_ref()
    }

    /// Returns whether live terms list the forces of pairs, and these act at the end of the open step.
    pub(crate) fn pairs_act_at_end(&self) -> bool {
        self.assembler.shared_live().is_some_and(|live| live.pairs_act_at_end())
    }

    /// Makes live terms act by potentials at the end of the step, with the friction that they have between two configurations, (q, t)
    /// each ([`vi_core::Potential::lagged_friction`]).
    pub(crate) fn lag_friction(&mut self, system: &System, start: (&[f64], f64), end: (&[f64], f64)) {
        self.set_ends(system, start, end);
        let Self { ends: Some([start, end]), assembler, pairs: Some(pairs), .. } = self else { return };
        if let Some(live) = assembler.live() {
            live.lag(start, end, pairs.acting());
            self.lists_pairs = false;
        }
    }

    /// Makes live terms act by their forces over the step again, after [`Evaluator::lag_friction`].
    pub(crate) fn end_lag(&mut self) {
        self.lists_pairs = true;
        self.gradient_is_of_x = false;
        if let Some(live) = self.assembler.live() {
            live.end_lag();
        }
    }

    /// Returns the parts of the last Hessian that come from discrete gradients, with their factors in it.
    pub(crate) fn last_tangents(&self) -> Vec<(f64, &SymmetricMatrix)> {
        self.assembler.shared_live().map_or_else(Vec::new, |live| live.last_tangents())
    }

    /// Returns the groups of nodes that meet on the path from `x` to `end`, or keep too little of their gap.
    pub(crate) fn meetings(&mut self, x: &[f64], end: &[f64]) -> Vec<Meeting> {
        let Some(live) = self.assembler.live() else { return Vec::new() };
        let start = self.ends.as_ref().map_or(x, |[start, _]| start);
        let (meetings, checked) = live.meetings(start, [x, end], KEPT);
        self.work.path_checks += checked as u64;
        meetings
    }

    /// Returns the Hessian of live terms alone at the last configuration; `None` if no pair is near.
    pub(crate) fn live_hessian(&mut self) -> Option<&SymmetricMatrix> {
        let Self { assembler, x, t, work, .. } = self;
        let (hessian, count) = assembler.live()?.own_hessian(x, *t)?;
        work.pair_forces += count as u64;
        Some(hessian)
    }

    /// Requests stencils of live terms for the flight from one configuration to another and beyond, (q, t) each.
    pub(crate) fn follow_flight(&mut self, system: &System, start: (&[f64], f64), end: (&[f64], f64)) {
        let [start, end] = [start, end].map(|(q, t)| system.coordinates().positions(q, t));
        if let Some(live) = self.assembler.live() {
            live.follow_flight(&start, &end);
        }
    }

    /// Returns the nodes of a pair of live terms that obstructs the straight path between two configurations, (q, t) each.
    pub(crate) fn obstacle(
        &mut self,
        system: &System,
        start: (&[f64], f64),
        end: (&[f64], f64),
    ) -> Option<[u32; 4]> {
        let [start, end] = [start, end].map(|(q, t)| system.coordinates().positions(q, t));
        let live = self.assembler.live()?;
        let obstacle = live.obstacle(&start, &end);
        self.work.path_checks += live.candidate_count() as u64;
        obstacle
    }

    /// Returns the ends of the step, if they have been set.
    pub(crate) fn ends(&self) -> Option<&[Vec<f64>; 2]> {
        self.ends.as_ref()
    }

    /// Returns whether pairs are near the last configuration.
    pub(crate) fn has_pairs_near(&self) -> bool {
        self.assembler.shared_live().is_some_and(|live| live.has_pairs_near())
    }

    /// Returns how often live terms have searched for their stencils.
    pub(crate) fn searches(&self) -> u64 {
        self.assembler.shared_live().map_or(0, |live| live.counts()[0])
    }

    /// Returns whether there are live terms that act over steps.
    pub(crate) fn acts_over_steps(&self) -> bool {
        self.assembler.shared_live().is_some_and(|live| live.acts_over_steps())
    }

    /// Returns whether there are live terms.
    pub(crate) fn has_live(&mut self) -> bool {
        self.assembler.live().is_some()
    }

    /// Opens a step from (q, t), for live terms with a memory of earlier steps.
    pub(crate) fn open_step(
        &mut self,
        system: &System,
        q: &[f64],
        t: f64,
        span: StepSpan,
    ) -> Result<(), SolverError> {
        if self.assembler.live().is_none() {
            return Ok(());
        }
        self.set_ends(system, (q, t), (q, t));
        match (&self.ends, self.assembler.live()) {
            (Some([start, _]), Some(live)) => live.open_step(start, span),
            _ => Ok(()),
        }
    }

    /// Opens a step that ends at (q, t) after a motion with the constant velocities q̇, to evaluate the forces of live
    /// terms with a memory in this motion. The step begins with the memory that belongs to (q, t).
    pub(crate) fn arrive(
        &mut self,
        system: &System,
        (q, t): (&[f64], f64),
        q_dot: &[f64],
        span: StepSpan,
    ) -> Result<(), SolverError> {
        self.open_step(system, q, t, span)?;
        if let Some([start, end]) = &mut self.ends {
            system.coordinates().embed_velocity(q_dot, t, start);
            vectors::update(start, |k, start| *start = end[k] - span.duration * *start);
        }
        Ok(())
    }

    /// Closes a step from (q, t) to (q, t). Returns the work and impulses of live terms in this step, without the work
    /// and impulses of their potential.
    ///
    /// # Errors
    /// Returns [`SolverError::Crossing`] if the path of the step is obstructed.
    pub(crate) fn close_step(
        &mut self,
        system: &System,
        start: (&[f64], f64),
        end: (&[f64], f64),
    ) -> Result<StepOutcome, SolverError> {
        self.set_ends(system, start, end);
        let (Some([start, end]), Some(live)) = (&self.ends, self.assembler.live()) else {
            return Ok(StepOutcome::default());
        };
        if let Some(nodes) = live.obstacle(start, end) {
            return Err(SolverError::Crossing { nodes });
        }
        Ok(live.close_step(start, end))
    }

    /// Returns the dampers and the friction that act at the end of the step that was closed last, at the velocities
    /// `x_dot` of all coordinates there.
    pub(crate) fn end_forces(&mut self, x_dot: &[f64]) -> EndForces {
        let (Some([_, end]), Some(live)) = (&self.ends, self.assembler.live()) else {
            return EndForces::default();
        };
        live.end_forces(end, x_dot)
    }

    /// Adds impulses (N s) at the end of the step that was closed last.
    pub(crate) fn add_impulses(&mut self, impulses: &[Impulse]) {
        if let Some(live) = self.assembler.live() {
            live.add_impulses(impulses);
        }
    }

    /// Adds impulses on nodes at the end of the step that was closed last: the nodes, and impulses with the sign of a
    /// gradient, N s.
    pub(crate) fn add_at_end(&mut self, nodal: impl Iterator<Item = (Vec<u32>, Vec<f64>)>) {
        if let Some(live) = self.assembler.live() {
            live.add_at_end(nodal);
        }
    }

    /// Calls `see` with the forces of live terms over the last step. Returns false if they are not known.
    pub(crate) fn see_forces(&self, see: &mut SeeForces<'_>) -> bool {
        self.assembler.shared_live().is_some_and(|live| live.see_forces(see))
    }

    /// Accepts the step that was closed last.
    pub(crate) fn accept_step(&mut self) {
        if let (Some([start, end]), Some(live)) = (&self.ends, self.assembler.live()) {
            live.accept_step(start, end);
        }
    }

    /// Returns whether live terms act by discrete gradients.
    pub(crate) fn has_discrete(&mut self) -> bool {
        self.assembler.live().is_some_and(|live| live.has_discrete())
    }

    /// Returns whether live terms have a memory between steps.
    pub(crate) fn remembers(&self) -> bool {
        self.assembler.shared_live().is_some_and(|live| live.remembers())
    }

    /// Returns the energy that live terms store between steps besides V, J.
    pub(crate) fn stored(&self) -> f64 {
        self.assembler.shared_live().map_or(0.0, |live| live.stored())
    }

    /// Returns the forces between parts of live terms at the last configuration, N.
    pub(crate) fn live_forces(&mut self) -> Vec<Impulse> {
        let Self { assembler, x, .. } = self;
        assembler.live().map(|live| live.forces_between(x)).unwrap_or_default()
    }

    /// Returns the impulses between parts of live terms since the last call, N s.
    pub(crate) fn take_impulses(&mut self) -> Vec<Impulse> {
        self.assembler.live().map(|live| live.take_impulses()).unwrap_or_default()
    }

    /// Returns the impulses of the forces of the last step over the duration of all steps since the last call, N s.
    pub(crate) fn take_last_forces(&mut self) -> Vec<Impulse> {
        self.assembler.live().map(|live| live.take_last_forces()).unwrap_or_default()
    }

    /// Returns the smallest gap of live terms in the steps since the last call, m; infinite if no pair acted.
    pub(crate) fn take_smallest_gap(&mut self) -> f64 {
        self.assembler.live().and_then(|live| live.take_smallest_gap()).unwrap_or(f64::INFINITY)
    }

    /// Keeps a copy of the memory of live terms, for [`Evaluator::return_to_mark`].
    pub(crate) fn mark(&mut self) {
        if let Some(live) = self.assembler.live() {
            live.mark();
        }
    }

    /// Restores the memory of live terms at the last [`Evaluator::mark`].
    pub(crate) fn return_to_mark(&mut self) {
        if let Some(live) = self.assembler.live() {
            live.return_to_mark();
        }
    }

    /// Returns the configurations from which the stencils of live terms come.
    pub(crate) fn live_state(&mut self) -> Option<LiveState> {
        self.assembler.live().map(|live| live.state())
    }

    /// Restores the stencils of live terms, and the ends of a step, of an earlier run.
    pub(crate) fn go_to_live(&mut self, state: &Option<LiveState>, ends: &Option<[Vec<f64>; 2]>) {
        if let (Some(live), Some(state)) = (self.assembler.live(), state) {
            live.go_to(state);
        }
        self.ends.clone_from(ends);
        self.gradient_is_of_x = false;
    }
}
