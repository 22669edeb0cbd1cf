//! Rules for every value of a scene: numbers are finite and texts are printable. The rules hold for new keys too. The
//! only exceptions are the bounds of boxes, which may be infinite and are checked where they are defined.

use serde_json::Value;

use super::{Problem, Scene};

/// Returns the problems of numbers that are not finite and texts that are not printable.
pub(super) fn problems(scene: &Scene) -> Vec<Problem> {
    let mut problems = Vec::new();
    match serde_json::to_value(scene) {
        Ok(value) => walk(&value, "", &mut problems),
        Err(error) => problems.push(Problem::new("", format!("cannot be written as JSON: {error}"))),
    }
    problems
}

/// Returns whether a number may be infinite: a bound of a box that selects nodes.
pub(super) fn may_be_infinite(key: &str) -> bool {
    key.contains(".box.min[") || key.contains(".box.max[")
}

fn walk(value: &Value, key: &str, problems: &mut Vec<Problem>) {
    match value {
        Value::Null if may_be_infinite(key) => {}
        // JSON cannot represent nan and infinities, and serde_json writes null. Keys without a value are left out.
        Value::Null => problems.push(Problem::new(key, "must be a finite number, is nan or infinite")),
        Value::String(text) => {
            let is_name = key == "name" || key.ends_with(".name");
            let is_allowed = |c: char| !c.is_control() || (!is_name && matches!(c, '\t' | '\n' | '\r'));
            if let Some(c) = text.chars().find(|&c| !is_allowed(c)) {
                let message = format!("must not have the control character {c:?}; write it without");
                problems.push(Problem::new(key, message));
            }
        }
        Value::Array(values) => {
            let rest = values.iter().enumerate().filter(|(_, value)| !value.is_number());
            for (i, value) in rest {
                walk(value, &format!("{key}[{i}]"), problems);
            }
        }
        Value::Object(table) => {
            for (name, value) in table {
                let key = if key.is_empty() { name.clone() } else { format!("{key}.{name}") };
                walk(value, &key, problems);
            }
        }
        Value::Bool(_) | Value::Number(_) => {}
    }
}
