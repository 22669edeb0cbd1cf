//! Lists of the candidates of live terms, in three sizes. The outer list results from a search, which is rare. The inner
//! list is chosen from it as soon as nodes leave their surroundings, and the list of a step is chosen from the inner list.
//! Iterations use only the list of the step.
//!
//! A list is valid in a tube of configurations about the path that the nodes are expected to take: for the outer list, that of
//! their mean motion since the last one. So a body that falls or slides as a whole needs no new search. If few nodes leave the
//! tube of the outer list, only their pairs are searched again.

use std::sync::Arc;

use vi_core::{Coordinates, Live, Potential, Tube};

use crate::assemble::live::shortest_reach;
use crate::memory::StepperMemory;

/// Least and largest number of steps for which an outer list is planned, and their ratio to the number of steps that
/// the last one served: along a long path the tube must be wide, because nodes deviate from the path.
const LEAST_OUTER: f64 = 6.0;
const LARGEST_OUTER: f64 = 48.0;
const LONGER: f64 = 1.25;
/// Bounds on the least reach of an outer list, and the least reach of an inner list, as multiples of the reach that its terms request.
/// To choose from a list costs far less than to search. So the inner list is just larger than that of a step, which leaves most of
/// the outer tube to the motion of the nodes. A cloth of 40 × 40 cells on a sphere takes 7.3 to 9.1 s with 114 to 154 searches; with
/// multiples of 9.6 and 6.4, inner lists for 3 steps, 9.1 to 11.0 s and 260 searches; with 14 and 1.6, 10.6 s and 45 searches.
const OUTER_REACH: [f64; 2] = [2.4, 9.6];
const INNER_REACH: f64 = 1.6;
/// The multiple of an outer list is the lower bound at first. It is doubled if a list has served fewer steps than this, and divided by
/// `LONGER` if one has served as many as can be planned: bodies that hardly move need few candidates. The first step of a stack of 20
/// cloths of 69 × 69 cells takes 2.6 instead of 8.0 s, and the program 1.4 instead of 3.1 GB.
const FEW_STEPS: f64 = 24.0;
/// Least reach of the list of a step, as a fraction of the longest motion of a node. A node that contact moved farther in the last step
/// reaches so far; where iterates leave the list, it is widened. A cloth of 40 × 40 cells on a sphere takes 3.40, 3.37, 3.44 and
/// 3.5 s with .01, .02, .05 and .25 for all nodes.
const LEAST: f64 = 0.02;
/// Reach of a node, as a multiple of its known distance from the path.
const SPARE: f64 = 1.5;
/// Largest fraction of the nodes whose paths are replaced in a list. If more have left it, all pairs are searched. The
/// cloth on a sphere takes 7.7 to 8.5 s, with .15 9.2 to 10.7 s.
const FEW: f64 = 0.05;
/// Nodes farther from their path than this fraction of their reach get another one together with those that have left it, because
/// they would leave next. The cloth on a sphere takes 7.7 to 8.5 s, with .9 7.7 to 9.2 s, with 1 7.9 to 10.1 s, with .7 8.6 to
/// 8.9 s.
const EARLY: f64 = 0.8;
/// Number of times that paths of nodes are replaced until a tube fits: each time changes the mean path a little.
const ROUNDS: usize = 3;

/// Terms that are valid in a tube.
#[derive(Default)]
struct List {
    tube: Tube,
    terms: Vec<Arc<dyn Potential>>,
}

