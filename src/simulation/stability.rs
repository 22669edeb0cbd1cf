//! Compares an explicit step with its stability limit before the run, using the highest frequency and damping rate of the scene.

use rayon::prelude::*;
use vi_core::{State, System};
use vi_solvers::{Frequencies, Method, SolverError, highest_frequency};

use crate::simulation::{Component, Simulation};

/// The largest part of the stability limit that is advised with contact.
const WITH_CONTACT: f64 = 0.25;

/// The stability of an explicit scheme at the start of a run.
#[derive(Debug, Clone, PartialEq)]
pub struct StabilityNote {
    /// The scheme.
    pub method: Method,
    /// The step, s; of adaptive steps the longest at the start.
    pub step: f64,
    /// Whether steps are adaptive: then they follow the limit.
    pub is_adaptive: bool,
    /// Whether bodies may meet. Contact changes the steps that nodes make, and each change adds energy near the limit.
    pub has_contact: bool,
    /// Highest angular frequency ω of the scene at its start, rad/s.
    pub highest_frequency: f64,
    /// Highest rate at which velocities decay by damping at the start, 1/s.
    pub damping_rate: f64,
    /// The largest stable step, s: (hω limit)/ω with the [frequency that limits it](Method::limiting_frequency).
    pub step_limit: f64,
}

impl StabilityNote {
    /// Returns the longest step that is advised, s: a tenth below the limit, a quarter of the limit with contact (docs/contact.md), or
    /// infinity if a scheme is unstable at any step.
    pub fn advised_step(&self) -> f64 {
        let share = if self.has_contact { WITH_CONTACT } else { 0.9 };
        if self.step_limit == 0.0 { f64::INFINITY } else { share * self.step_limit }
    }

    /// Returns advice for a run that became unstable with a step slightly below the limit at the start.
    pub fn diagnosis(&self) -> Option<String> {
        let share = self.step / self.step_limit;
        let (least, reason, advised) = match self.has_contact {
            true => (WITH_CONTACT, "near it, contact adds energy", self.advised_step()),
            false => {
                (0.5, "the limit falls as bodies deform, and above it a run is unstable", 0.8 * self.step)
            }
        };
        let is_near = !self.is_adaptive && share > least && share <= 1.0;
        is_near.then(|| {
            format!(
                "the step {:.3e} s was {share:.2} of the stability limit that {} had at the start; {reason}: try a step of \
                 {advised:.3e} s, or an implicit scheme",
                self.step,
                self.method.name(),
            )
        })
    }

    /// Returns a warning before the run if the step is above the limit.
    pub fn warning(&self) -> Option<String> {
        if self.step <= self.step_limit {
            return None;
        }
        let name = self.method.name();
        let (h, limit) = (self.step, self.step_limit);
        let damping = match self.damping_rate {
            0.0 => String::new(),
            rate => format!(", damping up to {rate:.4e} 1/s"),
        };
        Some(if limit == 0.0 {
            format!("{name} is unstable at any step: its energy grows; it is here for comparison")
        } else {
            format!(
                "the step {h:.3e} s is above the stability limit {limit:.3e} s of {name} (highest frequency {:.4e} rad/s{damping}): \
                 the run will become unstable; use a step of {:.3e} s or an implicit scheme",
                self.highest_frequency,
                self.advised_step()
            )
        })
    }
}

/// Returns the stability of a simulation's explicit scheme; `None` for implicit schemes and equilibria, or if nothing oscillates or is
/// damped.
///
/// # Errors
/// Returns the error of the first component with an unknown highest frequency: the limit is not known then.
pub fn stability(simulation: &Simulation) -> Result<Option<StabilityNote>, SolverError> {
    let method = simulation.method();
    let Some(limit) = method.facts().stability_limit else { return Ok(None) };
    if simulation.scene().statics.is_some() {
        return Ok(None);
    }
    let (rates, step, rule) = (rates(simulation)?, simulation.step_size(), simulation.adaptive);
    let limiting = limiting(&rates, method);
    if limiting == 0.0 {
        return Ok(None);
    }
    let longest = rule.and_then(|rule| rule.stability()).map(|limit| limit / limiting);
    Ok(Some(StabilityNote {
        method,
        step: longest.map_or(step, |longest| step.min(longest)),
        is_adaptive: rule.is_some(),
        has_contact: simulation.scene().contact.is_some(),
        highest_frequency: rates.iter().map(|rates| rates.omega).fold(0.0, f64::max),
        damping_rate: rates.iter().map(|rates| rates.damping).fold(0.0, f64::max),
        step_limit: limit / limiting,
    }))
}

