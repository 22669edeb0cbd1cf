//! The forces of pairs over a step, with their tangents, and the tractions of friction on the way to a solution.

use std::sync::Arc;

/// Sparse covectors, stored one after the other.
#[derive(Debug, Clone, PartialEq, Default)]
struct Covectors {
    entries: Vec<(u32, [f64; 3])>,
    ends: Vec<usize>,
}

impl Covectors {
    fn push(&mut self, entries: impl IntoIterator<Item = (u32, [f64; 3])>) {
        self.entries.extend(entries.into_iter().filter(|(_, value)| *value != [0.0; 3]));
        self.ends.push(self.entries.len());
    }

    fn append(&mut self, other: &Self) {
        let first = self.entries.len();
        self.entries.extend_from_slice(&other.entries);
        self.ends.extend(other.ends.iter().map(|end| first + end));
    }

    fn clear(&mut self) {
        self.entries.clear();
        self.ends.clear();
    }

    fn iter(&self) -> impl Iterator<Item = &[(u32, [f64; 3])]> {
        let mut start = 0;
        self.ends.iter().map(move |&end| &self.entries[std::mem::replace(&mut start, end)..end])
    }
}

/// The friction of a pair at an iterate of Newton's method.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Rubbing {
    /// Number of the pair.
    pub pair: u64,
    /// Components of its traction along two tangents, N.
    pub traction: [f64; 2],
    /// Components of the direction of the traction if the pair is taken to slide; `None` if it is taken to stick.
    pub sliding: Option<[f64; 2]>,
    /// Whether the traction obeys the law of friction at this iterate.
    pub is_lawful: bool,
}

/// A part of the derivative of a traction: the traction of pair number `rubbing` of the list changes by `direction` (N)
/// per unit of the right factor of tangent number `tangent`.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Share {
    rubbing: usize,
    tangent: usize,
    direction: [f64; 2],
}

/// The forces that act over a step and their tangents, pair by pair. They need little memory if most stencils do not act.
/// Covectors are lists of nodes, each with three numbers.
///
/// Coulomb friction has a kink between sticking and sliding that is much narrower than the errors of most iterates. Newton's
/// method therefore treats the tractions T of friction as unknowns of their own (a primal–dual method: P. Alart and A. Curnier,
/// Comput. Methods Appl. Mech. Engrg. 92 (1991) 353–375). Each linear system predicts them
/// ([`Acting::predict`]), and at the next iterate the prediction decides, with the slip, whether the pair sticks
/// ([`Acting::traction_of`]).
#[derive(Debug, Clone, PartialEq)]
pub struct Acting {
    /// The fraction of their stiffness with which bristles of friction resist the slip of this step, in (0, 1]. With soft
    /// bristles, the range of slip in which friction sticks is wide, so Newton's method finds it from afar.
    pub stiffness: f64,
    /// Whether the tangents include the change of the directions of forces. This part is indefinite: Newton's method
    /// needs it near a solution, and may diverge because of it far from one.
    pub turns: bool,
    /// A bound on the stiffness of bristles that stick, as a multiple of the force that moves both parts of the pair by a unit slip.
    /// With a finite bound, tractions follow slips gradually, from iteration to iteration.
    pub penalty: f64,
    /// The compliance of each node, m/N: how far a unit force moves it within the step if nothing else holds it. It weighs predicted
    /// tractions against slips. If it is empty, slips alone decide which pairs stick.
    pub compliance: Arc<[f64]>,
    gradients: Covectors,
    tangents: Covectors,
    rubbing: Vec<Rubbing>,
    shares: Vec<Share>,
    /// The predicted tractions, by the numbers of the pairs in ascending order.
    predicted: Arc<[(u64, [f64; 2])]>,
    has_friction: bool,
}

impl Default for Acting {
    fn default() -> Self {
        Self {
            stiffness: 1.0,
            turns: false,
            penalty: f64::INFINITY,
            compliance: Arc::default(),
            gradients: Covectors::default(),
            tangents: Covectors::default(),
            rubbing: Vec::new(),
            shares: Vec::new(),
            predicted: Arc::default(),
            has_friction: false,
        }
    }
}

impl Acting {
    /// Removes all forces and tangents. It keeps the predicted tractions, and whether friction acted.
    pub fn clear(&mut self) {
        self.gradients.clear();
        self.tangents.clear();
        self.rubbing.clear();
        self.shares.clear();
    }

    /// Removes everything but the compliance of the nodes.
    pub fn restart(&mut self) {
        *self = Self { compliance: Arc::clone(&self.compliance), ..Self::default() };
    }

    /// Returns an empty list for some of the pairs; [`Acting::append`] adds it to this one.
    #[must_use]
    pub fn part(&self) -> Self {
        Self {
            stiffness: self.stiffness,
            turns: self.turns,
            penalty: self.penalty,
            compliance: Arc::clone(&self.compliance),
            predicted: Arc::clone(&self.predicted),
            ..Self::default()
        }
    }

    /// Returns the predicted traction of a pair along its two tangents, N; `None` if there is no prediction.
    pub fn traction_of(&self, pair: u64) -> Option<[f64; 2]> {
        let found = self.predicted.binary_search_by_key(&pair, |(pair, _)| *pair);
        found.ok().map(|place| self.predicted[place].1)
    }

    /// Predicts the tractions after a change of x₁. `along` returns how much the right factor of the tangent with a number changes:
    /// its product with the change of x₁.
    ///
    /// A pair that slides does not pull in the other direction; where the prediction says so, the pair has opened.
    pub fn predict(&mut self, mut along: impl FnMut(usize) -> f64) {
        for &Share { rubbing, tangent, direction } in &self.shares {
            let amount = along(tangent);
            let traction = &mut self.rubbing[rubbing].traction;
            (0..2).for_each(|k| traction[k] += direction[k] * amount);
        }
        let mut predicted: Vec<_> =
            self.rubbing.iter().map(|rubbing| (rubbing.pair, allowed(rubbing))).collect();
        predicted.sort_unstable_by_key(|(pair, _)| *pair);
        self.predicted = predicted.into();
    }

