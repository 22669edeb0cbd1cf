//! Evaluates V and its derivatives at a configuration q and time t, and checks that they are finite. Steppers access
//! the terms of a system through it.

mod held_forces;
mod live_terms;
mod memory;
mod passes;

use vi_core::{State, System};

use crate::assemble::assembler::Assembler;
use crate::assemble::finite::check_state;
use crate::assemble::force_sum::ForceSum;
use crate::assemble::gather::Gather;
use crate::assemble::hessian::{HessianEvaluation, Place};
use crate::assemble::pairs::Pairs;
use crate::error::SolverError;
use crate::linear::matrix::SymmetricMatrix;
use crate::linear::matrix_sum::MatrixSum;
use crate::vectors;
use crate::work::Work;

use held_forces::HeldForces;

/// The sums of a system's terms, with the buffers to evaluate them.
pub(crate) struct Evaluator {
    assembler: Assembler,
    /// Positions of all coordinates at the last evaluation.
    x: Vec<f64>,
    /// Free coordinates at the last evaluation, if nodes have their own axes: then x does not determine them to the
    /// bit.
    q: Vec<f64>,
    t: f64,
    gradient: Vec<f64>,
    /// Whether `gradient` belongs to `x` and `t`.
    gradient_is_of_x: bool,
    depends: TimeDependence,
    /// Forces without a potential, if the scheme uses them.
    nonconservative: Option<Nonconservative>,
    /// Positions of all coordinates at the ends of the step, between which discrete gradients act.
    ends: Option<[Vec<f64>; 2]>,
    /// Positions of all coordinates at the ends of the step, if terms act by [forces over it](vi_core::Potential::corrections_over_step).
    step: Option<[Vec<f64>; 2]>,
    /// The forces of live terms pair by pair, and whether evaluations list them.
    pairs: Option<Pairs>,
    lists_pairs: bool,
    middle: Option<Middle>,
    pub(crate) work: Work,
}

/// Whether and how the potential and the positions of a system depend on the time t.
#[derive(Debug, Clone, Copy)]
pub(crate) struct TimeDependence {
    /// Whether V depends on t at the same positions.
    is_explicit: bool,
    /// Whether neither V nor x(q, t) depends on t.
    pub(crate) is_none: bool,
}

impl TimeDependence {
    /// Returns how a system depends on the time.
    pub(crate) fn of(system: &System) -> Self {
        let is_explicit = system.potentials().iter().any(|term| term.traits().time_dependent);
        Self { is_explicit, is_none: !is_explicit && !system.coordinates().is_moving() }
    }
}

/// The middle of a step: at time t, prescribed coordinates are half-way between their ends.
struct Middle {
    t: f64,
    ends: [f64; 2],
    x_end: Vec<f64>,
}

/// Forces without a potential, at the velocities that a stage implies.
struct Nonconservative {
    sum: ForceSum,
    x_dot: Vec<f64>,
    /// ∂ẋ/∂q within the stage, 1/s.
    rate: f64,
    tangent: Option<MatrixSum>,
    /// The forces that act instead, if they are held.
    held: Option<HeldForces>,
}

impl Evaluator {
    pub(crate) fn new(system: &System) -> Self {
        Self::with(Assembler::new(system), system)
    }

    /// Returns the evaluator of the portion of a system that a rank of several computes. All ranks must evaluate at the
    /// same calls, so `depends` is that of the whole system.
    pub(crate) fn of_portion(system: &System, gather: Gather, depends: TimeDependence) -> Self {
        Self { depends, ..Self::with(Assembler::of_portion(system.terms().clone(), gather), system) }
    }

    fn with(assembler: Assembler, system: &System) -> Self {
        let count = system.coordinates().dof_count();
        Self {
            assembler,
            x: vec![f64::NAN; count],
            q: Vec::new(),
            t: f64::NAN,
            gradient: vec![0.0; count],
            gradient_is_of_x: false,
            depends: TimeDependence::of(system),
            nonconservative: None,
            ends: None,
            step: None,
            pairs: None,
            lists_pairs: false,
            middle: None,
            work: Work::default(),
        }
    }

    /// Sets the prescribed coordinates of evaluations at time t to the mean of their positions at the times `ends`,
    /// in place of their positions at t. If q is the mean of the ends of the step, so is x.
    pub(crate) fn set_middle(&mut self, system: &System, t: f64, ends: [f64; 2]) {
        if system.coordinates().is_moving() {
            let x_end = self.middle.take().map_or_else(Vec::new, |middle| middle.x_end);
            self.middle = Some(Middle { t, ends, x_end });
        }
    }

