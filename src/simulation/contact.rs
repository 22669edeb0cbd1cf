//! Observations of contact: active pairs, the smallest gap, and forces between bodies.

use std::ops::Range;
use std::sync::Arc;

use nalgebra::Vector3;
use serde_json::{Value, json};
use vi_contact::{ActivePair, ContactPotential, ContactTerm, Gap};
use vi_core::{Impulse, Potential};

use crate::model::ContactModel;
use crate::record::record;

/// Observations of contact at one time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ContactFacts {
    /// Number of pairs with a contact force.
    pub pairs: u64,
    /// The smallest gap of these pairs, m; infinite without such pairs.
    pub smallest_gap: f64,
    /// Work of friction between bodies since the start, J (≤ 0).
    pub friction: f64,
    /// Work of the damping of contact since the start, J (≤ 0).
    pub damping: f64,
}

impl Default for ContactFacts {
    fn default() -> Self {
        Self { pairs: 0, smallest_gap: f64::INFINITY, friction: 0.0, damping: 0.0 }
    }
}

impl ContactFacts {
    /// Adds the pairs of a component at positions x.
    pub(crate) fn add(&mut self, watch: &mut ContactWatch, x: &[f64]) {
        let (pairs, gap) = watch.pairs_and_gap(x);
        self.pairs += pairs;
        self.smallest_gap = self.smallest_gap.min(gap);
    }
}

/// Totals of contact since the start, updated at each step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct ContactTotals {
    /// The smallest gap after any step, m.
    pub(crate) smallest_gap: f64,
    /// Work of friction and of contact damping, J.
    pub(crate) friction: f64,
    pub(crate) damping: f64,
    /// Largest number of crossings in any row, if the scene asserts their number or the smallest gap.
    pub(crate) intersections: u64,
    /// The time (s) of the first row with crossings, and the numbers of two bodies that cross there.
    pub(crate) first_crossing: Option<(f64, (u64, u64))>,
}

record!(ContactTotals {
    smallest_gap: f64,
    friction: f64,
    damping: f64,
    intersections: u64,
    first_crossing: Option<(f64, (u64, u64))>,
});

impl Default for ContactTotals {
    fn default() -> Self {
        let (smallest_gap, intersections) = (f64::INFINITY, 0);
        Self { smallest_gap, friction: 0.0, damping: 0.0, intersections, first_crossing: None }
    }
}

/// Contact at a node.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct ContactAt {
    /// Force per area without friction, Pa.
    pub(super) traction: [f64; 3],
    /// Size of the traction on the side where it is larger, Pa: a sheet, or the edge of a body, may be pressed from both sides.
    pub(super) pressure: f64,
    /// Smallest gap of the pairs that press, m.
    pub(super) gap: f64,
    /// Tangential velocity relative to the nearest opposite surface, m/s.
    pub(super) slip: [f64; 3],
}

impl ContactAt {
    /// Returns the contact of a node on which nothing presses.
    pub(super) fn away(gap: f64) -> Self {
        Self { gap, ..Self::default() }
    }
}

/// The contact forces on the two sides of a node. The pair with the largest force shows which side is which. Pairs that
/// subtract doubly counted shared edges pull. Therefore the direction in which a pair pushes is that of its vector, and
/// not that of its force.
#[derive(Debug, Clone, Copy, Default)]
struct Sides {
    /// The largest force of a pair, N, and the vector along which that pair pushes, m.
    largest: f64,
    outward: Vector3<f64>,
    /// Sums of the forces of the pairs that push along `outward` and against it, N.
    sums: [Vector3<f64>; 2],
}

impl Sides {
    /// Takes the direction of a pair, if its force is the largest so far.
    fn direct(&mut self, force: Vector3<f64>, push: Vector3<f64>) {
        if force.norm() > self.largest {
            (self.largest, self.outward) = (force.norm(), push);
        }
    }

