//! Prescribed motions x(t) of nodes, as scene files write them.

mod table;

use std::f64::consts::TAU;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use vi_core::Path;

use crate::error::FemError;
use crate::path::own_motion::{NodalMotion, OwnMotion};
use crate::small::tensor::{cross, dot};

/// The prescribed motion of nodes, measured from their positions at the start: `motion = { kind = "sine", amplitude =
/// [0.0, 0.01, 0.0], frequency = 5.0 }`.
///
/// The motion runs from `start` to `end`. Before and after, the nodes stay where they are.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "kind", rename_all = "kebab-case")]
#[non_exhaustive]
pub enum Motion {
    /// u(t) = v (t − start).
    Translate(Translate),
    /// Rotation about an axis at a constant rate.
    Rotate(Rotate),
    /// u(t) = a (sin(2πf (t − start) + φ) − sin φ).
    Sine(Sine),
    /// Displacement u(t) that is linear between given times.
    Table(Table),
    /// A motion that a program defines itself; a scene file cannot name it.
    #[serde(skip_deserializing, rename = "own")]
    #[schemars(skip)]
    Own(OwnMotion),
}

/// Translation at constant velocity.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Translate {
    /// Velocity, m/s.
    pub velocity: [f64; 3],
    /// Time when the motion starts, s; default 0.
    #[serde(default)]
    pub start: f64,
    /// Time when the motion stops, s; default never.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub end: Option<f64>,
}

/// Rotation about an axis in space.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Rotate {
    /// Direction of the axis, of any length but zero. A positive rate turns right-handed about it.
    pub axis: [f64; 3],
    /// A point on the axis, m; default the origin.
    #[serde(default)]
    pub point: [f64; 3],
    /// Angular velocity, rad/s.
    pub rate: f64,
    /// Time when the motion starts, s; default 0.
    #[serde(default)]
    pub start: f64,
    /// Time when the motion stops, s; default never.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub end: Option<f64>,
}

/// Oscillation along a vector.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Sine {
    /// Amplitude along x, y and z, m.
    pub amplitude: [f64; 3],
    /// Frequency f, Hz; positive.
    #[schemars(extend("exclusiveMinimum" = 0.0))]
    pub frequency: f64,
    /// Phase φ, rad; default 0. The displacement starts from zero for every φ.
    #[serde(default)]
    pub phase: f64,
    /// Time when the motion starts, s; default 0.
    #[serde(default)]
    pub start: f64,
    /// Time when the motion stops, s; default never.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub end: Option<f64>,
}

/// Displacements at given times: linear between them, constant before the first and after the last.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Table {
    /// Times, s; increasing.
    pub times: Vec<f64>,
    /// Displacements, m, one per time.
    pub displacements: Vec<[f64; 3]>,
}

impl Motion {
    /// Makes a motion that a program defines itself; `name` appears in reports.
    pub fn own(name: &str, motion: impl NodalMotion) -> Self {
        Self::Own(OwnMotion::new(name, motion))
    }

    /// Checks the parameters.
    ///
    /// # Errors
    /// Returns the first problem found: a value that is not finite, an axis of length zero, a frequency that is not
    /// positive, an end before the start, a table of unequal lengths or whose times do not increase.
    pub fn check(&self) -> Result<(), FemError> {
        match self {
            Self::Translate(motion) => {
                finite("velocity", &motion.velocity)?;
                window(motion.start, motion.end)
            }
            Self::Rotate(motion) => {
                finite("axis", &motion.axis)?;
                finite("point", &motion.point)?;
                finite("rate", &[motion.rate])?;
                if dot(motion.axis, motion.axis) == 0.0 {
                    let requirement = "the axis of a rotation must not be zero";
                    return Err(FemError::Parameter { key: "axis", value: 0.0, requirement });
                }
                window(motion.start, motion.end)
            }
            Self::Sine(motion) => {
                finite("amplitude", &motion.amplitude)?;
                finite("phase", &[motion.phase])?;
                if !(motion.frequency > 0.0 && motion.frequency.is_finite()) {
                    let requirement = "the frequency must be positive (Hz)";
                    return Err(FemError::Parameter {
                        key: "frequency",
                        value: motion.frequency,
                        requirement,
                    });
                }
                window(motion.start, motion.end)
            }
            Self::Table(table) => table.check(),
            Self::Own(_) => Ok(()),
        }
    }

