//! Nodes whose place is a fixed weighted sum of other nodes, x_i = Σ_k w_ik x_k: a vertex on a surface, a seam, a
//! point of a rigid body. They are eliminated exactly, as prescribed coordinates are.
//!
//! A rigid body is the case that needs *directors*: in natural coordinates (P. Betsch, P. Steinmann,
//! "Constrained integration of rigid body dynamics", Comput. Methods Appl. Mech. Engrg. 191 (2001)
//! 467–488) its point with body coordinates X is x = c + X₁ d₁ + X₂ d₂ + X₃ d₃, linear in the place c
//! and the directors d_k. A director is a node of the arrays that turns as points do but is not moved
//! by translations. It has the dimension of the body coordinates' inverse times length: none.
//!
//! # How to tie nodes
//! ```
//! use vi_core::{Combination, Coordinates, TiedMass};
//! // Node 3 rides on the triangle of nodes 0, 1, 2; its mass is shared by the weights.
//! let tie = Combination { node: 3, terms: vec![(0, 0.2), (1, 0.3), (2, 0.5)], mass: TiedMass::Lumped };
//! // Node 5 is sewn to node 4; its mass joins that of node 4.
//! let seam = Combination { node: 5, terms: vec![(4, 1.0)], mass: TiedMass::Exact };
//! let coordinates = Coordinates::new(18, vec![])?.with_combinations(&[tie, seam], &[])?;
//! assert_eq!(coordinates.free_count(), 12);
//! # Ok::<(), vi_core::CoreError>(())
//! ```
//! Everything else follows: [`crate::System::new`] pulls the mass back, steppers pull gradients and
//! Hessians back, frames and probes read x. Terms go on naming the tied node.

use crate::error::CoreError;

/// Coordinates of a node that can be tied.
const BLOCK: usize = 3;

/// Distribution of the mass of a tied node.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum TiedMass {
    /// M = Sᵀ M S, which must come out diagonal (one term, or a body at its principal axes).
    Exact,
    /// Each node of the sum takes m_i w_ik: mass, and so linear momentum, is kept; m_i w_ik w_il is not.
    Lumped,
}

/// x_node = Σ w x_k over `terms` (k, w), for all three coordinates of the node.
#[derive(Debug, Clone, PartialEq)]
pub struct Combination {
    /// The node that is tied; it is no longer free.
    pub node: u32,
    /// The nodes that it is tied to, with weights. Weights on points sum to one; on directors they are
    /// free.
    pub terms: Vec<(u32, f64)>,
    /// Distribution of its mass.
    pub mass: TiedMass,
}

/// All tied nodes, with sums over nodes that are not tied themselves; in ascending order.
#[derive(Debug, Clone, Default)]
pub(crate) struct Combinations {
    nodes: Vec<u32>,
    /// Node `nodes[i]` is the sum of `terms[start[i]..start[i + 1]]`.
    start: Vec<usize>,
    terms: Vec<(u32, f64)>,
    /// Ties whose mass moves as it is to the nodes that they name, those before that are named by none.
    lumped: Vec<(u32, Vec<(u32, f64)>)>,
}

