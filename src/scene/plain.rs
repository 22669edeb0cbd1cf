//! Rules for every value of a scene, whatever its key: numbers are finite and texts can be printed. It knows no keys
//! but the bounds of boxes, which may be infinite and are checked where they are defined, so that it holds for new keys.

use serde_json::Value;

use super::{Problem, Scene};

/// Everything in a scene that is no finite number or cannot be printed.
pub(super) fn problems(scene: &Scene) -> Vec<Problem> {
    let mut problems = Vec::new();
    match serde_json::to_value(scene) {
        Ok(value) => walk(&value, "", &mut problems),
        Err(error) => problems.push(Problem::new("", format!("cannot be written as JSON: {error}"))),
    }
    problems
}

fn walk(value: &Value, key: &str, problems: &mut Vec<Problem>) {
    match value {
        Value::Null if key.contains(".box.min[") || key.contains(".box.max[") => {}
        // JSON has no name for nan and infinities, and serde_json writes null. Keys without a value are left out.
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
