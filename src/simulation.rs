//! The simulation of a scene: systems with their states and steppers, stepped together.

mod adaptive;
mod added;
mod advance;
mod between;
mod circulation;
mod contact;
mod contact_fields;
mod contact_report;
mod crossing;
mod driven;
mod failure;
mod idle;
mod inertia;
mod march;
pub mod matrices;
mod measure;
mod needs;
mod observe;
mod pace;
mod passing;
mod ranks;
mod snapshot;
pub mod stability;
#[cfg(test)]
mod tests;
mod unheld;

use std::sync::Arc;

use vi_core::{Alone, Exchange, SharedTerms, State, System};
use vi_solvers::{Assembler, HeldWork, Member, Method, Partners, SolverOptions, Stepper, UnitCosts, Work};

use crate::model::parts::needs_no_elements;
use crate::model::{
    self, BodyModel, Holding, Meeting, Model, NodeSet, Parted, ProbeTarget, RegionProbe, RigidModel,
    path_control,
};
use crate::scene::{Fix, Problem, Scene};
pub use adaptive::AdaptiveCounts;
use adaptive::{Adaptive, StepDemand};
pub use added::AddedTerm;
pub use advance::Stepped;
pub(crate) use advance::TOGETHER;
pub use contact::ContactFacts;
use contact::{ContactTotals, ContactWatch};
use driven::Driven;
use needs::{has_domain, is_worked_on, keeps_ledger, method_of, problem_of_push, problem_of_ranks};
pub use observe::{Observation, ProbeValue};
use pace::Pace;
pub use ranks::RankFacts;
pub(crate) use ranks::{are_complete, far_nodes, is_shared, members, problems_of_ranks};
pub use snapshot::{Snapshot, Substeps};

/// Bodies that act on each other, as one Lagrangian system with its integrator.
///
/// Bodies that do not act on each other are separate components, with the same cost as if they were alone. A
/// component without a free coordinate has no stepper; its ledger alone costs something, if work is done on it.
pub struct Component {
    pub(crate) system: System,
    pub(crate) state: State,
    pub(crate) stepper: Option<Box<dyn Stepper>>,
    /// The account of the work on the component, if it has no free coordinate and its ledger is kept.
    held: Option<Box<HeldWork>>,
    /// Subdivision of its steps.
    pace: Pace,
    /// Evaluates energies for observers; created at first use.
    observer: Option<Assembler>,
    /// Whether its stepper keeps the full energy ledger.
    keeps_ledger: bool,
    /// Whether a configuration can lie outside the domain of a term.
    has_domain: bool,
    contact: Option<ContactWatch>,
    /// The frequencies of the motion that adaptive steps follow; created at first use.
    demand: Option<StepDemand>,
    /// The functions of time that adaptive steps follow; none with other steps.
    driven: Driven,
    /// Whether the ranks have made their portions from parts of the bodies.
    is_of_parts: bool,
}

impl Component {
    /// Returns the Lagrangian system.
    pub fn system(&self) -> &System {
        &self.system
    }

    /// Returns the state of the component.
    pub fn state(&self) -> &State {
        &self.state
    }

    /// Returns the velocities of all coordinates, m/s.
    fn velocities(&self) -> Vec<f64> {
        let known = self.stepper.as_ref().and_then(|stepper| stepper.velocity(&self.state));
        let Some(q_dot) = known else { return self.system.velocities(&self.state) };
        let mut x_dot = vec![0.0; self.system.coordinates().dof_count()];
        self.system.coordinates().embed_velocity(q_dot, self.state.t, &mut x_dot);
        x_dot
    }

    /// Returns the integrator; `None` if no coordinate is free.
    pub fn stepper(&self) -> Option<&dyn Stepper> {
        self.stepper.as_deref()
    }
}

