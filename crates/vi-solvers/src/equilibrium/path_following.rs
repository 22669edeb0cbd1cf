//! A stepper that follows a path of equilibria. `state.t` is the load factor, which each step finds; momenta are
//! zero.

use vi_core::{State, System};

use crate::assemble::assembler::Assembler;
use crate::assemble::finite::check_state;
use crate::equilibrium::balance::refuse_constraints;
use crate::equilibrium::function::PathFunction;
use crate::equilibrium::options::{LoadStep, StaticOptions};
use crate::equilibrium::path::branch::Path;
use crate::equilibrium::quasi_static::{findings, with_error};
use crate::equilibrium::search::Search;
use crate::error::SolverError;
use crate::memory::{StepperMemory, expect_method};
use crate::options::LinearSolver;
use crate::schemes::stepper::{StepError, StepReport, Stepper};
use crate::work::Work;

const NAME: &str = "path of equilibria";

/// The quantity that determines the length of a step along a path of equilibria.
pub enum PathControl {
    /// The arc length. The path is followed to the load factor `end` of the options, or for `arc_steps` steps.
    Arc,
    /// A function of the positions, which changes in `steps` equal steps from its initial value to `to`.
    Function {
        /// The function.
        function: Box<PathFunction>,
        /// The value of the function at the end.
        to: f64,
        /// Number of steps.
        steps: u64,
    },
}

struct PathFollowing {
    options: StaticOptions,
    control: PathControl,
    /// `None` before the first step.
    path: Option<Path>,
    /// Value of the function at the start; zero for arc length.
    start: f64,
    /// Number of steps made.
    made: u64,
    ledger: Option<Assembler>,
    work: Work,
    findings: Vec<String>,
}

/// Returns a stepper that follows a path of equilibria from the load factor `state.t`. Each step finds the next load
/// factor; its argument h is ignored. With a ledger, the work of loads and prescribed motion, which is ΔV along the
/// path, is booked as work of forces.
///
/// # Errors
/// Returns [`SolverError::Option`], or [`SolverError::ConstrainedAnalysis`] if the system has constraints.
pub fn path_following(
    system: &System,
    options: StaticOptions,
    control: PathControl,
    ledger: bool,
) -> Result<Box<dyn Stepper>, SolverError> {
    options.check()?;
    refuse_constraints("a path of equilibria", system)?;
    // Near limit points the tangent is indefinite, which conjugate gradients do not solve.
    let options = StaticOptions { linear: LinearSolver::Cholesky, ..options };
    Ok(Box::new(PathFollowing {
        options,
        control,
        path: None,
        start: 0.0,
        made: 0,
        ledger: ledger.then(|| Assembler::new(system)),
        work: Work::default(),
        findings: Vec::new(),
    }))
}

impl PathFollowing {
    /// Makes a step of the path that begins or continues at `state`; returns the data of the path after it.
    fn follow(&mut self, search: &mut Search, state: &mut State) -> Result<Path, SolverError> {
        let system = search.balance.system;
        let mut path = match self.path.clone() {
            Some(path) => path,
            None => {
                if let PathControl::Function { function, .. } = &mut self.control {
                    self.start = function.value(&system.positions(state));
                }
                Path::begin(search, state)?
            }
        };
        match &mut self.control {
            PathControl::Arc => path.arc_step(search, state)?,
            PathControl::Function { function, to, steps } => {
                let share = (self.made + 1) as f64 / *steps as f64;
                let goal =
                    if self.made + 1 == *steps { *to } else { self.start + share * (*to - self.start) };
                let smallest = self.options.smallest_increment * (*to - self.start).abs();
                path.step_to(search, state, function, goal, smallest)?
            }
        };
        Ok(path)
    }

    /// Records a finding if this was the last allowed arc step and the final load factor is not reached.
    fn note_end(&mut self, state: &State) {
        let end = self.options.end;
        if let (PathControl::Arc, Some(steps)) = (&self.control, self.options.arc_steps)
            && self.made == u64::from(steps)
            && state.t != end
        {
            let load_factor = state.t;
            self.findings.push(SolverError::ArcSteps { steps, load_factor, end }.to_string());
        }
    }
}

impl Stepper for PathFollowing {
    fn step(&mut self, system: &System, state: &mut State, h: f64) -> Result<StepReport, StepError> {
        let before = state.clone();
        let options = self.options.clone();
        let mut watch = |_: &State, _: &LoadStep| true;
        let mut search = Search::new(system, &options, &mut watch);
        let outcome = check_state(state, system).and_then(|()| {
            search.balance.begin_work(&before);
            let path = self.follow(&mut search, state)?;
            search.balance.accept(&state.q, state.t)?;
            Ok(path)
        });
        match outcome {
            Ok(path) => self.path = Some(path),
            Err(cause) => {
                *state = before;
                return Err(StepError { t: self.made as f64 * h, h, cause });
            }
        }
        state.p.fill(0.0);
        self.made += 1;
        self.findings.extend(findings(&search.report));
        let (mut work, done) = (search.balance.work, search.balance.work_done());
        work.steps = 1;
        self.work += work;
        self.note_end(state);
        let energy = with_error(done, 0.0, self.ledger.as_mut(), system, [&before, state]);
        Ok(StepReport { iterations: work.newton_iterations as u32, energy, work })
    }

    fn work(&self) -> Work {
        self.work
    }

    fn take_findings(&mut self) -> Vec<String> {
        std::mem::take(&mut self.findings)
    }

    fn memory(&self) -> StepperMemory {
        let mut memory = StepperMemory { method: NAME.to_owned(), ..Default::default() };
        memory.counts.push(("steps".to_owned(), self.made));
        if let Some(path) = &self.path {
            let Path { psi, length, shift, last: (moved, moved_t), velocity, is_stable } = path;
            memory.counts.push(("is stable".to_owned(), u64::from(*is_stable)));
            let scales = vec![*psi, *length, *shift, *moved_t, self.start];
            memory.arrays.extend([
                ("scales".to_owned(), scales),
                ("last step".to_owned(), moved.clone()),
                ("direction".to_owned(), velocity.clone()),
            ]);
        }
        memory
    }

    fn restore(&mut self, system: &System, memory: &StepperMemory) -> Result<(), SolverError> {
        expect_method(memory, NAME)?;
        self.work = Work::default();
        self.findings.clear();
        self.made = memory.count("steps")?;
        if self.made == 0 {
            self.path = None;
            return Ok(());
        }
        let n = system.coordinates().free_count();
        let vector = |name| {
            let found = memory.array(name)?;
            if found.len() == n { Ok(found.to_vec()) } else { Err(SolverError::Memory { missing: name }) }
        };
        let &[psi, length, shift, moved_t, start] = memory.array("scales")? else {
            return Err(SolverError::Memory { missing: "scales" });
        };
        self.start = start;
        self.path = Some(Path {
            psi,
            length,
            shift,
            last: (vector("last step")?, moved_t),
            velocity: vector("direction")?,
            is_stable: memory.count("is stable")? == 1,
        });
        Ok(())
    }
}
