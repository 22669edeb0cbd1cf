//! What happens in a scene: the functions of time of its loads and supports, and rigid bodies that may meet others. It determines how
//! coarse a trial may be without missing changes, and when the first change occurs.

use crate::scene::{Rigid, RigidShape, Scene};

/// Number of samples of a function of time over the run; the finest division that [`resolving_steps`] returns.
const SAMPLES: usize = 4096;
/// Fraction of a function's mean deviation from its start that the steps may miss. With 0.1, a pulse that lasts 1/100
/// of the run requires 512 steps, a sine 8 per period.
const MISSED: f64 = 0.1;
/// Fraction of the size of a motion below which a coordinate counts as constant: round-off of a rotation, which leaves the coordinate
/// along its axis where it is.
const ROUND_OFF: f64 = 1e-9;
/// Fraction of the time in which a free rigid body that can meet others flies or falls by its own thickness, for a step. The
/// dominoes of `scenes/contact/dominoes.toml`, of 1 cm, get steps of at most 4.5 ms.
const OF_THICKNESS: f64 = 0.1;

/// Returns the functions of time of a scene at SAMPLES + 1 times from 0 to the end, without constant ones.
fn functions(scene: &Scene) -> Vec<Vec<f64>> {
    let time = |k: usize| scene.time.end * k as f64 / SAMPLES as f64;
    let mut found = Vec::new();
    for (_, function) in scene.functions_of_time() {
        let component = |number| (0..=SAMPLES).map(|k| function.at(number, time(k))).collect::<Vec<f64>>();
        let components: Vec<Vec<f64>> = (0..function.count()).map(component).collect();
        let size = components.iter().map(|values| range(values)).fold(0.0, f64::max);
        found.extend(components.into_iter().filter(|values| range(values) > ROUND_OFF * size));
    }
    found.retain(|values| range(values) > 0.0 && values.iter().all(|v| v.is_finite()));
    found
}

/// Returns the largest deviation of a function from its start.
fn range(values: &[f64]) -> f64 {
    values.iter().fold(0.0, |most, value| most.max((value - values[0]).abs()))
}

/// Returns the smallest number of steps that resolves the flight of free rigid bodies that can meet others, as known at the start.
fn steps_of_flights(scene: &Scene) -> f64 {
    let norm = |v: [f64; 3]| v.iter().map(|v| v * v).sum::<f64>().sqrt();
    let gravity = norm(scene.gravity);
    let steps = |rigid: &Rigid| {
        let thickness = rigid.shape.as_ref().map_or(f64::NAN, RigidShape::thickness);
        let [speed, spin] = [rigid.velocity, rigid.angular_velocity].map(|v| v.map_or(0.0, norm));
        let rate = (speed / thickness + spin).max((0.5 * gravity / thickness).sqrt());
        scene.time.end * rate / OF_THICKNESS
    };
    let meeting = scene.rigids.iter().filter(|rigid| scene.contact.is_some() && !rigid.is_prescribed());
    // The thickness of a mesh is not known here.
    meeting.map(steps).filter(|steps| steps.is_finite()).fold(1.0, f64::max)
}

/// Returns the smallest number of steps, `coarsest` or a larger power of two, that resolves all functions of time of
/// the scene (linear interpolation between the steps misses at most a tenth of a function on average) and the flight of rigid bodies.
pub(super) fn resolving_steps(scene: &Scene, coarsest: u64) -> u64 {
    let functions = functions(scene);
    let misses = |values: &Vec<f64>, steps: usize| {
        let stride = SAMPLES / steps;
        let mut missed = 0.0;
        for (k, value) in values.iter().enumerate().take(SAMPLES) {
            let (from, part) = (k - k % stride, (k % stride) as f64 / stride as f64);
            let line = values[from] + part * (values[from + stride] - values[from]);
            missed += (value - line).abs();
        }
        let moved: f64 = values.iter().map(|value| (value - values[0]).abs()).sum();
        missed > MISSED * moved
    };
    let mut steps = (steps_of_flights(scene).ceil() as usize).next_power_of_two().min(SAMPLES);
    while steps < SAMPLES && functions.iter().any(|values| misses(values, steps)) {
        steps *= 2;
    }
    coarsest.max(steps as u64)
}

/// Returns the first time at which a function of time of the scene changes, s; `None` if all are constant.
pub(super) fn first_event(scene: &Scene) -> Option<f64> {
    let first = |values: &Vec<f64>| values.iter().position(|value| *value != values[0]);
    let sample = functions(scene).iter().filter_map(first).min()?;
    Some(scene.time.end * sample.saturating_sub(1) as f64 / SAMPLES as f64)
}

/// Returns whether a function of time of the scene deviates after `t` (s) from a straight line.
pub(super) fn has_event_after(scene: &Scene, t: f64) -> bool {
    let from = ((t / scene.time.end * SAMPLES as f64) as usize).min(SAMPLES);
    let bends = |values: &Vec<f64>| {
        let scale = range(values);
        let bent = |part: &[f64]| (part[0] - 2.0 * part[1] + part[2]).abs() > ROUND_OFF * scale;
        values[from..].windows(3).any(bent)
    };
    functions(scene).iter().any(bends)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{Fix, Load, Time};
    use std::f64::consts::PI;
    use vi_fem::{Amplitude, Motion, Rotate};

    fn scene(amplitude: &str) -> Scene {
        let load = Load::Point {
            body: "b".into(),
            point: None,
            node: Some(0),
            force: [1.0, 0.0, 0.0],
            amplitude: Amplitude::expression(amplitude).unwrap(),
        };
        Scene::new(Time::auto(2.0, 1e-3)).load(load)
    }

    #[test]
    fn steps_follow_what_happens() {
        assert_eq!(resolving_steps(&scene("1"), 16), 16);
        assert_eq!(resolving_steps(&scene("t"), 16), 16);
        // This function has 40 periods.
        let periods = resolving_steps(&scene("sin(2*pi*20*t)"), 16);
        assert!((256..=512).contains(&periods), "{periods}");
    }

    /// A rotation leaves the coordinate along its axis where it is, up to round-off, which no step needs to resolve.
    #[test]
    fn the_round_off_of_a_rotation_is_no_motion() {
        let turning = |axis: [f64; 3], rate: f64| {
            let motion = Motion::Rotate(Rotate { axis, point: [0.0; 3], rate, start: 0.0, end: None });
            let fix = Fix { motion: Some(motion), ..Fix::region("b", "x-min") };
            Scene::new(Time::auto(2.0, 1e-3)).fix(fix)
        };
        for axis in [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 2.0, 3.0]] {
            assert_eq!(resolving_steps(&turning(axis, 0.5), 16), 16, "{axis:?}");
            let turns = resolving_steps(&turning(axis, 2.0 * PI * 20.0), 16);
            assert!((256..=512).contains(&turns), "{axis:?}: {turns}");
        }
    }

    #[test]
    fn the_first_event_is_found() {
        let late = scene("max(t-1.5,0)");
        let t = first_event(&late).unwrap();
        assert!((t - 1.5).abs() < 2e-3, "{t}");
        assert!(has_event_after(&late, 1.0) && !has_event_after(&late, 1.6));
        assert_eq!(first_event(&scene("2")), None);
    }
}