/// A scene with its state, ready for steps.
pub struct Simulation {
    scene: Scene,
    bodies: Vec<BodyModel>,
    rigids: Vec<RigidModel>,
    probes: Vec<ProbeTarget>,
    /// The nodes of each fix of the scene.
    fixes: Vec<NodeSet>,
    region_probes: Vec<RegionProbe>,
    components: Vec<Component>,
    notes: Vec<String>,
    steps: u64,
    step_count: u64,
    h: f64,
    method: Method,
    options: SolverOptions,
    /// Number of parts into which each step is divided; 1 before any [`Simulation::halve`].
    parts: u32,
    /// Length of the longest part of a step since [`Simulation::keep`], in h/2¹⁴; 0 if there was none.
    longest_since_kept: u32,
    switched: bool,
    substeps: Substeps,
    /// The rule of adaptive steps, and their counts.
    adaptive: Option<Adaptive>,
    adaptive_counts: AdaptiveCounts,
    /// Work of replaced steppers, and of the run that this one continues.
    earlier_work: Work,
    /// Energy from [`Simulation::set_motion`] that no step has booked yet, J.
    given: f64,
    contact: ContactTotals,
    /// Pairs of bodies with contact.
    meeting: Meeting,
    /// Bodies that `contact.resolve` moved before the start.
    parted: Vec<Parted>,
    /// The ranks that share it, if there are several.
    ranks: Option<RankFacts>,
}

impl Simulation {
    /// Reads the meshes of a scene and builds its systems at t = 0. A scene with scheme `auto` must first be passed
    /// to [`crate::auto::settle`].
    ///
    /// # Errors
    /// Returns all problems of the scene and its meshes, at once.
    pub fn new(scene: Scene) -> Result<Self, Vec<Problem>> {
        Self::build(scene, (&alone(), Vec::new()), Ok)
    }

