//! Runs a scene only for its end state, run time and work, without history or frames. All measurements of the program
//! use it.

use std::cell::Cell;
use std::ops::Range;
use std::time::{Duration, Instant};

use serde::Serialize;
use vi_solvers::{Method, Work};

use crate::auto::processor::Used;
use crate::scene::{Scene, SchemeName, Time};
use crate::simulation::Simulation;

/// A time integrator with its step; never `auto`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Choice {
    /// The scheme.
    pub scheme: SchemeName,
    /// Number of stages of `gauss`; `None` for other schemes.
    pub stages: Option<usize>,
    /// Number of steps from 0 to the end.
    pub steps: u64,
}

impl Choice {
    /// Returns the choice of a scene.
    pub fn of(scene: &Scene) -> Self {
        Self {
            scheme: scene.time.scheme.unwrap_or(SchemeName::Auto),
            stages: scene.time.stages,
            steps: scene.time.steps().0,
        }
    }

    /// Returns the scene with this choice in place of its own.
    pub fn apply(&self, scene: &Scene) -> Scene {
        let mut scene = scene.clone();
        scene.time.choose(self.scheme, self.stages, self.steps);
        scene.time.estimate = false;
        scene.output.interval = None;
        (scene.output.fps, scene.output.cache) = (None, None);
        scene.output.ledger = None;
        scene
    }

    /// Returns the name of the scheme with its stages, e.g. `gauss 3`.
    pub fn label(&self) -> String {
        let name = self.method().name();
        match self.stages {
            Some(stages) => format!("{name} {stages}"),
            None => name.to_owned(),
        }
    }

    /// Returns the integrator.
    pub fn method(&self) -> Method {
        let mut time = Time::new(1.0, 1.0, self.scheme);
        time.stages = self.stages;
        time.method().unwrap_or(Method::StormerVerlet)
    }
}

/// Follows runs that measure: the trials of `auto`, the levels of a convergence study.
pub trait TrialWatch {
    /// Called with the next trial.
    fn next(&mut self, _what: &str) {}
    /// Called every few steps: false ends the trial and all later ones.
    fn go_on(&mut self) -> bool {
        true
    }
}

impl TrialWatch for () {}

/// Result of a trial.
#[derive(Debug, Clone)]
pub struct Trial {
    /// Free coordinates at the end, by component, m.
    pub end: Vec<Vec<f64>>,
    /// Free coordinates after half of the steps (rounded down), by component, m.
    pub middle: Vec<Vec<f64>>,
    /// Run time of stepping, s.
    pub seconds: f64,
    /// Processor time of stepping, of all threads of this process, s.
    pub processor_seconds: f64,
    /// Time for which runnable threads of this process waited for a processor, s, if the system provides it.
    pub waited_seconds: Option<f64>,
    /// Counted cost of stepping on one core of the reference machine, s.
    pub counted_seconds: f64,
    /// max |H − H₀ − work from outside| over the largest kinetic energy, sampled at about 32 times.
    pub energy_drift: f64,
    /// Counted work.
    pub work: Work,
}

/// Reason why a trial has no end state.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum TrialError {
    /// A step failed, or the energy exceeded all bounds.
    #[error("{0}")]
    Failed(String),
    /// The scheme does not accept the scene, whatever the step.
    #[error("{0}")]
    Refused(String),
    /// The trial exceeded its limit.
    #[error("out of time at t = {t:.3e} s")]
    OutOfTime {
        /// Time reached, s.
        t: f64,
    },
    /// The caller requested a stop.
    #[error("stopped")]
    Stopped,
}

/// Budget of a trial.
#[derive(Debug, Clone, Copy)]
pub enum Limit<'a> {
    /// Time by the clock.
    Clock(Duration),
    /// Cost on one core of the reference machine, s. It is counted, so the trial ends at the same step in every run.
    Counted {
        /// Largest cost allowed.
        seconds: f64,
        /// Receives the cost, even if the trial did not reach its end.
        spent: &'a Cell<f64>,
    },
}

/// Runs `scene` over `stretch`, a part of 0..1 of its time, within `limit`; calls `go_on` every few steps. The interrupt of the
/// scene stops it within a step. A stretch
/// that does not start at 0 starts with the initial state of the scene, moved in time.
pub fn run(
    scene: Scene,
    stretch: Range<f64>,
    limit: Limit<'_>,
    go_on: &mut dyn FnMut() -> bool,
) -> Result<Trial, TrialError> {
    // A trial shows the result of the scheme itself, so failed steps are not divided.
    let mut scene = scene;
    scene.time.substeps = false;
    let mut simulation = Simulation::new(scene).map_err(|problems| {
        let all: Vec<String> = problems.iter().map(ToString::to_string).collect();
        TrialError::Refused(all.join("; "))
    })?;
    let place = |fraction: f64| (simulation.step_count() as f64 * fraction).round() as u64;
    let begin = place(stretch.start).min(simulation.step_count() - 1);
    let count = (place(stretch.end) - begin).max(1);
    simulation.start_at(begin);
    let result = observed(&mut simulation, begin..begin + count, limit, go_on);
    if let Limit::Counted { spent, .. } = limit {
        spent.set(spent.get() + simulation.counted_seconds());
    }
    result
}

