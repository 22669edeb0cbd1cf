//! Evaluates initial fields of a body, given by numbers and formulas.

use crate::scene::{FieldComponent, field};

/// Adds a field of the rest position to values at nodes (3 per node).
pub(super) fn add_field(
    components: &[FieldComponent; 3],
    rest: &[[f64; 3]],
    values: &mut [f64],
) -> Result<(), String> {
    let field = field(components).map_err(|error| error.to_string())?;
    for (node, (value, place)) in values.as_chunks_mut::<3>().0.iter_mut().zip(rest).enumerate() {
        let at = field.at(*place);
        if let Some(wrong) = at.iter().find(|value| !value.is_finite()) {
            return Err(format!(
                "is {wrong} at node {node}, {place:?} m; a formula must be finite on the whole body"
            ));
        }
        (0..3).for_each(|k| value[k] += at[k]);
    }
    Ok(())
}

/// Returns the vector, if no component is a formula.
pub(super) fn constant(components: &[FieldComponent; 3]) -> Option<[f64; 3]> {
    let number = |component: &FieldComponent| match component {
        FieldComponent::Number(value) => Some(*value),
        FieldComponent::Formula(_) => None,
    };
    Some([number(&components[0])?, number(&components[1])?, number(&components[2])?])
}
