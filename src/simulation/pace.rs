//! The subdivision of the steps of a component, adapted to the cost of its last substeps. A substep that fails, or that
//! is given up because it exceeds its budget, is halved. If substeps take many iterations, halves are tried; from time
//! to time twice the length is tried. The length with the smaller cost per length is kept, and each trial that did not
//! pay makes the next one of its kind wait longer.
//!
//! Costs are counted, not measured, so that equal runs have equal subdivisions.

use vi_solvers::Budget;

use crate::record::record;

/// Number of substeps of a step at the smallest length: 2¹⁴.
pub(crate) const FLOOR: u32 = 1 << 14;
/// The smallest length without contact, h/1024, in h/2¹⁴. Bodies in contact may need shorter substeps: a gap that a hard impact leaves
/// bounds how far bodies may then turn or slide in a substep. Scenes 172 and 244 of `stress --contact --seed 1` failed at h/1024,
/// and run to their end in 1.2 and 2.1 s; 244 takes substeps of h/2¹⁴.
pub(crate) const SMALLEST_APART: u32 = FLOOR / 1024;

/// Number of substeps before another length is tried: at first, and at most.
const PATIENCE: [u64; 2] = [4, 64];
/// Number of substeps before a length is tried that did not fail last, at most. Newton iterations and factorisations of the strip by
/// `gauss` with h = 10 ms (.3 s), the flag by `energy-momentum` with h = 1/60 s (1 s) and the stiff band by `gauss` with
/// h = 10 ms (1 s): 2590 + 347, 2321 + 442, 2459 + 409 with 4; 2516 + 339, 2537 + 473, 2488 + 428 with 8; 2529 + 324, 2317 + 404,
/// 3188 + 652 with 16; 4225 + 637, 2370 + 393, 2710 + 529 with one patience for all lengths. With 8 and more the
/// flag by `energy-momentum` and by `gauss` with h = 10 ms takes the same parts as with one patience; 4 needs a tenth more.
const PATIENCE_ELSEWHERE: u64 = 8;
/// Number of substeps of a trial, after which its cost is compared with that of the original length.
const TRIAL: u64 = 4;
/// The mean cost is that of about this number of recent substeps.
const RECENT: u64 = 16;
/// A substep may cost this multiple of the mean cost of its length.
const EXCESS: f64 = 2.0;
/// To reduce cost alone, a length is divided by at most this number before a substep succeeds.
const DEEPEST: u64 = 8;

/// The state of the subdivision, with lengths in h/2¹⁴ and costs in seconds of the reference core.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Pace {
    /// Length of the next substep.
    size: u64,
    /// Number of recent substeps of that length, and their cost.
    count: u64,
    cost: f64,
    /// Length of the last completed substep.
    last: u64,
    /// The length from which a trial of another length began, and its cost per length; 0 without a trial.
    origin: u64,
    origin_rate: f64,
    /// Length to return to; 0 for none.
    goal: u64,
    /// Number of substeps since the last trial.
    since: u64,
    /// Number of substeps before shorter substeps are tried, and before those of the length `doubted` are.
    shorter: u64,
    longer: u64,
    /// The last length that failed or that a trial found too expensive; 0 if there is none.
    doubted: u64,
    /// Number of steps of the last interval of adaptive steps; 0 if there was none.
    number: u64,
}

record!(Pace {
    size: u64,
    count: u64,
    cost: f64,
    last: u64,
    origin: u64,
    origin_rate: f64,
    goal: u64,
    since: u64,
    shorter: u64,
    longer: u64,
    doubted: u64,
    number: u64,
});

impl Default for Pace {
    fn default() -> Self {
        let whole = u64::from(FLOOR);
        Self {
            size: whole,
            count: 0,
            cost: 0.0,
            last: whole,
            origin: 0,
            origin_rate: 0.0,
            goal: 0,
            since: 0,
            shorter: 1,
            longer: PATIENCE[0],
            doubted: 0,
            number: 0,
        }
    }
}

impl Pace {
    /// Returns whether the values are valid, for a pace read from a snapshot.
    pub(crate) fn is_sound(&self) -> bool {
        self.size.is_power_of_two() && self.size <= u64::from(FLOOR)
    }

