//! Discrete Shells (Grinspun, Hirani, Desbrun & Schröder 2003): V = Σ ½ k (|e|²/A)(θ − θ̄)², A the area
//! of the two triangles. It must not know stretching.
//!
//! k = h³/12 Q_mm, the bending modulus across the edge (for isotropic sheets D = E h³/(12(1 − ν²))).
//! With it, cylinders are right on equilateral triangles in every direction, and on right-angled ones
//! along their legs; in the direction α of `diagonal` the energy is 1 + sin 2α + sin² 2α times the
//! plate's, ¾ to 3. On equilateral triangles the model is an isotropic plate with ν = −1/3.

use std::ops::Range;

use vi_core::{Account, HessianKind, Potential, Stencils, Traits, packed_len};

use super::BentSheet;
use super::hinges::{Hinge, Opposite, hinges};
use crate::FemError;
use crate::dihedral;

pub(super) fn potentials(sheet: &BentSheet) -> Result<Vec<Box<dyn Potential>>, FemError> {
    Ok(from_hinges(sheet, &hinges(sheet)?))
}

/// One potential for pairs of triangles, one for held edges, where there are any.
pub(super) fn from_hinges<'a>(
    sheet: &BentSheet,
    hinges: impl IntoIterator<Item = &'a Hinge>,
) -> Vec<Box<dyn Potential>> {
    let offset = sheet.node_offset as u32;
    let new = |arity| Hinges { arity, nodes: Vec::new(), springs: Vec::new(), name: sheet.name.clone() };
    let (mut pairs, mut held) = (new(4), new(3));
    for hinge in hinges {
        let stiffness = across(sheet, hinge) * hinge.length.powi(2) / hinge.area();
        let (group, point) = match hinge.opposite {
            Opposite::Node(..) => (&mut pairs, None),
            Opposite::Held(point) => (&mut held, Some(point)),
        };
        group.nodes.extend(hinge.nodes.map(|node| node + offset));
        if let Opposite::Node(node, _) = hinge.opposite {
            group.nodes.push(node + offset);
        }
        group.springs.push(Spring { stiffness, rest_angle: hinge.rest_angle, point });
    }
    let some = |group: Hinges| (!group.springs.is_empty()).then(|| Box::new(group) as Box<dyn Potential>);
    some(pairs).into_iter().chain(some(held)).collect()
}

/// The bending modulus across the edge, (m ⊗ m):D:(m ⊗ m), N m, m normal to the edge in the plane of
/// the first triangle.
pub(super) fn across(sheet: &BentSheet, hinge: &Hinge) -> f64 {
    let (triangle, k) = (hinge.first.0 as usize, usize::from(hinge.first.1));
    let p = sheet.plane(triangle);
    let (a, b) = (p[(k + 1) % 3], p[(k + 2) % 3]);
    let length = (b[0] - a[0]).hypot(b[1] - a[1]);
    let m = [(b[1] - a[1]) / length, (a[0] - b[0]) / length];
    let strain = [m[0] * m[0], m[1] * m[1], 2.0 * m[0] * m[1]];
    (0..3).map(|i| (0..3).map(|j| strain[i] * sheet.moduli[i][j] * strain[j]).sum::<f64>()).sum()
}

struct Spring {
    /// k |e|²/A, J.
    stiffness: f64,
    rest_angle: f64,
    /// The fourth corner where it is held in space.
    point: Option<[f64; 3]>,
}

struct Hinges {
    arity: usize,
    nodes: Vec<u32>,
    springs: Vec<Spring>,
    name: String,
}

impl Hinges {
    fn corners(&self, index: usize, x: &[f64]) -> [[f64; 3]; 4] {
        let nodes = &self.nodes[index * self.arity..][..self.arity];
        std::array::from_fn(|k| match nodes.get(k) {
            Some(&node) => [0, 1, 2].map(|i| x[3 * node as usize + i]),
            None => self.springs[index].point.unwrap_or_default(),
        })
    }

    /// Moment k (|e|²/A)(θ − θ̄), J.
    fn moment(&self, index: usize, corners: &[[f64; 3]; 4]) -> f64 {
        self.springs[index].stiffness * (dihedral::angle(corners) - self.springs[index].rest_angle)
    }

    fn hessian(&self, index: usize, corners: &[[f64; 3]; 4], moment: f64, out: &mut [f64]) {
        let slope = dihedral::gradient(corners);
        let curvature = if moment == 0.0 { [[0.0; 12]; 12] } else { dihedral::hessian(corners) };
        let stiffness = self.springs[index].stiffness;
        let mut k = 0;
        for row in 0..3 * self.arity {
            for column in 0..=row {
                let square = slope[row / 3][row % 3] * slope[column / 3][column % 3];
                out[k] = stiffness * square + moment * curvature[row][column];
                k += 1;
            }
        }
    }
}

impl Potential for Hinges {
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
        Traits { hessian: HessianKind::Varying, time_dependent: false }
    }

    fn energies(&self, range: Range<usize>, x: &[f64], _t: f64, out: &mut [f64]) {
        for (index, out) in range.zip(out) {
            let spring = &self.springs[index];
            let turn = dihedral::angle(&self.corners(index, x)) - spring.rest_angle;
            *out = 0.5 * spring.stiffness * turn * turn;
        }
    }

    fn gradients(&self, range: Range<usize>, x: &[f64], _t: f64, out: &mut [f64]) {
        for (index, out) in range.zip(out.chunks_exact_mut(3 * self.arity)) {
            let corners = self.corners(index, x);
            let moment = self.moment(index, &corners);
            let slope = dihedral::gradient(&corners);
            for (out, slope) in out.iter_mut().zip(slope.as_flattened()) {
                *out = moment * slope;
            }
        }
    }

    fn hessians(&self, range: Range<usize>, x: &[f64], _t: f64, out: &mut [f64]) {
        for (index, out) in range.zip(out.chunks_exact_mut(packed_len(3 * self.arity))) {
            let corners = self.corners(index, x);
            self.hessian(index, &corners, self.moment(index, &corners), out);
        }
    }

    /// The part ∂θ ⊗ ∂θ, which is never negative, alone.
    fn projected_hessians(&self, range: Range<usize>, x: &[f64], _t: f64, out: &mut [f64]) {
        for (index, out) in range.zip(out.chunks_exact_mut(packed_len(3 * self.arity))) {
            self.hessian(index, &self.corners(index, x), 0.0, out);
        }
    }
}
