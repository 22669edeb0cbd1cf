//! Separates bodies whose surfaces touch or cross at the start, if `contact.resolve` is set. Whole bodies are
//! translated by the shortest way found; their orientation, shape and velocity do not change.

use std::collections::BTreeMap;

use nalgebra::Vector3;
use vi_contact::ContactTerm;
use vi_core::{State, System};
use vi_solvers::Assembler;

use super::meeting::{Meeting, name_of};
use super::outline::{Outline, outline};
use super::{BodyModel, RigidModel};
use crate::scene::Scene;

/// Bodies whose gap at the start is below this fraction of d̂ count as touching. Their layer would be as thin as the gap: a
/// block of 0.1 m at rest takes one step per step of 1 ms with a gap of 1e-2 d̂, ten with 4e-4 d̂, a hundred with 4e-5 d̂,
/// and fails with 4e-6 d̂.
pub(super) const THINNEST: f64 = 1e-4;

/// A body, or bodies that are joined, which were translated before the start.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Parted {
    /// Numbers of the bodies in the scene; rigid ones follow the others.
    pub(crate) bodies: Vec<usize>,
    /// Translation, m.
    pub(crate) by: [f64; 3],
    /// Change of the potential energy of their component, J.
    pub(crate) energy: f64,
}

/// Largest number of moves per body of a component.
const MOVES: usize = 16;
/// Number of bisections for the length of a translation.
const BISECTIONS: usize = 20;

/// A component whose bodies are to be separated.
pub(super) struct Start<'a> {
    pub(super) scene: &'a Scene,
    pub(super) meeting: &'a Meeting,
    pub(super) system: &'a System,
    pub(super) bodies: &'a [BodyModel],
    pub(super) rigids: &'a [RigidModel],
    pub(super) term: &'a ContactTerm,
    /// For each body of the term, its number in the scene, and the outward normal if it is a half-space.
    pub(super) parts: Vec<(usize, Option<[f64; 3]>)>,
}