    /// Returns the length of the next substep, at most `largest`.
    pub(crate) fn size(&mut self, largest: u32) -> u32 {
        self.size = self.size.min(u64::from(largest));
        self.size as u32
    }

    /// Returns the number of steps of the last interval of adaptive steps; 0 if there was none.
    pub(crate) fn number(&self) -> u64 {
        self.number
    }

    /// Records the number of steps of an interval of adaptive steps.
    pub(crate) fn set_number(&mut self, number: u64) {
        self.number = number;
    }

    /// Returns whether steps are not subdivided.
    pub(crate) fn is_whole(&self) -> bool {
        self.size == u64::from(FLOOR)
    }

    /// Returns the budget of the next substep; `smallest` is the smallest length.
    pub(crate) fn budget(&self, smallest: u32) -> Budget {
        if self.size <= u64::from(smallest) {
            return Budget::Unlimited;
        }
        if self.size <= u64::from(SMALLEST_APART) {
            return Budget::Divisible;
        }
        if self.size * DEEPEST <= self.last {
            return Budget::Seconds(f64::INFINITY);
        }
        let rate = if self.origin > 0 {
            self.origin_rate
        } else if self.count > 0 {
            self.rate()
        } else {
            0.0
        };
        Budget::Seconds(EXCESS * rate * self.size as f64)
    }

    /// Records `count` whole steps without difficulty.
    pub(crate) fn walk(&mut self, count: u32) {
        for _ in 0..count {
            self.succeed(FLOOR, FLOOR, false, 0.0);
        }
    }

    /// Records a completed substep of this cost that ends at `end` of its step. If it `is_expensive`, shorter substeps may be
    /// cheaper.
    pub(crate) fn succeed(&mut self, end: u32, largest: u32, is_expensive: bool, cost: f64) {
        self.count += 1;
        self.cost += cost;
        self.last = self.size;
        self.since += 1;
        let (largest, end) = (u64::from(largest), u64::from(end));
        if self.origin > 0 && self.count >= TRIAL {
            self.judge();
        } else if self.origin == 0 && self.goal == 0 {
            if self.count > RECENT {
                self.cost *= 0.5;
                self.count /= 2;
            }
            if is_expensive && self.size > u64::from(SMALLEST_APART) && self.since >= self.shorter {
                self.try_length(self.size / 2);
                return;
            }
        }
        let can_grow = self.size < largest && end.is_multiple_of(2 * self.size);
        if can_grow && self.goal > self.size {
            self.change(2 * self.size);
        } else if can_grow && self.origin == 0 && self.goal == 0 && self.since >= self.wait(2 * self.size) {
            self.try_length(2 * self.size);
        }
        if self.size >= self.goal {
            self.goal = 0;
        }
    }

    /// Records a substep that failed or was given up; returns false if it cannot be divided, because it has the `smallest` length.
    pub(crate) fn fail(&mut self, smallest: u32) -> bool {
        let can = self.size > u64::from(smallest);
        if can {
            if self.origin == 0 {
                self.assign_patience();
            } else if self.size > self.origin {
                self.assign_patience();
                self.longer = (2 * self.longer).min(PATIENCE[1]);
            }
            (self.origin, self.goal, self.since) = (0, 0, 0);
            self.change(self.size / 2);
        }
        can
    }

    /// Keeps the length of a trial if it is cheaper than the original one; otherwise returns to that.
    fn judge(&mut self) {
        let is_cheaper = self.rate() < self.origin_rate;
        let patience = if self.size > self.origin {
            self.assign_patience();
            &mut self.longer
        } else {
            &mut self.shorter
        };
        *patience =
            if is_cheaper { (*patience / 2).max(PATIENCE[0]) } else { (2 * *patience).min(PATIENCE[1]) };
        let origin = std::mem::take(&mut self.origin);
        self.since = 0;
        if !is_cheaper && origin < self.size {
            self.change(origin);
        } else if !is_cheaper {
            self.goal = origin;
        }
    }

    /// Returns the number of substeps before those of this greater length are tried.
    fn wait(&self, size: u64) -> u64 {
        if size == self.doubted { self.longer } else { self.longer.min(PATIENCE_ELSEWHERE) }
    }

