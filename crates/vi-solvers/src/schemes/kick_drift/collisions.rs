//! The drift of an explicit step in which live terms, such as contact, act by discrete gradients. It replaces q += h
//! M⁻¹p by
//! ```text
//! M (v₁ − v₀) = −h G(x₀, x₁),   x₁ = x₀ + h (v₀ + v₁)/2.
//! ```
//! This is a step of the energy–momentum method for the kinetic energy and these terms alone. It conserves their
//! energy and the momenta, and does not limit the step. If no term acts along the free drift, nothing is solved.

use std::ops::Range;
use std::sync::Arc;

use vi_core::{
    Account, HessianKind, Impulse, Live, Potential, State, Stencils, StepEnergy, System, Traits, Tube,
    packed_len,
};

use crate::assemble::stencil_forces::SeeForces;
use crate::error::SolverError;
use crate::interrupt::Interrupt;
use crate::memory::StepperMemory;
use crate::newton::budget::Budget;
use crate::options::SolverOptions;
use crate::schemes::kick_drift::touching::Touching;
use crate::schemes::one_stage::OneStage;
use crate::schemes::one_stage::rule::{Midpoint, MultiplierDirections, Rule};
use crate::schemes::stepper::Stepper;
use crate::vectors;
use crate::work::Work;

/// Prefix of the names of its memory in that of the scheme.
const PREFIX: &str = "collisions.";

pub(super) struct Collisions {
    /// A system with the live terms alone.
    system: System,
    solver: DriftSolver,
    state: State,
    interrupt: Interrupt,
    /// Whether no term acted in the last drift.
    is_free: bool,
}

/// The method by which a drift with acting terms is made.
enum DriftSolver {
    /// Solves for the coordinates in contact only.
    Touching(Box<Touching>),
    /// Solves for all coordinates, with constraints if there are any.
    Whole(Box<OneStage<Drift>>),
}

/// A live term that acts in drifts if it has a discrete gradient. Otherwise it is empty here, and acts in the kicks
/// by its gradient.
struct InDrift(Arc<dyn Live>);

impl InDrift {
    fn acting(near: Arc<dyn Potential>) -> Arc<dyn Potential> {
        match near.discrete_gradient() {
            Some(_) => near,
            None => Arc::new(Nothing { arity: near.stencils().arity, block: near.stencils().block }),
        }
    }
}

impl Live for InDrift {
    fn name(&self) -> &str {
        self.0.name()
    }

    fn reach(&self) -> f64 {
        self.0.reach()
    }

    fn near(&self, x: &[f64], reach: f64) -> Arc<dyn Potential> {
        Self::acting(self.0.near(x, reach))
    }

    fn within(&self, tube: &Tube) -> Arc<dyn Potential> {
        Self::acting(self.0.within(tube))
    }

    fn lists_pairs(&self) -> bool {
        self.0.lists_pairs()
    }

    fn dissipates(&self) -> bool {
        self.0.dissipates()
    }

    fn is_finite_on_free_paths(&self) -> bool {
        self.0.is_finite_on_free_paths()
    }
}

/// A potential without stencils.
struct Nothing {
    arity: usize,
    block: usize,
}

impl Potential for Nothing {
    fn name(&self) -> &str {
        "nothing"
    }

    fn account(&self) -> Account {
        Account::Contact
    }

    fn stencils(&self) -> Stencils<'_> {
        Stencils { arity: self.arity, block: self.block, nodes: &[] }
    }

    fn traits(&self) -> Traits {
        Traits { hessian: HessianKind::Zero, time_dependent: false }
    }

    fn energies(&self, range: Range<usize>, _x: &[f64], _t: f64, out: &mut [f64]) {
        out[..range.len()].fill(0.0);
    }

    fn gradients(&self, range: Range<usize>, _x: &[f64], _t: f64, out: &mut [f64]) {
        out[..range.len() * self.stencils().size()].fill(0.0);
    }

    fn hessians(&self, range: Range<usize>, _x: &[f64], _t: f64, out: &mut [f64]) {
        out[..range.len() * packed_len(self.stencils().size())].fill(0.0);
    }
}