    /// Sets the ends of the step, so that Hessians contain the tangents of forces over the step; with `None`, the
    /// Hessian is ∂²V/∂x².
    pub(crate) fn set_step(&mut self, ends: Option<[&[f64]; 2]>) {
        self.step = ends.map(|ends| ends.map(<[f64]>::to_vec));
    }

    /// Returns the ends of the step that [`Evaluator::set_step`] set.
    pub(crate) fn step(&self) -> Option<[&[f64]; 2]> {
        self.step.as_ref().map(|[start, end]| [&start[..], &end[..]])
    }

    /// See [`Assembler::limits_steps`].
    pub(crate) fn limits_steps(&self) -> bool {
        self.assembler.limits_steps()
    }

    /// See [`Assembler::largest_step`].
    pub(crate) fn largest_step(&mut self, x: &[f64], dx: &[f64], end: Option<[&[f64]; 2]>) -> f64 {
        self.assembler.largest_step(x, dx, end)
    }

    /// Returns an evaluator that includes the forces without a potential: its gradients are ∂V/∂x − f, and its
    /// Hessians contain their tangents. [`Evaluator::set_velocities`] sets their velocities.
    pub(crate) fn with_nonconservative(system: &System) -> Self {
        let count = system.coordinates().dof_count();
        let whole =
            |sum| Nonconservative { sum, x_dot: vec![0.0; count], rate: 0.0, tangent: None, held: None };
        Self { nonconservative: ForceSum::new(system).map(whole), ..Self::new(system) }
    }

    /// Returns whether evaluations include forces without a potential.
    pub(crate) fn has_nonconservative(&self) -> bool {
        self.nonconservative.is_some()
    }

    /// Sets the velocities q̇ of the next evaluation at time t, with ∂q̇/∂q = `rate` (1/s).
    pub(crate) fn set_velocities(&mut self, system: &System, q_dot: &[f64], t: f64, rate: f64) {
        if let Some(forces) = &mut self.nonconservative {
            system.coordinates().embed_velocity(q_dot, t, &mut forces.x_dot);
            forces.rate = rate;
            self.gradient_is_of_x = false;
        }
    }

    /// Linearises the forces without a potential at the last configuration and velocities; further evaluations use this
    /// linearisation.
    pub(crate) fn hold_forces(&mut self, system: &System) {
        if let Some(Nonconservative { sum, x_dot, rate, held, .. }) = &mut self.nonconservative {
            *held = Some(HeldForces::new(system, sum, &self.x, x_dot, self.t, *rate));
            self.gradient_is_of_x = false;
        }
    }

    /// Makes further evaluations use the forces themselves again, after [`Evaluator::hold_forces`].
    pub(crate) fn release_forces(&mut self) {
        if let Some(forces) = &mut self.nonconservative {
            forces.held = None;
            self.gradient_is_of_x = false;
        }
    }

    /// Returns the work of the forces without a potential at the last evaluation along `dx` (in the nodes' own axes)
    /// by account: (force, damping), J.
    pub(crate) fn nonconservative_work(&self, dx: &[f64]) -> (f64, f64) {
        self.nonconservative.as_ref().map_or((0.0, 0.0), |forces| forces.sum.work(dx))
    }

    /// Writes the forces without a potential at the last evaluation to `out`, N: [forces, damping] of all coordinates.
    /// Leaves `out` unchanged if the system has no such forces.
    pub(crate) fn nonconservative(&self, out: &mut [Vec<f64>; 2]) {
        let Some(forces) = &self.nonconservative else { return };
        let [force, damping] = out;
        force.clear();
        damping.clear();
        for dof in 0..forces.x_dot.len() {
            let (of_force, of_damping) = forces.sum.by_account(dof);
            force.push(of_force);
            damping.push(of_damping);
        }
    }

    /// Returns whether friction is [lagged](Evaluator::lag_friction) or forces are [held](Evaluator::hold_forces).
    pub(crate) fn is_simplified(&self) -> bool {
        let holds = self.nonconservative.as_ref().is_some_and(|forces| forces.held.is_some());
        holds || self.assembler.shared_live().is_some_and(|live| live.is_lagged())
    }

    /// Returns ∂V/∂x of all coordinates at the last configuration, N.
    pub(crate) fn gradient(&self) -> &[f64] {
        &self.gradient
    }

    /// Returns x of all coordinates at the last configuration, m.
    pub(crate) fn positions(&self) -> &[f64] {
        &self.x
    }

