//! A scene come to life: systems with their states and steppers, stepped together.
//! It must not know files: `run.rs` writes what it observes.

mod march;
mod observe;
mod pace;
mod snapshot;

use rayon::prelude::*;
use vi_core::{HessianKind, State, System};
use vi_solvers::{Assembler, Method, SolverError, SolverOptions, StepError, Stepper, Work};

use crate::auto::AutoReport;
use crate::model::{BodyModel, Model, ProbeTarget, RigidModel};
use crate::scene::{Problem, Scene};
use march::{Cut, March, march};
pub use observe::{Observation, ProbeValue};
use pace::Pace;
pub use snapshot::{Snapshot, Substeps};

/// Steps that are made together at most: a caller who asks for more may still interrupt.
pub(crate) const TOGETHER: u64 = 16;

/// Bodies that act on each other, as one Lagrangian system with its integrator.
///
/// Bodies apart from each other are separate components and cost what they cost alone; a component
/// without a free coordinate has no stepper and costs nothing.
pub struct Component {
    pub(crate) system: System,
    pub(crate) state: State,
    pub(crate) stepper: Option<Box<dyn Stepper>>,
    /// How finely its steps are cut.
    pace: Pace,
    /// Evaluates energies for observers; made when first asked for.
    observer: Option<Assembler>,
    /// Does its stepper keep the full energy ledger?
    keeps_ledger: bool,
    /// Can a configuration lie outside the domain of a term?
    has_domain: bool,
}

impl Component {
    /// The Lagrangian system.
    pub fn system(&self) -> &System {
        &self.system
    }

    /// Its state.
    pub fn state(&self) -> &State {
        &self.state
    }

    /// Velocities of all coordinates, m/s.
    fn velocities(&self) -> Vec<f64> {
        let known = self.stepper.as_ref().and_then(|stepper| stepper.velocity(&self.state));
        let Some(q_dot) = known else { return self.system.velocities(&self.state) };
        let mut x_dot = vec![0.0; self.system.coordinates().dof_count()];
        self.system.coordinates().embed_velocity(q_dot, self.state.t, &mut x_dot);
        x_dot
    }

    /// The integrator; none where no coordinate is free.
    pub fn stepper(&self) -> Option<&dyn Stepper> {
        self.stepper.as_deref()
    }
}

/// What one step of all components did.
#[derive(Debug, Clone, Copy, Default)]
pub struct Stepped {
    /// Newton iterations.
    pub iterations: u64,
    /// What changed the energy, J (where the ledger is kept, and always the prescribed work).
    pub energy: vi_core::StepEnergy,
    /// Substeps of all components; 0 where every step was made as it was asked for.
    pub substeps: u64,
}

/// A scene with its state, ready to be stepped.
pub struct Simulation {
    scene: Scene,
    bodies: Vec<BodyModel>,
    rigids: Vec<RigidModel>,
    probes: Vec<ProbeTarget>,
    components: Vec<Component>,
    notes: Vec<String>,
    steps: u64,
    step_count: u64,
    h: f64,
    method: Method,
    auto: Option<AutoReport>,
    options: SolverOptions,
    /// Into how many parts each step is cut from the start; 1 unless [`Simulation::halve`].
    parts: u32,
    switched: bool,
    substeps: Substeps,
    /// Work of steppers that have been replaced, and of the run that this one continues.
    earlier_work: Work,
}

impl Simulation {
    /// Reads the meshes of a scene and builds its systems at t = 0.
    ///
    /// # Errors
    /// Everything that is wrong with the scene and its meshes, at once.
    pub fn new(scene: Scene) -> Result<Self, Vec<Problem>> {
        let problems = scene.problems();
        if !problems.is_empty() {
            return Err(problems);
        }
        let (scene, method, auto) = match scene.time.method() {
            Some(method) => (scene, method, None),
            None => {
                let (settled, choice, report) = crate::auto::choose(&scene)?;
                (settled, choice.method(), Some(report))
            }
        };
        let model = Model::build(&scene)?;
        let mut problems = Vec::new();
        let mut options = scene.solver.options();
        let mut components = Vec::with_capacity(model.components.len());
        for (system, state) in model.components {
            options.ledger = match scene.output.ledger {
                Some(asked) => asked,
                None => scene.statics.is_none() && is_worked_on(&system),
            };
            let stepper = if system.coordinates().free_count() == 0 {
                None
            } else if let Some(statics) = &scene.statics {
                Some(vi_solvers::quasi_static(&system, statics.options(), options.ledger))
            } else {
                match vi_solvers::stepper(&method, &system, &options) {
                    Ok(stepper) => Some(stepper),
                    Err(error) => {
                        problems.push(Problem::new("time", error.to_string()));
                        None
                    }
                }
            };
            let keeps_ledger = options.ledger;
            let has_domain = has_domain(&system);
            components.push(Component {
                system,
                state,
                stepper,
                pace: Pace::default(),
                observer: None,
                keeps_ledger,
                has_domain,
            });
        }
        if !problems.is_empty() {
            return Err(problems);
        }
        let (step_count, h) = scene.time.steps();
        Ok(Self {
            scene,
            bodies: model.bodies,
            rigids: model.rigids,
            probes: model.probes,
            components,
            notes: model.notes,
            steps: 0,
            step_count,
            h,
            method,
            auto,
            options,
            parts: 1,
            switched: false,
            substeps: Substeps { finest: 1, ..Substeps::default() },
            earlier_work: Work::default(),
        })
    }

