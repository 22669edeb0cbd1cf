//! Discrete gradients: forces that exchange exactly the energy of a term over a step.

use std::ops::Range;
use std::sync::Arc;

/// A discrete gradient G(x₀, x₁) of a potential V, one G_s per stencil s, with the property
/// ```text
/// G_s(x₀, x₁)·(x₁ − x₀) = V_s(x₁) − V_s(x₀)
/// ```
/// exactly, and G_s(x, x) = ∂V_s/∂x (O. Gonzalez, J. Nonlinear Sci. 6 (1996) 449–467). A term that acts through G
/// over a step exchanges exactly its change of energy with the body. `start` and `end` hold all coordinates, m.
pub trait DiscreteGradient: Send + Sync {
    /// Writes G_s, N: n entries per stencil, as in [`Potential::gradients`](crate::Potential::gradients).
    fn gradients(&self, range: Range<usize>, start: &[f64], end: &[f64], out: &mut [f64]);

    /// Writes the symmetric part of ∂G_s/∂x₁, N/m, as packed lower triangles as in
    /// [`Potential::hessians`](crate::Potential::hessians). It is the matrix of Newton's method with symmetric
    /// factors. If ∂G_s/∂x₁ is not symmetric, convergence is linear instead of quadratic, and the solution is the
    /// same.
    fn tangents(&self, range: Range<usize>, start: &[f64], end: &[f64], out: &mut [f64]);

    /// Appends the forces that act between `start` and `end` to `out`, pair by pair, if the term belongs to a live term
    /// that [lists its pairs](crate::Live::lists_pairs). Other terms append nothing.
    fn acting(&self, _start: &[f64], _end: &[f64], _out: &mut Acting) {}

    /// Returns the term for one step of `duration` (s), if it has dissipative forces in addition to V. These may
    /// depend on earlier steps, as dry friction does: `memory` comes from [`DiscreteGradient::outcome`] of the last
    /// step. The stencils are those of this term. Returns `None` if the term has no such forces.
    ///
    /// An infinite duration leads from one equilibrium to the next. Then the forces are the dissipative ones alone, at the
    /// end of the step, and [`StepOutcome::impulses`] are those of one second.
    fn over_step(&self, _duration: f64, _memory: &[f64]) -> Option<Arc<dyn DiscreteGradient>> {
        None
    }

    /// Returns the work and the memory of the dissipative forces for a step from `start` to `end`.
    fn outcome(&self, _start: &[f64], _end: &[f64]) -> StepOutcome {
        StepOutcome::default()
    }
}

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

/// The forces that act over a step and their tangents, pair by pair. They need little memory if most stencils do not act.
/// Covectors are lists of nodes, each with three numbers.
#[derive(Debug, Clone, PartialEq)]
pub struct Acting {
    /// The fraction of their stiffness with which bristles of friction resist the slip of this step, in (0, 1]. With soft
    /// bristles, the range of slip in which friction sticks is wide, so Newton's method finds it from afar.
    pub stiffness: f64,
    /// Whether the tangents shall include those of the directions of forces. They are not positive, so Newton's method needs them
    /// near a solution and may be led astray by them far from it.
    pub turns: bool,
    gradients: Covectors,
    tangents: Covectors,
    /// The directions in which pairs slide, by the number of the pair: at this evaluation and, in ascending order, at
    /// the last one.
    slides: Vec<(u64, [f64; 3])>,
    slid: Arc<[(u64, [f64; 3])]>,
    reversals: usize,
    has_friction: bool,
}

impl Default for Acting {
    fn default() -> Self {
        Self {
            stiffness: 1.0,
            turns: false,
            gradients: Covectors::default(),
            tangents: Covectors::default(),
            slides: Vec::new(),
            slid: Arc::default(),
            reversals: 0,
            has_friction: false,
        }
    }
}

impl Acting {
    /// Removes all forces and tangents, and keeps the directions of sliding for [`Acting::reverses`], and whether friction acted.
    pub fn clear(&mut self) {
        self.gradients.clear();
        self.tangents.clear();
        self.slides.sort_unstable_by_key(|(pair, _)| *pair);
        self.slid = std::mem::take(&mut self.slides).into();
        self.reversals = 0;
    }

    /// Removes everything.
    pub fn restart(&mut self) {
        *self = Self::default();
    }

    /// Returns an empty list for some of the pairs; [`Acting::append`] adds it to this one.
    #[must_use]
    pub fn part(&self) -> Self {
        Self { stiffness: self.stiffness, turns: self.turns, slid: Arc::clone(&self.slid), ..Self::default() }
    }

    /// Returns whether a pair that slides in the direction `traction` slid in the opposite direction at the last
    /// evaluation. Newton's method may alternate between both; then the pair should be listed as sticking once.
    /// Otherwise, this function records the direction.
    pub fn reverses(&mut self, pair: u64, traction: [f64; 3]) -> bool {
        let last = self.slid.binary_search_by_key(&pair, |(pair, _)| *pair);
        let is_opposite = last.is_ok_and(|place| {
            let (_, last) = self.slid[place];
            last.iter().zip(traction).map(|(a, b)| a * b).sum::<f64>() < 0.0
        });
        if is_opposite {
            self.reversals += 1;
        } else {
            self.slides.push((pair, traction));
        }
        is_opposite
    }

    /// Returns the number of pairs that are listed as sticking because their direction of sliding reversed.
    pub fn reversals(&self) -> usize {
        self.reversals
    }

    /// Adds a covector (N) to G.
    pub fn add_gradient(&mut self, covector: impl IntoIterator<Item = (u32, [f64; 3])>) {
        self.gradients.push(covector);
    }

    /// Adds a covector (N) of friction to G.
    pub fn add_friction(&mut self, covector: impl IntoIterator<Item = (u32, [f64; 3])>) {
        self.has_friction = true;
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

    /// Appends the forces and tangents of `other`.
    pub fn append(&mut self, other: &Self) {
        self.gradients.append(&other.gradients);
        self.tangents.append(&other.tangents);
        self.slides.extend_from_slice(&other.slides);
        self.reversals += other.reversals;
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

/// Result of one step for the forces of a term that have no potential. With G of the term over the step,
/// ```text
/// Σ G·Δx = ΔV + Δstored + friction + damping.
/// ```
#[derive(Debug, Clone, PartialEq, Default)]
pub struct StepOutcome {
    /// Memory for the next step.
    pub memory: Vec<f64>,
    /// Energy stored in the memory, J.
    pub stored: f64,
    /// Energy dissipated by friction, J (≥ 0).
    pub friction: f64,
    /// Energy dissipated by the damping of the term, J (≥ 0).
    pub damping: f64,
    /// Impulses between parts of the system.
    pub impulses: Vec<Impulse>,
    /// The smallest gap of the pairs that acted, at either end, m; `None` if no pair acted.
    pub smallest_gap: Option<f64>,
    /// The smallest gaps of the pairs that acted, at the start and at the end of the step, relative to the gap from which on a
    /// pair acts; `None` if no pair acted.
    pub narrowest: Option<[f64; 2]>,
}

/// The impulse of the second of two parts on the first over a step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Impulse {
    /// Both parts, in the numbering of the term.
    pub between: [u32; 2],
    /// The impulse, N s.
    pub value: [f64; 3],
}
