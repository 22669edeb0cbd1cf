//! The forces that live terms list pair by pair ([`DiscreteGradient::acting`](vi_core::DiscreteGradient::acting)), with
//! their complete tangents on the free coordinates: ∂G/∂q₁ = Σ a ⊗ b. Friction follows pressure, but pressure does not
//! follow friction, so this matrix is not symmetric.

use std::sync::Arc;

use vi_core::{Acting, Coordinates, System};

use crate::assemble::compliance::Compliance;
use crate::index::{NONE, free_of};

/// The forces of pairs at the last evaluation.
pub(crate) struct Pairs {
    acting: Acting,
    compliance: Compliance,
    /// The free coordinate of each coordinate, or [`NONE`].
    free_of: Vec<u32>,
    /// Places and values of the factors a and b on the free coordinates, alternately, and the end of each.
    entries: Vec<(u32, f64)>,
    ends: Vec<u32>,
    /// The sum of the absolute forces of the pairs on each coordinate, N.
    sizes: Vec<f64>,
}

impl Pairs {
    pub(crate) fn new(coordinates: &Coordinates) -> Self {
        let free_of = free_of(coordinates);
        let sizes = vec![0.0; free_of.len()];
        Self {
            sizes,
            acting: Acting::default(),
            compliance: Compliance::default(),
            free_of,
            entries: Vec::new(),
            ends: Vec::new(),
        }
    }

    /// Returns the forces of the last evaluation, with the predicted tractions.
    pub(crate) fn acting(&self) -> &Acting {
        &self.acting
    }

    /// Returns an empty list to which terms append their forces.
    pub(crate) fn open(&mut self) -> &mut Acting {
        self.acting.clear();
        &mut self.acting
    }

    /// Sets the fraction of their stiffness with which bristles resist slip; see [`Acting::stiffness`].
    pub(crate) fn set_stiffness(&mut self, fraction: f64) {
        self.acting.stiffness = fraction;
    }

    /// Adds the forces (N) to `gradient`, which has all coordinates, and collects the tangents on the free coordinates.
    pub(crate) fn close(&mut self, coordinates: &Coordinates, gradient: &mut [f64]) {
        let Self { acting, free_of, entries, ends, sizes, .. } = self;
        sizes.fill(0.0);
        for covector in acting.gradients() {
            pull_back(coordinates, covector, |node, value| {
                for axis in 0..3 {
                    gradient[3 * node as usize + axis] += value[axis];
                    sizes[3 * node as usize + axis] += value[axis].abs();
                }
            });
        }
        entries.clear();
        ends.clear();
        for covector in acting.tangents() {
            pull_back(coordinates, covector, |node, value| {
                for axis in 0..3 {
                    let free = free_of[3 * node as usize + axis];
                    if free != NONE {
                        entries.push((free, value[axis]));
                    }
                }
            });
            ends.push(entries.len() as u32);
        }
    }

    /// Forgets the predicted tractions.
    pub(crate) fn restart(&mut self) {
        self.acting.restart();
    }

    /// Returns the number of pairs whose traction of friction does not obey its law at the last evaluation; `None` without
    /// friction.
    pub(crate) fn unlawful(&self) -> Option<usize> {
        self.acting.unlawful()
    }

    /// Predicts the tractions of friction after a change of the free coordinates at the end of the step by factor · `delta`.
    pub(crate) fn predict(&mut self, factor: f64, delta: &[f64]) {
        let Self { acting, entries, ends, .. } = self;
        acting.predict(|tangent| {
            let right = &entries[ends[2 * tangent] as usize..ends[2 * tangent + 1] as usize];
            factor * right.iter().map(|&(k, value)| value * delta[k as usize]).sum::<f64>()
        });
    }

    /// Sets the compliance of each node, m/N; see [`Acting::compliance`].
    pub(crate) fn set_compliance(&mut self, compliance: Arc<[f64]>) {
        self.acting.compliance = compliance;
    }

    /// Begins a series of iterations over a step in which a unit force moves a free coordinate of mass m by `per_mass`/m.
    pub(crate) fn begin(&mut self, system: &System, per_mass: f64) {
        self.restart();
        self.acting.compliance = self.compliance.over_step(system, per_mass);
    }

    /// Returns whether friction has acted since the last restart.
    pub(crate) fn has_friction(&self) -> bool {
        self.acting.has_friction()
    }

    /// Returns whether no force acts.
    pub(crate) fn is_empty(&self) -> bool {
        self.acting.count() == 0
    }

    /// Makes the tangents include those of the directions of forces; see [`Acting::turns`].
    pub(crate) fn set_turns(&mut self, turns: bool) {
        self.acting.turns = turns;
    }

    /// Bounds the stiffness of bristles that stick; see [`Acting::penalty`].
    pub(crate) fn set_penalty(&mut self, penalty: f64) {
        self.acting.penalty = penalty;
    }

    /// Returns the sum of the absolute forces of the pairs on each coordinate, N.
    pub(crate) fn sizes(&self) -> &[f64] {
        &self.sizes
    }

    /// Adds factor · (Σ |a| ⊗ |b|) |v| to `out`: a bound on how a change of coordinates by v changes the forces.
    pub(crate) fn add_bound(&self, factor: f64, v: &[f64], out: &mut [f64]) {
        self.for_each_tangent(|left, right| {
            let along: f64 = right.iter().map(|&(k, value)| (value * v[k as usize]).abs()).sum();
            left.iter().for_each(|&(k, value)| out[k as usize] += factor * along * value.abs());
        });
    }

    /// Adds factor · (Σ a ⊗ b) v to `out`.
    pub(crate) fn add_product(&self, factor: f64, v: &[f64], out: &mut [f64]) {
        self.for_each_tangent(|left, right| {
            let along: f64 = right.iter().map(|&(k, value)| value * v[k as usize]).sum();
            if along != 0.0 {
                left.iter().for_each(|&(k, value)| out[k as usize] += factor * along * value);
            }
        });
    }

    /// Calls `each` with the factors a and b of each tangent, as free coordinates and values.
    pub(crate) fn for_each_tangent(&self, mut each: impl FnMut(&[(u32, f64)], &[(u32, f64)])) {
        let mut start = 0;
        for pair in self.ends.chunks_exact(2) {
            let [middle, end] = [pair[0] as usize, pair[1] as usize];
            each(&self.entries[start..middle], &self.entries[middle..end]);
            start = end;
        }
    }
}

/// Pulls a covector in space back to nodes that are not tied; calls `each` with each node and its entry in the node's own
/// axes.
pub(crate) fn pull_back(
    coordinates: &Coordinates,
    covector: &[(u32, [f64; 3])],
    mut each: impl FnMut(u32, [f64; 3]),
) {
    let mut each = |node: u32, value: [f64; 3]| each(node, in_own_axes(coordinates, node, value));
    for &(node, value) in covector {
        match coordinates.combination(node) {
            Some(terms) => {
                terms.iter().for_each(|&(k, weight)| each(k, value.map(|value| weight * value)));
            }
            None => each(node, value),
        }
    }
}

/// Returns the components of a vector in space along the own axes of a node.
pub(crate) fn in_own_axes(coordinates: &Coordinates, node: u32, vector: [f64; 3]) -> [f64; 3] {
    match coordinates.axes_of(node) {
        Some(axes) => axes.map(|axis| axis.iter().zip(vector).map(|(e, v)| e * v).sum()),
        None => vector,
    }
}