    /// Adds the force of a pair to its side, once the largest is known.
    fn add(&mut self, force: Vector3<f64>, push: Vector3<f64>) {
        self.sums[usize::from(push.dot(&self.outward) < 0.0)] += force;
    }

    /// Returns the larger sum, N.
    fn larger(&self) -> Vector3<f64> {
        let [first, second] = self.sums;
        if first.norm() >= second.norm() { first } else { second }
    }
}

/// A force on a round rigid body.
pub(super) struct Press {
    /// Point of action, m.
    pub(super) place: [f64; 3],
    /// Force, N.
    pub(super) force: [f64; 3],
    /// Gap, m.
    pub(super) gap: f64,
    /// Tangential velocity relative to the opposite surface, m/s.
    pub(super) slip: [f64; 3],
}

/// Observes the contact of a component.
pub(crate) struct ContactWatch {
    term: Arc<ContactTerm>,
    /// For each body of the term, its number among all bodies of the scene.
    bodies: Vec<usize>,
    /// Mean forces over the last step, N.
    forces: Vec<Impulse>,
    /// Distance about nodes in which partners are searched for messages, m.
    farthest_gap: f64,
    /// Numbers of two bodies in the scene, and how many pairs of their parts do not meet because springs sew them together.
    sewn: Vec<([usize; 2], usize)>,
    /// The candidates of the last search.
    near: Option<ContactPotential>,
}

impl ContactWatch {
    pub(crate) fn new(model: ContactModel) -> Self {
        let ContactModel { term, bodies, farthest_gap, sewn } = model;
        Self { term, bodies, forces: Vec::new(), farthest_gap, sewn, near: None }
    }

    /// Returns the number of active pairs at positions x of the component, and their smallest gap, m.
    fn pairs_and_gap(&mut self, x: &[f64]) -> (u64, f64) {
        let active = self.near(x).contact().active(x);
        let smallest_gap = active.iter().map(|pair| pair.gap).fold(f64::INFINITY, f64::min);
        (active.len() as u64, smallest_gap)
    }

    /// Returns the pair that is deepest in its layer at positions x of the component, and the energy of contact there (J), if its gap is
    /// less than this fraction of its layer and surfaces do not touch.
    pub(super) fn pressed(&mut self, x: &[f64], fraction: f64) -> Option<(Gap, f64)> {
        let contact = self.near(x).contact();
        let tightest = tightest(contact.gaps(x)).filter(|gap| gap.gap < fraction * gap.distance)?;
        Some((tightest, contact.energy(x))).filter(|(_, energy)| energy.is_finite())
    }

    /// Returns the contact near positions x of the component, with the candidates of the last search if they serve.
    fn near(&mut self, x: &[f64]) -> &ContactPotential {
        let near = self.near.take().filter(|near| near.neighbours().covers(x));
        self.near.insert(near.unwrap_or_else(|| self.term.at(x)))
    }

    /// Stores the impulses of a step of h (s).
    pub(crate) fn enter(&mut self, impulses: Vec<Impulse>, h: f64) {
        self.forces = impulses;
        self.forces.iter_mut().for_each(|force| force.value.iter_mut().for_each(|value| *value /= h));
    }

    /// Stores the forces at positions x of the component, for equilibria and for schemes that do not know the impulses of their
    /// steps.
    pub(crate) fn enter_forces_at(&mut self, x: &[f64]) {
        self.forces = self.near(x).forces_between(x);
    }

    /// Returns the number of triangles that are searched.
    pub(crate) fn triangle_count(&self) -> usize {
        self.term.surface().cells().len()
    }

    /// Returns the size of the search for report.json.
    pub(crate) fn report(&self) -> Value {
        let surface = self.term.surface();
        let candidates = self.near.as_ref().map_or(0, |near| near.neighbours().count());
        json!({
            "bodies": self.bodies.len(), "points": surface.points().len(), "cells": surface.cells().len(),
            "edges": surface.edges().len(), "half_spaces": surface.half_spaces().len(),
            "candidates_at_end": candidates,
        })
    }

