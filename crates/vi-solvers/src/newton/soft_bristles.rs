//! Newton's method across the kink of friction between sticking and sliding. It can alternate without end between
//! states in which friction slides to and fro. Four measures prevent this. The tractions of friction are predicted by each linear
//! system, and the predictions decide which pairs stick ([`vi_core::Acting`]); far from a solution, tractions follow slips
//! gradually ([`Progress::penalty`]); and if an error repeats that of two iterations ago, half of the correction is made
//! ([`Progress::part`]). If this is not
//! enough, a second attempt begins with soft bristles, which stick over a wide range of slip, and makes them stiffer from
//! stage to stage. A third attempt does so from still softer ones; below the stiffness with which the second one begins, terms
//! make their forces stiffer instead, so that pairs that a hard impact brings very close are first found far apart.
//!
//! Another obstacle is a path that cuts corrections short. Usually only the nodes of the pairs that would meet are stopped.
//! If many pairs lie in a stiff layer, they are then brought too close in turn, without end. The last attempt
//! therefore makes the same fraction of the correction at all nodes, which reduces all residuals by that fraction.

use crate::error::SolverError;
use crate::newton::attempt::{ROUND_OFF, is_within};
use crate::newton::start::Start;

/// Largest number of iterations of a plain attempt. Those that converge need two to eight, and more if paths cut
/// corrections short.
const PLAIN_ITERATIONS: u32 = 30;
/// The stiffness of bristles in the first stage of the second attempt and of later ones, and the ratio of that of a stage to
/// the one before it; after a failed stage the ratio is smaller.
const SOFT: f64 = 1e-2;
const SOFTEST: f64 = 1e-6;
const LARGEST_RATIO: f64 = 10.0;
const SMALLEST_RATIO: f64 = 1.2;
/// The error to which a stage is solved, and its largest number of iterations. Those that converge need two to five.
const STAGE_TOLERANCE: f64 = 1e-3;
const STAGE_ITERATIONS: u32 = 15;
/// Largest number of iterations of a stage with equal fractions at all nodes.
const UNIFORM_ITERATIONS: u32 = 60;
/// A series ends without success after this many iterations in which neither the error nor the residual falls below the fraction `GAIN`
/// of the least one before, and the number of pairs that do not obey their law does not fall below the least one before. Two square
/// cloths of 10 × 10 cells, 1.2 mm apart on a floor, by energy–momentum with 6 steps of 5 ms, take 371 iterations with 4, and 124 with
/// 6, 8 and 12.
const IDLE: u32 = 8;
const GAIN: f64 = 0.5;
/// An iteration that reduces the residual to this fraction is not idle. If a pair is much too near, Newton's method doubles its
/// gap in each iteration, which halves the residual, however large it became when the pair came near.
const RECOVERY: f64 = 0.6;

/// A series also ends without success if neither its error nor its residual has decreased to the fraction `CRAWL` in the last
/// `WINDOW` iterations, nor the number of pairs that do not obey their law, whether paths cut them short or not: it would need a hundred
/// more. Of the scenes of `stress --contact
/// --seed 1`, 76 from 300 to 440 take 61 964 instead of 73 066 iterations, and 310 runs to its end. With 0.85, or with windows of 4,
/// scene 354 fails by name.
const WINDOW: usize = 6;
const CRAWL: f64 = 0.95;

/// A residual of at most this multiple of its round-off, which does not decrease any more, is round-off too: slips that are measured on
/// long thin triangles have more of it. At rest, the cards of `scenes/contact/cards.toml` (4 mm wide, .1 m long) have 3 to 50 times the bound.
const NOISE: f64 = 64.0;

/// A series also ends with success after this many iterations in a row that meet its aim, although pairs do not obey their law in each
/// of them. Slips at the round-off of positions have no direction, so those of a stack at rest turn without end.
const CALM: u32 = 3;

/// The bound on the stiffness of bristles ([`vi_core::Acting::penalty`]) after an iteration whose error is not below `CLOSE`, until one
/// is. Gaps are then nearly found, and the next iterations have bristles of full stiffness. Slips of second order in the corrections, times this
/// stiffness, would be forces greater than those that press. Three cloths of 15 × 15 cells as above take 1843 iterations without a
/// bound, 1050 to 1110 with 100 and 1000, 750 with 10 and a relative error of 0.1, and 780 with 1 (with complete factors,
/// and bounded from the first iteration on).
const FAR: f64 = 10.0;
const CLOSE: f64 = 0.1;
/// A residual below this fraction of the forces of pairs is not far, whatever its error is relative to a motion: that of bodies at rest is
/// round-off. A second of `scenes/contact/cards.toml` takes 69 648, 13 045, 3859 and 4283 iterations with 0, 1e-4, 1e-3 and 1e-2.
const BALANCED: f64 = 1e-3;

