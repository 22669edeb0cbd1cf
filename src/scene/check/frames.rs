//! Checks the number of frames that a run would write.

use super::checker::Checker;
use crate::scene::{Scene, Schedule, TimeStep};

/// Number that a frame must not reach. The names of their files have six digits, by which viewers order them.
const MOST: f64 = 1e6;

pub(super) fn count(check: &mut Checker, scene: &Scene) {
    let (time, output) = (&scene.time, &scene.output);
    // Frames at intervals are states at the ends of steps, of which there may be fewer.
    let steps = match time.step {
        Some(TimeStep::Fixed(_)) => time.steps().0 as f64,
        _ => f64::INFINITY,
    };
    let (key, count) = match output.schedule() {
        Some(Schedule::Rate(rate)) => ("output.fps", time.end * rate),
        Some(Schedule::Interval(interval)) => ("output.interval", (time.end / interval).min(steps)),
        None => return,
    };
    // The first frame, number 0, is one more.
    if count.is_finite() && count >= MOST {
        let remedy = match key {
            "output.fps" => format!("less than fps = {:.3e}", MOST / time.end),
            _ => format!("more than interval = {:.3e}", time.end / MOST),
        };
        let message = format!(
            "asks for {count:.3e} frames, but the names of their files have six digits, for fewer than {MOST:e}: write {remedy}"
        );
        check.say(key, message);
    }
}