    /// Returns t of the last configuration, s.
    pub(crate) fn time(&self) -> f64 {
        self.t
    }

    /// Sets the positions `x` of all coordinates and the time t.
    pub(crate) fn go_to_positions(&mut self, x: &[f64], t: f64) {
        self.x.copy_from_slice(x);
        self.q.clear();
        self.t = t;
        self.gradient_is_of_x = false;
    }

    /// Returns ẋ and ∂ẋ/∂q of the last evaluation, if there are forces that may depend on them.
    pub(crate) fn velocities(&self) -> Option<(Vec<f64>, f64)> {
        self.nonconservative.as_ref().map(|forces| (forces.x_dot.clone(), forces.rate))
    }

    /// Sets ẋ and ∂ẋ/∂q to values that [`Evaluator::velocities`] returned.
    pub(crate) fn go_to_velocities(&mut self, rates: &Option<(Vec<f64>, f64)>) {
        if let (Some(forces), Some((x_dot, rate))) = (&mut self.nonconservative, rates) {
            forces.x_dot.clone_from(x_dot);
            forces.rate = *rate;
            self.gradient_is_of_x = false;
        }
    }

    /// Returns the gradient at the last configuration, if it was evaluated there.
    pub(crate) fn known_gradient(&self) -> Option<&[f64]> {
        self.gradient_is_of_x.then_some(&self.gradient[..])
    }

    pub(crate) fn assembler(&mut self) -> &mut Assembler {
        &mut self.assembler
    }

    /// Returns whether (q, t) is bitwise the point of the last evaluation. If nothing depends on t, a different t is
    /// accepted: a clock that counts steps and one that sums them differ by round-off.
    pub(crate) fn is_at(&self, system: &System, q: &[f64], t: f64) -> bool {
        let coordinates = system.coordinates();
        if !coordinates.node_axes().is_empty() {
            return self.is_at_time(t) && self.q == q;
        }
        self.is_at_time(t) && q.iter().zip(coordinates.free()).all(|(q, &dof)| *q == self.x[dof as usize])
    }

    fn is_at_time(&self, t: f64) -> bool {
        self.t == t || (self.depends.is_none && !self.t.is_nan())
    }

    /// Returns whether the gradient is known at time t, for the positions of the last evaluation.
    pub(crate) fn knows_gradient_of(&self, t: f64) -> bool {
        self.gradient_is_of_x && self.is_at_time(t)
    }

    /// Returns whether several ranks share the system.
    pub(crate) fn is_shared(&self) -> bool {
        self.assembler.gather().is_some_and(Gather::is_shared)
    }

    /// Discards the configuration of the last evaluation, so that the next one computes everything anew.
    pub(crate) fn forget(&mut self) {
        self.t = f64::NAN;
        self.gradient_is_of_x = false;
    }

    /// Returns whether nothing has been evaluated since the start or the last [`Evaluator::forget`].
    pub(crate) fn is_blank(&self) -> bool {
        self.t.is_nan()
    }

    /// Moves to (q, t). Keeps the gradient only if it was evaluated at bitwise the same point.
    pub(crate) fn go_to(&mut self, system: &System, q: &[f64], t: f64) {
        if self.is_at(system, q, t) {
            self.t = t;
            return;
        }
        match &mut self.middle {
            Some(Middle { t: middle, ends: [start, end], x_end }) if *middle == t => {
                x_end.resize(self.x.len(), 0.0);
                system.coordinates().embed(q, *start, &mut self.x);
                system.coordinates().embed(q, *end, x_end);
                // x is affine in q, so the mean embeds the midpoint of q with the mean of the prescribed positions.
                self.x.iter_mut().zip(x_end).for_each(|(x, end)| *x = 0.5 * (*x + *end));
            }
            _ => system.coordinates().embed(q, t, &mut self.x),
        }
        if !system.coordinates().node_axes().is_empty() {
            self.q.clear();
            self.q.extend_from_slice(q);
        }
        self.t = t;
        self.gradient_is_of_x = false;
    }