/// If an error is that of two iterations ago within this fraction while pairs do not obey their law, only half of the correction is made:
/// pairs that turn between sticking and sliding in every second iteration do so without end. Of `stress --contact --seed 1`, scene 113
/// takes 83 058 and 8738 iterations without and with this; the 12 others of the first 240 that take more than 2000 and differ take a quarter
/// fewer to a fifth more. With .1 and .3, a curtain that a ball hits takes more iterations, and scene 113 fails.
const REPEATED: f64 = 0.02;

/// Number of attempts in stages that cost less than two steps over h/2. Only these are made if the step can be divided.
/// Of the slow scenes of `stress --contact --seed 1`, 15 take 28 319 iterations and 115 s instead of 35 248 and 173 s with all three.
const CHEAP: usize = 1;

/// The aim of a series of iterations.
#[derive(Clone, Copy)]
pub(crate) struct Aim {
    pub(crate) tolerance: f64,
    /// A series ends without success after this many iterations in a row in which the number of pairs that do not obey
    /// their law of friction does not fall below its least value.
    pub(crate) most: u32,
    /// The stiffness of bristles in this stage, as a fraction of their full stiffness. If it is below one, the solution
    /// is only a start for the next stage.
    pub(crate) stiffness: f64,
    /// Whether the same fraction of a correction is made at all nodes if it is cut short.
    pub(crate) is_uniform: bool,
}

/// An attempt to solve equations with friction in stages.
#[derive(Clone, Copy)]
pub(crate) struct Attempt {
    pub(crate) start: Start,
    /// The stiffness of bristles in the first stage.
    pub(crate) softest: f64,
    /// See [`Aim::is_uniform`].
    pub(crate) is_uniform: bool,
}

impl Attempt {
    /// Returns the attempts that are made one after the other, from a start, after a plain one. Those that cost more than two
    /// steps over h/2 are left out if the step can be divided. Without friction, the first one would repeat the plain one.
    pub(crate) fn after_plain(start: Start, can_be_divided: bool, has_friction: bool) -> Vec<Self> {
        let all = [
            Self { start, softest: SOFT, is_uniform: false },
            Self { start, softest: SOFTEST, is_uniform: false },
            Self { start: Start::Inertial, softest: SOFTEST, is_uniform: true },
        ];
        let count = if can_be_divided { CHEAP } else { all.len() };
        all[..count].iter().skip(usize::from(!has_friction)).copied().collect()
    }
}

impl Aim {
    /// Returns the aim of a plain attempt, of at most `most` iterations.
    pub(crate) fn plain(tolerance: f64, most: u32) -> Self {
        Self { tolerance, most: PLAIN_ITERATIONS.min(most), stiffness: 1.0, is_uniform: false }
    }

    fn is_stage(&self) -> bool {
        self.stiffness < 1.0
    }
}

/// Equations with friction, and the iteration that solves them.
pub(crate) trait Frictional {
    /// Goes to the start of an attempt.
    fn begin(&mut self, start: Start);
    fn unknowns(&self) -> Vec<f64>;
    fn go_to(&mut self, unknowns: &[f64]);
    /// Iterates from the unknowns to the aim.
    fn iterate(&mut self, aim: Aim) -> Result<(), SolverError>;
}

/// Solves the equations with bristles of full stiffness.
pub(crate) fn solve_plainly(
    series: &mut impl Frictional,
    start: Start,
    tolerance: f64,
    most: u32,
) -> Result<(), SolverError> {
    series.begin(start);
    series.iterate(Aim::plain(tolerance, most))
}

/// Solves the equations with bristles that become stiffer from stage to stage, attempt by attempt until one succeeds.
///
/// # Errors
/// Returns the error of the last attempt; `failed`, that of the plain attempt, if there is none or if it was interrupted.
pub(crate) fn solve_in_stages(
    series: &mut impl Frictional,
    attempts: &[Attempt],
    failed: SolverError,
    tolerance: f64,
    most: u32,
) -> Result<(), SolverError> {
    let mut outcome = Err(failed);
    for attempt in attempts {
        match &outcome {
            Err(error) if !error.is_interruption() => outcome = stiffen(series, *attempt, tolerance, most),
            _ => break,
        }
    }
    outcome
}