/// The results of a drift.
#[derive(Default)]
pub(super) struct Drifted {
    /// Change of the kinetic energy, J; zero without a ledger.
    pub(super) kinetic: f64,
    pub(super) energy: StepEnergy,
    pub(super) work: Work,
    solves: u32,
}

/// Largest number of times that a failed drift is halved. The step itself is not cut when a drift fails: near the
/// stability limit, a change of the step exchanges one conserved energy for another (docs/contact.md).
const HALVINGS: u32 = 14;
/// Largest number of solves of one drift, so that a run that has become unstable ends soon. An obstacle that moves by 14 d̂
/// in a step needs up to 60. Scene 569 of `stress --contact --seed 1` fails with 300 and ends with 1000.
const MOST_SOLVES: u32 = 1000;
/// Largest number of Newton iterations of one solve.
const MOST_ITERATIONS: u32 = 50;

/// The midpoint rule of a drift. It takes multiplier directions at the stage, where they do no work, so that bodies
/// with constraints conserve their energy.
pub(super) struct Drift(Midpoint);

impl Rule for Drift {
    fn name(&self) -> &'static str {
        "drift"
    }
    fn works_on_mean_velocity(&self) -> bool {
        true
    }
    fn coefficient(&self, h: f64) -> f64 {
        self.0.coefficient(h)
    }
    fn time(&self) -> f64 {
        self.0.time()
    }
    fn offset(&self, k: usize, v: f64, h: f64) -> f64 {
        self.0.offset(k, v, h)
    }
    fn change(&self, k: usize, v: f64, w: f64, h: f64) -> (f64, f64) {
        self.0.change(k, v, w, h)
    }
    fn takes_discrete_gradients(&self) -> bool {
        true
    }
    fn damps_end(&self) -> bool {
        false
    }
    fn multiplier_directions(&self) -> Option<MultiplierDirections> {
        Some(MultiplierDirections::Stage)
    }
}

impl Collisions {
    /// Returns the drift of a system; `None` if the system has no live terms.
    pub(super) fn new(system: &System, options: &SolverOptions) -> Result<Option<Self>, SolverError> {
        if system.terms().live().is_empty() {
            return Ok(None);
        }
        let acting = |term: &Arc<dyn Live>| Arc::new(InDrift(Arc::clone(term))) as Arc<dyn Live>;
        let live = system.terms().live().iter().map(acting).collect();
        let constraints = system.constraints().to_vec();
        let system = system
            .without_terms()
            .with_live(live)
            .with_constraints(constraints)
            .map_err(|_| SolverError::Memory { missing: "constraints of the system" })?;
        // The energy error is the work of the residual, which is linear in the residual.
        let tolerance = (1e-5 * options.tolerance).max(1e-14);
        let solver = match Touching::new(&system, tolerance, &options.interrupt) {
            Some(touching) => DriftSolver::Touching(Box::new(touching)),
            None => {
                let rule = Drift(Midpoint::new());
                let max_iterations = options.max_iterations.min(MOST_ITERATIONS);
                let options = SolverOptions { tolerance, max_iterations, ..options.clone() };
                DriftSolver::Whole(Box::new(OneStage::new(rule, &system, &options)?))
            }
        };
        let interrupt = options.interrupt.clone();
        let state = State { t: 0.0, q: Vec::new(), p: Vec::new() };
        Ok(Some(Self { system, solver, state, interrupt, is_free: false }))
    }

