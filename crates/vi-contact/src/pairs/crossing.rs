//! Contact over a step in which a point passes from one cell of a body to another.
//!
//! Each simplex σ of a body contributes n_σ times a chord from its closest point at the start to that at the end (`chord.rs`). If the
//! point passes over the edge e between the cells A and B, these are A → e, e → B, and, subtracted, e → e. Their works sum to the change of
//! the energy, but on a flat surface their forces do not sum to its normal force: a block that slides over the diagonal of a floor
//! would be pushed aside, and up by half its weight.
//!
//! Chords may be exchanged as long as the numbers of each feature keep their sum at both ends. The numbers of e sum to zero at the start,
//! while that of S, the closest point on A, is one. So the chords of e may begin at S instead: S → e, S → B and, subtracted, S → e, of
//! which S → B remains. It needs all nodes of A and B. With the weights c₀ of S and c₁ of the end j, the discrete gradient of the
//! distance is the sum of two parts that each act on the point and one cell,
//! ```text
//! N_a = c₀,a (½ Z + (½ − λ) R)/(d₀ + d₁) + c₁,a (½ Z + (½ + λ) R)/(d₀ + d₁),   R = ρ^c̄(x_m),   Z = R + λ ρ^δ(x_m).
//! ```
//! The sums at the start do not depend on the end, so forces are continuous functions of it. Sums at the end would jump where a cell
//! comes within reach. In valleys the rule is therefore not symmetric in time. Two cases fade out. λ is bounded only
//! where the surface is convex between S and j: 1 + (p₀ − p₁)/(½(a₀ + a₁)) is then at least one. In valleys it may be less, and forces
//! change to those of the simplices as it falls from ¾ to ½. If e is out of reach at the start, B joins as soon as it is within reach at
//! the end, and its chords fade in until the layer is compressed by half as much as at the start.

use super::chord::{DistanceChange, lambda};
use super::term::{Feature, NONE, PointTerm};
use crate::distance::{Closest, Vec3, at, combine};
use crate::surface::Gauge;

/// Bounds of the measure of convexity between which chords of simplices fade out.
const VALLEY: [f64; 2] = [0.5, 0.75];
/// Compression of the layer at the end, relative to that at the start, within which the chords of cells that join during a step fade in.
/// Bodies that weigh little compress the layer by a hundredth.
const FAINT: f64 = 0.5;

/// The chords of a point that passes from one cell to another.
#[derive(Debug, Default)]
pub(crate) struct Crossing {
    /// Features at the start with the sum of their numbers, and one of their terms.
    starts: Vec<(Feature, i32, usize)>,
    /// For each term, the number with which its own chord counts, if it is not its multiplicity.
    numbers: Vec<f64>,
    /// Chords that no simplex has.
    chords: Vec<Chord>,
}

/// A chord from the closest point of one term at the start to that of another one at the end.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Chord {
    /// Both terms, by their numbers.
    pub(crate) terms: [usize; 2],
    /// The number with which it counts.
    pub(crate) number: f64,
    /// The distances at both ends, m, and the discrete gradient by parts.
    pub(crate) distances: [f64; 2],
    pub(crate) parts: [DistanceChange; 2],
    /// The measure of convexity.
    convexity: f64,
}

/// Returns the part of a range that a value has passed, in [0, 1].
fn passed([low, high]: [f64; 2], value: f64) -> f64 {
    ((value - low) / (high - low)).clamp(0.0, 1.0)
}

fn contains(outer: &Feature, inner: &Feature) -> bool {
    inner.iter().all(|node| *node == NONE || outer.contains(node))
}

impl Crossing {
    /// Finds the chords of a point with these terms at positions x of both ends.
    pub(crate) fn find(&mut self, terms: &[PointTerm<2>], gauge: &Gauge, x: [&[f64]; 2]) {
        self.numbers.clear();
        self.chords.clear();
        let is_first = |term: &PointTerm<2>| term.features[0] == terms[0].features[0];
        if terms.iter().all(is_first) {
            return;
        }
        self.sum(terms);
        for row in 0..self.starts.len() {
            let (feature, number, of_feature) = self.starts[row];
            let is_around = |start: &&(Feature, i32, usize)| start.1 != 0 && contains(&start.0, &feature);
            let mut around = self.starts.iter().filter(is_around);
            let (0, Some(&(start, 1, from)), None) = (number, around.next(), around.next()) else { continue };
            let rest = |term: usize, end: usize| 1.0 - gauge.relative(terms[term].closest[end].distance());
            let joins = rest(of_feature, 0) <= 0.0;
            // The cells that contain an edge are known as soon as one of them joins, those that contain a node only within reach.
            let is_node = feature[1] == NONE;
            if rest(from, 0) > 0.0 && !(joins && is_node) {
                let fade =
                    |term| if joins { passed([0.0, FAINT * rest(from, 0)], rest(term, 1)) } else { 1.0 };
                self.exchange(terms, [feature, start], from, fade, x);
            }
        }
    }

