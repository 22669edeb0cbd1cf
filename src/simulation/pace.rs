//! How finely the steps of a component are cut, learnt from its last ones. A substep that fails is halved. One that
//! took the last rungs of Newton's method is made in halves from then on, if these cost less. After some that went
//! well twice the length is tried again, the less often the more often that failed.
//!
//! Costs are counted, not measured, so that equal runs are cut alike.

use crate::record::record;

/// Substeps of a step at its floor: 2¹⁰.
pub(crate) const FLOOR: u32 = 1024;

/// Good substeps after which twice the length is tried, at first and at most.
const PATIENCE: [u64; 2] = [4, 128];
/// Substeps after which a length is compared with the one that was left for its cost.
const TRIAL: u64 = 4;
/// A length that is left for its cost is cut down to this part of it.
const DEEPEST: u64 = 8;
/// Substeps for which none is cut for its cost after that did not pay.
const HOLD: u64 = 64;

/// Lengths count in h/1024, costs in seconds of the reference core.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Pace {
    /// Length of the next substep.
    size: u64,
    /// Substeps of that length in a row, and what they cost.
    count: u64,
    cost: f64,
    /// Number of consecutive steps made without the last rungs.
    calm: u64,
    /// Was the last change to twice the length, and has that not lasted yet?
    has_grown: bool,
    patience: u64,
    /// The length that was left for its cost, and that cost over it; 0 for none.
    origin: u64,
    origin_rate: f64,
    /// Length to return to; 0 for none.
    goal: u64,
    hold: u64,
}

record!(Pace {
    size: u64,
    count: u64,
    cost: f64,
    calm: u64,
    has_grown: bool,
    patience: u64,
    origin: u64,
    origin_rate: f64,
    goal: u64,
    hold: u64,
});

impl Default for Pace {
    fn default() -> Self {
        Self {
            size: u64::from(FLOOR),
            count: 0,
            cost: 0.0,
            calm: 0,
            has_grown: false,
            patience: PATIENCE[0],
            origin: 0,
            origin_rate: 0.0,
            goal: 0,
            hold: 0,
        }
    }
}

impl Pace {
    /// Could it have been remembered?
    pub(crate) fn is_sound(&self) -> bool {
        self.size.is_power_of_two() && self.size <= u64::from(FLOOR)
    }

    /// Does it want to know what calm substeps cost?
    pub(crate) fn compares(&self) -> bool {
        self.origin > 0
    }

    /// Length of the next substep, at most `largest`.
    pub(crate) fn size(&mut self, largest: u32) -> u32 {
        self.size = self.size.min(u64::from(largest));
        self.size as u32
    }

    /// Are steps made whole?
    pub(crate) fn is_whole(&self) -> bool {
        self.size == u64::from(FLOOR)
    }

    /// `count` whole steps were made, none of them hard.
    pub(crate) fn walk(&mut self, count: u32) {
        for _ in 0..count {
            self.succeed(FLOOR, FLOOR, false, 0.0);
        }
    }

    /// A substep was made that ends at `end` of its step.
    pub(crate) fn succeed(&mut self, end: u32, largest: u32, is_hard: bool, cost: f64) {
        self.count += 1;
        self.cost += cost;
        self.calm = if is_hard { 0 } else { self.calm + 1 };
        self.hold = self.hold.saturating_sub(1);
        if self.count == TRIAL {
            if self.origin > self.size && self.rate() >= self.origin_rate {
                (self.goal, self.hold) = (self.origin, HOLD);
            }
            self.origin = 0;
        }
        if is_hard && self.hold == 0 && self.goal == 0 && self.size > 1 {
            if self.origin == 0 {
                (self.origin, self.origin_rate) = (self.size, cost / self.size as f64);
            }
            if self.size * DEEPEST > self.origin {
                self.halve();
                return;
            }
        }
        let wants_more = self.goal > self.size || self.calm >= self.patience;
        if self.has_grown && self.calm >= self.patience {
            // It was right to grow.
            self.patience = (self.patience / 2).max(PATIENCE[0]);
            self.has_grown = false;
        }
        if wants_more && self.size < u64::from(largest) && u64::from(end).is_multiple_of(2 * self.size) {
            self.change(2 * self.size);
            self.has_grown = true;
            if self.size >= self.goal {
                self.goal = 0;
            }
        }
    }

    /// A substep failed; false where it cannot be cut.
    pub(crate) fn fail(&mut self) -> bool {
        let can = self.size > 1;
        if can {
            self.goal = 0;
            self.halve();
        }
        can
    }

    /// Cost of the substeps of this length over their length.
    fn rate(&self) -> f64 {
        self.cost / (self.count * self.size) as f64
    }

    fn halve(&mut self) {
        if self.has_grown {
            self.patience = (2 * self.patience).min(PATIENCE[1]);
        }
        self.change(self.size / 2);
        self.has_grown = false;
    }

    fn change(&mut self, size: u64) {
        (self.size, self.count, self.cost, self.calm) = (size, 0, 0.0, 0);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Steps of a component whose substeps fail above `limit` and are hard above `easy`; returns substeps made
    /// and tried.
    fn steps(pace: &mut Pace, count: u32, limit: u32, easy: u32, cost: impl Fn(u32) -> f64) -> (u32, u32) {
        let (mut made, mut tried) = (0, 0);
        for _ in 0..count {
            let mut at = 0;
            while at < FLOOR {
                let size = pace.size(FLOOR);
                assert!(at + size <= FLOOR && at.is_multiple_of(size));
                tried += 1;
                if size > limit {
                    assert!(pace.fail());
                    continue;
                }
                at += size;
                made += 1;
                pace.succeed(at, FLOOR, size > easy, cost(size));
            }
        }
        (made, tried)
    }

    #[test]
    fn whole_steps_stay_whole() {
        let mut pace = Pace::default();
        assert_eq!(steps(&mut pace, 50, FLOOR, FLOOR, f64::from), (50, 50));
    }

    #[test]
    fn lengths_that_fail_are_tried_ever_less() {
        let mut pace = Pace::default();
        let (made, tried) = steps(&mut pace, 100, FLOOR / 8, FLOOR, f64::from);
        assert_eq!(made, 800);
        assert!(tried - made < 30, "{tried} {made}");
        // And the whole step is found again.
        steps(&mut pace, 100, FLOOR, FLOOR, f64::from);
        assert_eq!(pace.size(FLOOR), FLOOR);
    }

    #[test]
    fn hard_steps_are_cut_where_it_pays() {
        let mut pace = Pace::default();
        // Whole steps and halves cost ten, quarters one.
        let cost = |size| if size > FLOOR / 4 { 10.0 } else { 1.0 };
        let (made, _) = steps(&mut pace, 100, FLOOR, FLOOR / 4, cost);
        assert!(made > 350, "{made}");
        let mut pace = Pace::default();
        // All cost alike and are hard.
        let (made, _) = steps(&mut pace, 1000, FLOOR, 0, |_| 1.0);
        assert!(made < 1400, "{made}");
    }
}
