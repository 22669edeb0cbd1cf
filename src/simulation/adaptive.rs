//! Steps that follow the motion, by a symmetric rule. The run is divided into equal intervals of length H. In each
//! interval a component makes n equal steps, with n from the density of steps Q (1/s) that the states at both ends
//! require:
//! ```text
//! n ≥ H · ½ (Q(z₀) + Q(z₁)),   rounded up to 1, 2, 3, 4, 5, 6, 7, 8, 10, 12, 14, 17, 20, 24 …
//! ```
//! Q depends on the state alone and is the same for a reversed velocity, so a run backwards finds the same n, and a
//! symmetric scheme stays symmetric: its energy does not drift (P. Hut, J. Makino, S. McMillan, Astrophys. J. 443 (1995)
//! L93; E. Hairer, C. Lubich, G. Wanner, *Geometric Numerical Integration*, 2006, VIII.3.2). A rule that looks at the
//! start of the interval alone is not symmetric, and its energy drifts. Elastic bodies vibrate many times per change of Q. Rigid bodies
//! do not, and may turn fast for a small part of an interval: for them, states at the same distances from both ends are asked too,
//! and n ≥ H · max Q. If a step has to be cut nevertheless, the interval is made again with twice as many.
//!
//! The integrating controller of E. Hairer and G. Söderlind (SIAM J. Sci. Comput. 26 (2005) 1838) needs dQ/dt; sampled
//! once per interval, it would accumulate the contributions of fast oscillations.

use vi_core::{State, System};
use vi_solvers::{Frequencies, Method, SolverError, StepError};

use super::driven::Driven;
use super::march::{Check, Course, Cut, Failure, March, march};
use super::pace::Pace;
use crate::record::record;
use crate::scene::Time;

/// Fraction of the stability limit that explicit steps use; the limit is known at the ends of an interval alone.
const SHARE: f64 = 0.8;
/// Largest number of times that an interval is made again because its end requires another number of steps.
const REPEATS: usize = 3;
/// Largest number of such repetitions for rigid bodies, whose motion may differ from the one that was computed with too
/// few steps.
const REPEATS_OF_BODIES: usize = 12;
/// For rigid bodies, the density of steps is evaluated at states inside an interval that are at most 1/`PLACES` of it
/// apart.
const PLACES: u64 = 8;
/// Largest number of steps per interval.
const MOST: f64 = 1e6;

/// Counts of adaptive steps of all components.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct AdaptiveCounts {
    /// Steps made.
    pub steps: u64,
    /// Fewest steps in an interval.
    pub fewest: u64,
    /// Most steps in an interval.
    pub most: u64,
    /// Intervals that were made again, because their end required another number of steps.
    pub repeated: u64,
}

record!(AdaptiveCounts { steps: u64, fewest: u64, most: u64, repeated: u64 });

impl Default for AdaptiveCounts {
    fn default() -> Self {
        Self { steps: 0, fewest: u64::MAX, most: 0, repeated: 0 }
    }
}

impl AdaptiveCounts {
    /// Adds the counts of one interval of a component.
    pub(super) fn add(&mut self, other: Self) {
        self.steps += other.steps;
        self.fewest = self.fewest.min(other.fewest);
        self.most = self.most.max(other.most);
        self.repeated += other.repeated;
    }
}

/// Evaluates the density of steps that the states of a component, and the functions of time that act on it, require.
/// Keeps the last result, because the end of an interval is the start of the next one.
pub(super) struct StepDemand {
    driven: Driven,
    frequencies: Frequencies,
    last: Option<(State, f64)>,
}

impl StepDemand {
    pub(super) fn new(system: &System, driven: &Driven) -> Self {
        Self { driven: driven.clone(), frequencies: Frequencies::new(system), last: None }
    }
}

/// The rule for the number of steps per interval.
#[derive(Debug, Clone, Copy)]
pub(super) struct Adaptive {
    /// Largest hω with the mean frequency ω of the motion.
    accuracy: f64,
    /// Largest hω at kinks of functions of time, where no scheme has an order above 2.
    accuracy_at_kinks: f64,
    /// The scheme.
    method: Method,
    /// Whether the end of an interval counts; false only to show what happens without it.
    pub(super) is_symmetric: bool,
}

impl Adaptive {
    /// Returns the rule for a scheme and the tolerance of a scene. A motion of frequency ω has a relative error of
    /// about (hω)^p/C per radian with a scheme of order p; C is the constant of implicit midpoint (p = 2) and of Gauss
    /// (p = 4, 6), and 2 for schemes of order 1.
    pub(super) fn new(method: Method, time: &Time) -> Self {
        let facts = method.facts();
        let tolerance = time.tolerance.unwrap_or(Time::DEFAULT_TOLERANCE);
        let accuracy = |order: usize| {
            let constant = match order {
                1 => 2.0,
                2 | 3 => 12.0,
                4 | 5 => 720.0,
                _ => 100_800.0,
            };
            f64::powf(constant * tolerance, 1.0 / order as f64)
        };
        let order = facts.order.max(1);
        let (accuracy, accuracy_at_kinks) = (accuracy(order), accuracy(order.min(2)));
        Self { accuracy, accuracy_at_kinks, method, is_symmetric: true }
    }

