//! Tied nodes: their positions are fixed weighted sums of other nodes, x_i = Σ_k w_ik x_k. Examples are a vertex
//! attached to a surface, a seam and a point of a rigid body. Tied nodes are eliminated exactly, as prescribed
//! coordinates are.
//!
//! Rigid bodies need *directors*. In natural coordinates (P. Betsch, P. Steinmann, "Constrained integration of rigid
//! body dynamics", Comput. Methods Appl. Mech. Engrg. 191 (2001) 467–488) the point of a body with body coordinates X
//! has the position x = c + X₁ d₁ + X₂ d₂ + X₃ d₃, which is linear in the reference point c and the directors d_k. A
//! director is stored like a node. It rotates as points do, but translations do not move it. The components of d_k
//! are dimensionless if X is in metres.
//!
//! # How to tie nodes
//! ```
//! use vi_core::{Combination, Coordinates, TiedMass};
//! // Node 3 is attached to the triangle of nodes 0, 1, 2, which share its mass by the weights.
//! let tie = Combination { node: 3, terms: vec![(0, 0.2), (1, 0.3), (2, 0.5)], mass: TiedMass::Lumped };
//! // Node 5 is sewn to node 4, and its mass is added to that of node 4.
//! let seam = Combination { node: 5, terms: vec![(4, 1.0)], mass: TiedMass::Exact };
//! let coordinates = Coordinates::new(18, vec![])?.with_combinations(&[tie, seam], &[])?;
//! assert_eq!(coordinates.free_count(), 12);
//! # Ok::<(), vi_core::CoreError>(())
//! ```
//! The rest is automatic: [`crate::System::new`] pulls the mass back, steppers pull gradients and Hessians back,
//! frames and probes read x. Terms still refer to the tied node.

use crate::error::CoreError;

/// Coordinates of a node that can be tied.
const BLOCK: usize = 3;

/// Distribution of the mass of a tied node.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum TiedMass {
    /// M = Sᵀ M S. It must be diagonal: a tie to one node, or a body at its principal axes.
    Exact,
    /// Each node k of the sum receives the mass m_i w_ik. This conserves mass and linear momentum; the products m_i
    /// w_ik w_il are dropped.
    Lumped,
}

/// x_node = Σ w x_k over `terms` (k, w), for all three coordinates of the node.
#[derive(Debug, Clone, PartialEq)]
pub struct Combination {
    /// The tied node; it is no longer free.
    pub node: u32,
    /// Pairs (node, weight) to which the node is tied. The weights of points sum to one; the weights of directors are
    /// arbitrary.
    pub terms: Vec<(u32, f64)>,
    /// Distribution of the mass of the tied node.
    pub mass: TiedMass,
}

/// All tied nodes in ascending order, each with its sum over nodes that are not tied themselves.
#[derive(Debug, Clone, Default)]
pub(crate) struct Combinations {
    nodes: Vec<u32>,
    /// Node `nodes[i]` is the sum of `terms[start[i]..start[i + 1]]`.
    start: Vec<usize>,
    terms: Vec<(u32, f64)>,
    /// Ties whose whole mass moves to the nodes of their sums. A tie precedes all ties that it refers to.
    lumped: Vec<(u32, Vec<(u32, f64)>)>,
}

impl Combinations {
    /// # Errors
    /// Returns [`CoreError::Coordinate`] if a node is out of range or tied twice, [`CoreError::Combination`] if ties
    /// form a cycle or the weights do not preserve translations.
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
                    reason: format!("the weights of its points sum to {sum}; the sum must be {expected}"),
                });
            }
            all.nodes.push(tie.node);
            all.terms.extend(terms);
            all.start.push(all.terms.len());
        }
        all.lumped = lumped_order(combinations);
        Ok(all)
    }

    /// Returns the tied nodes in ascending order, each with its sum.
    pub(crate) fn iter(&self) -> impl Iterator<Item = (u32, &[(u32, f64)])> {
        let sums = self.start.windows(2).map(|range| &self.terms[range[0]..range[1]]);
        self.nodes.iter().copied().zip(sums)
    }

    /// Returns the sum of a node, if it is tied.
    pub(crate) fn of(&self, node: u32) -> Option<&[(u32, f64)]> {
        let place = self.nodes.binary_search(&node).ok()?;
        Some(&self.terms[self.start[place]..self.start[place + 1]])
    }

    /// Sets the tied nodes: x_i ← Σ w x_k.
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

    /// Adds g_k += w g_i, then sets g_i = 0, for each tied node i.
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

    /// Replaces the mass of every coordinate by that of the free ones. Lumped ties distribute their mass, m_k += w
    /// m_i; the others contribute the diagonal of Sᵀ M S.
    ///
    /// # Errors
    /// Returns [`CoreError::Combination`] if Sᵀ M S is not diagonal.
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
        // Off-diagonal entries by pair of nodes. One number is enough because masses are isotropic (except along
        // prescribed axes).
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
        // Two prescribed nodes have no free motion that could be coupled.
        for ((l, k), (value, node)) in beside.into_iter().filter(|((l, k), _)| is_free(*l) || is_free(*k)) {
            let scale = (mass[BLOCK * k as usize] * mass[BLOCK * l as usize]).sqrt();
            if value.abs() > 1e-9 * scale {
                return Err(CoreError::Combination {
                    node: node as usize,
                    reason: format!(
                        "its mass couples nodes {l} and {k} by {value:e} kg, with a diagonal of {scale:e} kg; lump its \
                         mass by the weights, or choose the principal origin and axes of its body"
                    ),
                });
            }
        }
        Ok(())
    }
}

/// Moves the masses (kg, one per node) of lumped ties, and of ties to a single node, to the nodes that they refer to,
/// as [`crate::System::new`] does. The result is the mass that the remaining ties see at each node.
///
/// Ties and nodes must satisfy the conditions of [`crate::Coordinates::with_combinations`].
pub fn redistribute_lumped_mass(combinations: &[Combination], mass: &mut [f64]) {
    for (node, terms) in lumped_order(combinations) {
        let value = std::mem::take(&mut mass[node as usize]);
        for (k, weight) in terms {
            mass[k as usize] += weight * value;
        }
    }
}

/// Returns the ties whose whole mass moves, each before those that it refers to.
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

/// Appends the ties that a tie refers to, then the tie itself.
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

/// Adds `scale` times the sum of a tie; nodes that are tied themselves are replaced by their sums.
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
