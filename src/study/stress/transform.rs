//! Changes of a scene that must not change its result: other units of length, mass and time, or another position.
//! Every number of a scene is listed here with its dimension.
//!
//! Numbers in mesh files can only be lengths: `scale` and `translate` of the body change them. A file with point data
//! `velocity` cannot be converted to other units of time.

use std::fmt::Write;

use serde_json::Value;

use crate::scene::{RigidShape, Scene};

/// A change of units or of position.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Transform {
    /// All lengths, masses and times are multiplied by 2 to these powers: the same motion in other units, with
    /// bitwise equal numbers.
    Units {
        /// Power of two of lengths.
        length: i32,
        /// Power of two of masses.
        mass: i32,
        /// Power of two of times.
        time: i32,
    },
    /// All positions are moved by this vector, m: the same motion at another place, up to the round-off of its
    /// coordinates.
    Moved([f64; 3]),
}

/// Dimension of a number of a scene.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Meaning {
    /// Powers of length, mass and time.
    Of(i32, i32, i32),
    /// A position in space.
    Place,
    /// A factor in time: a number, a formula of t, or pairs (t, factor).
    Amplitude,
    /// Names and dimensionless vectors of directions.
    Directions,
}
use Meaning::{Amplitude, Directions, Of, Place};

const NUMBER: Meaning = Of(0, 0, 0);
const LENGTH: Meaning = Of(1, 0, 0);
const MASS: Meaning = Of(0, 1, 0);
const TIME: Meaning = Of(0, 0, 1);
const RATE: Meaning = Of(0, 0, -1);
const VELOCITY: Meaning = Of(1, 0, -1);
const DENSITY: Meaning = Of(-3, 1, 0);
const PRESSURE: Meaning = Of(-1, 1, -2);
const STIFFNESS: Meaning = Of(0, 1, -2);
const VISCOSITY: Meaning = Of(-1, 1, -1);

