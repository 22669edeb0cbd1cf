//! Lists of the candidates of live terms, in three sizes. The outer list results from a search, which is rare. The inner
//! list is chosen from it every few steps, and the list of a step is chosen from the inner list. Iterations use only
//! the list of the step.

use std::sync::Arc;

use vi_core::{Live, Potential};

use crate::memory::StepperMemory;

/// Numbers of steps for which an outer and an inner list should be valid, at the speed at which they are made.
const OUTER: f64 = 50.0;
const INNER: f64 = 2.0;
/// Motion of a node for which the list of a step is valid, as a multiple of its free drift.
const STEP: f64 = 1.5;
/// Smallest motion of a node for which a list is valid, as a fraction of the largest motion of all nodes: a node at rest
/// may be hit.
const LEAST: f64 = 0.25;
/// Largest reach of an outer list, as a multiple of the reach that its terms request. The number of candidates grows with
/// the square of the reach.
const MOST: f64 = 3.0;

/// Terms that are valid while no node is farther than its reach from `about`.
#[derive(Default)]
struct List {
    about: Vec<f64>,
    /// The reach of each node, m; the outer list has one for all nodes.
    reach: Vec<f64>,
    terms: Vec<Arc<dyn Potential>>,
}

impl List {
    /// Returns whether every node of x is within its reach.
    fn serves(&self, x: &[f64]) -> bool {
        let near = || self.about.chunks_exact(3).zip(x.chunks_exact(3)).zip(&self.reach);
        self.about.len() == x.len() && near().all(|((a, b), reach)| square(a, b) <= reach * reach)
    }
}

fn square(a: &[f64], b: &[f64]) -> f64 {
    (a[0] - b[0]).powi(2) + (a[1] - b[1]).powi(2) + (a[2] - b[2]).powi(2)
}

/// Returns the distance of each node between two configurations, m.
fn distances(a: &[f64], b: &[f64]) -> Vec<f64> {
    a.chunks_exact(3).zip(b.chunks_exact(3)).map(|(a, b)| square(a, b).sqrt()).collect()
}

fn largest(values: &[f64]) -> f64 {
    values.iter().copied().fold(0.0, f64::max)
}

fn narrowed(list: &List, about: Vec<f64>, reach: Vec<f64>) -> List {
    let narrowed = |term: &Arc<dyn Potential>| term.narrowed(&about, &reach);
    let terms = list.terms.iter().map(|term| narrowed(term).unwrap_or_else(|| Arc::clone(term)));
    let terms = terms.collect();
    List { about, reach, terms }
}

pub(super) struct Lists {
    live: Vec<Arc<dyn Live>>,
    outer: List,
    inner: List,
    /// The list of a step, chosen from the inner list.
    step: List,
    searches: u64,
}

impl Lists {
    pub(super) fn new(live: Vec<Arc<dyn Live>>) -> Self {
        Self { live, outer: List::default(), inner: List::default(), step: List::default(), searches: 0 }
    }

    /// Returns the terms that are valid for the current step.
    pub(super) fn terms(&self) -> &[Arc<dyn Potential>] {
        &self.step.terms
    }

    /// Returns whether no term has a candidate.
    pub(super) fn is_empty(&self) -> bool {
        self.count() == 0
    }

    /// Makes the lists valid at `start` and `end` of a step.
    pub(super) fn follow(&mut self, start: &[f64], end: &[f64]) {
        if !(self.inner.serves(start) && self.inner.serves(end)) {
            self.choose(start, distances(start, end), INNER);
        }
        self.begin_step(start, &distances(start, end));
    }

    /// Chooses the list of a step from `start` in which the nodes make these motions (m).
    fn begin_step(&mut self, start: &[f64], motions: &[f64]) {
        let farthest = largest(motions);
        let reach = motions.iter().map(|motion| STEP * motion.max(LEAST * farthest)).collect();
        self.step = narrowed(&self.inner, start.to_vec(), reach);
    }

    /// Makes the lists of a step from `start` valid at `x` too. Returns true if they changed.
    pub(super) fn widen(&mut self, start: &[f64], x: &[f64]) -> bool {
        if self.step.serves(x) {
            return false;
        }
        let apart = distances(start, x);
        if !apart.iter().all(|apart| apart.is_finite()) {
            return false;
        }
        if !self.inner.serves(x) {
            self.choose(start, apart.clone(), 2.0 * STEP);
        }
        self.begin_step(start, &apart);
        true
    }

    /// Chooses the inner list for motions from `about` of `steps` times these.
    fn choose(&mut self, about: &[f64], motions: Vec<f64>, steps: f64) {
        let farthest = largest(&motions);
        let reach: Vec<f64> = motions.iter().map(|motion| steps * motion.max(LEAST * farthest)).collect();
        let gone = if self.outer.about.len() == about.len() {
            largest(&distances(&self.outer.about, about))
        } else {
            f64::INFINITY
        };
        if gone + steps * farthest > self.outer.reach.first().copied().unwrap_or(0.0) {
            let asked = self.live.iter().map(|term| term.reach()).fold(f64::INFINITY, f64::min);
            self.search(about, (OUTER * farthest).clamp(asked, MOST * asked).max(2.0 * steps * farthest));
        }
        self.narrow(about.to_vec(), reach);
    }

    fn narrow(&mut self, about: Vec<f64>, reach: Vec<f64>) {
        self.inner = narrowed(&self.outer, about, reach);
    }

    fn search(&mut self, about: &[f64], reach: f64) {
        self.searches += 1;
        let terms = self.live.iter().map(|term| term.near(about, reach)).collect();
        self.outer = List { about: about.to_vec(), reach: vec![reach], terms };
    }

    /// Returns the number of searches for outer lists.
    pub(super) fn searches(&self) -> u64 {
        self.searches
    }

    /// Returns the number of candidates of the step.
    pub(super) fn count(&self) -> u64 {
        self.step.terms.iter().map(|term| term.stencils().count() as u64).sum()
    }

    /// Saves the positions at which the lists were made, so that a continued run makes the same lists.
    pub(super) fn save(&self, memory: &mut StepperMemory) {
        for (name, list) in [("outer", &self.outer), ("inner", &self.inner)] {
            memory.arrays.push((format!("{name}.about"), list.about.clone()));
            memory.arrays.push((format!("{name}.reach"), list.reach.clone()));
        }
    }

    pub(super) fn restore(&mut self, memory: &StepperMemory) {
        let array =
            |name: &str| memory.arrays.iter().find(|(key, _)| key == name).map(|(_, values)| values.clone());
        self.outer = List::default();
        self.inner = List::default();
        let (about, reach) = (array("outer.about"), array("outer.reach"));
        if let (Some(about), Some(&[reach])) = (about, reach.as_deref())
            && !about.is_empty()
        {
            self.search(&about, reach);
        }
        if let (Some(about), Some(reach)) = (array("inner.about"), array("inner.reach"))
            && 3 * reach.len() == about.len()
            && !about.is_empty()
        {
            self.narrow(about, reach);
        }
    }
}
