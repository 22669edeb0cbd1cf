//! Ties: springs between a node and either a weighted mean of nodes (a point of a surface, or another node) or a
//! point of space that may move.

use std::collections::BTreeMap;
use std::ops::Range;

use vi_core::{Account, HessianKind, Potential, Stencils, Traits, packed_len};

use crate::error::FemError;
use crate::path::motion::Motion;
use crate::small::tensor::dot;

/// The end of a tie that is not its own node.
#[derive(Debug, Clone, PartialEq)]
pub enum Anchor {
    /// The weighted mean y = Σ weight × node.
    Nodes(Vec<(u32, f64)>),
    /// A point of space (m) that is fixed, or that follows a motion.
    Place([f64; 3], Option<Motion>),
}

/// The spring V = ½ k (|x − y| − L)². It is quadratic if L = 0 and y does not move by itself.
#[derive(Debug, Clone, PartialEq)]
pub struct Tie {
    /// The node at x.
    pub node: u32,
    /// The point y.
    pub anchor: Anchor,
    /// Stiffness k, N/m.
    pub stiffness: f64,
    /// Length L of the spring at zero force, m.
    pub length: f64,
}

/// Returns the potentials of ties. Ties share a potential if they have equally many nodes and agree in whether L = 0
/// and whether their point moves.
///
/// # Errors
/// Returns [`FemError::Parameter`] for k ≤ 0 or L < 0; [`FemError::Invalid`] for a node tied to itself.
pub fn ties(ties: &[Tie], name: &str) -> Result<Vec<Box<dyn Potential>>, FemError> {
    let mut groups: BTreeMap<(usize, bool, bool), Ties> = BTreeMap::new();
    for tie in ties {
        if !(tie.stiffness > 0.0 && tie.stiffness.is_finite()) {
            let requirement = "the stiffness of a tie must be positive (N/m)";
            return Err(FemError::Parameter { key: "stiffness", value: tie.stiffness, requirement });
        }
        if !(tie.length >= 0.0 && tie.length.is_finite()) {
            let requirement = "the length of a tie must not be negative (m)";
            return Err(FemError::Parameter { key: "length", value: tie.length, requirement });
        }
        let (targets, place, motion) = match &tie.anchor {
            Anchor::Nodes(targets) => (&targets[..], [0.0; 3], None),
            Anchor::Place(place, motion) => (&[][..], *place, motion.clone()),
        };
        if targets.iter().any(|(node, _)| *node == tie.node) {
            let problem = format!("node {} cannot be tied to itself: choose another anchor", tie.node);
            return Err(FemError::Invalid { what: "tie", problem });
        }
        let arity = 1 + targets.len();
        let group = groups.entry((arity, tie.length == 0.0, motion.is_some())).or_insert_with(|| Ties {
            name: name.into(),
            arity,
            nodes: Vec::new(),
            factors: Vec::new(),
            springs: Vec::new(),
        });
        group.nodes.push(tie.node);
        group.factors.push(1.0);
        for &(node, weight) in targets {
            group.nodes.push(node);
            group.factors.push(-weight);
        }
        group.springs.push(Spring { stiffness: tie.stiffness, length: tie.length, place, motion });
    }
    Ok(groups.into_values().map(|group| Box::new(group) as Box<dyn Potential>).collect())
}

struct Spring {
    stiffness: f64,
    length: f64,
    place: [f64; 3],
    motion: Option<Motion>,
}

/// Ties with equally many nodes each, which agree in whether L = 0 and whether their point moves.
struct Ties {
    name: String,
    arity: usize,
    nodes: Vec<u32>,
    /// The coefficients c_a in d = Σ c_a x_a − place: 1 for the tied node, −weight for the others.
    factors: Vec<f64>,
    springs: Vec<Spring>,
}