/// The keys of a scene that contain numbers or formulas. Keys of motions and materials are listed by the part after
/// `motion.` and `material.`.
const KEYS: &[(&str, Meaning)] = &[
    ("gravity", Of(1, 0, -2)),
    ("gravity_amplitude", Amplitude),
    ("time.end", TIME),
    ("time.step", TIME),
    ("time.stages", NUMBER),
    ("time.spectral_radius", NUMBER),
    ("time.solves", NUMBER),
    ("time.largest_step", TIME),
    ("time.tolerance", NUMBER),
    ("body.weld", LENGTH),
    ("body.box.size", LENGTH),
    ("body.box.cells", NUMBER),
    ("body.box.origin", LENGTH),
    ("body.sheet.size", LENGTH),
    ("body.sheet.cells", NUMBER),
    ("body.sheet.origin", LENGTH),
    ("body.sheet.directions", NUMBER),
    ("body.sheet.seed", NUMBER),
    ("body.order", NUMBER),
    ("body.refine", NUMBER),
    ("body.uv_scale", LENGTH),
    ("body.scale", NUMBER),
    ("body.translate", Place),
    ("body.displacement", LENGTH),
    ("body.velocity", VELOCITY),
    ("body.angular_velocity", RATE),
    ("material.young", PRESSURE),
    ("material.young_warp", PRESSURE),
    ("material.young_weft", PRESSURE),
    ("material.shear", PRESSURE),
    ("material.c10", PRESSURE),
    ("material.c01", PRESSURE),
    ("material.bulk", PRESSURE),
    ("material.poisson", NUMBER),
    ("material.density", DENSITY),
    ("material.area_density", Of(-2, 1, 0)),
    ("material.thickness", LENGTH),
    ("material.warp", NUMBER),
    ("fix.axes", Directions),
    ("fix.about.point", Place),
    ("fix.about.axis", NUMBER),
    ("motion.velocity", VELOCITY),
    ("motion.start", TIME),
    ("motion.end", TIME),
    ("motion.axis", NUMBER),
    ("motion.point", Place),
    ("motion.rate", RATE),
    ("motion.amplitude", LENGTH),
    ("motion.frequency", RATE),
    ("motion.phase", NUMBER),
    ("motion.times", TIME),
    ("motion.displacements", LENGTH),
    ("rigid.mass", MASS),
    ("rigid.density", DENSITY),
    ("rigid.inertia", Of(2, 1, 0)),
    ("rigid.shape.size", LENGTH),
    ("rigid.shape.radius", LENGTH),
    ("rigid.shape.length", LENGTH),
    ("rigid.shape.scale", LENGTH),
    ("rigid.shape.normal", NUMBER),
    ("rigid.position", Place),
    ("rigid.orientation.axis", NUMBER),
    ("rigid.orientation.angle", NUMBER),
    ("rigid.velocity", VELOCITY),
    ("rigid.angular_velocity", RATE),
    ("joint.point", Place),
    ("joint.to_point", Place),
    ("joint.axis", NUMBER),
    ("spring.from.point", Place),
    ("spring.from.node", NUMBER),
    ("spring.to.point", Place),
    ("spring.to.node", NUMBER),
    ("spring.stiffness", STIFFNESS),
    ("spring.length", LENGTH),
    ("attach.stiffness", STIFFNESS),
    ("attach.length", LENGTH),
    ("seam.nodes", NUMBER),
    ("seam.to_nodes", NUMBER),
    ("seam.stiffness", STIFFNESS),
    ("seam.length", LENGTH),
    ("strike.impulse", Of(1, 1, -1)),
    ("load.traction", PRESSURE),
    ("load.pressure", PRESSURE),
    ("load.point", Place),
    ("load.node", NUMBER),
    // The total force at a point; that of a body force is per volume.
    ("load.force", Of(1, 1, -2)),
    ("load.moment", Of(2, 1, -2)),
    ("load.about", Place),
    ("load.amplitude", Amplitude),
    ("wind.velocity", VELOCITY),
    ("wind.density", DENSITY),
    ("wind.normal", NUMBER),
    ("wind.tangential", NUMBER),
    ("damping.shear_viscosity", VISCOSITY),
    ("damping.bulk_viscosity", VISCOSITY),
    ("damping.stiffness_time", TIME),
    ("damping.mass_rate", RATE),
    ("contact.friction", NUMBER),
    ("contact.damping", TIME),
    ("contact.distance", LENGTH),
    ("contact.stiffness", PRESSURE),
    ("contact.pair.friction", NUMBER),
    ("contact.pair.damping", TIME),
    ("contact.pair.distance", LENGTH),
    ("contact.pair.stiffness", PRESSURE),
    ("static.tolerance", NUMBER),
    ("static.smallest_increment", TIME),
    ("static.arc_steps", NUMBER),
    ("static.push", LENGTH),
    ("probe.point", Place),
    ("probe.node", NUMBER),
    ("solver.tolerance", NUMBER),
    ("output.interval", TIME),
    ("output.fps", RATE),
    ("output.history", NUMBER),
    ("output.piece_points", NUMBER),
    ("checkpoint.interval", TIME),
    ("checkpoint.keep", NUMBER),
    ("guard.bound", NUMBER),
    ("assert.energy_drift", NUMBER),
    ("assert.momentum_drift", NUMBER),
    ("assert.angular_momentum_drift", NUMBER),
];

/// The keys of a selection of nodes, relative to the table that contains it.
const KEYS_OF_SELECTIONS: &[(&str, Meaning)] = &[
    ("box.min", Place),
    ("box.max", Place),
    ("plane.point", Place),
    ("plane.normal", NUMBER),
    ("plane.distance", LENGTH),
    ("sphere.centre", Place),
    ("sphere.radius", LENGTH),
    ("nodes", NUMBER),
];
/// The tables that select nodes.
const SELECTING: &[&str] =
    &["fix.", "attach.", "periodic.from.", "periodic.to.", "strike.", "load.", "probe."];