fn stiffen(
    series: &mut impl Frictional,
    Attempt { start, softest, is_uniform }: Attempt,
    tolerance: f64,
    most: u32,
) -> Result<(), SolverError> {
    let most = if is_uniform { UNIFORM_ITERATIONS } else { STAGE_ITERATIONS.min(most) };
    series.begin(start);
    // Stiffness of the last solution, and the ratio of the next to it.
    let (mut reached, mut ratio) = (softest / LARGEST_RATIO, LARGEST_RATIO);
    loop {
        let stiffness = (ratio * reached).min(1.0);
        let is_stage = stiffness < 1.0;
        let tolerance = if is_stage { STAGE_TOLERANCE } else { tolerance };
        let place = series.unknowns();
        let outcome = series.iterate(Aim { tolerance, most, stiffness, is_uniform });
        match outcome {
            Ok(()) if !is_stage => return Ok(()),
            Ok(()) => (reached, ratio) = (stiffness, (ratio * ratio).min(LARGEST_RATIO)),
            Err(error) if error.is_interruption() => return Err(error),
            Err(_) if reached >= softest && ratio > SMALLEST_RATIO => {
                series.go_to(&place);
                ratio = ratio.sqrt();
            }
            Err(error) => return Err(error),
        }
    }
}

/// The results of one iteration, by which it is judged.
pub(crate) struct Iteration {
    /// The error, relative, and the size of the residual.
    pub(crate) eta: f64,
    pub(crate) size: f64,
    /// Whether the correction was made in full.
    pub(crate) is_whole: bool,
    /// Number of pairs whose traction of friction does not obey its law; `None` without friction.
    pub(crate) unlawful: Option<usize>,
    /// The size of the forces of pairs in the residual; zero if it is not known, or if [`Progress::needs_forces`]
    /// returns false.
    pub(crate) forces: f64,
    /// A bound on the size that the residual has by round-off; zero if it is not known.
    pub(crate) round_off: f64,
    /// Whether the correction is below the resolution of positions.
    pub(crate) is_at_resolution: bool,
}

/// The decision after an iteration.
#[derive(PartialEq)]
pub(crate) enum Verdict {
    Solved,
    Continue,
    Hopeless,
}

/// Judges the iterations of a series.
pub(crate) struct Progress {
    aim: Aim,
    last: Option<f64>,
    last_size: f64,
    /// The least error, residual and number of pairs that do not obey their law.
    least: [f64; 3],
    idle: u32,
    /// Number of the last iterations in a row in which the number of pairs that do not obey their law did not fall below its
    /// least value.
    unsettled: u32,
    /// Number of the last iterations in a row that met the aim, whether or not pairs obeyed their law.
    calm: u32,
    /// [`FAR`] from the first iteration with a large error until the first one with a small error, and infinite otherwise.
    penalty: f64,
    /// Whether `penalty` is or was [`FAR`].
    was_far: bool,
    /// Error, residual and number of pairs that do not obey their law in the last iterations, and the number of all iterations.
    recent: [[f64; 3]; WINDOW],
    count: usize,
    /// The errors of the last two iterations since the last correction of which only a part was made, the older first.
    errors: [f64; 2],
    /// The part of the last correction that shall be made.
    part: f64,
}

impl Progress {
    pub(crate) fn towards(aim: Aim) -> Self {
        let infinite = [f64::INFINITY; 3];
        Self {
            aim,
            last: None,
            last_size: 0.0,
            least: infinite,
            idle: 0,
            unsettled: 0,
            calm: 0,
            penalty: f64::INFINITY,
            was_far: false,
            recent: [infinite; WINDOW],
            count: 0,
            errors: [f64::INFINITY; 2],
            part: 1.0,
        }
    }

    /// Returns the part of the last correction that shall be made: a half if pairs turn between sticking and sliding without progress,
    /// otherwise all of it.
    pub(crate) fn part(&self) -> f64 {
        self.part
    }

    /// Returns the bound on the stiffness of bristles for the next iteration; see [`vi_core::Acting::penalty`].
    pub(crate) fn penalty(&self) -> f64 {
        self.penalty
    }

    /// Returns whether the judgement of an iteration with this error and number of unlawful pairs depends on the forces of pairs:
    /// far from the solution, until bristles were made softer once.
    pub(crate) fn needs_forces(&self, eta: f64, unlawful: Option<usize>) -> bool {
        !self.was_far && unlawful.is_some() && eta >= CLOSE
    }