impl Ties {
    /// Returns d = x − y (m) and the coefficients of its nodes.
    fn arm(&self, tie: usize, x: &[f64], t: f64) -> ([f64; 3], &[f64]) {
        let range = tie * self.arity..(tie + 1) * self.arity;
        let (nodes, factors) = (&self.nodes[range.clone()], &self.factors[range]);
        let spring = &self.springs[tie];
        let place = match &spring.motion {
            Some(motion) => motion.position(spring.place, t),
            None => spring.place,
        };
        let origin = &x[3 * nodes[0] as usize..][..3];
        let d = [0, 1, 2].map(|i| {
            if self.arity == 1 {
                return origin[i] - place[i];
            }
            // The coefficients sum to zero: form differences of positions, so that round-off does not grow with the
            // distance from the origin.
            let others = nodes[1..].iter().zip(&factors[1..]);
            others.map(|(&node, c)| c * (x[3 * node as usize + i] - origin[i])).sum::<f64>()
        });
        (d, factors)
    }

    fn block(&self, tie: usize, x: &[f64], t: f64, is_projected: bool, out: &mut [f64]) {
        let (d, factors) = self.arm(tie, x, t);
        let Spring { stiffness, length, .. } = self.springs[tie];
        let square = dot(d, d);
        // The block is k (1 − L/|d|) I + k L/|d|³ d ⊗ d; k I if |d| = 0.
        let slack = if square > 0.0 { length / square.sqrt() } else { 0.0 };
        let straight = if is_projected { (1.0 - slack).max(0.0) } else { 1.0 - slack };
        let along = if square > 0.0 { (1.0 - straight) / square } else { 0.0 };
        let mut k = 0;
        for row in 0..3 * self.arity {
            for column in 0..=row {
                let (i, j) = (row % 3, column % 3);
                let entry = along * d[i] * d[j] + if i == j { straight } else { 0.0 };
                out[k] = stiffness * factors[row / 3] * factors[column / 3] * entry;
                k += 1;
            }
        }
    }
}

impl Potential for Ties {
    fn name(&self) -> &str {
        &self.name
    }

    fn account(&self) -> Account {
        Account::Elastic
    }