    /// Lets the chords of a feature begin at the start of the term `from`. `fade` is a bound on their share by one of them.
    fn exchange(
        &mut self,
        terms: &[PointTerm<2>],
        [feature, start]: [Feature; 2],
        from: usize,
        fade: impl Fn(usize) -> f64,
        x: [&[f64]; 2],
    ) {
        let first = self.chords.len();
        let own = |end: Feature| terms.iter().position(|term| term.features == [start, end]);
        let row = || terms.iter().enumerate().filter(|(_, term)| term.features[0] == feature);
        let (mut convexity, mut faded) = (f64::INFINITY, 0.0_f64);
        for (to, term) in row() {
            faded = faded.max(fade(to));
            if own(term.features[1]).is_none() {
                let chord = Chord::new([from, to], f64::from(term.multiplicity), terms, x);
                convexity = convexity.min(chord.convexity);
                self.chords.push(chord);
            }
        }
        let share = faded * passed(VALLEY, convexity);
        if share == 0.0 {
            self.chords.truncate(first);
            return;
        }
        self.chords[first..].iter_mut().for_each(|chord| chord.number *= share);
        if self.numbers.is_empty() {
            self.numbers.extend(terms.iter().map(|term| f64::from(term.multiplicity)));
        }
        for (to, term) in row() {
            let number = share * f64::from(term.multiplicity);
            self.numbers[to] -= number;
            if let Some(own) = own(term.features[1]) {
                self.numbers[own] += number;
            }
        }
    }

    /// Returns the number with which the chord of a term counts.
    pub(crate) fn number(&self, term: usize, multiplicity: i32) -> f64 {
        self.numbers.get(term).copied().unwrap_or(f64::from(multiplicity))
    }

    /// Returns the chords that no simplex has.
    pub(crate) fn chords(&self) -> &[Chord] {
        &self.chords
    }

    /// Sums the numbers of the features at the start.
    fn sum(&mut self, terms: &[PointTerm<2>]) {
        let features = terms.iter().enumerate();
        self.starts.clear();
        self.starts.extend(features.map(|(k, term)| (term.features[0], term.multiplicity, k)));
        self.starts.sort_unstable_by_key(|&(feature, _, k)| (feature, k));
        self.starts.dedup_by(|next, kept| {
            let is_same = next.0 == kept.0;
            kept.1 += if is_same { next.1 } else { 0 };
            is_same
        });
    }
}

impl Chord {
    fn new(terms: [usize; 2], number: f64, all: &[PointTerm<2>], x: [&[f64]; 2]) -> Self {
        let [from, to] = terms.map(|term| &all[term]);
        let [start, end] = [from.closest[0], to.closest[1]];
        let places = |term: &PointTerm<2>, end: usize| term.nodes.map(|node| at(x[end], node));
        let [c0, c1] = [start.weights, end.weights];
        // ρ^c₀ and ρ^c₁ at both ends.
        let by_start = [start.vector, combine(&c0, &places(from, 1))];
        let by_end = [combine(&c1, &places(to, 0)), end.vector];
        let slips = [0, 1].map(|k: usize| by_end[k] - by_start[k]);
        let [a0, a1] = slips.map(|slip| slip.norm_squared());
        let (lambda, weight) = lambda([a0, a1], [start.vector.dot(&slips[0]), end.vector.dot(&slips[1])]);
        let mean = 0.5 * (a0 + a1);
        let convexity = if mean > 0.0 { weight / mean } else { 0.0 };
        let rho = (by_start[0] + by_start[1] + by_end[0] + by_end[1]) * 0.25;
        let rho_other = rho + (slips[0] + slips[1]) * (0.5 * lambda);
        let inverse = 1.0 / (start.distance() + end.distance());
        let vectors = [0.5 - lambda, 0.5 + lambda].map(|part| (rho_other * 0.5 + rho * part) * inverse);
        let change = vectors[0].dot(&(by_start[1] - by_start[0])) + vectors[1].dot(&(by_end[1] - by_end[0]));
        let normal = rho.try_normalize(0.0).unwrap_or_default();
        let part = |term: &PointTerm<2>, weights: [f64; 4], vector: Vec3| DistanceChange {
            gradient: weights.map(|weight| vector * weight),
            at_end: end_gradient(term, to, &end),
            change,
            weights,
            normal,
        };
        let parts = [part(from, c0, vectors[0]), part(to, c1, vectors[1])];
        Self { terms, number, distances: [start.distance(), end.distance()], parts, convexity }
    }
}

/// Returns ∂d₁/∂x₁ at the nodes of a term, where d₁ is the distance of the term `to`.
fn end_gradient(term: &PointTerm<2>, to: &PointTerm<2>, end: &Closest) -> [Vec3; 4] {
    let direction = end.vector / end.distance();
    // Nodes of smaller pairs repeat, with weights of zero.
    let weight = |node: u32| -> f64 {
        to.nodes.iter().zip(end.weights).filter(|(other, _)| **other == node).map(|(_, weight)| weight).sum()
    };
    let mut gradient = [Vec3::zeros(); 4];
    for a in 0..term.shape.arity() {
        gradient[a] = direction * weight(term.nodes[a]);
    }
    gradient
}