/// Returns the dimension of a key of a scene.
fn meaning(path: &str) -> Option<Meaning> {
    let of = |keys: &[(&str, Meaning)], key: &str| {
        keys.iter().find(|(known, _)| *known == key).map(|entry| entry.1)
    };
    let selection = SELECTING.iter().find_map(|table| path.strip_prefix(table));
    of(KEYS, path).or_else(|| of(KEYS_OF_SELECTIONS, selection?))
}

/// Dimension of a key of a material.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Quantity {
    /// Pa.
    Modulus,
    /// kg/m³.
    Density,
    /// m.
    Length,
}

/// Returns the quantity of a key of a material table; `None` for pure numbers and words.
pub(super) fn quantity(key: &str) -> Option<Quantity> {
    let of = |(path, _): &&(&str, Meaning)| path.strip_prefix("material.") == Some(key);
    match KEYS.iter().find(of)?.1 {
        PRESSURE => Some(Quantity::Modulus),
        DENSITY => Some(Quantity::Density),
        LENGTH => Some(Quantity::Length),
        _ => None,
    }
}

impl Transform {
    /// Returns the scene after this change.
    ///
    /// # Errors
    /// Returns the key of a number without a listed dimension, or the message of serde about the changed scene.
    pub fn of(&self, scene: &Scene) -> Result<Scene, String> {
        let mut value = serde_json::to_value(scene).map_err(|error| error.to_string())?;
        self.walk("", &mut value)?;
        let mut changed: Scene = serde_json::from_value(value).map_err(|error| error.to_string())?;
        for body in &mut changed.bodies {
            match *self {
                // The file itself does not change.
                Self::Units { length, .. } if body.mesh.is_some() => {
                    body.scale = Some(body.scale.unwrap_or(1.0) * power(length));
                }
                Self::Units { .. } => {}
                Self::Moved(by) if body.translate.is_none() => body.translate = Some(by),
                Self::Moved(_) => {}
            }
        }
        for rigid in &mut changed.rigids {
            if let (Self::Units { length, .. }, Some(RigidShape::Mesh { scale, .. })) =
                (self, &mut rigid.shape)
            {
                // A scale that is given was changed as a length.
                scale.get_or_insert(power(*length));
            }
        }
        Ok(changed)
    }

    /// Returns the factor for a quantity with these powers of length, mass and time.
    pub fn factor(&self, powers: [i32; 3]) -> f64 {
        match *self {
            Self::Units { length, mass, time } => {
                power(powers[0] * length) * power(powers[1] * mass) * power(powers[2] * time)
            }
            Self::Moved(_) => 1.0,
        }
    }

    fn walk(&self, path: &str, value: &mut Value) -> Result<(), String> {
        match value {
            Value::Object(table) => {
                let is = |table: &serde_json::Map<String, Value>, of: &str, kind: &str| {
                    path == of && table.get("kind").is_some_and(|found| found == kind)
                };
                let is_body_force = is(table, "load", "body-force");
                let is_volume = is(table, "static.control", "volume");
                for (key, value) in table {
                    let inner = match key.as_str() {
                        "motion" | "material" => key.clone(),
                        _ if path.is_empty() => key.clone(),
                        _ => format!("{path}.{key}"),
                    };
                    if is_body_force && key == "force" {
                        self.change(Of(-2, 1, -2), value);
                    } else if inner == "static.control.to" {
                        self.change(if is_volume { Of(3, 0, 0) } else { LENGTH }, value);
                    } else {
                        self.walk(&inner, value)?;
                    }
                }
                Ok(())
            }
            // The list contains tables, or numbers.
            Value::Array(list) if list.iter().any(Value::is_object) => {
                list.iter_mut().try_for_each(|value| self.walk(path, value))
            }
            _ => match meaning(path) {
                Some(meaning) => {
                    self.change(meaning, value);
                    Ok(())
                }
                None if holds_numbers(value) => Err(format!("no dimension is listed for `{path}`")),
                None => Ok(()),
            },
        }
    }