    /// Returns the number of pairs whose traction does not obey the law of friction at this iterate; `None` if no friction acts.
    pub fn unlawful(&self) -> Option<usize> {
        let unlawful = || self.rubbing.iter().filter(|rubbing| !rubbing.is_lawful).count();
        (!self.rubbing.is_empty()).then(unlawful)
    }

    /// Adds a covector (N) to G.
    pub fn add_gradient(&mut self, covector: impl IntoIterator<Item = (u32, [f64; 3])>) {
        self.gradients.push(covector);
    }

    /// Adds the covector (N) of the friction of a pair to G.
    pub fn add_friction(&mut self, rubbing: Rubbing, covector: impl IntoIterator<Item = (u32, [f64; 3])>) {
        self.has_friction = true;
        self.rubbing.push(rubbing);
        self.add_gradient(covector);
    }

    /// Returns whether friction has acted since the last [`Acting::restart`].
    pub fn has_friction(&self) -> bool {
        self.has_friction
    }

    /// Adds left ⊗ right (N/m) to ∂G/∂x₁. The two factors differ in general: friction depends on pressure, but pressure
    /// does not depend on friction.
    pub fn add_tangent(
        &mut self,
        left: impl IntoIterator<Item = (u32, [f64; 3])>,
        right: impl IntoIterator<Item = (u32, [f64; 3])>,
    ) {
        self.tangents.push(left);
        self.tangents.push(right);
    }

    /// Adds left ⊗ right (N/m) to ∂G/∂x₁ for the friction that was added last, whose traction changes by `direction` · (right · Δx₁).
    pub fn add_friction_tangent(
        &mut self,
        direction: [f64; 2],
        left: impl IntoIterator<Item = (u32, [f64; 3])>,
        right: impl IntoIterator<Item = (u32, [f64; 3])>,
    ) {
        if let Some(rubbing) = self.rubbing.len().checked_sub(1) {
            self.shares.push(Share { rubbing, tangent: self.tangents.ends.len() / 2, direction });
        }
        self.add_tangent(left, right);
    }

    /// Appends the forces and tangents of `other`.
    pub fn append(&mut self, other: &Self) {
        let (rubbing, tangent) = (self.rubbing.len(), self.tangents.ends.len() / 2);
        self.shares.extend(other.shares.iter().map(|share| Share {
            rubbing: rubbing + share.rubbing,
            tangent: tangent + share.tangent,
            direction: share.direction,
        }));
        self.rubbing.extend_from_slice(&other.rubbing);
        self.gradients.append(&other.gradients);
        self.tangents.append(&other.tangents);
        self.has_friction |= other.has_friction;
    }

    /// Returns the number of covectors whose sum is G.
    pub fn count(&self) -> usize {
        self.gradients.ends.len()
    }

    /// Returns the covectors whose sum is G.
    pub fn gradients(&self) -> impl Iterator<Item = &[(u32, [f64; 3])]> {
        self.gradients.iter()
    }

    /// Returns the left and right factors of the terms of ∂G/∂x₁, alternately.
    pub fn tangents(&self) -> impl Iterator<Item = &[(u32, [f64; 3])]> {
        self.tangents.iter()
    }
}

/// Returns the predicted traction of a pair, without a part against the direction in which it slides.
fn allowed(rubbing: &Rubbing) -> [f64; 2] {
    let [first, second] = rubbing.traction;
    let Some([a, b]) = rubbing.sliding else { return rubbing.traction };
    let along = (first * a + second * b).min(0.0);
    [first - along * a, second - along * b]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns a list of a tangent without friction, a pair that sticks (7) and a pair that slides along the first direction (3), each
    /// with one tangent.
    fn two_pairs() -> Acting {
        let mut acting = Acting::default();
        let unit = || [(0, [1.0, 0.0, 0.0])];
        let rubbing = |pair, sliding| Rubbing { pair, traction: [2.0, 1.0], sliding, is_lawful: pair == 3 };
        acting.add_tangent(unit(), unit());
        let mut part = acting.part();
        part.add_friction(rubbing(7, None), unit());
        part.add_friction_tangent([0.0, 5.0], unit(), unit());
        acting.append(&part);
        let mut part = acting.part();
        part.add_friction(rubbing(3, Some([1.0, 0.0])), unit());
        part.add_friction_tangent([4.0, 0.0], unit(), unit());
        acting.append(&part);
        acting
    }

    #[test]
    fn tractions_follow_the_tangents_and_do_not_turn_against_their_direction() {
        let mut acting = two_pairs();
        assert_eq!((acting.count(), acting.unlawful()), (2, Some(1)));
        assert_eq!(acting.traction_of(3), None);
        acting.predict(|tangent| [f64::NAN, -0.2, -0.25][tangent]);
        assert_eq!([7, 3].map(|pair| acting.traction_of(pair)), [Some([2.0, 0.0]), Some([1.0, 1.0])]);
        let mut opened = two_pairs();
        opened.predict(|tangent| [f64::NAN, 0.0, -2.0][tangent]);
        assert_eq!(opened.traction_of(3), Some([0.0, 1.0]));
        opened.clear();
        assert_eq!((opened.part().traction_of(7), opened.unlawful()), (Some([2.0, 1.0]), None));
        opened.restart();
        assert_eq!(opened.traction_of(7), None);
    }
}