    /// What all work so far costs on one core of the reference machine, s: counted, so that it is the same
    /// in every run.
    pub fn counted_seconds(&self) -> f64 {
        let cost = |component: &Component| {
            let stepper = component.stepper.as_ref()?;
            Some(stepper.unit_costs(&component.system).seconds(&stepper.work()))
        };
        self.components.iter().filter_map(cost).sum()
    }

    /// Does any component keep the full energy ledger?
    pub(crate) fn has_ledger(&self) -> bool {
        self.components.iter().any(|component| component.keeps_ledger)
    }

    /// Is all work from outside accounted for, or is there none?
    pub(crate) fn is_accounted(&self) -> bool {
        self.components.iter().all(|component| component.keeps_ledger || !is_worked_on(&component.system))
    }

    /// The integrator.
    pub fn method(&self) -> Method {
        self.method
    }

    /// Why this scheme and step, where the scene left them open.
    pub fn auto(&self) -> Option<&AutoReport> {
        self.auto.as_ref()
    }

    /// The scene, with scheme and step settled.
    pub fn scene(&self) -> &Scene {
        &self.scene
    }

    /// The bodies, in the order of the scene.
    pub fn bodies(&self) -> &[BodyModel] {
        &self.bodies
    }

    /// The rigid bodies, in the order of the scene.
    pub fn rigids(&self) -> &[RigidModel] {
        &self.rigids
    }

    /// The systems.
    pub fn components(&self) -> &[Component] {
        &self.components
    }

    /// What was repaired or left out when meshes were read.
    pub fn notes(&self) -> &[String] {
        &self.notes
    }

    /// What a reader should hear of the steps since the last call, e.g. of a limit point.
    pub fn take_findings(&mut self) -> Vec<String> {
        let steppers = self.components.iter_mut().filter_map(|component| component.stepper.as_mut());
        steppers.flat_map(|stepper| stepper.take_findings()).collect()
    }

    /// The step h that lands on the scene's end, s.
    pub fn step_size(&self) -> f64 {
        self.h
    }

    /// Steps made.
    pub fn steps(&self) -> u64 {
        self.steps
    }

    /// Steps that the scene asks for.
    pub fn step_count(&self) -> u64 {
        self.step_count
    }

    /// Time, s.
    pub fn time(&self) -> f64 {
        self.steps as f64 * self.h
    }

    /// Is the end reached?
    pub fn is_done(&self) -> bool {
        self.steps >= self.step_count
    }

    /// Steps that were cut into substeps so far.
    pub fn substeps(&self) -> Substeps {
        self.substeps
    }

    /// Advances every component by one step, in substeps where it fails as a whole and the scene allows them.
    ///
    /// # Errors
    /// The first component's [`StepError`]; all states are then as before.
    pub fn step(&mut self) -> Result<Stepped, StepError> {
        let (h, is_static) = (self.h, self.scene.statics.is_some());
        let end = (self.steps + 1) as f64 * h;
        // Statics cuts its increments by itself.
        let further = self.scene.time.substeps && !is_static;
        let cut = Cut { parts: self.parts, further };
        let advance = |component: &mut Component| -> Result<March, StepError> {
            let Component { system, state, stepper, pace, observer, has_domain, .. } = component;
            match stepper {
                Some(stepper) => {
                    // Not all schemes look at the end of a step: implicit midpoint only sees its middle.
                    let unseen = *has_domain && !is_static && stepper.gradient().is_none();
                    let mut check = |system: &System, state: &State| {
                        let assembler = observer.get_or_insert_with(|| Assembler::new(system));
                        accepts(assembler, system, state)
                    };
                    let check: Option<march::Check<'_>> = if unseen { Some(&mut check) } else { None };
                    march(stepper.as_mut(), system, (state, pace), h, end, cut, check)
                }
                None => {
                    state.t = end;
                    Ok(March::default())
                }
            }
        };
        let mut total = Stepped::default();
        let mut finest = self.parts;
        let mut enter = |done: March| {
            total.iterations += done.iterations;
            total.energy += done.energy;
            total.substeps += done.substeps;
            finest = finest.max(done.finest);
        };
        let bodies = &self.bodies;
        if let [component] = self.components.as_mut_slice() {
            enter(advance(component).map_err(|error| in_numbers_of_meshes(bodies, 0, error))?);
        } else {
            let before: Vec<State> = self.components.iter().map(|c| c.state.clone()).collect();
            let results: Vec<_> = self.components.par_iter_mut().map(advance).collect();
            if results.iter().any(Result::is_err) {
                for (component, state) in self.components.iter_mut().zip(before) {
                    component.state = state;
                }
            }
            for (number, result) in results.into_iter().enumerate() {
                enter(result.map_err(|error| in_numbers_of_meshes(bodies, number, error))?);
            }
        }
        if total.substeps > 0 {
            self.substeps.steps += 1;
            self.substeps.substeps += total.substeps;
            self.substeps.finest = self.substeps.finest.max(u64::from(finest));
        }
        self.steps += 1;
        Ok(total)
    }