impl Start<'_> {
    /// Returns the outline of a part at positions x.
    fn outline(&self, part: usize, x: &[f64]) -> Outline {
        outline(self.parts[part].0, self.bodies, self.rigids, x)
    }

    fn may_meet(&self, a: usize, b: usize) -> bool {
        self.meeting.may_meet(self.scene, self.parts[a].0, self.parts[b].0)
    }

    fn is_joined(&self, a: usize, b: usize) -> bool {
        self.meeting.is_joined(self.parts[a].0, self.parts[b].0)
    }

    /// Returns this part and all parts joined to it.
    fn group(&self, part: usize) -> Vec<usize> {
        let mut group = vec![part];
        let mut next = 0;
        while next < group.len() {
            let member = group[next];
            next += 1;
            let more = (0..self.parts.len()).filter(|&other| self.is_joined(member, other));
            let more: Vec<usize> = more.filter(|other| !group.contains(other)).collect();
            group.extend(more);
        }
        group.sort_unstable();
        group
    }

    /// Returns the nodes of a group that are points in space, not directors, in increasing order.
    fn nodes(&self, group: &[usize]) -> Vec<usize> {
        let of = |&part: &usize| -> Vec<usize> {
            let number = self.parts[part].0;
            match number.checked_sub(self.bodies.len()) {
                Some(rigid) => {
                    let directors = self.rigids[rigid].frame().map(|node| node as usize);
                    let nodes = self.rigids[rigid].nodes().map(|node| node as usize);
                    nodes.filter(|node| !directors[1..].contains(node)).collect()
                }
                None => {
                    let body = &self.bodies[number];
                    (0..body.mesh.points.len()).map(|node| body.node(node)).collect()
                }
            }
        };
        let mut nodes: Vec<usize> = group.iter().flat_map(of).collect();
        nodes.sort_unstable();
        nodes
    }

    /// Returns whether the group is free of prescribed coordinates.
    fn is_movable(&self, group: &[usize]) -> bool {
        let nodes = self.nodes(group);
        let is_own = |dof: &u32| nodes.binary_search(&(*dof as usize / 3)).is_ok();
        let prescribed = self.system.coordinates().prescribed().iter();
        let is_held = prescribed.flat_map(|group| &group.dofs).any(is_own);
        let names: Vec<&str> = group.iter().map(|&part| name_of(self.scene, self.parts[part].0)).collect();
        let to_world =
            self.scene.joints.iter().any(|joint| joint.to().is_none() && names.contains(&joint.body()));
        let to_space = self
            .scene
            .attachments
            .iter()
            .any(|attach| attach.to.is_none() && names.contains(&attach.body.as_str()));
        !is_held && !to_world && !to_space && group.iter().all(|&part| self.parts[part].1.is_none())
    }

    /// Returns the pairs of parts that touch or cross.
    fn offending(&self, x: &[f64], gaps: &BTreeMap<[u32; 2], f64>) -> Vec<[usize; 2]> {
        let outlines: Vec<Outline> = (0..self.parts.len()).map(|part| self.outline(part, x)).collect();
        let mut found = Vec::new();
        for a in 0..self.parts.len() {
            for b in (a + 1..self.parts.len()).filter(|&b| self.may_meet(a, b)) {
                let thinnest = THINNEST * self.layer([a, b]);
                let touches = gaps.get(&[a as u32, b as u32]).is_some_and(|&gap| gap <= thinnest);
                if touches || (!self.is_joined(a, b) && outlines[a].meets(&outlines[b])) {
                    found.push([a, b]);
                }
            }
        }
        found
    }

    /// Returns d̂ of a pair of parts, m.
    fn layer(&self, [a, b]: [usize; 2]) -> f64 {
        self.term.surface().law(a as u32, b as u32).map_or(0.0, |law| law.distance)
    }

    /// Returns whether this pair is separated by at least its layer at positions x.
    fn is_apart(&self, [a, b]: [usize; 2], x: &[f64]) -> bool {
        let layer = self.layer([a, b]);
        let gaps = self.term.at(x).smallest_gaps(x);
        gaps.get(&[a as u32, b as u32]).is_none_or(|&gap| gap >= layer)
            && !self.outline(a, x).meets(&self.outline(b, x))
    }

    /// Returns the shortest translation of `nodes` found that separates a pair, m.
    fn way(&self, pair: [usize; 2], nodes: &[usize], mover: usize, x: &[f64]) -> Option<Vector3<f64>> {
        let [a, b] = pair;
        let other = if mover == a { b } else { a };
        let directions = match self.parts[other].1 {
            Some(normal) => vec![Vector3::from(normal)],
            None => {
                let middle = |part: usize| {
                    let outline = self.outline(part, x);
                    let count = outline.points.len().max(1) as f64;
                    outline.points.into_iter().map(Vector3::from).sum::<Vector3<f64>>() / count
                };
                let mut directions: Vec<Vector3<f64>> =
                    (0..3).flat_map(|axis| [1.0, -1.0].map(|sign| Vector3::ith(axis, sign))).collect();
                directions.extend((middle(mover) - middle(other)).try_normalize(0.0));
                directions
            }
        };
        let extent = (0..3)
            .map(|k| {
                let values = || x.iter().skip(k).step_by(3).copied();
                values().fold(f64::NEG_INFINITY, f64::max) - values().fold(f64::INFINITY, f64::min)
            })
            .sum::<f64>();
        let layer = self.term.surface().law(a as u32, b as u32)?.distance;
        let moved = |by: Vector3<f64>| {
            let mut x = x.to_vec();
            nodes.iter().for_each(|node| (0..3).for_each(|k| x[3 * node + k] += by[k]));
            x
        };
        let mut best: Option<Vector3<f64>> = None;
        for direction in directions {
            let mut high = layer;
            while high <= 2.0 * extent && !self.is_apart(pair, &moved(direction * high)) {
                high *= 2.0;
            }
            if high > 2.0 * extent || best.is_some_and(|best| 0.5 * high > best.norm()) {
                continue;
            }
            let mut low = if high > layer { 0.5 * high } else { 0.0 };
            for _ in 0..BISECTIONS {
                let middle = 0.5 * (low + high);
                let is_apart = self.is_apart(pair, &moved(direction * middle));
                *(if is_apart { &mut high } else { &mut low }) = middle;
            }
            if best.is_none_or(|best| high < best.norm()) {
                best = Some(direction * high);
            }
        }
        best
    }

    /// Moves bodies until none touch or cross, and returns the moves. Joined bodies move together.
    ///
    /// # Errors
    /// Returns an error that names the bodies if a pair cannot be separated, or comes together again each time that another one is separated.
    pub(super) fn part(&self, state: &mut State) -> Result<Vec<Parted>, String> {
        let mut parted: Vec<Parted> = Vec::new();
        let energy = |x: &[f64]| {
            let energies = Assembler::new(self.system).energies(x, 0.0);
            energies.elastic + energies.gravity + energies.load
        };
        // The number of moves, and the pair that the last one separated.
        let (mut moves, mut separated) = (0, [0; 2]);
        loop {
            let x = self.system.positions(state);
            let gaps = self.term.at(&x).smallest_gaps(&x);
            let name = |part: usize| name_of(self.scene, self.parts[part].0);
            if let Some(([a, _], _)) = gaps.iter().find(|([a, b], gap)| a == b && **gap <= 0.0) {
                return Err(format!(
                    "'{}' touches itself: `contact.resolve` moves whole bodies",
                    name(*a as usize)
                ));
            }
            let Some(&[a, b]) = self.offending(&x, &gaps).first() else { return Ok(parted) };
            if moves == MOVES * self.parts.len() {
                let [[a, b], [c, d]] = [[a, b], separated].map(|pair| pair.map(name));
                return Err(format!("separating '{c}' and '{d}' brings '{a}' and '{b}' together again"));
            }
            (moves, separated) = (moves + 1, [a, b]);
            let (first, second) = (self.group(a), self.group(b));
            let is_one = first == second;
            let mover =
                [(b, second), (a, first)].into_iter().find(|(_, group)| !is_one && self.is_movable(group));
            let Some((mover, group)) = mover else {
                return Err(format!(
                    "neither '{}' nor '{}' can be moved: both are held, or joined",
                    name(a),
                    name(b)
                ));
            };
            let nodes = self.nodes(&group);
            let Some(way) = self.way([a, b], &nodes, mover, &x) else {
                return Err(format!("no translation separates '{}' and '{}'", name(a), name(b)));
            };
            let before = energy(&x);
            for (q, &dof) in state.q.iter_mut().zip(self.system.coordinates().free()) {
                if nodes.binary_search(&(dof as usize / 3)).is_ok() {
                    *q += way[dof as usize % 3];
                }
            }
            let change = energy(&self.system.positions(state)) - before;
            let bodies: Vec<usize> = group.iter().map(|&part| self.parts[part].0).collect();
            match parted.iter_mut().find(|known| known.bodies == bodies) {
                Some(known) => {
                    (0..3).for_each(|k| known.by[k] += way[k]);
                    known.energy += change;
                }
                None => parted.push(Parted { bodies, by: way.into(), energy: change }),
            }
        }
    }
}
