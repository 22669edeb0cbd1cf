//! Kirchhoff–Love bending on any triangulation from positions alone:
//! V = Σ_T ½ A (κ − κ̄):D:(κ − κ̄), κ Morley's curvature of the triangle, a linear function of the angles
//! of the hinges at and next to it (see `reconstruction`). It must not know stretching.
//!
//! Chosen over mid-edge normals with a degree of freedom an edge (Grinspun, Gingold, Reisman & Zorin
//! 2006), whose rotations would need a made-up inertia in explicit schemes; over rotation-free patches
//! with averaged normals (BST, EBST: Oñate & Zárate 2000; Flores & Oñate 2005), which do not converge on
//! unstructured meshes; and over C⁰ interior penalty, which needs quadratic triangles and a parameter.
//! A function of angles is objective, needs no rotations, and has no force at a curved rest shape.
//! At free edges the turn is eliminated by M_mm = 0. Where more than two triangles meet, every pair
//! bends as a hinge.

use std::collections::BTreeMap;
use std::ops::Range;

use nalgebra::{Matrix3, Vector3};
use vi_core::{Account, HessianKind, Potential, Stencils, Traits, packed_len};

use super::BentSheet;
use super::hinge::from_hinges;
use super::hinges::{Hinge, Opposite, hinges};
use super::reconstruction::{Turn, edge_frames, turns};
use crate::FemError;
use crate::dihedral;

pub(super) fn potentials(sheet: &BentSheet) -> Result<Vec<Box<dyn Potential>>, FemError> {
    let hinges = hinges(sheet)?;
    let turns = turns(sheet, &hinges);
    // A stencil is the triangle and the nodes of its hinges, 4 to 12: one potential for each number.
    let mut groups: BTreeMap<usize, Patches> = BTreeMap::new();
    for (triangle, turns) in turns.iter().enumerate() {
        let forms = forms(sheet, triangle, turns);
        if forms.is_empty() {
            continue;
        }
        let mut nodes: Vec<u32> = sheet.surface.triangles[triangle].to_vec();
        let bends =
            forms.iter().map(|(&hinge, form)| bend(&hinges[hinge as usize], form, &mut nodes)).collect();
        let group = groups.entry(nodes.len()).or_insert_with(|| Patches {
            arity: nodes.len(),
            nodes: Vec::new(),
            patches: Vec::new(),
            name: sheet.name.clone(),
        });
        group.nodes.extend(nodes.iter().map(|node| node + sheet.node_offset as u32));
        group.patches.push(bends);
    }
    let branches = from_hinges(sheet, hinges.iter().filter(|hinge| !hinge.is_single));
    Ok(groups.into_values().map(|group| Box::new(group) as Box<dyn Potential>).chain(branches).collect())
}

/// Three linear forms in hinge angles, y, with V_T = ½ |y|²: the coefficients of each hinge, √J.
///
/// With B_ij = A (2/hᵢ)(2/hⱼ) (mᵢ⊗mᵢ):D:(mⱼ⊗mⱼ), V_T = ½ φᵀBφ; free turns leave it by their Schur
/// complement, and y = Lᵀφ with LLᵀ = B of those that remain.
fn forms(sheet: &BentSheet, triangle: usize, turns: &[Turn; 3]) -> BTreeMap<u32, [f64; 3]> {
    let p = sheet.plane(triangle);
    let (gradients, area) = crate::membrane::barycentric_gradients(&p);
    let frames = edge_frames(&p);
    let moduli = Matrix3::from_fn(|i, j| sheet.moduli[i][j]);
    let curvature = [0, 1, 2].map(|k| {
        let [_, m] = frames[k];
        let height = 1.0 / gradients[k][0].hypot(gradients[k][1]);
        Vector3::new(m[0] * m[0], m[1] * m[1], 2.0 * m[0] * m[1]) * (2.0 / height)
    });
    let mut b = Matrix3::from_fn(|i, j| area * curvature[i].dot(&(moduli * curvature[j])));
    for free in (0..3).filter(|&k| turns[k].is_none()) {
        let column = b.column(free).into_owned();
        b -= column * column.transpose() / column[free];
        // Round-off of the eliminated row; a unit pivot keeps the factor of the rest.
        b.set_row(free, &nalgebra::RowVector3::zeros());
        b.set_column(free, &Vector3::zeros());
        b[(free, free)] = 1.0;
    }
    let mut forms: BTreeMap<u32, [f64; 3]> = BTreeMap::new();
    let Some(factor) = b.cholesky() else { return forms };
    let lower = factor.l();
    for (k, turn) in turns.iter().enumerate() {
        for &(hinge, coefficient) in turn.iter().flatten() {
            let form = forms.entry(hinge).or_default();
            for row in 0..3 {
                form[row] += lower[(k, row)] * coefficient;
            }
        }
    }
    forms.retain(|_, form| form.iter().any(|&c| c != 0.0));
    forms
}

/// A hinge of a patch.
struct Bend {
    /// Its corners in the stencil; the fourth is past the end where it is held in space.
    corners: [u8; 4],
    point: [f64; 3],
    rest_angle: f64,
    /// Its coefficients in the three forms, √J.
    form: [f64; 3],
}

