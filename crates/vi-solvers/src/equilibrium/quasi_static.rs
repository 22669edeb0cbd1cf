//! A stepper that goes from one equilibrium to the next: t is the load factor, momenta are zero.

use vi_core::{Impulse, State, StepEnergy, System};

use crate::assemble::assembler::Assembler;
use crate::assemble::live::LiveState;
use crate::assemble::stencil_forces::SeeForces;
use crate::equilibrium::friction::Rubbed;
use crate::equilibrium::load_control::{Earlier, search};
use crate::equilibrium::options::{CriticalKind, CriticalPoint, StaticOptions, StaticReport};
use crate::equilibrium::tangent_solver::ConstantTangent;
use crate::error::SolverError;
use crate::linear::choice::REASON;
use crate::memory::{StepperMemory, expect_method};
use crate::options::LinearSolver;
use crate::schemes::stepper::{StepError, StepReport, Stepper};
use crate::work::Work;

const NAME: &str = "static";
/// Error of a critical load, relative to the load, up to which it is printed without the error.
const SHARP: f64 = 1e-5;
/// Names of the state of friction in the memory.
const FRICTION: &str = "friction";
const STORED: &str = "friction.stored";
/// Name of the choice of conjugate gradients in the memory.
const PCG: &str = "static.pcg";

/// Names of the last equilibrium in the memory.
const EQUILIBRIUM: &str = "static.equilibrium";
const STABLE: &str = "static.stable";
/// Name of the number of factors of a constant K in the memory, 0 or 1.
const TANGENT: &str = "static.tangent";

struct QuasiStatic {
    options: StaticOptions,
    ledger: Option<Assembler>,
    work: Work,
    findings: Vec<String>,
    /// The linear solver of the first step and the reason for it; later steps keep it.
    linear: Option<(LinearSolver, String)>,
    friction: Rubbed,
    /// The last equilibrium, and whether it is stable.
    last: Option<(Vec<f64>, bool)>,
    /// The factor of a K that is the same everywhere.
    tangent: Option<ConstantTangent>,
    /// Whether there is that factor, or was one when the run was interrupted. Then to make it again is not counted.
    was_made: bool,
    /// Duration of the last step.
    h: f64,
}

/// Returns descriptions of the critical points and snaps of a step.
pub(crate) fn findings(report: &StaticReport) -> impl Iterator<Item = String> {
    let critical = report.critical.iter().map(|point| {
        let what = match point.kind {
            CriticalKind::Limit => "a limit point, where the load that the body carries has an extremum",
            CriticalKind::Bifurcation => "a bifurcation: the body buckles",
        };
        let [before, after] = point.eigenvalues;
        let CriticalPoint { load_factor, error, .. } = *point;
        let place = match error <= SHARP * load_factor.abs() {
            true => format!("at load factor {load_factor:.6}"),
            false => format!("near load factor {load_factor:.6} ± {error:.1e}"),
        };
        format!("{place} {what} (lowest ω² {before:.3e} before, {after:.3e} 1/s² after)")
    });
    let snapped = |t: &f64| {
        format!("the path of equilibria ends at load factor {t:.6}: the body has snapped beyond it")
    };
    critical.chain(report.jumps.iter().map(snapped)).collect::<Vec<_>>().into_iter()
}

/// Returns a stepper that goes from the equilibrium at t to that at t + h. It cuts steps further as `options` say;
/// their `end` is not used. With a ledger, the part of ΔV that is neither the work of loads nor of prescribed motion is booked as
/// error of the scheme.
pub fn quasi_static(system: &System, options: StaticOptions, ledger: bool) -> Box<dyn Stepper> {
    Box::new(QuasiStatic {
        options,
        ledger: ledger.then(|| Assembler::new(system)),
        work: Work::default(),
        findings: Vec::new(),
        linear: None,
        friction: Rubbed::default(),
        last: None,
        tangent: None,
        was_made: false,
        h: 0.0,
    })
}