    /// Drifts from (q, p) at time t by h. Returns `None` if no term acts along the free drift; the caller then makes
    /// that drift.
    ///
    /// # Errors
    /// Returns an error if the equations cannot be solved even in small parts of the drift; q and p are then unchanged. After
    /// [`SolverError::Interrupted`], so is everything else on which the next drift depends.
    pub(super) fn drift(
        &mut self,
        (q, p): (&mut Vec<f64>, &mut Vec<f64>),
        t: f64,
        h: f64,
        ledger: bool,
    ) -> Result<Option<Drifted>, SolverError> {
        self.state.t = t;
        self.state.q.clone_from(q);
        self.state.p.clone_from(p);
        let mut drifted = Drifted::default();
        match &mut self.solver {
            DriftSolver::Whole(stepper) => {
                let is_constrained = !self.system.constraints().is_empty();
                self.is_free =
                    !is_constrained && !stepper.remembers() && stepper.is_free(&self.system, &self.state, h);
                if self.is_free {
                    return Ok(None);
                }
                let remembered = stepper.live_state();
                let memory = self.interrupt.is_possible().then(|| stepper.memory());
                if let Err(error) = self.pass(h, HALVINGS, ledger, &mut drifted) {
                    if let DriftSolver::Whole(stepper) = &mut self.solver {
                        match memory.filter(|_| error.is_interruption()) {
                            Some(memory) => stepper.restore(&self.system, &memory)?,
                            None => stepper.go_to_live(&remembered),
                        }
                    }
                    return Err(error);
                }
            }
            DriftSolver::Touching(touching) => {
                let remembered = touching.keep();
                touching.ledger = ledger;
                match Self::pass_touching(touching, &self.system, &mut self.state, h, HALVINGS, &mut drifted)
                {
                    Ok(false) => return Ok(None),
                    Ok(true) => {}
                    Err(error) => {
                        touching.go_to(remembered);
                        return Err(error);
                    }
                }
            }
        }
        drifted.work.steps = 0;
        std::mem::swap(q, &mut self.state.q);
        std::mem::swap(p, &mut self.state.p);
        Ok(Some(drifted))
    }

    /// Drifts by h, or by two halves of it if that fails. Returns false if no term acted.
    fn pass_touching(
        touching: &mut Touching,
        system: &System,
        state: &mut State,
        h: f64,
        halvings: u32,
        sum: &mut Drifted,
    ) -> Result<bool, SolverError> {
        sum.solves += 1;
        let may_divide = halvings > 0 && sum.solves < MOST_SOLVES;
        let outcome = touching.step(system, state, h, may_divide);
        sum.work += touching.work();
        match outcome {
            Ok(Some(energy)) => {
                sum.energy += energy;
                Ok(true)
            }
            Ok(None) if halvings == HALVINGS => Ok(false),
            Ok(None) => {
                let mass = system.free_mass();
                vectors::update_pair(&mut state.q, &mut state.p, |k, q, p| *q += h * (*p / mass[k]));
                state.t += h;
                Ok(true)
            }
            Err(error) if may_divide && !error.is_interruption() => {
                Self::pass_touching(touching, system, state, 0.5 * h, halvings - 1, sum)?;
                Self::pass_touching(touching, system, state, 0.5 * h, halvings - 1, sum)
            }
            Err(error) => Err(error),
        }
    }

    /// Drifts by h, or by two halves of it if that fails.
    fn pass(&mut self, h: f64, halvings: u32, ledger: bool, sum: &mut Drifted) -> Result<(), SolverError> {
        let Self { system, solver: DriftSolver::Whole(stepper), state, .. } = self else { return Ok(()) };
        let kinetic = |state: &State| if ledger { vi_core::kinetic_energy(system, state) } else { 0.0 };
        let before = kinetic(state);
        sum.solves += 1;
        let may_divide = halvings > 0 && sum.solves < MOST_SOLVES;
        stepper.set_budget(if may_divide { Budget::Seconds(f64::INFINITY) } else { Budget::Unlimited });
        match stepper.step(system, state, h) {
            Ok(report) => {
                sum.kinetic += kinetic(state) - before;
                sum.energy += report.energy;
                sum.work += report.work;
                Ok(())
            }
            Err(error) if may_divide && error.smaller_step_may_help() => {
                self.pass(0.5 * h, halvings - 1, ledger, sum)?;
                self.pass(0.5 * h, halvings - 1, ledger, sum)
            }
            Err(error) => Err(error.cause),
        }
    }