    pub(crate) fn judge(&mut self, iteration: &Iteration) -> Verdict {
        let Iteration { eta, size, is_whole, unlawful, forces, round_off, is_at_resolution } = *iteration;
        if !eta.is_finite() {
            return Verdict::Hopeless;
        }
        if self.penalty == FAR && unlawful.is_some() && eta < CLOSE {
            *self = Self { was_far: true, ..Self::towards(self.aim) };
            return Verdict::Continue;
        }
        if self.needs_forces(eta, unlawful) && size >= BALANCED * forces {
            (self.penalty, self.was_far) = (FAR, true);
        }
        let unlawful = unlawful.unwrap_or(0);
        let repeats = unlawful > 0 && (eta / self.errors[0] - 1.0).abs() < REPEATED;
        self.part = if repeats { 0.5 } else { 1.0 };
        self.errors = if repeats { [f64::INFINITY; 2] } else { [self.errors[1], eta] };
        let contraction = self.last.map(|last| eta / last);
        let is_met = match self.aim.is_stage() {
            true => eta <= self.aim.tolerance,
            false => is_close(eta, contraction, self.aim.tolerance),
        };
        let has_stalled = self.calm > 0 || (self.last_size > 0.0 && size > GAIN * self.last_size);
        let is_noise = size <= round_off || (has_stalled && size <= NOISE * round_off);
        self.calm = if is_whole && (is_met || is_at_resolution || is_noise) { self.calm + 1 } else { 0 };
        if self.calm > 0 && (unlawful == 0 || self.calm == CALM) {
            return Verdict::Solved;
        }
        // Out of a stiff layer, corrections grow at first while the residual decreases.
        let measures = [eta, size, unlawful as f64];
        let settles = measures[2] < self.least[2];
        let gains = settles || (0..2).any(|k| measures[k] < GAIN * self.least[k]);
        self.unsettled = if settles { 0 } else { self.unsettled + 1 };
        (0..3).for_each(|k| self.least[k] = self.least[k].min(measures[k]));
        // An iteration that a path cut short may lead far away from the solution without harm.
        let recovers = size < RECOVERY * self.last_size;
        self.idle = if gains { 0 } else { self.idle + u32::from(is_whole && !recovers) };
        self.last_size = size;
        self.last = (is_whole && unlawful == 0).then_some(eta);
        let past = std::mem::replace(&mut self.recent[self.count % WINDOW], measures);
        self.count += 1;
        let crawls = !recovers && (0..3).all(|k| measures[k] >= CRAWL * past[k]);
        if crawls || self.idle >= IDLE || self.unsettled >= self.aim.most {
            Verdict::Hopeless
        } else {
            Verdict::Continue
        }
    }

    /// Records that the last correction was not made in full after all, so that its error does not predict the next one.
    pub(crate) fn interrupt(&mut self) {
        self.last = None;
    }
}