impl Combinations {
    /// # Errors
    /// [`CoreError::Coordinate`] where a node is out of range or tied twice, [`CoreError::Combination`]
    /// where nodes are tied to each other in a ring, or weights do not leave translations alone.
    pub(crate) fn new(
        node_count: usize,
        combinations: &[Combination],
        is_director: &[bool],
    ) -> Result<Self, CoreError> {
        let mut tie_of = vec![None; node_count];
        for combination in combinations {
            let named = std::iter::once(combination.node).chain(combination.terms.iter().map(|term| term.0));
            for node in named {
                if node as usize >= node_count {
                    return Err(out_of_range(node, node_count));
                }
            }
            let tie = &mut tie_of[combination.node as usize];
            if tie.is_some() {
                return Err(out_of_range(combination.node, node_count));
            }
            *tie = Some(combination);
        }
        let mut all = Self { start: vec![0], ..Self::default() };
        for tie in tie_of.iter().flatten() {
            let mut terms = Vec::new();
            resolve(&tie_of, tie, 1.0, 0, &mut terms)?;
            terms.sort_unstable_by_key(|term| term.0);
            terms.dedup_by(|next, kept| {
                let same = next.0 == kept.0;
                kept.1 += if same { next.1 } else { 0.0 };
                same
            });
            terms.retain(|term| term.1 != 0.0);
            let points = terms.iter().filter(|term| !is_director[term.0 as usize]).map(|term| term.1);
            let sum: f64 = points.sum();
            let expected = if is_director[tie.node as usize] { 0.0 } else { 1.0 };
            if !sum.is_finite() || (sum - expected).abs() > 1e-9 {
                return Err(CoreError::Combination {
                    node: tie.node as usize,
                    reason: format!("its weights on points sum to {sum}, must be {expected}"),
                });
            }
            all.nodes.push(tie.node);
            all.terms.extend(terms);
            all.start.push(all.terms.len());
        }
        all.lumped = lumped_order(combinations);
        Ok(all)
    }

    /// The tied nodes, ascending, each with its sum.
    pub(crate) fn iter(&self) -> impl Iterator<Item = (u32, &[(u32, f64)])> {
        let sums = self.start.windows(2).map(|range| &self.terms[range[0]..range[1]]);
        self.nodes.iter().copied().zip(sums)
    }

    /// The sum of a node, where it is tied.
    pub(crate) fn of(&self, node: u32) -> Option<&[(u32, f64)]> {
        let place = self.nodes.binary_search(&node).ok()?;
        Some(&self.terms[self.start[place]..self.start[place + 1]])
    }

    /// x_i ← Σ w x_k.
    pub(crate) fn embed(&self, x: &mut [f64]) {
        for (node, terms) in self.iter() {
            let mut sum = [0.0; BLOCK];
            for &(k, weight) in terms {
                for (sum, x) in sum.iter_mut().zip(&x[BLOCK * k as usize..]) {
                    *sum += weight * x;
                }
            }
            x[BLOCK * node as usize..][..BLOCK].copy_from_slice(&sum);
        }
    }

    /// g_k += w g_i, then g_i = 0.
    pub(crate) fn pull_back(&self, covector: &mut [f64]) {
        for (node, terms) in self.iter() {
            let own = &mut covector[BLOCK * node as usize..][..BLOCK];
            let value = [own[0], own[1], own[2]];
            own.fill(0.0);
            for &(k, weight) in terms {
                for (target, value) in covector[BLOCK * k as usize..].iter_mut().zip(value) {
                    *target += weight * value;
                }
            }
        }
    }