    /// Returns the path of prescribed coordinates. Each is given as (x₀ (m) of its node at the start, axis 0, 1 or
    /// 2), in the order of the list. A coordinate follows the component of its node's motion along this axis.
    ///
    /// # Errors
    /// Returns the errors of [`Motion::check`], and [`FemError::Invalid`] for an axis above 2.
    pub fn path(&self, coordinates: Vec<([f64; 3], usize)>) -> Result<Box<dyn Path>, FemError> {
        self.check()?;
        if let Some(&(_, axis)) = coordinates.iter().find(|(_, axis)| *axis > 2) {
            let problem = format!("axis {axis} is not one of 0, 1, 2");
            return Err(FemError::Invalid { what: "motion", problem });
        }
        Ok(match self {
            Self::Own(motion) => Box::new(motion.path(&coordinates)),
            _ => Box::new(MovingPath { motion: self.clone(), coordinates }),
        })
    }

    /// Returns the position (m) at time t (s) of the point that starts at x₀.
    pub fn position(&self, x: [f64; 3], t: f64) -> [f64; 3] {
        match self {
            Self::Translate(motion) => {
                let (s, _) = clock(motion.start, motion.end, t);
                [0, 1, 2].map(|i| x[i] + s * motion.velocity[i])
            }
            Self::Rotate(motion) => {
                let (s, _) = clock(motion.start, motion.end, t);
                let arm = motion.turned_arm(x, s);
                [0, 1, 2].map(|i| motion.point[i] + arm[i])
            }
            Self::Sine(motion) => {
                let (s, _) = clock(motion.start, motion.end, t);
                let wave = (TAU * motion.frequency * s + motion.phase).sin() - motion.phase.sin();
                [0, 1, 2].map(|i| x[i] + wave * motion.amplitude[i])
            }
            Self::Table(table) => {
                let (displacement, _) = table.at(t);
                [0, 1, 2].map(|i| x[i] + displacement[i])
            }
            Self::Own(motion) => motion.position(x, t),
        }
    }

    /// Returns the velocity (m/s) at time t (s) of the point that starts at x₀. If the velocity jumps, this is the
    /// derivative of the position from the right.
    pub fn velocity(&self, x: [f64; 3], t: f64) -> [f64; 3] {
        match self {
            Self::Translate(motion) => {
                let (_, rate) = clock(motion.start, motion.end, t);
                motion.velocity.map(|v| rate * v)
            }
            Self::Rotate(motion) => {
                let (s, rate) = clock(motion.start, motion.end, t);
                cross(motion.unit_axis(), motion.turned_arm(x, s)).map(|v| rate * motion.rate * v)
            }
            Self::Sine(motion) => {
                let (s, rate) = clock(motion.start, motion.end, t);
                let omega = TAU * motion.frequency;
                let wave = rate * omega * (omega * s + motion.phase).cos();
                motion.amplitude.map(|a| wave * a)
            }
            Self::Table(table) => table.at(t).1,
            Self::Own(motion) => motion.velocity(x, t),
        }
    }

    /// Returns whether no point ever moves along `direction`, which may have any length. The motion of a program is not known to be
    /// still.
    pub fn is_still_along(&self, direction: [f64; 3]) -> bool {
        match self {
            Self::Translate(motion) => dot(motion.velocity, direction) == 0.0,
            Self::Rotate(motion) => motion.rate == 0.0 || cross(motion.axis, direction) == [0.0; 3],
            Self::Sine(motion) => dot(motion.amplitude, direction) == 0.0,
            Self::Table(table) => table.displacements.iter().all(|&u| dot(u, direction) == 0.0),
            Self::Own(_) => false,
        }
    }

    /// Returns whether no point ever moves along an axis of space: 0 for x, 1 for y, 2 for z.
    pub fn is_still_along_axis(&self, axis: usize) -> bool {
        let mut direction = [0.0; 3];
        direction[axis] = 1.0;
        self.is_still_along(direction)
    }

    /// Returns whether directions that are fixed to the moving body never turn.
    pub fn keeps_directions(&self) -> bool {
        !matches!(self, Self::Rotate(motion) if motion.rate != 0.0)
    }

    /// Returns a direction fixed to the moving body at time t (s); `direction` is its value at the start.
    pub fn turned(&self, direction: [f64; 3], t: f64) -> [f64; 3] {
        match self {
            Self::Rotate(motion) => motion.turned(direction, clock(motion.start, motion.end, t).0),
            _ => direction,
        }
    }

