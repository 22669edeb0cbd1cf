//! The stencils of live terms near one configuration, and those of them that the iterates of one step can reach. A body that moves
//! far in a step makes candidates of all pairs within that distance, although few of them come near each other while bodies move
//! together.

use std::sync::Arc;

use vi_core::{DiscreteGradient, Potential, Tube};

use crate::assemble::fixed::FixedSum;
use crate::assemble::hessian::HessianEvaluation;
use crate::assemble::passage::Passage;
use crate::linear::matrix::SymmetricMatrix;

/// Returns ∂x₁/∂x for a stage x at the end x₁ of a step, or in the middle between x₀ and x₁.
pub(crate) fn end_per_stage(is_at_end: bool) -> f64 {
    if is_at_end { 1.0 } else { 2.0 }
}

/// Number of candidates up to which all of them are used, because choosing would cost more than it saves.
const FEW: usize = 500;
/// Reach of the first choice relative to the longest motion of a node in the step, and of later ones relative to the distance of
/// an iterate outside the last one.
const FIRST: f64 = 0.1;
const SPARE: f64 = 2.0;

/// A term with a discrete gradient, with its index in the list.
type Numbered = (usize, Arc<dyn Potential>);
/// The discrete gradient of a term over the open step; `None` to use the discrete gradient of the term itself.
type Over = Option<Arc<dyn DiscreteGradient>>;

/// The stencils near one configuration.
pub(super) struct Near {
    /// All terms.
    pub(super) whole: FixedSum,
    /// The terms without and with a discrete gradient, if they are kept apart and both kinds may occur.
    pub(super) parts: Option<[FixedSum; 2]>,
    /// The terms with a discrete gradient.
    pub(super) discrete: Vec<Numbered>,
    /// The discrete gradients of these terms over the open step.
    pub(super) over: Vec<Over>,
    /// The pairs of the open step, if they were chosen from all.
    pub(super) close: Option<Close>,
}

impl Near {
    /// Returns the terms with the pairs of the open step, and their discrete gradients.
    pub(super) fn of_step(&self) -> (&[Numbered], &[Over]) {
        match &self.close {
            Some(Close { terms, over, .. }) => (terms, over),
            None => (&self.discrete, &self.over),
        }
    }

    /// Returns the Hessians to be summed, with their factors. The tangents of discrete gradients have the factor ∂x₁/∂x
    /// = `end_per_stage`; they are left out if it is `None`.
    pub(super) fn hessians<'a>(
        &'a mut self,
        fixed: &'a SymmetricMatrix,
        x: &[f64],
        pair: &[f64],
        t: f64,
        kind: HessianEvaluation,
        end_per_stage: Option<f64>,
    ) -> Vec<(f64, &'a SymmetricMatrix)> {
        let Self { whole, parts, .. } = self;
        let mut hessians = vec![(1.0, fixed)];
        match parts {
            Some([plain, discrete]) => {
                hessians.push((1.0, plain.hessian(x, t, kind)));
                if let Some(factor) = end_per_stage {
                    hessians.push((factor, discrete.hessian(pair, t, kind)));
                }
            }
            None => hessians.push((1.0, whole.hessian(x, t, kind))),
        }
        hessians
    }

    /// Chooses the pairs of the open step such that they are valid at `start`, where the nodes are when the step
    /// begins, and at all `places`. The last of these is the end of the step as far as it is known.
    pub(super) fn choose(&mut self, start: &[f64], places: &[&[f64]], passage: &Passage) {
        let count: usize = self.discrete.iter().map(|(_, term)| term.stencil_count()).sum();
        let is_served =
            |close: &Close| close.tube.contains(start) && places.iter().all(|x| close.tube.contains(x));
        if count <= FEW || self.close.as_ref().is_some_and(is_served) {
            return;
        }
        let Some(tube) = tube(self.close.take(), start, places) else { return };
        let narrowed = |(number, term): &Numbered| Some((*number, term.narrowed(&tube)?));
        let Some(terms) = self.discrete.iter().map(narrowed).collect::<Option<Vec<_>>>() else { return };
        let over = passage.over_each(&terms);
        self.close = Some(Close { tube, terms, over });
    }
}

/// Terms with the pairs that can act or meet in a tube about the path of a step, and their discrete gradients over the step.
pub(super) struct Close {
    tube: Tube,
    terms: Vec<Numbered>,
    over: Vec<Over>,
}

/// Returns a tube about the path of a step from `start` that contains all `places`; `None` if these are not finite positions in
/// space. A tube about the same step, `before`, is widened.
fn tube(before: Option<Close>, start: &[f64], places: &[&[f64]]) -> Option<Tube> {
    let is_sound = |x: &[f64]| x.len() == start.len() && x.iter().all(|x| x.is_finite());
    let end = places.last()?;
    if !start.len().is_multiple_of(3) || !is_sound(start) || !places.iter().all(|x| is_sound(x)) {
        return None;
    }
    let mut tube = match before {
        Some(Close { tube, .. }) if tube.start == start => tube,
        _ => {
            let motion: Vec<f64> = start.iter().zip(*end).map(|(start, end)| end - start).collect();
            let length = |v: &[f64]| v.iter().map(|v| v * v).sum::<f64>().sqrt();
            let farthest = motion.chunks_exact(3).map(length).fold(0.0, f64::max);
            Tube { start: start.to_vec(), motion, reach: vec![FIRST * farthest; start.len() / 3] }
        }
    };
    for x in places {
        let distances: Vec<f64> = tube.distances(x).collect();
        for (reach, distance) in tube.reach.iter_mut().zip(distances) {
            if distance > *reach {
                *reach = SPARE * distance;
            }
        }
    }
    places.iter().all(|x| tube.contains(x)).then_some(tube)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Iterates of a step of two bodies that move together by 2 m, and apart from each other by less. The tube contains all of
    /// them after each choice, and the second body needs a small part of the reach that a ball about the start would need.
    #[test]
    fn a_tube_keeps_all_iterates_of_its_step() {
        let start = vec![0.0, 0.0, 0.0, 1.0, 0.0, 0.0];
        let iterates =
            [[2.0, 0.0, 0.0, 3.0, 0.0, 0.0], [2.0, 0.1, 0.0, 3.0, 0.0, 0.3], [1.9, 0.6, 0.0, 2.9, 0.0, 0.0]];
        let mut close = None;
        for count in 1..=iterates.len() {
            let found = tube(close.take(), &start, &[&iterates[count - 1]]).unwrap();
            assert!(found.contains(&start) && iterates[..count].iter().all(|x| found.contains(x)));
            assert!(found.reach[1] < 0.7, "{:?}", found.reach);
            close = Some(Close { tube: found, terms: Vec::new(), over: Vec::new() });
        }
        assert!(tube(close, &start, &[&[f64::NAN; 6]]).is_none());
    }
}