    fn stencils(&self) -> Stencils<'_> {
        Stencils { arity: self.arity, block: 3, nodes: &self.nodes }
    }

    fn traits(&self) -> Traits {
        let spring = self.springs.first();
        let is_linear = spring.is_some_and(|spring| spring.length == 0.0);
        Traits {
            hessian: if is_linear { HessianKind::Constant } else { HessianKind::Varying },
            time_dependent: spring.is_some_and(|spring| spring.motion.is_some()),
        }
    }

    fn energies(&self, range: Range<usize>, x: &[f64], t: f64, out: &mut [f64]) {
        for (tie, out) in range.zip(out) {
            let (d, _) = self.arm(tie, x, t);
            *out = 0.5 * self.springs[tie].stiffness * (dot(d, d).sqrt() - self.springs[tie].length).powi(2);
        }
    }

    /// Writes k (1 − L/|d|) d c_a. If |d| = 0 the direction is undefined, and the force is set to zero.
    fn gradients(&self, range: Range<usize>, x: &[f64], t: f64, out: &mut [f64]) {
        for (tie, out) in range.zip(out.chunks_exact_mut(3 * self.arity)) {
            let (d, factors) = self.arm(tie, x, t);
            let Spring { stiffness, length, .. } = self.springs[tie];
            let norm = dot(d, d).sqrt();
            let pull = stiffness * if norm > 0.0 { 1.0 - length / norm } else { 0.0 };
            for (out, c) in out.chunks_exact_mut(3).zip(factors) {
                for i in 0..3 {
                    out[i] = pull * c * d[i];
                }
            }
        }
    }

    fn hessians(&self, range: Range<usize>, x: &[f64], t: f64, out: &mut [f64]) {
        for (tie, out) in range.zip(out.chunks_exact_mut(packed_len(3 * self.arity))) {
            self.block(tie, x, t, false, out);
        }
    }

    /// Drops the negative transverse stiffness of a compressed spring.
    fn projected_hessians(&self, range: Range<usize>, x: &[f64], t: f64, out: &mut [f64]) {
        for (tie, out) in range.zip(out.chunks_exact_mut(packed_len(3 * self.arity))) {
            self.block(tie, x, t, true, out);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn samples() -> Vec<Box<dyn Potential>> {
        let motion: Motion =
            serde_json::from_str(r#"{ "kind": "rotate", "axis": [0, 0, 1], "rate": 2.0 }"#).unwrap();
        let on_facet = || Anchor::Nodes(vec![(1, 0.2), (2, 0.5), (3, 0.3)]);
        let list = [
            Tie { node: 0, anchor: on_facet(), stiffness: 30.0, length: 0.0 },
            Tie { node: 0, anchor: on_facet(), stiffness: 20.0, length: 0.4 },
            Tie { node: 4, anchor: Anchor::Nodes(vec![(2, 1.0)]), stiffness: 10.0, length: 5.0 },
            Tie {
                node: 4,
                anchor: Anchor::Place([1.0, 0.5, 0.2], Some(motion)),
                stiffness: 7.0,
                length: 0.1,
            },
            Tie { node: 1, anchor: Anchor::Place([1.0, 0.5, 0.2], None), stiffness: 7.0, length: 0.0 },
        ];
        ties(&list, "ties").unwrap()
    }

    fn positions() -> Vec<f64> {
        (0..15).map(|k| (f64::from(k) * 1.7).sin()).collect()
    }

    #[test]
    fn derivatives_are_those_of_the_energy() {
        let (x, t, e) = (positions(), 0.3, 1e-6);
        for term in samples() {
            let size = term.stencils().size();
            let mut hessian = vec![0.0; packed_len(size)];
            let mut projected = hessian.clone();
            term.hessians(0..1, &x, t, &mut hessian);
            term.projected_hessians(0..1, &x, t, &mut projected);
            let gradient = |x: &[f64]| {
                let mut out = vec![0.0; size];
                term.gradients(0..1, x, t, &mut out);
                out
            };
            let energy = |x: &[f64]| {
                let mut out = [0.0];
                term.energies(0..1, x, t, &mut out);
                out[0]
            };
            for n in 0..size {
                let dof = 3 * term.stencils().of(0)[n / 3] as usize + n % 3;
                let moved = |h: f64| {
                    let mut x = x.clone();
                    x[dof] += h;
                    x
                };
                let (plus, minus) = (moved(e), moved(-e));
                assert!(((energy(&plus) - energy(&minus)) / (2.0 * e) - gradient(&x)[n]).abs() < 1e-7);
                let slope: Vec<f64> =
                    gradient(&plus).iter().zip(gradient(&minus)).map(|(a, b)| (a - b) / (2.0 * e)).collect();
                for m in 0..=n {
                    assert!((slope[m] - hessian[n * (n + 1) / 2 + m]).abs() < 1e-6);
                }
            }
            let full = nalgebra::DMatrix::from_fn(size, size, |i, j| {
                projected[i.max(j) * (i.max(j) + 1) / 2 + i.min(j)]
            });
            assert!(full.symmetric_eigenvalues().min() > -1e-12);
        }
    }

    #[test]
    fn forces_between_nodes_have_no_sum_and_no_torque() {
        let x = positions();
        for term in samples().iter().filter(|term| term.stencils().arity > 1) {
            let mut gradient = vec![0.0; term.stencils().size()];
            term.gradients(0..1, &x, 0.0, &mut gradient);
            let (mut force, mut torque) = ([0.0; 3], [0.0; 3]);
            for (g, &node) in gradient.chunks_exact(3).zip(term.stencils().of(0)) {
                let p = &x[3 * node as usize..][..3];
                for i in 0..3 {
                    let (j, k) = ((i + 1) % 3, (i + 2) % 3);
                    force[i] += g[i];
                    torque[i] += p[j] * g[k] - p[k] * g[j];
                }
            }
            assert!(force.iter().chain(&torque).all(|c| c.abs() < 1e-13), "{force:?} {torque:?}");
        }
    }

    #[test]
    fn a_tie_that_cannot_be_is_refused() {
        let tie = Tie { node: 0, anchor: Anchor::Nodes(vec![(0, 1.0)]), stiffness: 1.0, length: 0.0 };
        assert!(ties(std::slice::from_ref(&tie), "t").err().unwrap().to_string().contains("tied to itself"));
        let weak = Tie { node: 1, stiffness: 0.0, ..tie };
        assert!(ties(&[weak], "t").err().unwrap().to_string().contains("stiffness"));
    }
}
