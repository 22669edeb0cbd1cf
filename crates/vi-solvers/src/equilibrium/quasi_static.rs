//! A stepper that goes from one equilibrium to the next: t is the load factor, momenta are zero.

use vi_core::{State, StepEnergy, System};

use crate::assemble::assembler::Assembler;
use crate::equilibrium::load_control::equilibrium;
use crate::equilibrium::options::{CriticalKind, StaticOptions, StaticReport};
use crate::error::SolverError;
use crate::memory::{StepperMemory, expect_method};
use crate::schemes::stepper::{StepError, StepReport, Stepper};
use crate::work::Work;

const NAME: &str = "static";

struct QuasiStatic {
    options: StaticOptions,
    ledger: Option<Assembler>,
    work: Work,
    findings: Vec<String>,
}

/// Returns descriptions of the critical points and snaps of a step.
pub(crate) fn findings(report: &StaticReport) -> impl Iterator<Item = String> {
    let critical = report.critical.iter().map(|point| {
        let what = match point.kind {
            CriticalKind::Limit => "a limit point, where the load that the body carries has an extremum",
            CriticalKind::Bifurcation => "a bifurcation: the body buckles",
        };
        let [before, after] = point.eigenvalues;
        let factor = point.load_factor;
        format!("at load factor {factor:.6} {what} (lowest ω² {before:.3e} before, {after:.3e} 1/s² after)")
    });
    let snapped = |t: &f64| {
        format!("the path of equilibria ends at load factor {t:.6}: the body has snapped beyond it")
    };
    critical.chain(report.jumps.iter().map(snapped)).collect::<Vec<_>>().into_iter()
}

/// Returns a stepper that goes from the equilibrium at t to that at t + h. It cuts steps further as `options` say;
/// their `end` is not used. With a ledger, the work of loads and prescribed motion, which is ΔV along a path of
/// equilibria, is booked as work of forces.
pub fn quasi_static(system: &System, options: StaticOptions, ledger: bool) -> Box<dyn Stepper> {
    Box::new(QuasiStatic {
        options,
        ledger: ledger.then(|| Assembler::new(system)),
        work: Work::default(),
        findings: Vec::new(),
    })
}

impl Stepper for QuasiStatic {
    fn step(&mut self, system: &System, state: &mut State, h: f64) -> Result<StepReport, StepError> {
        let options = StaticOptions {
            end: state.t + h,
            increment: h.abs(),
            largest_increment: h.abs(),
            ..self.options.clone()
        };
        let before = state.clone();
        let report =
            equilibrium(system, state, &options).map_err(|cause| StepError { t: before.t, h, cause })?;
        self.findings.extend(findings(&report));
        let force = work_of_loads(self.ledger.as_mut(), system, &before, state);
        let energy = StepEnergy { force, ..StepEnergy::default() };
        let mut work = report.work;
        work.steps = 1;
        self.work += work;
        Ok(StepReport { iterations: work.newton_iterations as u32, energy, work })
    }

    fn work(&self) -> Work {
        self.work
    }

    fn take_findings(&mut self) -> Vec<String> {
        std::mem::take(&mut self.findings)
    }

    fn memory(&self) -> StepperMemory {
        StepperMemory { method: NAME.to_owned(), ..Default::default() }
    }

    fn restore(&mut self, _system: &System, memory: &StepperMemory) -> Result<(), SolverError> {
        self.work = Work::default();
        expect_method(memory, NAME)
    }
}

/// Returns the work (J) of loads and prescribed motion between two equilibria: ΔV minus the kinetic energy of
/// `before`, which is not used. Zero without a ledger.
pub(super) fn work_of_loads(
    ledger: Option<&mut Assembler>,
    system: &System,
    before: &State,
    after: &State,
) -> f64 {
    let Some(assembler) = ledger else { return 0.0 };
    let mut potential = |state: &State| assembler.energies(&system.positions(state), state.t).total();
    potential(after) - potential(before) - vi_core::kinetic_energy(system, before)
}