impl List {
    /// Returns the tube of the list that follows this one, which has served `served` steps, planned for a number of steps. It
    /// contains `inside`, the tube of a smaller list for one step, and begins there.
    ///
    /// The expected motion is the mean motion over about as many steps as planned: nodes that oscillate would leave a path
    /// along their momentary velocities.
    fn next_tube(&self, served: f64, inside: &Tube, steps: f64, least: f64) -> Tube {
        let start = inside.start.clone();
        let motion = if self.tube.start.len() == start.len() && served > 0.0 {
            let (old, new) = match served / steps {
                part if part < 1.0 => (1.0 - part, 1.0),
                part => (0.0, 1.0 / part),
            };
            let places = start.iter().zip(&self.tube.start).zip(&self.tube.motion);
            places.map(|((x, before), motion)| old * motion + new * (x - before)).collect()
        } else {
            inside.motion.iter().map(|motion| motion * steps).collect()
        };
        let mut tube = Tube { start, motion, reach: Vec::new() };
        let needed = needed(&tube, inside, &inside.end());
        tube.reach = needed.into_iter().map(|needed| least.max(SPARE * needed)).collect();
        tube
    }

    /// Returns the tube with other paths of the few nodes that leave it or soon will, such that it contains `inside`. Returns
    /// `None` if these are many.
    fn repaired(&self, inside: &Tube, least: f64) -> Option<Tube> {
        let mut tube = self.tube.clone();
        if tube.start.len() != inside.start.len() {
            return None;
        }
        let end = inside.end();
        for _ in 0..ROUNDS {
            let needed = needed(&tube, inside, &end).into_iter();
            let parts: Vec<f64> = needed.zip(&tube.reach).map(|(needed, reach)| needed / reach).collect();
            if parts.iter().all(|part| *part <= 1.0) {
                return Some(tube);
            }
            let leaves: Vec<usize> = (0..parts.len()).filter(|&node| parts[node] > EARLY).collect();
            if leaves.len() as f64 > FEW * tube.reach.len() as f64 {
                return None;
            }
            let [from, to] = [tube.nearest(&inside.start), tube.nearest(&end)];
            for node in leaves {
                let mut apart = 0.0;
                for k in 3 * node..3 * node + 3 {
                    let motion = tube.motion[k];
                    tube.start[k] = inside.start[k] - from * motion;
                    apart += (end[k] - tube.start[k] - to * motion).powi(2);
                }
                tube.reach[node] = least.max(SPARE * (apart.sqrt() + inside.reach[node]));
            }
        }
        None
    }
}

/// Returns the reach, m, that each node needs so that a tube with the path of `tube` contains the tube `inside`, whose path ends
/// at `end`.
fn needed(tube: &Tube, inside: &Tube, end: &[f64]) -> Vec<f64> {
    let apart = tube.distances(&inside.start).zip(tube.distances(end));
    apart.zip(&inside.reach).map(|((start, end), reach)| start.max(end) + reach).collect()
}

pub(super) struct Lists {
    live: Vec<Arc<dyn Live>>,
    coordinates: Arc<Coordinates>,
    outer: Arc<List>,
    /// Number of steps that the outer list has served.
    served: f64,
    /// Least reach of the outer list, as a multiple of the reach that its terms request.
    multiple: f64,
    inner: Arc<List>,
    /// The list of a step, chosen from the inner list.
    step: List,
    searches: u64,
    /// Number of lists of steps so far.
    version: u64,
    /// Distance of each node from its expected place at the end of the last step, m; empty if contact moved none.
    deviations: Vec<f64>,
    /// Longest motion of a node that is expected in the step, m.
    farthest: f64,
}

/// The data on which the lists of the next steps depend, to return to this point.
pub(in crate::schemes::kick_drift) struct Kept {
    outer: Arc<List>,
    served: f64,
    multiple: f64,
    inner: Arc<List>,
    deviations: Vec<f64>,
}

impl Lists {
    pub(super) fn new(live: Vec<Arc<dyn Live>>, coordinates: &Arc<Coordinates>) -> Self {
        Self {
            live,
            coordinates: Arc::clone(coordinates),
            farthest: 0.0,
            outer: Arc::default(),
            served: 0.0,
            multiple: OUTER_REACH[0],
            inner: Arc::default(),
            step: List::default(),
            searches: 0,
            version: 0,
            deviations: Vec::new(),
        }
    }