    /// Advances every component by one step, or by up to `most` together where that is cheaper: the bits are those
    /// of [`Simulation::step`] every time.
    ///
    /// # Errors
    /// As [`Simulation::step`].
    pub fn advance(&mut self, most: u64) -> Result<Stepped, StepError> {
        let count = most.min(TOGETHER).min(self.step_count.saturating_sub(self.steps));
        if count > 1 && self.steps_together(count as u32) {
            return Ok(Stepped::default());
        }
        self.step()
    }

    /// Makes `count` steps in one stretch; false, with nothing changed, where a component cannot.
    fn steps_together(&mut self, count: u32) -> bool {
        let (h, end) = (self.h, (self.steps + u64::from(count)) as f64 * self.h);
        if self.parts > 1 || self.scene.statics.is_some() {
            return false;
        }
        let several = self.components.len() > 1;
        let advance = |component: &mut Component| -> Option<Option<State>> {
            let Component { system, state, stepper, pace, has_domain, .. } = component;
            let before = several.then(|| state.clone());
            if let Some(stepper) = stepper {
                let unseen = *has_domain && stepper.gradient().is_none();
                if unseen || !pace.is_whole() {
                    return None;
                }
                stepper.steps(system, state, h, count)?;
                pace.walk(count);
            }
            state.t = end;
            Some(before)
        };
        if let [component] = self.components.as_mut_slice() {
            if advance(component).is_none() {
                return false;
            }
        } else {
            let paces: Vec<Pace> = self.components.iter().map(|component| component.pace).collect();
            let results: Vec<_> = self.components.par_iter_mut().map(advance).collect();
            if results.iter().any(Option::is_none) {
                for ((component, before), pace) in self.components.iter_mut().zip(results).zip(paces) {
                    component.pace = pace;
                    if let Some(Some(before)) = before {
                        component.state = before;
                    }
                }
                return false;
            }
        }
        self.steps += u64::from(count);
        true
    }

    /// Work done by all steppers so far.
    pub fn work(&self) -> Work {
        let mut total = self.earlier_work;
        for stepper in self.components.iter().filter_map(Component::stepper) {
            total += stepper.work();
        }
        total
    }
}

/// The error of a component with the coordinate that it names counted as in the bodies' own meshes.
fn in_numbers_of_meshes(bodies: &[BodyModel], component: usize, mut error: StepError) -> StepError {
    if let SolverError::NotFinite { dof, .. } = &mut error.cause {
        let body = bodies.iter().filter(|body| body.component == component).find_map(|body| {
            let number = (*dof / 3).checked_sub(body.node_offset)? as u32;
            Some(body.node_offset + body.numbering.node(number)? as usize)
        });
        *dof = body.map_or(*dof, |node| 3 * node + *dof % 3);
    }
    error
}

/// Can a configuration lie outside the domain of a term? So it can where the first stencil has no energy when
/// all its nodes are in one place.
fn has_domain(system: &System) -> bool {
    let collapsed = vec![0.0; system.coordinates().dof_count()];
    system.potentials().iter().any(|term| {
        let mut energy = [0.0];
        let is_varying = term.traits().hessian == HessianKind::Varying && term.stencils().count() > 0;
        if is_varying {
            term.energies(0..1, &collapsed, 0.0, &mut energy);
        }
        !energy[0].is_finite()
    })
}

/// Do all terms have a finite energy at a state?
fn accepts(assembler: &mut Assembler, system: &System, state: &State) -> Result<(), SolverError> {
    let x = system.positions(state);
    if assembler.energies(system, &x, state.t).total().is_finite() {
        return Ok(());
    }
    Err(match assembler.fault(system, &x, state.t) {
        Some(term) => SolverError::Term { term, at_start: false },
        None => SolverError::NotFinite { what: "energy", dof: 0, at_start: false },
    })
}

/// Does something outside put energy in or take it out: moving supports, forces without a potential, or loads
/// that change in time?
fn is_worked_on(system: &System) -> bool {
    system.coordinates().is_moving()
        || !system.forces().is_empty()
        || system.potentials().iter().any(|term| term.traits().time_dependent)
}