/// Returns whether an error, with the ratio to that of the iteration before, meets the tolerance.
fn is_close(eta: f64, contraction: Option<f64>, tolerance: f64) -> bool {
    // To round-off: until there is no more improvement.
    let has_stalled =
        tolerance <= ROUND_OFF && eta < 1e-9 && contraction.is_some_and(|theta| theta > 0.5 && theta < 1.0);
    eta == 0.0 || has_stalled || is_within(tolerance, eta, contraction)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns the number of iterations after which a series ends whose errors and residuals change by these factors in each one,
    /// all of which paths cut short; at most 100.
    fn length(of_error: f64, of_residual: f64) -> i32 {
        let mut progress =
            Progress::towards(Aim { tolerance: 1e-6, most: 100, stiffness: 1.0, is_uniform: false });
        let iteration = |k: i32| Iteration {
            eta: of_error.powi(k),
            size: of_residual.powi(k),
            is_whole: false,
            unlawful: None,
            forces: 0.0,
            round_off: 0.0,
            is_at_resolution: false,
        };
        (0..100).find(|&k| progress.judge(&iteration(k)) != Verdict::Continue).map_or(100, |last| last + 1)
    }

    /// Slips at round-off turn without end.
    #[test]
    fn a_series_at_round_off_ends_although_pairs_turn() {
        let aim = Aim { tolerance: 1e-11, most: 100, stiffness: 1.0, is_uniform: false };
        let verdicts = |is_at_resolution: &dyn Fn(usize) -> bool| -> Vec<bool> {
            let mut progress = Progress::towards(aim);
            let iteration = |k: usize| Iteration {
                eta: 1e-9 / (k + 1) as f64,
                size: 1e-16 / (k + 1) as f64,
                is_whole: true,
                unlawful: Some(1),
                forces: 0.0,
                round_off: 0.0,
                is_at_resolution: is_at_resolution(k),
            };
            (0..5).map(|k| progress.judge(&iteration(k)) == Verdict::Solved).collect()
        };
        assert_eq!(verdicts(&|_| true)[..3], [false, false, true]);
        assert_eq!(verdicts(&|k| k != 1), [false, false, false, false, true]);
        assert_eq!(verdicts(&|_| false), [false; 5]);
    }

    /// A residual near its round-off ends a series when it stops decreasing, and one below it at once.
    #[test]
    fn a_series_ends_with_a_residual_that_is_noise() {
        let aim = Aim { tolerance: 1e-11, most: 100, stiffness: 1.0, is_uniform: false };
        let solved_after = |sizes: &[f64]| {
            let mut progress = Progress::towards(aim);
            let mut is_solved = |size: f64| {
                let found = Iteration {
                    eta: 1e-2,
                    size,
                    is_whole: true,
                    unlawful: Some(0),
                    forces: 0.0,
                    round_off: 1.0,
                    is_at_resolution: false,
                };
                progress.judge(&found) == Verdict::Solved
            };
            sizes.iter().position(|&size| is_solved(size))
        };
        assert_eq!(solved_after(&[1e4, 20.0, 8.0, 3.0, 0.9]), Some(4));
        assert_eq!(solved_after(&[1e4, 20.0, 15.0]), Some(2));
        assert_eq!(solved_after(&[1e4, 2.0 * NOISE, 1.9 * NOISE]), None);
    }

    /// Half of a correction is made if errors alternate while pairs do not obey their law, and the next one is whole again.
    #[test]
    fn half_of_a_correction_is_made_if_errors_alternate() {
        let aim = Aim { tolerance: 1e-6, most: 100, stiffness: 1.0, is_uniform: false };
        let parts = |errors: [f64; 6], unlawful: usize| {
            let mut progress = Progress::towards(aim);
            errors.map(|eta| {
                let found = Iteration {
                    eta,
                    size: eta,
                    is_whole: true,
                    unlawful: Some(unlawful),
                    forces: 0.0,
                    round_off: 0.0,
                    is_at_resolution: false,
                };
                progress.judge(&found);
                progress.part()
            })
        };
        let alternating = [3e-2, 5e-2, 3.001e-2, 5e-2, 3e-2, 5e-2];
        assert_eq!(parts(alternating, 2), [1.0, 1.0, 0.5, 1.0, 1.0, 0.5]);
        assert_eq!(parts(alternating, 0), [1.0; 6]);
        assert_eq!(parts([3e-2, 5e-2, 2.9e-2, 4.8e-2, 2.8e-2, 4.6e-2], 2), [1.0; 6]);
    }

    /// Bristles have their full stiffness once the error is small, and a series then ends only after one more iteration.
    #[test]
    fn bristles_have_their_full_stiffness_close_to_a_solution() {
        let mut progress =
            Progress::towards(Aim { tolerance: 1e-6, most: 100, stiffness: 1.0, is_uniform: false });
        let mut judge = |eta: f64| {
            let found = Iteration {
                eta,
                size: eta,
                is_whole: true,
                unlawful: Some(0),
                forces: 0.0,
                round_off: 0.0,
                is_at_resolution: false,
            };
            (progress.judge(&found) == Verdict::Solved, progress.penalty())
        };
        assert_eq!(judge(0.5), (false, FAR));
        assert_eq!(judge(0.0), (false, f64::INFINITY));
        assert_eq!(judge(0.0), (true, f64::INFINITY));
    }

    /// Iterations that are cut short go on while either number decreases by more than a hundredth each time.
    #[test]
    fn a_series_ends_when_it_crawls() {
        assert_eq!([length(0.98, 1.0), length(1.0, 0.98), length(0.9, 1.1), length(1.1, 0.9)], [100; 4]);
        let soon = WINDOW as i32 + 1;
        assert_eq!([length(1.0, 1.0), length(0.995, 0.995), length(1.0, 1.1), length(1.1, 1.1)], [soon; 4]);
    }
}
