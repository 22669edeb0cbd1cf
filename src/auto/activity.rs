//! Analyses the events of a scene: the functions of time of its loads and supports, and rigid bodies that may meet
//! others. Determines how coarse the steps of a trial may be without missing changes, when the first change occurs, and
//! the error that steps make at kinks.

use super::trial::Choice;
use crate::scene::{FunctionOfTime, Rigid, RigidShape, Scene, integral};

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

/// Returns the largest error of the impulse of a function of time, relative to the impulse of its deviation from its mean or from its start, that a choice
/// makes at the kinks that the scene names: those of tables, and the start and the end of motions.
///
/// Differences of trials do not always show this error. For a pulse of 2.048 steps, the sum of the errors at its three
/// kinks is the same for half and for a quarter of the step, and for schemes of different order: 5.5e-4 of the impulse
/// of a triangle of 2 ms in 2 s, with 4096 to 16 384 steps.
pub(super) fn missed_at_kinks(scene: &Scene, choice: &Choice) -> f64 {
    let Some(samples) = choice.method().samples() else { return 0.0 };
    let h = scene.time.end / choice.steps as f64;
    let missed = |function: &FunctionOfTime, number: usize| {
        let f = |t: f64| function.at(number, t);
        let is_inside = |t: &f64| *t > 0.0 && *t < scene.time.end;
        let kinks: Vec<f64> = function.kinks().into_iter().filter(is_inside).collect();
        let mut steps: Vec<u64> = kinks.iter().map(|t| (t / h) as u64).collect();
        steps.dedup();
        let error = |step: &u64| {
            let [from, to] = [step, &(step + 1)].map(|step| *step as f64 * h);
            let within = kinks.iter().copied().filter(|t| from < *t && *t < to);
            let places: Vec<f64> = std::iter::once(from).chain(within).chain([to]).collect();
            let exact: f64 =
                places.windows(2).map(|pair| 0.5 * (f(pair[0]) + f(pair[1])) * (pair[1] - pair[0])).sum();
            samples.iter().map(|[t, weight]| weight * h * f(from + t * h)).sum::<f64>() - exact
        };
        let missed: f64 = steps.iter().map(error).sum();
        let end = scene.time.end;
        let points = function.points(number, [0.0, end], SAMPLES);
        let mean = integral(&points, |f| f) / end;
        // Compare with the deviation from the mean or from the start, whichever is smaller: a pulse deviates from its
        // start only while it lasts, and a load that stays deviates from its mean only before it begins.
        let size = [mean, points[0][1]].map(|level| integral(&points, |f| (f - level).abs()));
        let size = size[0].min(size[1]);
        if size > ROUND_OFF * end * mean.abs() { missed.abs() / size } else { 0.0 }
    };
    let functions = scene.functions_of_time();
    let each = functions
        .iter()
        .flat_map(|(_, function)| (0..function.count()).map(move |number| (function, number)));
    each.map(|(function, number)| missed(function, number))
        .filter(|missed| missed.is_finite())
        .fold(0.0, f64::max)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{Fix, Load, SchemeName, Time};
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
        // The run contains 40 periods of this function.
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

    /// The error at kinks is zero if they fall on steps. For a triangle of 2 ms in 2 s it is the number that was
    /// computed independently.
    #[test]
    fn what_steps_miss_at_kinks_is_known() {
        let points = vec![[0.0, 0.0], [1.93, 0.0], [1.931, 1.0], [1.932, 0.0]];
        let mut pulse = scene("1");
        pulse.loads = vec![match pulse.loads.remove(0) {
            Load::Point { body, point, node, force, .. } => {
                let amplitude = Amplitude::table(points).unwrap();
                Load::Point { body, point, node, force, amplitude }
            }
            other => other,
        }];
        for scheme in [SchemeName::StormerVerlet, SchemeName::BlanesMoan4, SchemeName::ImplicitMidpoint] {
            let missed = |steps: u64| missed_at_kinks(&pulse, &Choice { scheme, stages: None, steps });
            assert!((missed(4096) / 5.493e-4 - 1.0).abs() < 0.02, "{scheme:?} {}", missed(4096));
            assert!(missed(20_000) < 1e-11, "{scheme:?} {}", missed(20_000));
        }
        let verlet = Choice { scheme: SchemeName::StormerVerlet, stages: None, steps: 100 };
        assert_eq!(missed_at_kinks(&scene("sin(t)"), &verlet), 0.0);
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
