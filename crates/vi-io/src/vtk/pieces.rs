//! Joins the arrays of files that hold their mesh in several pieces.

use crate::mesh::DataArray;

/// Joins the arrays of piece `i` to those of the earlier pieces. An array that is missing in a piece is left out.
pub(crate) fn join(all: &mut Vec<DataArray>, piece: Vec<DataArray>, i: usize, notes: &mut Vec<String>) {
    if i == 0 {
        *all = piece;
        return;
    }
    all.retain_mut(|array| {
        match piece.iter().find(|other| other.name == array.name && other.components == array.components) {
            Some(other) => {
                array.values.extend_from_slice(&other.values);
                true
            }
            None => {
                notes.push(format!("the array \"{}\" is not in every piece: left out", array.name));
                false
            }
        }
    });
}
