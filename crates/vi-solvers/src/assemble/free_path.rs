//! Shortens motions node by node until no pair of live terms meets on their paths. One pair then does not stop all nodes.

use vi_core::Coordinates;

/// Number of rounds in which the motions of nodes are shortened until no pair meets. After that, the nodes of pairs that
/// still meet are not moved.
const ROUNDS: usize = 10;

/// Shortens the change `delta` of the free coordinates. For a given change, `limit` reduces `parts`, which are 1, to the
/// fraction of its path that each node may move. Calls `shortened` with each node whose motion it shortens. Returns whether
/// it shortened none.
pub(crate) fn shorten(
    coordinates: &Coordinates,
    delta: &mut [f64],
    parts: &mut [f64],
    mut limit: impl FnMut(&[f64], &mut [f64]),
    mut shortened: impl FnMut(u32),
) -> bool {
    let free = coordinates.free();
    for round in 0..2 * ROUNDS {
        parts.fill(1.0);
        limit(delta, parts);
        if parts.iter().all(|part| *part >= 1.0) {
            return round == 0;
        }
        for (node, terms) in coordinates.combinations() {
            let part = parts[node as usize];
            if part < 1.0 {
                terms.iter().for_each(|&(k, _)| parts[k as usize] = parts[k as usize].min(part));
            }
        }
        for (delta, &dof) in delta.iter_mut().zip(free) {
            let part = parts[dof as usize / 3];
            if part < 1.0 {
                *delta *= if round < ROUNDS { part } else { 0.0 };
                shortened(dof / 3);
            }
        }
    }
    false
}