impl Stepper for QuasiStatic {
    fn step(&mut self, system: &System, state: &mut State, h: f64) -> Result<StepReport, StepError> {
        let options = StaticOptions {
            end: state.t + h,
            increment: h.abs(),
            largest_increment: h.abs(),
            linear: self.linear.as_ref().map_or(self.options.linear, |(linear, _)| *linear),
            ..self.options.clone()
        };
        let before = state.clone();
        let mut rubbed = Rubbed { work: 0.0, ..self.friction.clone() };
        let is_stable = self.last.as_ref().filter(|(q, _)| *q == state.q).map(|&(_, is_stable)| is_stable);
        let earlier = Earlier {
            is_stable,
            rubbed: &mut rubbed,
            work: &mut self.work,
            tangent: &mut self.tangent,
            was_made: self.was_made,
        };
        let report = search(system, state, &options, &mut |_, _| true, earlier)
            .map_err(|cause| StepError { t: before.t, h, cause })?;
        self.was_made = self.tangent.is_some() || (self.was_made && report.work.factorizations == 0);
        self.findings.extend(findings(&report));
        if self.linear.is_none() {
            self.linear.clone_from(&report.linear);
        }
        let stored = rubbed.stored - self.friction.stored;
        let friction = rubbed.work;
        self.friction = rubbed;
        self.last = Some((state.q.clone(), report.is_stable()));
        self.h = h;
        let energy = StepEnergy { friction, ..report.energy };
        let energy = with_error(energy, stored, self.ledger.as_mut(), system, [&before, state]);
        let mut work = report.work;
        work.steps = 1;
        self.work.steps += 1;
        Ok(StepReport { iterations: work.newton_iterations as u32, energy, work })
    }

    fn work(&self) -> Work {
        self.work
    }

    fn linear_solver(&self) -> Option<&str> {
        self.linear.as_ref().map(|(_, reason)| reason.as_str())
    }

    fn take_findings(&mut self) -> Vec<String> {
        std::mem::take(&mut self.findings)
    }

    fn stored_energy(&self) -> f64 {
        self.friction.stored
    }

    fn take_impulses(&mut self) -> Option<Vec<Impulse>> {
        let mut impulses = std::mem::take(&mut self.friction.forces);
        impulses.iter_mut().for_each(|impulse| impulse.value.iter_mut().for_each(|value| *value *= self.h));
        // Without friction, nothing is listed.
        (!impulses.is_empty()).then_some(impulses)
    }

    fn see_live_forces(&self, see: &mut SeeForces<'_>) -> bool {
        self.friction.listed.see(see)
    }

    fn take_smallest_gap(&mut self) -> Option<f64> {
        self.friction.smallest_gap.take()
    }

    fn memory(&self) -> StepperMemory {
        let mut memory = StepperMemory { method: NAME.to_owned(), ..Default::default() };
        self.friction.memory.save(FRICTION, &mut memory);
        memory.arrays.push((STORED.to_owned(), vec![self.friction.stored]));
        if let Some((q, is_stable)) = &self.last {
            memory.arrays.push((EQUILIBRIUM.to_owned(), q.clone()));
            memory.counts.push((STABLE.to_owned(), u64::from(*is_stable)));
        }
        let chosen = self.linear.as_ref().map(|(linear, _)| match linear {
            LinearSolver::Petsc => 2,
            LinearSolver::Pcg => 1,
            _ => 0,
        });
        memory.counts.push((TANGENT.to_owned(), u64::from(self.was_made)));
        memory.counts.extend(chosen.map(|code| (PCG.to_owned(), code)));
        memory.texts.extend(self.linear.iter().map(|(_, reason)| (REASON.to_owned(), reason.clone())));
        memory
    }

    fn restore(&mut self, system: &System, memory: &StepperMemory) -> Result<(), SolverError> {
        self.work = Work::default();
        expect_method(memory, NAME)?;
        let count = system.coordinates().dof_count();
        self.linear = None;
        if let Ok(code) = memory.count(PCG) {
            let linear = match code {
                2 => LinearSolver::Petsc,
                1 => LinearSolver::Pcg,
                _ => LinearSolver::Cholesky,
            };
            self.linear = Some((linear, memory.text(REASON)?.to_owned()));
        }
        let state = LiveState::restore(FRICTION, memory, count).unwrap_or_default();
        let stored = memory.array(STORED)?.first().copied().unwrap_or(0.0);
        self.friction = Rubbed { memory: state, stored, ..Rubbed::default() };
        self.tangent = None;
        self.was_made = memory.count(TANGENT).is_ok_and(|count| count == 1);
        self.last = match (memory.array(EQUILIBRIUM), memory.count(STABLE)) {
            (Ok(q), Ok(is_stable)) => Some((q.to_vec(), is_stable == 1)),
            _ => None,
        };
        Ok(())
    }
}

/// Returns the work between two equilibria with the rest of the change of energy as error of the scheme, J. The energy is V plus that
/// which friction `stored`. The kinetic energy of `before` is not used and counts as taken away by forces. Without a ledger, the work is unchanged.
pub(super) fn with_error(
    work: StepEnergy,
    stored: f64,
    ledger: Option<&mut Assembler>,
    system: &System,
    [before, after]: [&State; 2],
) -> StepEnergy {
    let Some(assembler) = ledger else { return work };
    let mut potential = |state: &State| assembler.energies(&system.positions(state), state.t).total();
    let change = potential(after) - potential(before) + stored;
    StepEnergy {
        scheme: change - work.work(),
        force: work.force - vi_core::kinetic_energy(system, before),
        ..work
    }
}