    /// Returns the time derivative of [`Motion::turned`], 1/s.
    pub fn turning(&self, direction: [f64; 3], t: f64) -> [f64; 3] {
        match self {
            Self::Rotate(motion) => {
                let (s, rate) = clock(motion.start, motion.end, t);
                cross(motion.unit_axis(), motion.turned(direction, s)).map(|v| rate * motion.rate * v)
            }
            _ => [0.0; 3],
        }
    }
}

impl Rotate {
    fn unit_axis(&self) -> [f64; 3] {
        let length = dot(self.axis, self.axis).sqrt();
        self.axis.map(|value| value / length)
    }

    /// Returns x − point, rotated by the angle rate · s.
    fn turned_arm(&self, x: [f64; 3], s: f64) -> [f64; 3] {
        self.turned([0, 1, 2].map(|i| x[i] - self.point[i]), s)
    }

    /// Rotates a vector by the angle rate · s (Rodrigues' formula).
    fn turned(&self, arm: [f64; 3], s: f64) -> [f64; 3] {
        let n = self.unit_axis();
        let (sin, cos) = (self.rate * s).sin_cos();
        let (across, along) = (cross(n, arm), dot(n, arm));
        [0, 1, 2].map(|i| cos * arm[i] + sin * across[i] + (1.0 - cos) * along * n[i])
    }
}

/// Returns the motion's own time, which runs from `start` to `end`, and its rate, 1 or 0.
fn clock(start: f64, end: Option<f64>, t: f64) -> (f64, f64) {
    let end = end.unwrap_or(f64::INFINITY);
    (t.clamp(start, end) - start, if start <= t && t < end { 1.0 } else { 0.0 })
}

fn finite(key: &'static str, values: &[f64]) -> Result<(), FemError> {
    let requirement = "must be a finite number";
    match values.iter().find(|value| !value.is_finite()) {
        Some(&value) => Err(FemError::Parameter { key, value, requirement }),
        None => Ok(()),
    }
}

fn window(start: f64, end: Option<f64>) -> Result<(), FemError> {
    finite("start", &[start])?;
    match end {
        Some(end) if end.is_nan() || end < start => Err(FemError::Parameter {
            key: "end",
            value: end,
            requirement: "`end` must not be before `start` (s)",
        }),
        _ => Ok(()),
    }
}

/// The coordinates of nodes that follow one motion.
struct MovingPath {
    motion: Motion,
    /// Position of the node at the start (m), and the axis of the coordinate.
    coordinates: Vec<([f64; 3], usize)>,
}

impl Path for MovingPath {
    fn position(&self, t: f64, out: &mut [f64]) {
        for (out, &(x, axis)) in out.iter_mut().zip(&self.coordinates) {
            *out = self.motion.position(x, t)[axis];
        }
    }

    fn velocity(&self, t: f64, out: &mut [f64]) {
        for (out, &(x, axis)) in out.iter_mut().zip(&self.coordinates) {
            *out = self.motion.velocity(x, t)[axis];
        }
    }