    /// Returns the largest hω of an explicit scheme with the frequency ω that limits its step
    /// ([`Method::limiting_frequency`]); `None` if stability does not limit it.
    pub(super) fn stability(&self) -> Option<f64> {
        self.method.facts().stability_limit.map(|limit| SHARE * limit)
    }

    /// Returns the density of steps that a state requires, 1/s.
    fn density(&self, demand: &mut StepDemand, system: &System, state: &State) -> Result<f64, SolverError> {
        if let Some((known, density)) = &demand.last
            && known == state
        {
            return Ok(*density);
        }
        let motion = demand.frequencies.of_motion(system, state)?;
        let motion = motion.max(demand.frequencies.of_drag(system, state)?);
        let stability = match self.stability() {
            Some(limit) => {
                let omega = demand.frequencies.highest(system, state)?;
                let rate = demand.frequencies.damping_rate(system, state, omega)?;
                self.method.limiting_frequency(omega, rate) / limit
            }
            None => 0.0,
        };
        let density = (motion / self.accuracy).max(stability);
        demand.last = Some((state.clone(), density));
        Ok(density)
    }

    /// Returns the density of steps that the functions of time require between two times (s), 1/s. At their kinks no
    /// scheme has an order above 2.
    fn density_of_driven(&self, demand: &StepDemand, from: f64, to: f64) -> f64 {
        let rates = demand.driven.rates(from, to);
        (rates.smooth / self.accuracy).max(rates.kinked / self.accuracy_at_kinks)
    }

    /// Advances a component by an interval of length h (s) to the time `end`, with `cut.parts` times as many steps as
    /// the rule requires.
    ///
    /// # Errors
    /// Returns the error of the first step that failed; the state is then unchanged.
    pub(super) fn advance(
        &self,
        course: Course<'_>,
        demand: &mut StepDemand,
        (h, end): (f64, f64),
        cut: Cut<'_>,
        mut check: Option<Check<'_>>,
    ) -> Result<(March, AdaptiveCounts), Failure> {
        let Course { stepper, system, state, pace } = course;
        let before = (state.clone(), *pace);
        stepper.mark();
        let start = state.t;
        let failed =
            |cause| Failure { error: StepError { t: start, h, cause }, from: Box::new(before.0.clone()) };
        let at_start = self.density(demand, system, state).map_err(failed)?;
        let driven = self.density_of_driven(demand, end - h, end);
        let mut number = level(h * at_start.max(driven));
        let has_bodies = !system.constraints().is_empty();
        // Intervals of rigid bodies are made again instead of being divided.
        let repeats_for_cuts = has_bodies && system.terms().live().is_empty();
        let repeats = if has_bodies { REPEATS_OF_BODIES } else { REPEATS };
        let mut tried: Vec<u64> = Vec::new();
        let mut counts = AdaptiveCounts::default();
        loop {
            tried.push(number);
            let made = number * u64::from(cut.parts);
            let part = Cut { parts: 1, ..cut };
            let mut done = March::default();
            let stride = made.div_ceil(PLACES);
            let mut inside: f64 = 0.0;
            let outcome = (1..=made).try_for_each(|k| {
                let to = if k == made { end } else { start + h * (k as f64 / made as f64) };
                if repeats_for_cuts {
                    // Begin undivided: parts that only follow from earlier steps are no reason to make the interval again.
                    *pace = Pace::default();
                }
                let course = Course { stepper: &mut *stepper, system, state: &mut *state, pace: &mut *pace };
                let check: Option<Check<'_>> = match &mut check {
                    Some(check) => Some(&mut **check),
                    None => None,
                };
                done.add(march(course, h / made as f64, to, part, check)?);
                let is_asked = k.is_multiple_of(stride) || (made - k).is_multiple_of(stride);
                if has_bodies && k < made && is_asked {
                    inside = inside.max(self.density(demand, system, state).map_err(failed)?);
                }
                Ok(())
            });
            let at_end = outcome.and_then(|()| self.density(demand, system, state).map_err(failed));
            let at_end = match at_end {
                Ok(at_end) => at_end,
                Err(failure) => {
                    stepper.return_to_mark();
                    (*state, *pace) = before;
                    return Err(failure);
                }
            };
            let mut wanted = level(h * inside.max(0.5 * (at_start + at_end)).max(driven));
            if repeats_for_cuts && done.substeps > 0 {
                wanted = wanted.max(level(2.0 * number as f64));
            }
            let is_final = !self.is_symmetric || wanted == number || tried.len() > repeats;
            // If each of two numbers of steps leads to an end that requires the other, the larger one is taken from
            // either end.
            if is_final || (tried.contains(&wanted) && wanted < number) {
                (counts.steps, counts.fewest, counts.most) = (made, made, made);
                // `Simulation::halve` divides each of the `number` equal steps, of which this is the longest part.
                done.longest /= cut.parts;
                return Ok((done, counts));
            }
            counts.repeated += 1;
            number = wanted;
            stepper.return_to_mark();
            (*state, *pace) = before.clone();
        }
    }
}

/// Returns the smallest allowed number of steps that is not below `wanted`: all integers to 8, then integers of which
/// each is about a fifth larger than the one before.
fn level(wanted: f64) -> u64 {
    let wanted = wanted.min(MOST);
    let mut number: u64 = 1;
    while (number as f64) < wanted {
        number = if number < 8 { number + 1 } else { (number as f64 * 2.0_f64.powf(0.25)).round() as u64 };
    }
    number
}