    /// Returns whether all live terms act in the drift, pair by pair.
    pub(super) fn is_exact(&self) -> bool {
        matches!(self.solver, DriftSolver::Touching(_))
    }

    /// Returns the energy that the terms store between steps besides V, J.
    pub(super) fn stored(&self) -> f64 {
        match &self.solver {
            DriftSolver::Touching(touching) => touching.stored(),
            DriftSolver::Whole(stepper) => stepper.stored_energy(),
        }
    }

    /// Returns the impulses between parts of the terms since the last call, N s.
    pub(super) fn take_impulses(&mut self) -> Vec<Impulse> {
        match &mut self.solver {
            DriftSolver::Touching(touching) => touching.take_impulses(),
            DriftSolver::Whole(stepper) => stepper.take_impulses().unwrap_or_default(),
        }
    }

    /// Calls `see` with the forces of the terms over the last drift. Returns false if they are not known.
    pub(super) fn see_forces(&self, see: &mut SeeForces<'_>) -> bool {
        match &self.solver {
            DriftSolver::Touching(touching) => touching.see_forces(see),
            DriftSolver::Whole(_) if self.is_free => true,
            DriftSolver::Whole(stepper) => stepper.see_live_forces(see),
        }
    }

    /// Returns the smallest gap in the steps since the last call, m; `None` if it is not known.
    pub(super) fn take_smallest_gap(&mut self) -> Option<f64> {
        match &mut self.solver {
            DriftSolver::Touching(touching) => Some(touching.take_smallest_gap().unwrap_or(f64::INFINITY)),
            DriftSolver::Whole(stepper) => stepper.take_smallest_gap(),
        }
    }

    /// Returns the number of times that the ordering and layout of a matrix were computed.
    pub(super) fn analyses(&self) -> u64 {
        match &self.solver {
            DriftSolver::Touching(_) => 0,
            DriftSolver::Whole(stepper) => stepper.analyses(),
        }
    }

    pub(super) fn save(&self, memory: &mut StepperMemory) {
        let own = match &self.solver {
            DriftSolver::Touching(touching) => {
                let mut own = StepperMemory::default();
                touching.save(&mut own);
                own
            }
            DriftSolver::Whole(stepper) => stepper.memory(),
        };
        let arrays = own.arrays.into_iter().map(|(name, values)| (format!("{PREFIX}{name}"), values));
        memory.arrays.extend(arrays);
        memory.counts.extend(own.counts.into_iter().map(|(name, count)| (format!("{PREFIX}{name}"), count)));
        memory.texts.extend(own.texts.into_iter().map(|(name, text)| (format!("{PREFIX}{name}"), text)));
    }

    pub(super) fn restore(&mut self, memory: &StepperMemory) -> Result<(), SolverError> {
        let own = |name: &str| name.strip_prefix(PREFIX).map(str::to_owned);
        let arrays = memory.arrays.iter().filter_map(|(name, values)| Some((own(name)?, values.clone())));
        let counts = memory.counts.iter().filter_map(|(name, count)| Some((own(name)?, *count)));
        let texts = memory.texts.iter().filter_map(|(name, text)| Some((own(name)?, text.clone())));
        let mut memory = StepperMemory {
            method: String::new(),
            arrays: arrays.collect(),
            counts: counts.collect(),
            texts: texts.collect(),
        };
        match &mut self.solver {
            DriftSolver::Touching(touching) => {
                touching.restore(&memory);
                Ok(())
            }
            DriftSolver::Whole(stepper) => {
                memory.method = stepper.memory().method;
                stepper.restore(&self.system, &memory)
            }
        }
    }
}
