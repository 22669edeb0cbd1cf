//! The subdivision of the steps of a component, adapted to its last steps. A substep that fails is halved. If a
//! substep needed the last fallbacks of Newton's method, further substeps are halved, provided that halves cost less.
//! After several good substeps twice the length is tried again. Each time this fails, the next attempt waits longer.
//!
//! Costs are counted, not measured, so that equal runs have equal subdivisions.

use crate::record::record;

/// Number of substeps of a step at the smallest length: 2¹⁰.
pub(crate) const FLOOR: u32 = 1024;

/// Number of good substeps before twice the length is tried: at first, and at most.
const PATIENCE: [u64; 2] = [4, 128];
/// Number of substeps after which the cost of a length is compared with that of the original length.
const TRIAL: u64 = 4;
/// To reduce its cost, a length is divided by at most this number.
const DEEPEST: u64 = 8;
/// Number of substeps without further subdivision for cost, after one that did not reduce it.
const HOLD: u64 = 64;

/// The state of the subdivision, with lengths in h/1024 and costs in seconds of the reference core.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Pace {
    /// Length of the next substep.
    size: u64,
    /// Number of consecutive substeps of that length, and their cost.
    count: u64,
    cost: f64,
    /// Number of consecutive steps without the last fallbacks.
    calm: u64,
    /// Whether the last change doubled the length, and the new length is not confirmed yet.
    has_grown: bool,
    patience: u64,
    /// The length that was reduced because of its cost, and its cost per length; 0 for none.
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
    /// Returns whether the values are valid, for a pace read from a snapshot.
    pub(crate) fn is_sound(&self) -> bool {
        self.size.is_power_of_two() && self.size <= u64::from(FLOOR)
    }

    /// Returns whether it compares the cost of good substeps.
    pub(crate) fn compares(&self) -> bool {
        self.origin > 0
    }

    /// Returns the length of the next substep, at most `largest`.
    pub(crate) fn size(&mut self, largest: u32) -> u32 {
        self.size = self.size.min(u64::from(largest));
        self.size as u32
    }

    /// Returns whether steps are not subdivided.
    pub(crate) fn is_whole(&self) -> bool {
        self.size == u64::from(FLOOR)
    }

    /// Records `count` whole steps without difficulty.
    pub(crate) fn walk(&mut self, count: u32) {
        for _ in 0..count {
            self.succeed(FLOOR, FLOOR, false, 0.0);
        }
    }

    /// Records a completed substep that ends at `end` of its step.
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
            // The doubled length is confirmed.
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

    /// Records a failed substep; returns false if it cannot be divided.
    pub(crate) fn fail(&mut self) -> bool {
        let can = self.size > 1;
        if can {
            self.goal = 0;
            self.halve();
        }
        can
    }

    /// Returns the cost of the substeps of this length per length.
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

    /// Makes steps of a component whose substeps fail above `limit` and are difficult above `easy`; returns the
    /// numbers of substeps made and tried.
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
        // It returns to whole steps.
        steps(&mut pace, 100, FLOOR, FLOOR, f64::from);
        assert_eq!(pace.size(FLOOR), FLOOR);
    }

    #[test]
    fn hard_steps_are_cut_where_it_pays() {
        let mut pace = Pace::default();
        // Whole steps and halves cost ten, quarters cost one.
        let cost = |size| if size > FLOOR / 4 { 10.0 } else { 1.0 };
        let (made, _) = steps(&mut pace, 100, FLOOR, FLOOR / 4, cost);
        assert!(made > 350, "{made}");
        let mut pace = Pace::default();
        // All lengths cost the same and are difficult.
        let (made, _) = steps(&mut pace, 1000, FLOOR, 0, |_| 1.0);
        assert!(made < 1400, "{made}");
    }
}