fn bend(hinge: &Hinge, form: &[f64; 3], nodes: &mut Vec<u32>) -> Bend {
    let mut local = |node: u32| {
        nodes.iter().position(|&other| other == node).unwrap_or_else(|| {
            nodes.push(node);
            nodes.len() - 1
        }) as u8
    };
    let [a, b, c] = hinge.nodes.map(&mut local);
    let (d, point) = match hinge.opposite {
        Opposite::Node(node, _) => (local(node), [0.0; 3]),
        Opposite::Held(point) => (u8::MAX, point),
    };
    Bend { corners: [a, b, c, d], point, rest_angle: hinge.rest_angle, form: *form }
}

/// The triangles whose stencils have `arity` nodes.
struct Patches {
    arity: usize,
    nodes: Vec<u32>,
    patches: Vec<Vec<Bend>>,
    name: String,
}

/// Most coordinates a stencil can have.
const MOST: usize = 36;

impl Patches {
    fn corners(&self, patch: usize, bend: &Bend, x: &[f64]) -> [[f64; 3]; 4] {
        let nodes = &self.nodes[patch * self.arity..][..self.arity];
        bend.corners.map(|corner| match nodes.get(usize::from(corner)) {
            Some(&node) => [0, 1, 2].map(|i| x[3 * node as usize + i]),
            None => bend.point,
        })
    }

    /// The three forms y, √J.
    fn forms(&self, patch: usize, x: &[f64]) -> [f64; 3] {
        let mut y = [0.0; 3];
        for bend in &self.patches[patch] {
            let turn = dihedral::angle(&self.corners(patch, bend, x)) - bend.rest_angle;
            for (y, c) in y.iter_mut().zip(bend.form) {
                *y += c * turn;
            }
        }
        y
    }

    /// Σ_k ∂y_k ⊗ ∂y_k, and with `moments` also Σ y_k ∂²y_k.
    fn hessian(&self, patch: usize, x: &[f64], moments: Option<[f64; 3]>, out: &mut [f64]) {
        let size = 3 * self.arity;
        let mut slopes = [[0.0; MOST]; 3];
        let mut full = [[0.0; MOST]; MOST];
        for bend in &self.patches[patch] {
            let corners = self.corners(patch, bend, x);
            let slope = dihedral::gradient(&corners);
            let places = bend.corners.map(|corner| 3 * usize::from(corner));
            let inside = if places[3] < size { 4 } else { 3 };
            for (corner, &place) in places[..inside].iter().enumerate() {
                for i in 0..3 {
                    for (line, c) in slopes.iter_mut().zip(bend.form) {
                        line[place + i] += c * slope[corner][i];
                    }
                }
            }
            let Some(y) = moments else { continue };
            let moment = crate::tensor::dot(y, bend.form);
            let curvature = dihedral::hessian(&corners);
            for n in 0..3 * inside {
                let line = &mut full[places[n / 3] + n % 3];
                for m in 0..3 * inside {
                    line[places[m / 3] + m % 3] += moment * curvature[n][m];
                }
            }
        }
        let mut k = 0;
        for row in 0..size {
            let [a, b, c] = [0, 1, 2].map(|form| slopes[form][row]);
            for column in 0..=row {
                let squares = a * slopes[0][column] + b * slopes[1][column] + c * slopes[2][column];
                out[k] = squares + full[row][column];
                k += 1;
            }
        }
    }
}

impl Potential for Patches {
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
        for (patch, out) in range.zip(out) {
            let y = self.forms(patch, x);
            *out = 0.5 * crate::tensor::dot(y, y);
        }
    }

    fn gradients(&self, range: Range<usize>, x: &[f64], _t: f64, out: &mut [f64]) {
        for (patch, out) in range.zip(out.chunks_exact_mut(3 * self.arity)) {
            let y = self.forms(patch, x);
            out.fill(0.0);
            for bend in &self.patches[patch] {
                let moment = crate::tensor::dot(y, bend.form);
                let slope = dihedral::gradient(&self.corners(patch, bend, x));
                for (corner, slope) in bend.corners.iter().zip(slope) {
                    let Some(out) = out.chunks_exact_mut(3).nth(usize::from(*corner)) else { continue };
                    for i in 0..3 {
                        out[i] += moment * slope[i];
                    }
                }
            }
        }
    }

    fn hessians(&self, range: Range<usize>, x: &[f64], _t: f64, out: &mut [f64]) {
        let length = packed_len(3 * self.arity);
        for (patch, out) in range.zip(out.chunks_exact_mut(length)) {
            self.hessian(patch, x, Some(self.forms(patch, x)), out);
        }
    }

    /// The part Σ ∂y ⊗ ∂y, which is never negative, alone.
    fn projected_hessians(&self, range: Range<usize>, x: &[f64], _t: f64, out: &mut [f64]) {
        let length = packed_len(3 * self.arity);
        for (patch, out) in range.zip(out.chunks_exact_mut(length)) {
            self.hessian(patch, x, None, out);
        }
    }
}
