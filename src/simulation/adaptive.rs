//! Steps that follow the motion, by a symmetric rule. The run is divided into equal intervals of length H. In each
//! interval a component makes n equal steps, with n from the states z₀ … z₁ between its ends:
//! ```text
//! n ≥ H · max(ω/θ, Q_s(z₀), Q_s(z₁)),   ω² = Σ T ω(z)² / Σ T,   rounded up to 1, 2, 3, 4, 6, 8, 11, 16, 23, 33 …
//! ```
//! ω(z) is the frequency of the motion of a state and T its kinetic energy, of up to eight states at the same distances from both
//! ends; Q_s is the density of steps (1/s) that stability requires. Both are the same for a reversed velocity, so a run backwards
//! finds the same n, and a symmetric scheme stays symmetric: its energy does not drift (P. Hut, J. Makino, S. McMillan, Astrophys. J. 443
//! (1995) L93; E. Hairer, C. Lubich, G. Wanner, *Geometric Numerical Integration*, 2006, VIII.3.2). A rule that looks at the
//! start of the interval alone is not symmetric, and its energy drifts.
//!
//! Elastic bodies vibrate many times per change of n. The ends alone would sample these vibrations at random phases: n would change at
//! random, and each change moves the energy that the scheme conserves. Rigid bodies may turn fast for a small part of an
//! interval instead: for them n ≥ H · max Q with the density Q of all states asked. If a step has to be cut nevertheless, the
//! interval is made again with twice as many.
//!
//! No rule that finds a whole number n from states alone is exact at every state: at the border between two numbers both may be
//! right, each by its own path. The number of the last interval is then kept, so that the way back differs at most where n changes.
//!
//! The integrating controller of E. Hairer and G. Söderlind (SIAM J. Sci. Comput. 26 (2005) 1838) is exact with a density that is
//! carried along. It needs dQ/dt; sampled once per interval, it would accumulate the contributions of fast oscillations.

use vi_core::{State, System};
use vi_solvers::{Frequencies, Method, Motion, SolverError, StepError};

use super::driven::Driven;
use super::march::{Check, Course, Cut, Failure, March, march};
use super::pace::Pace;
use crate::record::record;
use crate::scene::Time;

/// Fraction of the stability limit that explicit steps use; the limit is known at the ends of an interval alone.
const SHARE: f64 = 0.8;
/// Largest number of times that an interval is made again because its states require another number of steps: from 1 to [`MOST`] by
/// factors of [`GROWTH`], and back.
const REPEATS: usize = 24;
/// Largest number of such repetitions for rigid bodies, whose motion may differ from the one that was computed with too
/// few steps.
const REPEATS_OF_BODIES: usize = 12;
/// Number of parts of an interval between which the states of elastic bodies are asked. With 4, 8 and 16, a block that spins and
/// vibrates (`adaptive_steps_keep_the_energy_at_the_default_tolerance`) had 309, 23 and 39 of 2000 intervals repeated.
const PARTS: u64 = 8;
/// Largest factor by which n grows at a time: a path with too few steps may end in a state that is far from the motion, and ask for a
/// thousand times as many as are right. A cube that hits a floor by `energy-momentum` took 1272 factors with a factor of 2, and 1052 with 8.
const GROWTH: f64 = 8.0;
/// If the states at both ends of an interval require less than this fraction of the steps that stability requires, those inside are not
/// asked: their mean would have to be 1/`MINOR`² times the square at both ends to change the number.
const MINOR: f64 = 0.25;
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
    /// Intervals that were made again, because their states required another number of steps.
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
    last: Option<(State, Requirement)>,
}

/// What a state requires.
#[derive(Debug, Clone, Copy)]
struct Requirement {
    /// The frequency of the motion, and twice its kinetic energy.
    motion: Motion,
    /// The rate at which drag slows it, 1/s.
    drag: f64,
    /// Density of steps for stability, 1/s; 0 for states inside an interval.
    stability: f64,
}

/// The mean over the states of an interval.
#[derive(Debug, Clone, Copy, Default)]
struct Mean {
    /// Sums of weights W and of W ω² with twice the kinetic energies as weights.
    weights: f64,
    squares: f64,
    /// The largest rate of drag, 1/s.
    drag: f64,
}

impl Mean {
    fn add(&mut self, required: &Requirement, share: f64) {
        let Motion { square, weight } = required.motion;
        self.weights += share * weight;
        self.squares += share * weight * square;
        self.drag = self.drag.max(required.drag);
    }

    /// Returns the mean rate of change of the motion, rad/s.
    fn rate(&self) -> f64 {
        let square = if self.weights > 0.0 { self.squares / self.weights } else { 0.0 };
        square.sqrt().max(self.drag)
    }
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

