//! Kirchhoff–Love bending on any triangulation, from positions alone: V = Σ_T ½ A (κ − κ̄):D:(κ − κ̄). Here κ is
//! Morley's curvature of the triangle, a linear function of the angles of the hinges at it and next to it (see
//! `reconstruction`). Angles are replaced by a function that is smooth around the circle (see `turn`).
//!
//! This model was chosen over three others. Mid-edge normals with a degree of freedom per edge (Grinspun, Gingold,
//! Reisman & Zorin 2006) have rotations that would need an artificial inertia in explicit schemes. Rotation-free
//! patches with averaged normals (BST, EBST: Oñate & Zárate 2000; Flores & Oñate 2005) do not converge on
//! unstructured meshes. C⁰ interior penalty needs quadratic triangles and a parameter. A function of angles is
//! objective, needs no rotations, and exerts no force at a curved rest shape. At free edges the rotation is
//! eliminated by M_mm = 0. Where more than two triangles meet, every pair bends as a hinge.

use std::collections::BTreeMap;

use nalgebra::{Matrix3, Vector3};
use vi_core::Potential;

use super::hinge::from_hinges;
use super::hinges::{Hinge, Opposite, hinges};
use super::patches::patches;
use super::reconstruction::{Turn, edge_frames, turns};
use super::sheet::BentSheet;
use super::stencil::{Bend, CARRIED, Stencil};
use crate::error::FemError;

pub(super) fn potentials(sheet: &BentSheet) -> Result<Vec<Box<dyn Potential>>, FemError> {
    let hinges = hinges(sheet)?;
    let turns = turns(sheet, &hinges);
    let at = hinges_of_edges(sheet, &hinges);
    // A stencil has the nodes of the triangle and of its hinges, 4 to 12.
    let mut list = Vec::with_capacity(turns.len());
    for (triangle, turns) in turns.iter().enumerate() {
        let mut forms = forms(sheet, triangle, turns);
        let mut nodes: Vec<u32> = sheet.surface.triangles[triangle].to_vec();
        let mut bends = Vec::with_capacity(forms.len());
        for (index, viewer) in in_order(&at, &hinges, triangle as u32) {
            if let Some(form) = forms.remove(&index) {
                bends.push(bend((index, &hinges[index as usize]), viewer, form, &mut nodes));
            }
        }
        if !bends.is_empty() {
            nodes.iter_mut().for_each(|node| *node += sheet.node_offset as u32);
            list.push(Stencil { nodes, bends });
        }
    }
    let branches = from_hinges(sheet, hinges.iter().filter(|hinge| !hinge.is_single));
    Ok(patches(list, sheet).into_iter().chain(branches).collect())
}

/// Returns the single hinge at each edge of each triangle.
fn hinges_of_edges(sheet: &BentSheet, hinges: &[Hinge]) -> Vec<[Option<u32>; 3]> {
    let mut at = vec![[None; 3]; sheet.surface.triangles.len()];
    for (index, hinge) in hinges.iter().enumerate().filter(|(_, hinge)| hinge.is_single) {
        at[hinge.first.0 as usize][usize::from(hinge.first.1)] = Some(index as u32);
        if let Opposite::Node(_, (two, k)) = hinge.opposite {
            at[two as usize][usize::from(k)] = Some(index as u32);
        }
    }
    at
}

/// Returns the hinges of a triangle, then the two other hinges of each neighbour, each with the triangle from which
/// it is seen. In this order the stencils of regular parts of a mesh have the same pattern.
fn in_order(at: &[[Option<u32>; 3]], hinges: &[Hinge], triangle: u32) -> Vec<(u32, u32)> {
    let own = at[triangle as usize];
    let mut order: Vec<(u32, u32)> = own.iter().flatten().map(|&hinge| (hinge, triangle)).collect();
    for index in own.into_iter().flatten() {
        let hinge = &hinges[index as usize];
        let Opposite::Node(_, second) = hinge.opposite else { continue };
        let (other, k) = if hinge.first.0 == triangle { second } else { hinge.first };
        for next in [1, 2] {
            let index = at[other as usize][(usize::from(k) + next) % 3];
            order.extend(index.map(|index| (index, other)));
        }
    }
    order
}

/// Returns three linear forms y in hinge angles with V_T = ½ |y|²: the coefficients of each hinge, with energies in
/// the unit of [`BentSheet::unit`].
///
/// With B_ij = A (2/hᵢ)(2/hⱼ) (mᵢ⊗mᵢ):D:(mⱼ⊗mⱼ) the energy is V_T = ½ φᵀBφ. Rotations at free edges are eliminated by
/// the Schur complement. For the others y = Lᵀφ with LLᵀ = B.
fn forms(sheet: &BentSheet, triangle: usize, turns: &[Turn; 3]) -> BTreeMap<u32, [f64; 3]> {
    let p = sheet.plane(triangle);
    let (gradients, area) = crate::sheet::triangle::barycentric_gradients(&p);
    let frames = edge_frames(&p);
    let moduli = Matrix3::from_fn(|i, j| sheet.moduli[i][j] / sheet.unit());
    let curvature = [0, 1, 2].map(|k| {
        let [_, m] = frames[k];
        let height = 1.0 / gradients[k][0].hypot(gradients[k][1]);
        Vector3::new(m[0] * m[0], m[1] * m[1], 2.0 * m[0] * m[1]) * (2.0 / height)
    });
    let mut b = Matrix3::from_fn(|i, j| area * curvature[i].dot(&(moduli * curvature[j])));
    for free in (0..3).filter(|&k| turns[k].is_none()) {
        let column = b.column(free).into_owned();
        b -= column * column.transpose() / column[free];
        // Remove the round-off of the eliminated row; a unit pivot keeps the factor of the other rows.
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
    // On regular meshes some hinges cancel up to round-off; drop them.
    let largest = forms.values().flatten().fold(0.0_f64, |most, c| most.max(c.abs()));
    forms.retain(|_, form| form.iter().any(|c| c.abs() > 1e-13 * largest));
    forms
}

/// Returns a hinge of a stencil as seen from one of its triangles, and adds its new nodes to the stencil.
fn bend((index, hinge): (u32, &Hinge), viewer: u32, form: [f64; 3], nodes: &mut Vec<u32>) -> Bend<3> {
    let mut local = |node: u32| {
        nodes.iter().position(|&other| other == node).unwrap_or_else(|| {
            nodes.push(node);
            nodes.len() - 1
        }) as u8
    };
    let [a, b, c] = hinge.nodes;
    let (corners, vector) = match hinge.opposite {
        // The angle is the same from both sides.
        Opposite::Node(d, _) if hinge.first.0 != viewer => ([b, a, d, c].map(&mut local), [0.0; 3]),
        Opposite::Node(d, _) => ([a, b, c, d].map(&mut local), [0.0; 3]),
        Opposite::Held(vector) | Opposite::Mirror(vector) => {
            let [a, b, c] = [a, b, c].map(&mut local);
            ([a, b, c, CARRIED], vector)
        }
    };
    Bend { hinge: index, corners, vector, rest_angle: hinge.rest_angle, form }
}
