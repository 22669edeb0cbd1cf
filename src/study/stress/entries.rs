//! Entries of scenes that the generators of bodies that meet share.

use serde_json::{Value, json};

use super::random::Random;

/// Holds a rigid body, which then needs no density.
pub(super) fn held(mut rigid: Value) -> Value {
    if let Some(keys) = rigid.as_object_mut() {
        keys.remove("density");
        keys.insert("fixed".to_owned(), json!(true));
    }
    rigid
}

/// Returns an entry with one more key, or another value of it.
pub(super) fn with(mut value: Value, key: &str, entry: Value) -> Value {
    value[key] = entry;
    value
}

/// Returns the half-space below z = 0.
pub(super) fn floor() -> Value {
    json!({ "name": "floor", "shape": { "kind": "plane", "normal": [0.0, 0.0, 1.0] }, "fixed": true })
}

/// Draws a shape with a diameter of about `size`.
pub(super) fn shape(random: &mut Random, size: f64) -> Value {
    match random.below(4) {
        0 => json!({ "kind": "sphere", "radius": 0.5 * size }),
        1 => json!({ "kind": "capsule", "length": 0.5 * size, "radius": 0.2 * size }),
        2 => json!({ "kind": "cylinder", "length": 0.7 * size, "radius": 0.3 * size }),
        _ => json!({ "kind": "box", "size": [0.6 * size, 0.5 * size, 0.5 * size] }),
    }
}

/// Returns the motion of a translation at a constant velocity, m/s.
pub(super) fn translation(velocity: [f64; 3]) -> Value {
    json!({ "kind": "translate", "velocity": velocity })
}

/// Returns a rigid body whose motion is prescribed: a translation from `position` (m) at a constant velocity, m/s.
pub(super) fn moved(name: &str, shape: Value, position: [f64; 3], velocity: [f64; 3]) -> Value {
    json!({ "name": name, "shape": shape, "position": position, "motion": translation(velocity) })
}