    /// Returns the mean force of the second body on the first over the last step, N; bodies have their numbers in the
    /// scene.
    pub(crate) fn force(&self, first: usize, second: usize) -> [f64; 3] {
        let mut sum = [0.0; 3];
        for Impulse { between, value } in &self.forces {
            let between = between.map(|body| self.bodies[body as usize]);
            let sign = match between {
                _ if between == [first, second] => 1.0,
                _ if between == [second, first] => -1.0,
                _ => continue,
            };
            (0..3).for_each(|k| sum[k] += sign * value[k]);
        }
        sum
    }

    /// Returns pairs of bodies of which springs sew parts together, by their numbers in the scene, with the number of pairs of parts that
    /// do not meet therefore.
    pub(super) fn sewn(&self) -> &[([usize; 2], usize)] {
        &self.sewn
    }

    /// Returns the number in the scene of a body of the term.
    pub(super) fn number_of(&self, body: u32) -> usize {
        self.bodies[body as usize]
    }

    /// Returns the nodes of the pair that meets first if all nodes move straight from x to `end`; `None` if none meets.
    pub(super) fn first_to_meet(&self, x: &[f64], end: &[f64]) -> Option<[u32; 4]> {
        let dofs = self.term.surface().nodes().flat_map(|node| 3 * node as usize..3 * node as usize + 3);
        let farthest = dofs.map(|dof| (end[dof] - x[dof]).abs()).fold(0.0, f64::max);
        let near = self.term.about(x, 2.0 * farthest.max(self.farthest_gap));
        near.contact().first_impact(x, end).map(|impact| impact.nodes)
    }

    /// Returns the candidate with these nodes at positions x, or the one whose gap is the smallest fraction of its layer;
    /// `None` if there are no candidates.
    pub(super) fn tightest(&self, x: &[f64], nodes: Option<[u32; 4]>) -> Option<Gap> {
        if let Some(nodes) = nodes {
            let place = |node: u32| [0, 1, 2].map(|axis| x[3 * node as usize + axis]);
            let apart = |node: u32| {
                let (a, b) = (place(nodes[0]), place(node));
                (0..3).map(|k| (a[k] - b[k]).powi(2)).sum::<f64>().sqrt()
            };
            let reach = nodes.into_iter().map(apart).fold(self.farthest_gap, f64::max);
            let near = self.term.about(x, reach);
            let found = near.contact().gaps(x).find(|gap| gap.has_nodes(&nodes));
            if found.is_some() {
                return found;
            }
        }
        tightest(self.term.at(x).contact().gaps(x))
    }

    /// Returns whether rims of two bodies of the term lie on each other at positions x.
    pub(super) fn rims_coincide(&self, bodies: [u32; 2], x: &[f64]) -> bool {
        self.term.at(x).contact().rims_coincide(bodies, x)
    }

    /// Returns the constants of contact between two bodies with these numbers in the scene; `None` if they do not meet
    /// in this component.
    pub(crate) fn law(&self, first: usize, second: usize) -> Option<vi_contact::Law> {
        let number = |body| Some(self.bodies.iter().position(|&other| other == body)? as u32);
        self.term.surface().law(number(first)?, number(second)?)
    }

    /// Returns the widest layer d̂ of the pairs of a body with this number in the scene, or of all pairs of bodies, m; `None` if there
    /// are none.
    pub(super) fn widest_layer(&self, number: Option<usize>) -> Option<f64> {
        let all = 0..self.bodies.len();
        let first = all.clone().filter(|&body| number.is_none_or(|number| self.bodies[body] == number));
        let pairs = first.flat_map(|a| all.clone().map(move |b| [a as u32, b as u32]));
        let laws = pairs.filter_map(|[a, b]| self.term.surface().law(a, b));
        laws.map(|law| law.distance).reduce(f64::max)
    }