    /// Builds the simulation after `extend` has changed the model of the scene. `own` are the portions of the components that
    /// were made from parts.
    fn build(
        scene: Scene,
        (exchange, own): (&Arc<dyn Exchange>, Vec<Option<Member>>),
        extend: impl FnOnce(Model) -> Result<Model, Vec<Problem>>,
    ) -> Result<Self, Vec<Problem>> {
        let problems = scene.problems();
        if !problems.is_empty() {
            return Err(problems);
        }
        let Some(method) = method_of(&scene) else {
            let message = "\"auto\" is settled by trial runs before a simulation is made: pass the scene that \
                           variational::auto::settle returns";
            return Err(vec![Problem::new("time.scheme", message)]);
        };
        let is_shared = is_shared(&scene, exchange);
        let holding = match is_shared {
            true if !own.is_empty() && needs_no_elements(&scene) => Holding::Nodes,
            true => Holding::Portions,
            false => Holding::Whole,
        };
        let model = extend(model::build(&scene, holding)?)?;
        let mut problems = Vec::new();
        let followed = scene.statics.as_ref().filter(|statics| statics.follows_path());
        let mut path = followed
            .map(|_| path_control(&scene, model.control.as_ref(), &model.bodies, &model.components))
            .transpose()
            .map_err(|problem| vec![problem])?;
        let mut options = scene.solver.options();
        options.impulses = scene.probes.iter().any(|probe| probe.between.is_some());
        let mut components = Vec::with_capacity(model.components.len());
        let mut own = own.into_iter();
        for (number, ((mut system, state), contact)) in
            model.components.into_iter().zip(model.contacts).enumerate()
        {
            options.ledger = keeps_ledger(&scene, &system);
            let mut partners = None;
            let member = own.next().flatten();
            let far = far_nodes(&model.bodies, number, exchange.size());
            let mut own_bodies = model.bodies.iter().filter(|body| body.component == number);
            if let Some((id, fault)) = own_bodies.find_map(|body| Some((body.id, body.far_fault()?))) {
                problems.push(Problem::new(format!("body[{}].mesh", id.index()), fault));
                continue;
            }
            let of_parts = member
                .and_then(|member| Partners::of_parts((number, &system), far, member, Arc::clone(exchange)));
            let is_of_parts = of_parts.is_some();
            if is_shared && system.coordinates().free_count() > 0 {
                let run = (&method, &options);
                let made = of_parts
                    .map_or_else(|| Partners::new((number, &system, &state), run, Arc::clone(exchange)), Ok);
                match made {
                    Ok(made) => {
                        let made = Arc::new(made);
                        system = system.with_shared(Arc::clone(&made) as Arc<dyn SharedTerms>);
                        partners = Some(made);
                    }
                    Err(error) => {
                        problems.push(problem_of_ranks(&error));
                        continue;
                    }
                }
            }
            let made = if system.coordinates().free_count() == 0 {
                Ok(None)
            } else if let Some(statics) = &scene.statics {
                let statics = statics.options(&scene.time, &scene.solver);
                match path.take() {
                    Some(control) => {
                        vi_solvers::path_following(&system, statics, control, options.ledger).map(Some)
                    }
                    None => Ok(Some(vi_solvers::quasi_static(&system, statics, options.ledger))),
                }
            } else if let Some(partners) = &partners {
                vi_solvers::stepper_of_ranks(&method, &system, &options, partners).map(Some)
            } else {
                vi_solvers::stepper(&method, &system, &options).map(Some)
            };
            let stepper = made.unwrap_or_else(|error| {
                let key = if scene.statics.is_some() { "static" } else { "time" };
                problems.push(Problem::new(key, error.to_string()));
                None
            });
            problems.extend(problem_of_push(&scene, &system));
            let keeps_ledger = options.ledger;
            let has_domain = has_domain(&system);
            let is_held = system.coordinates().free_count() == 0;
            let held = (is_held && keeps_ledger && is_worked_on(&system))
                .then(|| Box::new(HeldWork::new(&system, scene.statics.is_some())));
            components.push(Component {
                system,
                state,
                stepper,
                held,
                pace: Pace::default(),
                observer: None,
                keeps_ledger,
                has_domain,
                contact: contact.map(ContactWatch::new),
                demand: None,
                driven: Driven::default(),
                is_of_parts,
            });
        }
        if !problems.is_empty() {
            return Err(problems);
        }
        let adaptive = scene.time.is_adaptive().then(|| Adaptive::new(method, &scene.time));
        if adaptive.is_some() {
            for (number, component) in components.iter_mut().enumerate() {
                let bodies = model.bodies.iter().map(|body| (&body.name, body.component));
                let rigids = model.rigids.iter().map(|rigid| (&rigid.name, rigid.component));
                let own: Vec<&String> =
                    bodies.chain(rigids).filter(|(_, of)| *of == number).map(|(name, _)| name).collect();
                component.driven = Driven::new(&scene, |body| own.iter().any(|name| *name == body));
            }
        }
        let (step_count, h) = match scene.output.schedule() {
            Some(schedule) if adaptive.is_some() => scene.time.intervals(schedule.interval()),
            _ => scene.time.steps(),
        };
        let arc_steps = scene.statics.as_ref().and_then(|statics| statics.arc_steps);
        let step_count = arc_steps.map_or(step_count, u64::from);
        let mut simulation = Self {
            scene,
            bodies: model.bodies,
            rigids: model.rigids,
            probes: model.probes,
            fixes: model.fixes,
            region_probes: model.region_probes,
            components,
            notes: model.notes,
            steps: 0,
            step_count,
            h,
            method,
            options,
            parts: 1,
            longest_since_kept: 0,
            switched: false,
            substeps: Substeps { finest: 1, ..Substeps::default() },
            adaptive,
            adaptive_counts: AdaptiveCounts::default(),
            earlier_work: Work::default(),
            given: 0.0,
            contact: ContactTotals::default(),
            meeting: model.meeting,
            parted: model.parted,
            ranks: None,
        };
        simulation.note_contact();
        simulation.note_passing();
        simulation.note_inertia();
        simulation.note_circulation();
        simulation.note_idle();
        let problems = simulation.crossing_start();
        if problems.is_empty() { Ok(simulation) } else { Err(problems) }
    }

    /// Returns the cost of all work so far on one core of the reference machine, s. It is counted, not measured, so
    /// it is the same in every run.
    pub fn counted_seconds(&self) -> f64 {
        let cost = |component: &Component| {
            let stepper = component.stepper.as_ref()?;
            let work = stepper.work();
            let triangle_count = component.contact.as_ref().map_or(0, ContactWatch::triangle_count);
            let live = UnitCosts::live_seconds(&work, triangle_count);
            Some(stepper.unit_costs(&component.system).seconds(&work) + live)
        };
        self.components.iter().filter_map(cost).sum()
    }

    /// Returns whether any component keeps the full energy ledger.
    pub(crate) fn has_ledger(&self) -> bool {
        self.components.iter().any(|component| component.keeps_ledger)
    }