    fn change(&self, meaning: Meaning, value: &mut Value) {
        match (meaning, &mut *value) {
            (Amplitude, Value::Array(pairs)) => {
                for pair in pairs {
                    if let Some(time) = pair.get_mut(0) {
                        self.change(TIME, time);
                    }
                }
            }
            (Amplitude, Value::String(formula)) => {
                *formula = renamed(formula, &["t"], &|_| format!("(t*{:e})", 1.0 / self.factor([0, 0, 1])));
            }
            (Amplitude, _) => {}
            (Place, Value::Array(point)) => {
                for (k, x) in point.iter_mut().enumerate() {
                    match *self {
                        Self::Moved(by) => add(x, by[k % 3]),
                        Self::Units { .. } => self.change(LENGTH, x),
                    }
                }
            }
            (Of(..), Value::Array(list)) => list.iter_mut().for_each(|value| self.change(meaning, value)),
            (Of(length, mass, time), Value::String(formula)) => {
                let place = |k: usize, name: &str| match *self {
                    Self::Moved(by) => format!("({name}-({:e}))", by[k]),
                    Self::Units { .. } => format!("({name}*{:e})", 1.0 / self.factor([1, 0, 0])),
                };
                let inner = renamed(formula, &["x", "y", "z"], &|k| place(k, ["x", "y", "z"][k]));
                *formula = format!("{:e}*({inner})", self.factor([length, mass, time]));
            }
            (Of(length, mass, time), number) => {
                let factor = self.factor([length, mass, time]);
                if factor != 1.0
                    && let Some(old) = number.as_f64()
                {
                    *number = Value::from(old * factor);
                }
            }
            (Place | Directions, _) => {}
        }
    }
}

/// Returns 2^e.
fn power(e: i32) -> f64 {
    2.0_f64.powi(e)
}

fn add(value: &mut Value, by: f64) {
    if let Some(old) = value.as_f64() {
        *value = Value::from(old + by);
    }
}

fn holds_numbers(value: &Value) -> bool {
    match value {
        Value::Number(_) => true,
        Value::Array(list) => list.iter().any(holds_numbers),
        _ => false,
    }
}

/// Returns a formula with its variables replaced; numbers such as 1e3 and other names do not change.
fn renamed(formula: &str, variables: &[&str], by: &dyn Fn(usize) -> String) -> String {
    let mut out = String::with_capacity(formula.len());
    let mut rest = formula;
    while let Some(first) = rest.chars().next() {
        let is_word = |c: char| c.is_alphanumeric() || c == '_' || c == '.';
        let end = match is_word(first) {
            true => rest.find(|c| !is_word(c)).unwrap_or(rest.len()),
            false => first.len_utf8(),
        };
        let (word, after) = rest.split_at(end);
        match variables.iter().position(|variable| *variable == word) {
            // Writing into a string cannot fail.
            Some(k) => drop(write!(out, "{}", by(k))),
            None => out.push_str(word),
        }
        rest = after;
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn formulas_keep_numbers_and_names_of_functions() {
        let renamed = renamed("exp(x)+1e3*max(y,x2)-0.5*x", &["x", "y"], &|k| format!("<{k}>"));
        assert_eq!(renamed, "exp(<0>)+1e3*max(<1>,x2)-0.5*<0>");
    }

    #[test]
    fn a_change_of_units_and_back_is_none() {
        let scene = crate::study::stress::case(3, 5, &std::env::temp_dir()).unwrap().scene;
        let there = Transform::Units { length: 12, mass: -7, time: 5 };
        let back = Transform::Units { length: -12, mass: 7, time: -5 };
        let mut again = back.of(&there.of(&scene).unwrap()).unwrap();
        again.bodies.iter_mut().for_each(|body| body.scale = None);
        assert_eq!(again, scene);
    }
}