fn observed(
    simulation: &mut Simulation,
    steps: Range<u64>,
    limit: Limit<'_>,
    go_on: &mut dyn FnMut() -> bool,
) -> Result<Trial, TrialError> {
    let count = steps.end - steps.start;
    let half = steps.start + count / 2;
    let stride = count.div_ceil(32);
    let first = simulation.observe();
    let (mut kinetic, mut drift) = (first.kinetic, 0.0_f64);
    let (mut spent, mut used) = (Duration::ZERO, Used::default());
    let mut outside = 0.0;
    let places = |simulation: &Simulation| -> Vec<Vec<f64>> {
        simulation.components().iter().map(|component| component.state().q.clone()).collect()
    };
    let mut middle = places(simulation);
    while simulation.steps() < steps.end {
        let now = simulation.steps();
        let until = if now < half { half } else { steps.end };
        let next = (now + stride).min(until);
        let (begin, used_before) = (Instant::now(), Used::now());
        while simulation.steps() < next {
            match simulation.advance(next - simulation.steps()) {
                Ok(done) => outside += done.energy.work(),
                Err(error) if error.is_interruption() => return Err(TrialError::Stopped),
                Err(error) => return Err(TrialError::Failed(error.to_string())),
            }
            let is_over = match limit {
                Limit::Clock(limit) => begin.elapsed() + spent > limit,
                Limit::Counted { seconds, .. } => simulation.counted_seconds() > seconds,
            };
            if is_over {
                return Err(TrialError::OutOfTime { t: simulation.time() });
            }
            if !go_on() {
                return Err(TrialError::Stopped);
            }
        }
        spent += begin.elapsed();
        used += Used::now() - used_before;
        if next == half {
            middle = places(simulation);
        }
        let seen = simulation.observe();
        if !seen.total().is_finite() {
            return Err(TrialError::Failed(format!("blew up before t = {:.3e} s", simulation.time())));
        }
        kinetic = kinetic.max(seen.kinetic);
        drift = drift.max((seen.total() - first.total() - outside).abs());
    }
    Ok(Trial {
        end: places(simulation),
        middle,
        seconds: spent.as_secs_f64(),
        processor_seconds: used.processor_seconds,
        waited_seconds: used.waited_seconds,
        counted_seconds: simulation.counted_seconds(),
        energy_drift: if drift == 0.0 { 0.0 } else { drift / kinetic },
        work: simulation.work(),
    })
}

/// The norm for the comparison of end states: ‖w‖²_M = Σ mᵢ wᵢ² over the free coordinates.
pub struct Norm {
    mass: Vec<Vec<f64>>,
    rest: Vec<Vec<f64>>,
}

impl Norm {
    /// Returns the norm of a simulation's systems; displacements are measured from rest.
    pub fn new(simulation: &Simulation) -> Self {
        let components = simulation.components();
        // The rest shape of rigid bodies is their initial one.
        let mut rest: Vec<Vec<f64>> = components.iter().map(|c| c.system().positions(c.state())).collect();
        for body in simulation.bodies() {
            let (rest, _) = rest[body.component].as_chunks_mut::<3>();
            for (node, point) in body.mesh.points.iter().enumerate() {
                rest[body.node(node)] = *point;
            }
        }
        let restricted = components.iter().zip(&rest).map(|(component, x)| {
            let mut q = vec![0.0; component.system().coordinates().free_count()];
            component.system().coordinates().coordinates_of(x, &mut q);
            q
        });
        Self {
            mass: components.iter().map(|c| c.system().free_mass().to_vec()).collect(),
            rest: restricted.collect(),
        }
    }

    /// Returns ‖u − u_ref‖_M / ‖u_ref‖_M, or zero if both are at rest.
    pub fn error(&self, end: &[Vec<f64>], reference: &[Vec<f64>]) -> f64 {
        let difference = self.squares(end, reference);
        if difference == 0.0 { 0.0 } else { (difference / self.squares(&self.rest, reference)).sqrt() }
    }

    fn squares(&self, a: &[Vec<f64>], b: &[Vec<f64>]) -> f64 {
        let component = |((mass, a), b): ((&Vec<f64>, &Vec<f64>), &Vec<f64>)| -> f64 {
            mass.iter().zip(a).zip(b).map(|((m, a), b)| m * (a - b) * (a - b)).sum()
        };
        self.mass.iter().zip(a).zip(b).map(component).sum()
    }
}