    /// Returns whether all work from outside is recorded, or there is none.
    pub(crate) fn is_accounted(&self) -> bool {
        self.components.iter().all(|component| component.keeps_ledger || !is_worked_on(&component.system))
    }

    /// Returns the ranks that share the simulation, if there are several.
    pub fn ranks(&self) -> Option<&RankFacts> {
        self.ranks.as_ref()
    }

    /// Returns the integrator.
    pub fn method(&self) -> Method {
        self.method
    }

    /// Returns the scene.
    pub fn scene(&self) -> &Scene {
        &self.scene
    }

    /// Returns the bodies, in the order of the scene.
    pub fn bodies(&self) -> &[BodyModel] {
        &self.bodies
    }

    /// Returns the rigid bodies, in the order of the scene.
    pub fn rigids(&self) -> &[RigidModel] {
        &self.rigids
    }

    /// Returns the fixes of the scene, each with its nodes.
    pub fn fixed_nodes(&self) -> impl Iterator<Item = (&Fix, &NodeSet)> {
        self.scene.fixes.iter().zip(&self.fixes)
    }

    /// Returns the systems.
    pub fn components(&self) -> &[Component] {
        &self.components
    }

    /// Returns the number of free coordinates of all systems.
    pub fn free_coordinates(&self) -> usize {
        self.components.iter().map(|component| component.system.coordinates().free_count()).sum()
    }

    /// Returns the notes on repairs and omissions of the mesh readers.
    pub fn notes(&self) -> &[String] {
        &self.notes
    }

    /// Returns the notes on the steps since the last call, e.g. on a limit point.
    pub fn take_findings(&mut self) -> Vec<String> {
        let mut found = Vec::new();
        for component in &mut self.components {
            found.extend(component.stepper.iter_mut().flat_map(|stepper| stepper.take_findings()));
            found.extend(component.system.terms().shared().iter().flat_map(|shared| shared.take_findings()));
        }
        found
    }

    /// Returns the step h that lands on the scene's end, s.
    pub fn step_size(&self) -> f64 {
        self.h
    }

    /// Returns the number of steps made.
    pub fn steps(&self) -> u64 {
        self.steps
    }

    /// Declares the initial state to be that after `steps` steps, without earlier motion.
    pub(crate) fn start_at(&mut self, steps: u64) {
        self.steps = steps;
        let t = self.time();
        self.components.iter_mut().for_each(|component| component.state.t = t);
    }

    /// Returns the number of steps of the scene; on a path by arc length it is the largest number of arc steps.
    pub fn step_count(&self) -> u64 {
        self.step_count
    }

    /// Returns the time, s. On a path of equilibria it counts steps of `time.step`; see [`Simulation::load_factor`].
    pub fn time(&self) -> f64 {
        self.steps as f64 * self.h
    }

    /// Returns whether the end is reached.
    pub fn is_done(&self) -> bool {
        let statics = self.scene.statics.as_ref();
        let is_arc = statics.is_some_and(|statics| statics.arc_steps.is_some());
        self.steps >= self.step_count || (is_arc && self.load_factor() == Some(self.scene.time.end))
    }

    /// Returns the load factor on a path of equilibria that computes it.
    pub fn load_factor(&self) -> Option<f64> {
        self.scene.statics.as_ref().filter(|statics| statics.follows_path())?;
        self.components.iter().find(|component| component.stepper.is_some()).map(|c| c.state.t)
    }

    /// Returns the name of a body by its number in the scene. Rigid bodies are numbered after the others.
    pub(crate) fn name_of(&self, number: usize) -> &str {
        model::name_of(&self.scene, number)
    }

    /// Returns the counts of adaptive steps so far; `None` if steps are equal.
    pub fn adaptive_counts(&self) -> Option<AdaptiveCounts> {
        self.adaptive.map(|_| self.adaptive_counts)
    }

    /// Returns the counts of steps that were cut into substeps so far.
    pub fn substeps(&self) -> Substeps {
        self.substeps
    }

    /// Returns the work done by all steppers so far.
    pub fn work(&self) -> Work {
        let mut total = self.earlier_work;
        for stepper in self.components.iter().filter_map(Component::stepper) {
            total += stepper.work();
        }
        total
    }
}

/// Returns the exchange of one process.
fn alone() -> Arc<dyn Exchange> {
    Arc::new(Alone)
}