    /// Returns what a state at an end of an interval requires.
    fn at_end(
        &self,
        demand: &mut StepDemand,
        system: &System,
        state: &State,
    ) -> Result<Requirement, SolverError> {
        if let Some((known, required)) = &demand.last
            && known == state
        {
            return Ok(*required);
        }
        let mut required = self.inside(demand, system, state)?;
        if let Some(limit) = self.stability() {
            let omega = demand.frequencies.highest(system, state)?;
            let rate = demand.frequencies.damping_rate(system, state, omega)?;
            required.stability = self.method.limiting_frequency(omega, rate) / limit;
        }
        demand.last = Some((state.clone(), required));
        Ok(required)
    }

    /// Returns what a state inside an interval requires.
    fn inside(
        &self,
        demand: &mut StepDemand,
        system: &System,
        state: &State,
    ) -> Result<Requirement, SolverError> {
        let motion = demand.frequencies.of_motion(system, state)?;
        let drag = demand.frequencies.of_drag(system, state)?;
        Ok(Requirement { motion, drag, stability: 0.0 })
    }

    /// Returns the density of steps for the accuracy of the motion of a state, 1/s.
    fn density(&self, required: &Requirement) -> f64 {
        required.motion.square.sqrt().max(required.drag) / self.accuracy
    }

    /// Returns whether the motion of a state at an end of an interval requires far fewer steps than another reason, with this density of
    /// steps, 1/s. Only explicit schemes have one.
    fn is_minor(&self, required: &Requirement, density: f64) -> bool {
        self.stability().is_some() && self.density(required) < MINOR * density
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
        let first = self.at_end(demand, system, state).map_err(failed)?;
        let driven = self.density_of_driven(demand, end - h, end);
        let has_bodies = !system.constraints().is_empty();
        let at_least = first.stability.max(driven);
        let mut number = match pace.number() {
            // The state at the start alone may ask for too many; with less than half, a first try would be of little use.
            last if last > 0 && !has_bodies && self.is_symmetric => {
                last.max(level(h * at_least.max(0.5 * self.density(&first))))
            }
            _ => level(h * at_least.max(self.density(&first))),
        };
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
            let is_asked = |k: u64| match has_bodies {
                true => k.is_multiple_of(stride) || (made - k).is_multiple_of(stride),
                false => {
                    (1..=PARTS / 2).map(|j| j * made / PARTS).any(|place| k == place || made - k == place)
                }
            };
            // States that are asked only if the one at the end of the interval demands it.
            let mut kept: Vec<State> = Vec::new();
            let may_be_minor = !has_bodies && self.is_minor(&first, driven.max(first.stability));
            let (mut largest, mut mean) = (0.0_f64, Mean::default());
            mean.add(&first, 0.5);
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
                if k == made || !is_asked(k) {
                    return Ok(());
                }
                if may_be_minor {
                    kept.push(state.clone());
                } else {
                    let required = self.inside(demand, system, state).map_err(failed)?;
                    largest = largest.max(self.density(&required));
                    mean.add(&required, 1.0);
                }
                Ok(())
            });
            let last = outcome.and_then(|()| self.at_end(demand, system, state).map_err(failed));
            let last = last.and_then(|last| {
                if !self.is_minor(&last, driven.max(last.stability)) {
                    for state in &kept {
                        mean.add(&self.inside(demand, system, state).map_err(failed)?, 1.0);
                    }
                }
                Ok(last)
            });
            let last = match last {
                Ok(last) => last,
                Err(failure) => {
                    stepper.return_to_mark();
                    (*state, *pace) = before;
                    return Err(failure);
                }
            };
            mean.add(&last, 0.5);
            let motion = match has_bodies {
                true => largest.max(0.5 * (self.density(&first) + self.density(&last))),
                false => mean.rate() / self.accuracy,
            };
            let mut wanted = level(h * motion.max(at_least).max(last.stability));
            wanted = wanted.min(level(GROWTH * number as f64));
            if repeats_for_cuts && done.substeps > 0 {
                wanted = wanted.max(level(2.0 * number as f64));
            }
            let is_final = !self.is_symmetric || wanted == number || tried.len() > repeats;
            // If each of two numbers of steps leads to an end that requires the other, the larger one is taken from
            // either end.
            if is_final || (tried.contains(&wanted) && wanted < number) {
                (counts.steps, counts.fewest, counts.most) = (made, made, made);
                pace.set_number(number);
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

/// Returns the smallest allowed number of steps that is not below `wanted`: 1, 2, 3, 4, and then integers of which each is about
/// √2 times the one before. Finer numbers change more often: with factors of 2^(1/4) and 2^(1/3), blocks that spin and vibrate as in
/// `adaptive_steps_keep_the_energy_at_the_default_tolerance` needed 27 300 and 26 900 steps in place of 31 900, and changed n in 202
/// and 196 of 2000 intervals in place of 20.
fn level(wanted: f64) -> u64 {
    let wanted = wanted.min(MOST);
    let mut number: u64 = 1;
    while (number as f64) < wanted {
        number = (number + 1).max((number as f64 * std::f64::consts::SQRT_2).round() as u64);
    }
    number
}