    fn is_still(&self, place: usize) -> bool {
        self.motion.is_still_along_axis(self.coordinates[place].1)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn motions() -> Vec<Motion> {
        [
            r#"{ "kind": "translate", "velocity": [1.0, -2.0, 0.5], "start": 0.25 }"#,
            r#"{ "kind": "rotate", "axis": [0.0, 2.0, 2.0], "point": [0.1, 0.0, 0.0], "rate": 3.0, "end": 0.8 }"#,
            r#"{ "kind": "sine", "amplitude": [0.0, 0.1, 0.2], "frequency": 1.5, "phase": 0.4 }"#,
            r#"{ "kind": "table", "times": [0.0, 0.5, 0.9], "displacements": [[0, 0, 0], [1, 0, 2], [1, 1, 1]] }"#,
        ]
        .iter()
        .map(|text| serde_json::from_str(text).unwrap())
        .collect()
    }

    #[test]
    fn velocities_are_the_derivatives_of_positions() {
        let (x, e) = ([0.3, -0.4, 0.7], 1e-5);
        for motion in motions() {
            motion.check().unwrap();
            assert_eq!(motion.position(x, 0.0).map(|v| (v * 1e12).round()), x.map(|v| (v * 1e12).round()));
            for t in [0.1, 0.31, 0.62, 0.77, 0.95, 1.3] {
                let (a, b) = (motion.position(x, t + e), motion.position(x, t - e));
                for (i, velocity) in motion.velocity(x, t).into_iter().enumerate() {
                    assert!((velocity - (a[i] - b[i]) / (2.0 * e)).abs() < 1e-7, "{motion:?} at {t}");
                }
                // Directions are differences of points.
                let y = [0, 1, 2].map(|i| x[i] + [0.6, 0.0, -0.8][i]);
                let between = |from: [f64; 3], to: [f64; 3]| [0, 1, 2].map(|i| to[i] - from[i]);
                for (found, expected) in [
                    (motion.turned(between(x, y), t), between(motion.position(x, t), motion.position(y, t))),
                    (motion.turning(between(x, y), t), between(motion.velocity(x, t), motion.velocity(y, t))),
                ] {
                    assert!((0..3).all(|i| (found[i] - expected[i]).abs() < 1e-14), "{motion:?} at {t}");
                }
            }
        }
    }

    #[test]
    fn a_turn_keeps_the_distance_from_the_axis_and_takes_its_time() {
        let rate = std::f64::consts::FRAC_PI_2;
        let turn = Motion::Rotate(Rotate {
            axis: [0.0, 0.0, 3.0],
            point: [1.0; 3],
            rate,
            start: 1.0,
            end: Some(2.0),
        });
        for (t, expected) in [(0.5, [2.0, 1.0, 5.0]), (2.0, [1.0, 2.0, 5.0]), (9.0, [1.0, 2.0, 5.0])] {
            let found = turn.position([2.0, 1.0, 5.0], t);
            assert!((0..3).all(|i| (found[i] - expected[i]).abs() < 1e-15), "{found:?}");
        }
    }

    #[test]
    fn bad_motions_are_refused() {
        for text in [
            r#"{ "kind": "rotate", "axis": [0, 0, 0], "rate": 1.0 }"#,
            r#"{ "kind": "sine", "amplitude": [0, 1, 0], "frequency": -1.0 }"#,
            r#"{ "kind": "translate", "velocity": [0, 1, 0], "start": 2.0, "end": 1.0 }"#,
            r#"{ "kind": "table", "times": [0, 1, 1], "displacements": [[0,0,0],[0,0,0],[0,0,0]] }"#,
            r#"{ "kind": "table", "times": [0, 1], "displacements": [[0,0,0]] }"#,
            r#"{ "kind": "table", "times": [], "displacements": [] }"#,
        ] {
            assert!(serde_json::from_str::<Motion>(text).unwrap().check().is_err(), "{text}");
        }
        assert!(
            serde_json::from_str::<Motion>(
                r#"{ "kind": "sine", "amplitude": [0,0,0], "frequency": 1, "x": 1 }"#
            )
            .is_err()
        );
    }

    /// Swings along z with the amplitude x.
    struct Swing;

    impl NodalMotion for Swing {
        fn positions(&self, start: &[[f64; 3]], t: f64, out: &mut [[f64; 3]]) {
            out.iter_mut().zip(start).for_each(|(out, x)| *out = [x[0], x[1], x[2] + x[0] * t.sin()]);
        }
        fn velocities(&self, start: &[[f64; 3]], t: f64, out: &mut [[f64; 3]]) {
            out.iter_mut().zip(start).for_each(|(out, x)| *out = [0.0, 0.0, x[0] * t.cos()]);
        }
    }

    #[test]
    fn a_path_follows_the_motion_of_each_node() {
        let motion = Motion::own("swing", Swing);
        let starts = [[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]];
        let coordinates: Vec<_> = starts.iter().flat_map(|&x| [0, 2].map(|axis| (x, axis))).collect();
        let path = motion.path(coordinates.clone()).unwrap();
        let (mut x, mut v) = ([0.0; 4], [0.0; 4]);
        path.position(0.7, &mut x);
        path.velocity(0.7, &mut v);
        for (k, (start, axis)) in coordinates.into_iter().enumerate() {
            assert_eq!(x[k], motion.position(start, 0.7)[axis]);
            assert_eq!(v[k], motion.velocity(start, 0.7)[axis]);
        }
        assert!(!path.is_fixed());
        let text = serde_json::to_string(&motion).unwrap();
        assert_eq!(text, r#"{"kind":"own","name":"swing"}"#);
        assert!(serde_json::from_str::<Motion>(&text).is_err());
    }
}
