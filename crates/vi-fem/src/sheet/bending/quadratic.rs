//! Isometric bending (Bergou, Wardetzky, Harmon, Zorin & Grinspun 2006). The energy is quadratic in x, so its Hessian
//! is computed once.
//!
//! V = Σ ½ k (|e|²/A) |[∂x/∂m]|², where [∂x/∂m] is the jump of the slope across the edge. For a sheet that does not
//! stretch its length is 2 sin(θ/2). The modulus k and the dependence on the mesh are those of `hinge`. Rest shapes
//! are flat. On the far side of a held edge the slope is that of the support.

use std::ops::Range;

use vi_core::{Account, HessianKind, Potential, Stencils, Traits, packed_len};

use super::hinge::across;
use super::hinges::{Opposite, hinges};
use super::sheet::BentSheet;
use crate::error::FemError;

pub(super) fn potentials(sheet: &BentSheet) -> Result<Vec<Box<dyn Potential>>, FemError> {
    let offset = sheet.node_offset as u32;
    let new = |arity| Jumps { arity, nodes: Vec::new(), terms: Vec::new(), name: sheet.name.clone() };
    let (mut pairs, mut held) = (new(4), new(3));
    for hinge in hinges(sheet)? {
        if hinge.rest_angle.abs() > 1e-6 {
            return Err(FemError::Invalid {
                what: "bending",
                problem: format!(
                    "\"quadratic\" is for sheets that are flat at rest, but element {} and its neighbour \
                     meet at {:.3} rad; use \"hinge\" or \"shell\", or write rest = \"flat\"",
                    sheet.surface.cells[hinge.first.0 as usize], hinge.rest_angle
                ),
            });
        }
        let stiffness = across(sheet, &hinge) * hinge.length.powi(2) / hinge.area();
        let [height, far_height] = hinge.heights;
        let near = |foot: f64, height: f64| {
            let s = foot / hinge.length;
            [-(0.5 - s) / height, -(0.5 + s) / height]
        };
        let one = near(hinge.feet[0], height);
        match hinge.opposite {
            Opposite::Node(node, _) => {
                let two = near(hinge.feet[1], far_height);
                let weights = [one[0] + two[0], one[1] + two[1], 1.0 / height, 1.0 / far_height];
                pairs.nodes.extend(hinge.nodes.map(|node| node + offset));
                pairs.nodes.push(node + offset);
                pairs.terms.push(Jump { stiffness, weights, constant: [0.0; 3], normal: [0.0; 3] });
            }
            Opposite::Held(vector) => {
                // The slope of the support is the unit vector along its height.
                let constant = vector.map(|v| v / far_height);
                held.nodes.extend(hinge.nodes.map(|node| node + offset));
                let weights = [one[0], one[1], 1.0 / height, 0.0];
                held.terms.push(Jump { stiffness, weights, constant, normal: [0.0; 3] });
            }
            Opposite::Mirror(vector) => {
                // The slope and its mirror image differ by twice the component in the mirror plane. The sheet takes
                // half of their energy.
                let length = crate::small::tensor::dot(vector, vector).sqrt();
                held.nodes.extend(hinge.nodes.map(|node| node + offset));
                let weights = [one[0], one[1], 1.0 / height, 0.0];
                let normal = vector.map(|v| v / length);
                held.terms.push(Jump { stiffness, weights, constant: [0.0; 3], normal });
            }
        }
    }
    let some = |group: Jumps| (!group.terms.is_empty()).then(|| Box::new(group) as Box<dyn Potential>);
    Ok(some(pairs).into_iter().chain(some(held)).collect())
}

/// The energy ½ stiffness |P (Σ weights x + constant)|² with P = I − n ⊗ n; `normal` n is a unit vector or zero.
struct Jump {
    /// Stiffness, J.
    stiffness: f64,
    /// Weights, 1/m; they sum to zero over the corners of two triangles.
    weights: [f64; 4],
    constant: [f64; 3],
    normal: [f64; 3],
}

struct Jumps {
    arity: usize,
    nodes: Vec<u32>,
    terms: Vec<Jump>,
    name: String,
}

impl Jumps {
    fn jump(&self, index: usize, x: &[f64]) -> [f64; 3] {
        let Jump { weights, constant, normal, .. } = &self.terms[index];
        let nodes = &self.nodes[index * self.arity..][..self.arity];
        let whole = [0, 1, 2].map(|i| {
            // Form differences to the first corner, so that round-off does not grow with the distance from the
            // origin. This is exact for held edges too: their weights also sum to zero, because the constant is a
            // vector.
            let origin = x[3 * nodes[0] as usize + i];
            let from_origin = nodes.iter().zip(weights).map(|(&n, w)| w * (x[3 * n as usize + i] - origin));
            from_origin.sum::<f64>() + constant[i]
        });
        let across = crate::small::tensor::dot(whole, *normal);
        [0, 1, 2].map(|i| whole[i] - across * normal[i])
    }
}

impl Potential for Jumps {
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
        Traits { hessian: HessianKind::Constant, time_dependent: false }
    }

    fn held_edge(&self, stencil: usize) -> Option<[u32; 2]> {
        let nodes = self.stencils().of(stencil);
        (self.arity == 3).then(|| [nodes[0], nodes[1]])
    }

    fn energies(&self, range: Range<usize>, x: &[f64], _t: f64, out: &mut [f64]) {
        for (index, out) in range.zip(out) {
            let jump = self.jump(index, x);
            *out = 0.5 * self.terms[index].stiffness * crate::small::tensor::dot(jump, jump);
        }
    }

    fn gradients(&self, range: Range<usize>, x: &[f64], _t: f64, out: &mut [f64]) {
        for (index, out) in range.zip(out.chunks_exact_mut(3 * self.arity)) {
            let Jump { stiffness, weights, .. } = &self.terms[index];
            let jump = self.jump(index, x);
            for (out, weight) in out.chunks_exact_mut(3).zip(weights) {
                for i in 0..3 {
                    out[i] = stiffness * weight * jump[i];
                }
            }
        }
    }

    fn hessians(&self, range: Range<usize>, _x: &[f64], _t: f64, out: &mut [f64]) {
        for (index, out) in range.zip(out.chunks_exact_mut(packed_len(3 * self.arity))) {
            let Jump { stiffness, weights, normal, .. } = &self.terms[index];
            let mut k = 0;
            for row in 0..3 * self.arity {
                for column in 0..=row {
                    let (i, j) = (row % 3, column % 3);
                    let projection = f64::from(i == j) - normal[i] * normal[j];
                    out[k] = projection * stiffness * weights[row / 3] * weights[column / 3];
                    k += 1;
                }
            }
        }
    }

    /// Writes the Hessians unchanged: a sum of squares is never negative.
    fn projected_hessians(&self, range: Range<usize>, x: &[f64], t: f64, out: &mut [f64]) {
        self.hessians(range, x, t, out);
    }
}