    /// Returns the terms that are valid for the current step.
    pub(super) fn terms(&self) -> &[Arc<dyn Potential>] {
        &self.step.terms
    }

    /// Returns the shortest reach of the terms, m: a fraction of their activation distance.
    pub(super) fn shortest_reach(&self) -> f64 {
        shortest_reach(&self.live)
    }

    /// Returns whether no term has a candidate.
    pub(super) fn is_empty(&self) -> bool {
        self.count() == 0
    }

    /// Begins a step for which the nodes are expected to move from `start` to `end`, and makes the lists valid there.
    pub(super) fn follow(&mut self, start: &[f64], end: &[f64]) {
        let [start, end] = [start, end].map(|x| self.coordinates.places(x));
        let motion: Vec<f64> = start.iter().zip(&*end).map(|(start, end)| end - start).collect();
        self.farthest = motion.chunks_exact(3).map(length).fold(0.0, f64::max);
        let least = LEAST * self.farthest;
        // A free drift leaves none.
        let mut deviations = std::mem::take(&mut self.deviations);
        deviations.resize(motion.len() / 3, 0.0);
        let reach = deviations.into_iter().map(|deviation| least.max(SPARE * deviation)).collect();
        self.choose(Tube { start: start.into_owned(), motion, reach });
        self.served += 1.0;
    }

    /// Returns the longest motion of a node that is expected in the step, m.
    pub(super) fn farthest(&self) -> f64 {
        self.farthest
    }

    /// Ends the step at `x`. Nodes that left their expected paths are expected to do so again.
    pub(super) fn end_step(&mut self, x: &[f64]) {
        let x = self.coordinates.places(x);
        let expected = self.step.tube.end();
        let places = x.as_chunks::<3>().0.iter().zip(expected.as_chunks::<3>().0);
        let apart =
            |(x, expected): (&[f64; 3], &[f64; 3])| length(&[0, 1, 2].map(|k: usize| x[k] - expected[k]));
        self.deviations = places.map(apart).collect();
    }

    /// Makes the lists of the step valid at `x` too.
    pub(super) fn widen(&mut self, x: &[f64]) {
        let x = &*self.coordinates.places(x);
        if self.step.tube.contains(x) || !x.iter().all(|x| x.is_finite()) {
            return;
        }
        let mut tube = std::mem::take(&mut self.step.tube);
        let distances: Vec<f64> = tube.distances(x).collect();
        for (reach, distance) in tube.reach.iter_mut().zip(distances) {
            *reach = reach.max(SPARE * distance);
        }
        self.choose(tube);
    }

    /// Chooses the list of a step, and the larger lists if they are not valid there.
    fn choose(&mut self, step: Tube) {
        if !self.inner.tube.contains_tube(&step) {
            let asked = self.shortest_reach();
            let reach = step.reach.iter().map(|reach| (SPARE * reach).max(INNER_REACH * asked)).collect();
            let inner = Tube { start: step.start.clone(), motion: step.motion.clone(), reach };
            if !self.outer.tube.contains_tube(&inner) {
                let least = self.multiple * asked;
                match self.outer.repaired(&inner, least) {
                    Some(tube) => self.outer = Arc::new(self.within(tube)),
                    None => {
                        self.searches += 1;
                        let steps = if self.served > 0.0 {
                            (LONGER * self.served).clamp(LEAST_OUTER, LARGEST_OUTER)
                        } else {
                            LARGEST_OUTER
                        };
                        self.multiple = self.next_multiple();
                        let least = self.multiple * asked;
                        let tube = self.outer.next_tube(self.served, &inner, steps, least);
                        (self.outer, self.served) = (Arc::new(self.within(tube)), 0.0);
                    }
                }
            }
            self.inner = Arc::new(narrowed(&self.outer, inner));
        }
        self.step = narrowed(&self.inner, step);
        self.version += 1;
    }