    /// Returns the contact forces on a round rigid body with the skeleton `nodes` at positions x and velocities v of the
    /// component.
    pub(super) fn presses(&self, x: &[f64], v: &[f64], nodes: &Range<usize>) -> Vec<Press> {
        let (near, surface) = (self.term.at(x), self.term.surface());
        let is_own = |node: &u32| nodes.contains(&(*node as usize));
        let mut presses = Vec::new();
        for pair in near.contact().active(x) {
            let used = &pair.nodes[..pair.shape.arity()];
            let Some(body) = used.iter().find(|node| is_own(node)).and_then(|&node| surface.body_of(node))
            else {
                continue;
            };
            let radius = surface.radius(body);
            let (mut force, mut place, mut sign) = ([0.0; 3], [0.0; 3], 0.0);
            for (k, &node) in used.iter().enumerate().filter(|(_, node)| is_own(node)) {
                let (gradient, weight) = (pair.gradient(x)[k], pair.closest.weights[k]);
                sign += weight;
                for axis in 0..3 {
                    force[axis] -= gradient[axis];
                    place[axis] += weight * x[3 * node as usize + axis];
                }
            }
            // The vector of the pair points from its second side to its first; the weights of the first side sum to
            // one.
            let arm = pair.closest.vector * (-radius / pair.closest.distance());
            (0..3).for_each(|axis| place[axis] = sign * (place[axis] + arm[axis]));
            let slip = near.sliding(&pair, x, v).map(|value| sign * value);
            presses.push(Press { place, force, gap: pair.gap, slip });
        }
        presses
    }

    /// Returns the contact at every node of the component at positions x (m) and velocities v (m/s); gaps of nodes on which nothing
    /// presses are infinite.
    pub(super) fn fields(&self, x: &[f64], v: &[f64]) -> Vec<ContactAt> {
        let (near, surface) = (self.term.at(x), self.term.surface());
        let mut all = vec![ContactAt::away(f64::INFINITY); x.len() / 3];
        let active = near.contact().active(x);
        if active.is_empty() {
            return all;
        }
        let mut sides = vec![Sides::default(); x.len() / 3];
        let push = |pair: &ActivePair, k: usize| pair.closest.vector * pair.closest.weights[k];
        for pair in &active {
            let gradient = pair.gradient(x);
            for (k, &node) in pair.nodes.iter().enumerate().take(pair.shape.arity()) {
                sides[node as usize].direct(gradient[k], push(pair, k));
            }
        }
        for pair in active {
            let (gradient, sliding) = (pair.gradient(x), near.sliding(&pair, x, v));
            for (k, &node) in pair.nodes.iter().enumerate().take(pair.shape.arity()) {
                let (at, weight) = (&mut all[node as usize], pair.closest.weights[k]);
                (0..3).for_each(|axis| at.traction[axis] -= gradient[k][axis]);
                sides[node as usize].add(gradient[k], push(&pair, k));
                if weight != 0.0 && pair.gap < at.gap {
                    at.gap = pair.gap;
                    at.slip = sliding.map(|value| value * weight.signum());
                }
            }
        }
        let net = surface.pressed_areas(x, |node| Vector3::from(all[node as usize].traction));
        let of_side = surface.pressed_areas(x, |node| sides[node as usize].larger());
        for (node, at) in all.iter_mut().enumerate() {
            at.traction.iter_mut().for_each(|value| *value /= net[node]);
            at.pressure = sides[node].larger().norm() / of_side[node];
        }
        all
    }
}

/// Returns the gap that is the smallest fraction of its layer.
fn tightest(gaps: impl Iterator<Item = Gap>) -> Option<Gap> {
    gaps.min_by(|a, b| (a.gap / a.distance).total_cmp(&(b.gap / b.distance)))
}