/// Returns a warning before the run if the step is above the limit, or if the limit is not known.
pub fn warning(found: &Result<Option<StabilityNote>, SolverError>, method: Method) -> Option<String> {
    match found {
        Ok(note) => note.as_ref().and_then(StabilityNote::warning),
        Err(error) => {
            Some(format!("the stability limit of {} at the start is not known: {error}", method.name()))
        }
    }
}

/// The rates that limit the explicit steps of a component.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Rates {
    /// Highest angular frequency, rad/s.
    pub omega: f64,
    /// Highest rate at which velocities decay by damping, 1/s.
    pub damping: f64,
}

/// Returns the largest of the [limiting frequencies](Method::limiting_frequency) of components, rad/s.
pub fn limiting(rates: &[Rates], method: Method) -> f64 {
    let of = |rates: &Rates| method.limiting_frequency(rates.omega, rates.damping);
    rates.iter().map(of).fold(0.0, f64::max)
}

/// Returns the rates of all components that move, at the start of a scene.
///
/// # Errors
/// Returns the error of the first component whose rates cannot be estimated.
pub fn rates(simulation: &Simulation) -> Result<Vec<Rates>, SolverError> {
    of_moving(simulation, |system, state| {
        let omega = highest_frequency(system, state)?.omega;
        let damping = match system.forces().is_empty() {
            true => 0.0,
            false => Frequencies::new(system).damping_rate(system, state, omega)?,
        };
        Ok(Rates { omega, damping })
    })
}

/// Returns the highest angular frequency of a scene at its start, rad/s, or `None` if no free coordinate feels a force
/// that changes with position.
///
/// # Errors
/// Returns the error of the first component whose frequency cannot be estimated.
pub fn highest(simulation: &Simulation) -> Result<Option<f64>, SolverError> {
    let omegas = of_moving(simulation, |system, state| Ok(highest_frequency(system, state)?.omega))?;
    Ok(omegas.into_iter().reduce(f64::max).filter(|omega| *omega > 0.0))
}

/// Returns what `of` finds of each component that moves, at the start of a scene.
fn of_moving<T: Send>(
    simulation: &Simulation,
    of: impl Fn(&System, &State) -> Result<T, SolverError> + Sync,
) -> Result<Vec<T>, SolverError> {
    let components = simulation.components().iter().filter(|component| component.stepper().is_some());
    let moving: Vec<(&System, &State)> =
        components.map(|component| (component.system(), component.state())).collect();
    // Components whose terms other processes share must not be evaluated at the same time.
    if moving.iter().any(|(system, _)| system.terms().shared().is_some()) {
        moving.into_iter().map(|(system, state)| of(system, state)).collect()
    } else {
        moving.into_par_iter().map(|(system, state)| of(system, state)).collect()
    }
}

/// Returns the highest angular frequency of the motion with which rigid bodies start, rad/s: the multipliers of their
/// constraints change at this rate. Zero if none is free.
pub fn rotation(simulation: &Simulation) -> f64 {
    let constrained = simulation
        .components()
        .iter()
        .filter(|component| component.stepper().is_some() && !component.system().constraints().is_empty());
    let rate = |component: &Component| {
        let (system, state) = (component.system(), component.state());
        // If the state has no finite force, the trials say so.
        Frequencies::new(system).of_motion(system, state).map_or(0.0, |motion| motion.square.sqrt())
    };
    constrained.map(rate).fold(0.0, f64::max)
}