    /// Returns the multiple of the outer list that follows this one.
    fn next_multiple(&self) -> f64 {
        let [least, largest] = OUTER_REACH;
        match self.served {
            0.0 => self.multiple,
            few if few < FEW_STEPS => (2.0 * self.multiple).min(largest),
            many if many >= LARGEST_OUTER => (self.multiple / LONGER).max(least),
            _ => self.multiple,
        }
    }

    fn within(&self, tube: Tube) -> List {
        let terms = self.live.iter().map(|term| term.within(&tube)).collect();
        List { tube, terms }
    }

    /// Returns a number that changes with the list of the step.
    pub(super) fn version(&self) -> u64 {
        self.version
    }

    /// Returns the number of searches for outer lists.
    pub(super) fn searches(&self) -> u64 {
        self.searches
    }

    /// Returns the number of candidates of the step.
    pub(super) fn count(&self) -> u64 {
        self.step.terms.iter().map(|term| term.stencil_count() as u64).sum()
    }

    /// Returns what is needed to return to this point between two steps.
    pub(super) fn keep(&self) -> Kept {
        let (outer, inner) = (Arc::clone(&self.outer), Arc::clone(&self.inner));
        let Self { served, multiple, .. } = *self;
        Kept { outer, served, multiple, inner, deviations: self.deviations.clone() }
    }

    /// Returns to a point between two steps.
    pub(super) fn go_to(&mut self, kept: Kept) {
        let Kept { outer, served, multiple, inner, deviations } = kept;
        (self.outer, self.served, self.multiple) = (outer, served, multiple);
        (self.inner, self.deviations) = (inner, deviations);
    }

    /// Saves the tubes of the lists, so that a continued run makes the same lists.
    pub(super) fn save(&self, memory: &mut StepperMemory) {
        for (name, list) in [("outer", &self.outer), ("inner", &self.inner)] {
            memory.arrays.push((format!("{name}.start"), list.tube.start.clone()));
            memory.arrays.push((format!("{name}.motion"), list.tube.motion.clone()));
            memory.arrays.push((format!("{name}.reach"), list.tube.reach.clone()));
        }
        memory.arrays.push(("outer.served".to_owned(), vec![self.served, self.multiple]));
        memory.arrays.push(("deviations".to_owned(), self.deviations.clone()));
    }

    pub(super) fn restore(&mut self, memory: &StepperMemory) {
        let array = |name: String| memory.arrays.iter().find(|(key, _)| *key == name).map(|(_, v)| v.clone());
        let saved = |name: &str| {
            let part = |part: &str| array(format!("{name}.{part}"));
            let tube = Tube { start: part("start")?, motion: part("motion")?, reach: part("reach")? };
            let count = tube.start.len();
            let fits = count > 0 && tube.motion.len() == count && 3 * tube.reach.len() == count;
            fits.then_some(tube)
        };
        (self.outer, self.inner, self.served) = (Arc::default(), Arc::default(), 0.0);
        self.multiple = OUTER_REACH[0];
        self.deviations = array("deviations".to_owned()).unwrap_or_default();
        if let (Some(tube), Some(&[served, multiple])) =
            (saved("outer"), array("outer.served".to_owned()).as_deref())
        {
            (self.outer, self.served, self.multiple) = (Arc::new(self.within(tube)), served, multiple);
            if let Some(tube) = saved("inner") {
                self.inner = Arc::new(narrowed(&self.outer, tube));
            }
        }
    }
}

fn length(vector: &[f64]) -> f64 {
    vector.iter().map(|value| value * value).sum::<f64>().sqrt()
}

fn narrowed(list: &List, tube: Tube) -> List {
    let narrowed = |term: &Arc<dyn Potential>| term.narrowed(&tube);
    let terms = list.terms.iter().map(|term| narrowed(term).unwrap_or_else(|| Arc::clone(term)));
    let terms = terms.collect();
    List { tube, terms }
}
