//! Paths on which no pair of live terms meets. Motions are shortened node by node, so that one pair does not stop all
//! nodes. Nodes in the way of an obstacle with a prescribed motion are taken along by it.

use vi_core::{Coordinates, Meeting};

use crate::assemble::pairs::in_own_axes;

/// Number of rounds in which the motions of nodes are shortened until no pair meets. After that, the nodes of pairs that
/// still meet are not moved.
const ROUNDS: usize = 10;
/// Number of rounds in which nodes are taken along by obstacles. In each round, they push the next ones.
const PUSHES: usize = 30;

/// Replaces a change of coordinates, some of which were shortened, by the smallest remaining fraction of the whole change.
/// If the path of the shortened change is free, that of the fraction is too: it is part of the whole path, before the first
/// meeting on it.
pub(crate) fn make_uniform(whole: &[f64], shortened: &mut [f64]) {
    let parts = whole.iter().zip(&*shortened).filter(|(whole, _)| **whole != 0.0);
    let least = parts.map(|(whole, part)| part / whole).fold(1.0, f64::min);
    shortened.iter_mut().zip(whole).for_each(|(part, whole)| *part = least * whole);
}

/// The straight paths of all nodes that begin at given positions.
pub(crate) struct FreePath<'a, P, M> {
    pub(crate) coordinates: &'a Coordinates,
    /// The positions of all nodes at the start, m.
    pub(crate) from: &'a [f64],
    /// Returns the positions of all nodes at the end, for a change of the free coordinates.
    pub(crate) place: P,
    /// Returns the groups of nodes that meet on the path to these positions.
    pub(crate) meetings: M,
}

impl<P, M> FreePath<'_, P, M>
where
    P: FnMut(&[f64]) -> Vec<f64>,
    M: FnMut(&[f64], &[f64]) -> Vec<Meeting>,
{
    fn meetings(&mut self, delta: &[f64]) -> Vec<Meeting> {
        let end = (self.place)(delta);
        (self.meetings)(self.from, &end)
    }

    /// Shortens the change `delta` of the free coordinates. Calls `changed` with each node whose motion it changes. Returns
    /// whether it changed none.
    pub(crate) fn shorten(&mut self, delta: &mut [f64], changed: impl FnMut(u32)) -> bool {
        self.shorten_to(&vec![0.0; delta.len()], delta, changed)
    }

    /// Shortens the change `delta` from the start of a step to its end, while prescribed nodes make their whole motion. Nodes
    /// that would be in their way are taken along.
    pub(crate) fn shorten_past_obstacles(&mut self, delta: &mut [f64], mut changed: impl FnMut(u32)) -> bool {
        let pushed = self.pushed(delta.len());
        let mut is_pushed = false;
        for ((delta, pushed), &dof) in delta.iter_mut().zip(&pushed).zip(self.coordinates.free()) {
            if *pushed != 0.0 {
                *delta = *pushed;
                changed(dof / 3);
                is_pushed = true;
            }
        }
        self.shorten_to(&pushed, delta, changed) && !is_pushed
    }

    /// Shortens the change `delta` towards the change `least`.
    fn shorten_to(&mut self, least: &[f64], delta: &mut [f64], mut changed: impl FnMut(u32)) -> bool {
        for round in 0..2 * ROUNDS {
            let met = self.meetings(delta);
            if met.is_empty() {
                return round == 0;
            }
            let mut parts = vec![1.0_f64; self.from.len() / 3];
            for Meeting { nodes, part } in met {
                nodes.into_iter().for_each(|node| parts[node as usize] = parts[node as usize].min(part));
            }
            for (node, terms) in self.coordinates.combinations() {
                let part = parts[node as usize];
                if part < 1.0 {
                    terms.iter().for_each(|&(k, _)| parts[k as usize] = parts[k as usize].min(part));
                }
            }
            for ((delta, least), &dof) in delta.iter_mut().zip(least).zip(self.coordinates.free()) {
                let part = parts[dof as usize / 3];
                if part < 1.0 {
                    *delta = least + if round < ROUNDS { part * (*delta - least) } else { 0.0 };
                    changed(dof / 3);
                }
            }
        }
        false
    }

    /// Returns the change of the free coordinates that takes along the nodes that moving obstacles would hit if they stayed,
    /// the nodes that these would hit, and so on.
    fn pushed(&mut self, count: usize) -> Vec<f64> {
        let mut pushed = vec![0.0; count];
        for _ in 0..PUSHES {
            let end = (self.place)(&pushed);
            let motion = |node: u32| {
                let k = 3 * node as usize;
                [0, 1, 2].map(|axis: usize| end[k + axis] - self.from[k + axis])
            };
            if end == self.from {
                return pushed;
            }
            let mut moves = false;
            for Meeting { nodes, .. } in (self.meetings)(self.from, &end) {
                let Some(by) = nodes.into_iter().map(motion).find(|motion| *motion != [0.0; 3]) else {
                    continue;
                };
                for node in nodes.into_iter().filter(|&node| motion(node) == [0.0; 3]) {
                    moves |= self.push(node, by, &mut pushed);
                }
            }
            if !moves {
                return pushed;
            }
        }
        pushed
    }

    /// Moves a node, or the nodes to which it is tied, by a translation. Returns whether one of them is free to move.
    fn push(&self, node: u32, by: [f64; 3], pushed: &mut [f64]) -> bool {
        let own = [(node, 1.0)];
        let nodes = self.coordinates.combination(node).unwrap_or(&own);
        let mut moves = false;
        for &(node, _) in nodes.iter().filter(|(node, _)| !self.coordinates.is_director(*node)) {
            for (axis, by) in (0..3).zip(in_own_axes(self.coordinates, node, by)) {
                if let Ok(k) = self.coordinates.free().binary_search(&(3 * node + axis)) {
                    pushed[k] = by;
                    moves |= by != 0.0;
                }
            }
        }
        moves
    }
}
