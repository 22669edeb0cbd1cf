//! Paths on which no pair of live terms meets. Motions are shortened node by node, so that one pair does not stop all
//! nodes. Nodes in the way of an obstacle with a prescribed motion are taken along by it.

use vi_core::{Coordinates, Meeting};

use crate::assemble::pairs::in_own_axes;

/// Number of rounds in which the motions of nodes are shortened until no pair meets. If only the nodes of pairs that meet were
/// shortened, the pairs next to them would meet in turn, and pairs that open in the whole correction would close. So the nodes
/// around a meeting are shortened too: most at its own nodes, and not at all from a distance on. This distance is the
/// distance between neighbouring nodes times [`NEAR`] in the first round, and [`WIDER`] times as far in each later one; in the last round it is infinite.
const ROUNDS: usize = 16;
const NEAR: f64 = 2.0;
const WIDER: f64 = 2.0;
/// Fraction of its gap that a pair keeps on the path of a correction.
pub(crate) const KEPT: f64 = 0.25;
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
        let whole = delta.to_vec();
        let mut surroundings = None;
        // All meetings so far, with the parts of the whole change.
        let mut all: Vec<Meeting> = Vec::new();
        let mut parts = vec![1.0_f64; self.from.len() / 3];
        for round in 0..ROUNDS {
            let met = self.meetings(delta);
            if met.is_empty() {
                return round == 0;
            }
            if round + 1 < ROUNDS {
                let least =
                    |nodes: [u32; 4]| nodes.iter().map(|&node| parts[node as usize]).fold(1.0, f64::min);
                all.extend(met.iter().map(|met| Meeting { part: met.part * least(met.nodes), ..*met }));
                let wider = NEAR * WIDER.powi(round as i32);
                let surroundings =
                    surroundings.get_or_insert_with(|| Surroundings::new(self.from, self.coordinates));
                all.iter().for_each(|meeting| surroundings.shorten(meeting, wider, &mut parts));
            } else {
                let least = met.iter().map(|met| met.part).fold(1.0, f64::min);
                parts.iter_mut().for_each(|part| *part *= least);
            }
            for (node, terms) in self.coordinates.combinations() {
                let part = parts[node as usize];
                if part < 1.0 {
                    terms.iter().for_each(|&(k, _)| parts[k as usize] = parts[k as usize].min(part));
                }
            }
            let dofs = self.coordinates.free().iter();
            for (((delta, whole), least), &dof) in delta.iter_mut().zip(&whole).zip(least).zip(dofs) {
                let part = parts[dof as usize / 3];
                if part < 1.0 && whole != least {
                    *delta = least + part * (*whole - least);
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

/// Finds the nodes around a pair.
struct Surroundings<'a> {
    x: &'a [f64],
    /// All nodes that are in space in the order of their first coordinate.
    order: Vec<u32>,
}

impl<'a> Surroundings<'a> {
    fn new(x: &'a [f64], coordinates: &Coordinates) -> Self {
        let nodes = 0..x.len() as u32 / 3;
        let mut order: Vec<u32> = nodes.filter(|&node| !coordinates.is_director(node)).collect();
        order.sort_unstable_by(|&a, &b| x[3 * a as usize].total_cmp(&x[3 * b as usize]));
        Self { x, order }
    }

    /// Limits the fraction of its motion that each node makes: to that of the meeting at its own nodes, growing
    /// linearly to one at the distance of `wider` times the distance between neighbouring nodes.
    fn shorten(&self, meeting: &Meeting, wider: f64, parts: &mut [f64]) {
        let place = |node: u32| &self.x[3 * node as usize..3 * node as usize + 3];
        let apart = |a: &[f64], b: &[f64]| (0..3).map(|k| (a[k] - b[k]).powi(2)).sum::<f64>().sqrt();
        let corners = meeting.nodes.map(place);
        let reach = wider * meeting.size;
        for &node in &meeting.nodes {
            parts[node as usize] = parts[node as usize].min(meeting.part);
        }
        let from = corners.iter().map(|corner| corner[0]).fold(f64::INFINITY, f64::min) - reach;
        let to = corners.iter().map(|corner| corner[0]).fold(f64::NEG_INFINITY, f64::max) + reach;
        let first = self.order.partition_point(|&node| place(node)[0] < from);
        for &node in self.order[first..].iter().take_while(|&&node| place(node)[0] <= to) {
            let part = &mut parts[node as usize];
            if meeting.part < *part {
                let x = place(node);
                let distance = corners.iter().map(|corner| apart(corner, x)).fold(f64::INFINITY, f64::min);
                *part = part.min(meeting.part + (1.0 - meeting.part) * (distance / reach).min(1.0));
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const NODES: usize = 60;

    /// Shortens the motions of nodes in a row, one length unit apart, that must not pass each other. A pair must keep a quarter
    /// of its gap, and is stopped where half of it is left. Returns the parts of the motions.
    fn shorten(motions: &[f64]) -> Vec<f64> {
        let coordinates = Coordinates::all_free(3 * NODES);
        let from: Vec<f64> = (0..3 * NODES).map(|k| if k % 3 == 0 { k as f64 / 3.0 } else { 0.0 }).collect();
        let place = |delta: &[f64]| from.iter().zip(delta).map(|(x, delta)| x + delta).collect();
        let meetings = |from: &[f64], to: &[f64]| -> Vec<Meeting> {
            let closing = |k: usize| (to[3 * k] - from[3 * k]) - (to[3 * k + 3] - from[3 * k + 3]);
            let pairs = (0..NODES - 1).filter(|&k| closing(k) > 0.75);
            let meeting = |k: usize| {
                let [a, b] = [k as u32, k as u32 + 1];
                Meeting { nodes: [a, b, b, b], part: 0.5 / closing(k), size: 1.0 }
            };
            pairs.map(meeting).collect()
        };
        let mut delta = vec![0.0; 3 * NODES];
        motions.iter().enumerate().for_each(|(k, motion)| delta[3 * k] = *motion);
        let mut path = FreePath { coordinates: &coordinates, from: &from, place, meetings };
        let is_whole = path.shorten(&mut delta, |_| ());
        assert!(path.meetings(&delta).is_empty());
        assert_eq!(is_whole, (0..NODES).all(|k| delta[3 * k] == motions[k]));
        (0..NODES).map(|k| delta[3 * k] / motions[k]).collect()
    }

    #[test]
    fn the_path_is_free_however_nodes_move() {
        for seed in 0..50 {
            let motion =
                |k: usize| 5.0 * (1.0 + seed as f64 * 0.1) * ((7 * seed + 1) as f64 * (k as f64 + 0.5)).sin();
            let motions: Vec<f64> = (0..NODES).map(motion).collect();
            assert!(shorten(&motions).iter().all(|part| (0.0..=1.0).contains(part)));
        }
    }

    /// All nodes move by ten gaps to the right, but the last one makes a tenth of that. Nodes next to each other then move
    /// nearly alike, and nodes far away make the whole motion.
    #[test]
    fn an_obstacle_stops_the_nodes_around_it_gradually() {
        let motions: Vec<f64> = (0..NODES).map(|k| if k == NODES - 1 { 1.0 } else { 10.0 }).collect();
        let parts = shorten(&motions);
        assert_eq!(parts[0], 1.0);
        let changes = parts[..NODES - 1].windows(2).map(|pair| pair[0] - pair[1]);
        assert!(changes.into_iter().all(|change| change.abs() < 0.1), "{parts:?}");
    }
}