    /// The mass of what is free, from the mass of every coordinate: lumped ties hand theirs on, m_k += w m_i;
    /// of the others the diagonal of Sᵀ M S is taken.
    ///
    /// # Errors
    /// [`CoreError::Combination`] where that is not diagonal.
    pub(crate) fn pull_back_mass(
        &self,
        mass: &mut [f64],
        is_free: impl Fn(u32) -> bool,
    ) -> Result<(), CoreError> {
        for (node, terms) in &self.lumped {
            for axis in 0..BLOCK {
                let value = std::mem::take(&mut mass[BLOCK * *node as usize + axis]);
                for &(k, weight) in terms {
                    mass[BLOCK * k as usize + axis] += weight * value;
                }
            }
        }
        // What stands beside the diagonal, by pair of nodes; isotropic up to prescribed axes.
        let mut beside: std::collections::BTreeMap<(u32, u32), (f64, u32)> = Default::default();
        for (node, terms) in self.iter() {
            let own = &mut mass[BLOCK * node as usize..][..BLOCK];
            let value = [own[0], own[1], own[2]];
            own.fill(0.0);
            if value == [0.0; BLOCK] {
                continue;
            }
            for (j, &(k, w)) in terms.iter().enumerate() {
                for (target, value) in mass[BLOCK * k as usize..].iter_mut().zip(value) {
                    *target += w * w * value;
                }
                for &(l, other) in &terms[..j] {
                    beside.entry((l, k)).or_insert((0.0, node)).0 += value[0] * w * other;
                }
            }
        }
        // Between nodes that are both prescribed there is no motion to couple.
        for ((l, k), (value, node)) in beside.into_iter().filter(|((l, k), _)| is_free(*l) || is_free(*k)) {
            let scale = (mass[BLOCK * k as usize] * mass[BLOCK * l as usize]).sqrt();
            if value.abs() > 1e-9 * scale {
                return Err(CoreError::Combination {
                    node: node as usize,
                    reason: format!(
                        "the mass that it brings couples nodes {l} and {k} by {value:e} kg, beside a diagonal of \
                         {scale:e} kg; let its mass be lumped by the weights, or choose the origin and axes of its \
                         body principal"
                    ),
                });
            }
        }
        Ok(())
    }
}

/// Hands the masses (kg, one a node) of lumped ties, and of ties to one node alone, on to the nodes that
/// they name, as [`crate::System::new`] will: what other ties then find there.
///
/// Ties and nodes must be such as [`crate::Coordinates::with_combinations`] takes.
pub fn redistribute_lumped_mass(combinations: &[Combination], mass: &mut [f64]) {
    for (node, terms) in lumped_order(combinations) {
        let value = std::mem::take(&mut mass[node as usize]);
        for (k, weight) in terms {
            mass[k as usize] += weight * value;
        }
    }
}

/// The ties whose mass moves as it is, each before those that it names.
fn lumped_order(combinations: &[Combination]) -> Vec<(u32, Vec<(u32, f64)>)> {
    let moves = |tie: &&Combination| {
        tie.mass == TiedMass::Lumped || matches!(tie.terms[..], [(_, weight)] if weight == 1.0)
    };
    let ties: std::collections::BTreeMap<u32, &Combination> =
        combinations.iter().filter(moves).map(|tie| (tie.node, tie)).collect();
    let mut done = std::collections::BTreeSet::new();
    let mut order = Vec::new();
    for &node in ties.keys() {
        name_first(node, &ties, &mut done, &mut order);
    }
    order.reverse();
    order
}

/// Lists what a tie names, then the tie.
fn name_first(
    node: u32,
    ties: &std::collections::BTreeMap<u32, &Combination>,
    done: &mut std::collections::BTreeSet<u32>,
    order: &mut Vec<(u32, Vec<(u32, f64)>)>,
) {
    let Some(tie) = ties.get(&node) else { return };
    if done.insert(node) {
        for &(k, _) in &tie.terms {
            name_first(k, ties, done, order);
        }
        order.push((node, tie.terms.clone()));
    }
}

fn out_of_range(node: u32, count: usize) -> CoreError {
    CoreError::Coordinate { what: "tied nodes", dof: BLOCK * node as usize, count: BLOCK * count }
}

/// Adds `scale` times the sum of a tie, its terms that are tied themselves replaced by their sums.
fn resolve(
    tie_of: &[Option<&Combination>],
    tie: &Combination,
    scale: f64,
    depth: usize,
    out: &mut Vec<(u32, f64)>,
) -> Result<(), CoreError> {
    const DEEPEST: usize = 64;
    if depth > DEEPEST {
        return Err(CoreError::Combination {
            node: tie.node as usize,
            reason: "it is tied to itself through other nodes".to_owned(),
        });
    }
    for &(k, weight) in &tie.terms {
        match tie_of[k as usize] {
            Some(other) => resolve(tie_of, other, scale * weight, depth + 1, out)?,
            None => out.push((k, scale * weight)),
        }
    }
    Ok(())
}