    /// Makes `longer` the patience of the present length.
    fn assign_patience(&mut self) {
        self.longer = self.wait(self.size);
        self.doubted = self.size;
    }

    fn try_length(&mut self, size: u64) {
        (self.origin, self.origin_rate) = (self.size, self.rate());
        self.change(size);
    }

    /// Returns the mean cost per length of the recent substeps of this length.
    fn rate(&self) -> f64 {
        self.cost / (self.count * self.size) as f64
    }

    fn change(&mut self, size: u64) {
        (self.size, self.count, self.cost) = (size, 0, 0.0);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The substeps of a component and their total cost.
    struct Course {
        made: u32,
        tried: u32,
        cost: f64,
    }

    /// Makes steps of a component whose substeps fail above `limit`, cost `cost` and are expensive above a cost of 10.
    fn steps(pace: &mut Pace, count: u32, limit: u32, cost: impl Fn(u32) -> f64) -> Course {
        let mut course = Course { made: 0, tried: 0, cost: 0.0 };
        for _ in 0..count {
            let mut at = 0;
            while at < FLOOR {
                let size = pace.size(FLOOR);
                assert!(at + size <= FLOOR && at.is_multiple_of(size));
                course.tried += 1;
                if size > limit {
                    course.cost += cost(size);
                    assert!(pace.fail(SMALLEST_APART));
                    continue;
                }
                at += size;
                course.made += 1;
                course.cost += cost(size);
                pace.succeed(at, FLOOR, cost(size) > 10.0, cost(size));
            }
        }
        course
    }

    #[test]
    fn whole_steps_stay_whole() {
        let mut pace = Pace::default();
        let course = steps(&mut pace, 50, FLOOR, |_| 5.0);
        assert_eq!((course.made, course.tried), (50, 50));
    }

    #[test]
    fn lengths_that_fail_are_tried_ever_less() {
        let mut pace = Pace::default();
        let course = steps(&mut pace, 100, FLOOR / 8, |_| 5.0);
        assert_eq!(course.made, 800);
        assert!(course.tried - course.made < 30, "{} {}", course.tried, course.made);
        // It returns to whole steps.
        steps(&mut pace, 200, FLOOR, |_| 5.0);
        assert_eq!(pace.size(FLOOR), FLOOR);
    }

    #[test]
    fn the_cheapest_length_is_found_from_either_side() {
        // Whole steps cost 200, halves 60, quarters 12, shorter ones 8: quarters cost 48 per step, the least.
        let cost = |size| match FLOOR / size {
            1 => 200.0,
            2 => 60.0,
            4 => 12.0,
            _ => 8.0,
        };
        let mut pace = Pace::default();
        let course = steps(&mut pace, 500, FLOOR, cost);
        assert!(course.cost < 1.3 * 500.0 * 48.0, "{}", course.cost);
        let mut pace = Pace { size: 128, last: 128, ..Pace::default() };
        let course = steps(&mut pace, 500, FLOOR, cost);
        assert!(course.cost < 1.5 * 500.0 * 48.0, "{}", course.cost);
    }

    /// At h/1024 a step of a single body may end in any way. One with contact is divided further, and may end in any way at h/2¹⁴.
    #[test]
    fn contact_divides_further_than_other_failures() {
        for (smallest, deepest) in [(SMALLEST_APART, 1024), (1, 1 << 14)] {
            let (mut pace, mut parts) = (Pace::default(), 1);
            while pace.fail(smallest) {
                parts *= 2;
                let budget = pace.budget(smallest);
                assert_eq!(budget == Budget::Unlimited, parts == deepest, "{parts}: {budget:?}");
                assert_eq!(
                    budget == Budget::Divisible,
                    parts >= 1024 && parts < deepest,
                    "{parts}: {budget:?}"
                );
            }
            assert_eq!((parts, pace.size(FLOOR)), (deepest, smallest));
        }
    }

    #[test]
    fn equally_dear_lengths_are_rarely_tried() {
        let mut pace = Pace::default();
        let course = steps(&mut pace, 1000, FLOOR, |_| 20.0);
        assert!(course.made < 1100, "{}", course.made);
    }
}