    /// Evaluates ∂V/∂x at (q, t), unless the last evaluation was made there.
    pub(crate) fn evaluate(
        &mut self,
        system: &System,
        q: &[f64],
        t: f64,
        at_start: bool,
    ) -> Result<(), SolverError> {
        self.go_to(system, q, t);
        if self.gradient_is_of_x {
            return Ok(());
        }
        self.assembler.gradient(&self.x, t, &mut self.gradient);
        self.add_discrete_gradient(system);
        self.work.gradients += 1;
        if let Some(Nonconservative { held: Some(held), .. }) = &mut self.nonconservative {
            held.subtract(system, &self.x, &mut self.gradient);
        } else if let Some(forces) = &mut self.nonconservative {
            forces.sum.evaluate(&self.x, &forces.x_dot, t);
            for (dof, gradient) in self.gradient.iter_mut().enumerate() {
                *gradient -= forces.sum.total(dof);
            }
        }
        if vectors::all_finite(&self.gradient) {
            self.gradient_is_of_x = true;
            return Ok(());
        }
        Err(self.why_not_finite(at_start))
    }

    /// Returns the error of a failed step from `state`. If the start itself has no finite force, returns that error
    /// instead.
    pub(crate) fn explain(&mut self, system: &System, state: &State, error: SolverError) -> SolverError {
        self.ends = None;
        if check_state(state, system).is_err() {
            return error;
        }
        self.evaluate(system, &state.q, state.t, true).err().unwrap_or(error)
    }

    /// Returns V at (q, t), J; with the potential of forces that are [held](Evaluator::hold_forces).
    pub(crate) fn energy(&mut self, system: &System, q: &[f64], t: f64) -> f64 {
        self.go_to(system, q, t);
        self.work.energies += 1;
        let energy = self.assembler.energies(&self.x, t).total();
        match &mut self.nonconservative {
            Some(Nonconservative { held: Some(held), .. }) => energy + held.energy(system, &self.x),
            _ => energy,
        }
    }

    /// Returns V with positions `x` of all coordinates at time t, J.
    pub(crate) fn energy_of_positions(&mut self, x: &[f64], t: f64) -> f64 {
        self.work.energies += 1;
        self.assembler.energies(x, t).total()
    }

    /// Returns whether neither V nor x(q, t) depends on t.
    pub(crate) fn is_autonomous(&self) -> bool {
        self.depends.is_none
    }

    /// Returns whether V depends on t explicitly.
    pub(crate) fn is_time_dependent(&self) -> bool {
        self.depends.is_explicit
    }

    /// Returns ∂²V/∂q² at the last configuration, with the tangents of forces without a potential.
    ///
    /// # Errors
    /// Returns an error if the matrices cannot be summed into one.
    pub(crate) fn hessian(
        &mut self,
        system: &System,
        kind: HessianEvaluation,
    ) -> Result<&SymmetricMatrix, SolverError> {
        self.work.hessians += 1;
        self.work.projections += u64::from(kind == HessianEvaluation::Projected);
        let ends = self.ends.as_ref().map(|[start, end]| [&start[..], &end[..]]);
        let step = self.step.as_ref().map(|[start, end]| [&start[..], &end[..]]);
        let k = self.assembler.hessian_over(Place { x: &self.x, t: self.t, ends: step }, kind, ends)?;
        let Some(Nonconservative { sum, x_dot, rate, tangent, held }) = &mut self.nonconservative else {
            return Ok(k);
        };
        let mut parts = vec![(1.0, k)];
        match held {
            Some(held) => parts.extend(held.tangent().map(|matrix| (1.0, matrix))),
            None => {
                sum.evaluate(&self.x, x_dot, self.t);
                parts.extend(sum.tangents(system, *rate));
            }
        }
        MatrixSum::of(tangent, &parts)
    }

    /// Calls `each` with matrices and factors whose sum is ∂²V/∂q² at the last configuration, with the tangents of forces
    /// without a potential and without those of discrete gradients.
    pub(crate) fn for_each_hessian(&mut self, system: &System, each: &mut dyn FnMut(f64, &SymmetricMatrix)) {
        self.work.hessians += 1;
        self.assembler.for_each_hessian(&self.x, self.t, each);
        if let Some(Nonconservative { sum, x_dot, rate, .. }) = &mut self.nonconservative {
            sum.evaluate(&self.x, x_dot, self.t);
            sum.tangents(system, *rate).for_each(|(factor, matrix)| each(factor, matrix));
        }
    }

    fn why_not_finite(&self, at_start: bool) -> SolverError {
        if let Some(dof) = self.x.iter().position(|x| !x.is_finite()) {
            return SolverError::NotFinite { what: "position", dof, at_start };
        }
        match self.assembler.fault(&self.x, self.t) {
            Some(term) => SolverError::Term { term, at_start },
            None => {
                let dof = self.gradient.iter().position(|g| !g.is_finite()).unwrap_or(0);
                SolverError::NotFinite { what: "force", dof, at_start }
            }
        }
    }
}
