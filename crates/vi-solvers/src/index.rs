//! Indices of nodes, rows and coordinates: the index that means "none", and grouping by a key.

use vi_core::Coordinates;

/// Stands for no index: a coordinate that is not free, or a node without a row.
pub(crate) const NONE: u32 = u32::MAX;

/// Returns the free coordinate of each coordinate, or [`NONE`].
pub(crate) fn free_of(coordinates: &Coordinates) -> Vec<u32> {
    let mut free_of = vec![NONE; coordinates.dof_count()];
    for (k, &dof) in (0..).zip(coordinates.free()) {
        free_of[dof as usize] = k;
    }
    free_of
}

/// Returns for each key below `key_count` the places where it occurs in `keys`, ascending, as (start, places).
pub(crate) fn group_by(keys: &[u32], key_count: usize) -> (Vec<u32>, Vec<u32>) {
    let mut start = vec![0_u32; key_count + 1];
    for &key in keys {
        start[key as usize + 1] += 1;
    }
    for key in 0..key_count {
        start[key + 1] += start[key];
    }
    let mut next = start.clone();
    let mut places = vec![0; keys.len()];
    for (place, &key) in keys.iter().enumerate() {
        places[next[key as usize] as usize] = place as u32;
        next[key as usize] += 1;
    }
    (start, places)
}
