//! Discrete Shells (Grinspun, Hirani, Desbrun & Schröder 2003): V = Σ ½ k (|e|²/A)(θ − θ̄)², where A is the area of
//! the two triangles. The square is replaced by a function that is smooth around the circle (see `turn`).
//!
//! The modulus k = h³/12 Q_mm is the bending modulus across the edge (D = E h³/(12(1 − ν²)) for isotropic sheets; of two
//! triangles with different axes see [`across`]).
//! With it the energy of a cylinder is right on equilateral triangles in every direction, and on right-angled
//! triangles along their legs. On the right-angled triangles of `diagonal`, in the direction α, the energy is 1 + sin
//! 2α + sin² 2α times that of the plate, ¾ to 3. On equilateral triangles the model is an isotropic plate with ν =
//! −1/3.

use vi_core::Potential;

use super::hinges::{Hinge, Opposite, hinges};
use super::patches::patches;
use super::sheet::BentSheet;
use super::stencil::{Bend, CARRIED, Stencil};
use crate::error::FemError;

pub(super) fn potentials(sheet: &BentSheet) -> Result<Vec<Box<dyn Potential>>, FemError> {
    Ok(from_hinges(sheet, &hinges(sheet)?))
}

/// Returns one potential for pairs of triangles and one for held edges, if there are any.
pub(super) fn from_hinges<'a>(
    sheet: &BentSheet,
    hinges: impl IntoIterator<Item = &'a Hinge>,
) -> Vec<Box<dyn Potential>> {
    let (offset, unit) = (sheet.node_offset as u32, sheet.unit());
    let stencil = |(index, hinge): (usize, &Hinge)| {
        let stiffness = across(sheet, hinge) * hinge.length.powi(2) / hinge.area();
        let mut nodes: Vec<u32> = hinge.nodes.iter().map(|node| node + offset).collect();
        let (last, vector) = match hinge.opposite {
            Opposite::Node(node, _) => {
                nodes.push(node + offset);
                (3, [0.0; 3])
            }
            Opposite::Held(vector) | Opposite::Mirror(vector) => (CARRIED, vector),
        };
        let (corners, rest_angle) = ([0, 1, 2, last], hinge.rest_angle);
        let form = [(stiffness / unit).sqrt()];
        Stencil { nodes, bends: vec![Bend { hinge: index as u32, corners, vector, rest_angle, form }] }
    };
    patches(hinges.into_iter().enumerate().map(stencil).collect(), sheet)
}

/// Returns the bending modulus across the edge of a hinge, N m: k = (h₁ + h₂)/(h₁/k₁ + h₂/k₂), from the moduli k and heights
/// h of its two triangles, where they differ.
///
/// A hinge stands for the bending of the strip along its edge, half of which lies on each triangle. The moment M across the edge is
/// the same on both, and each bends by the angle M h/(2k) there, so that the angles add: θ = M (h₁/k₁ + h₂/k₂)/2. A strip of two
/// materials so bends as a beam of them does, where the edge is their border, and no triangle is the first.
pub(super) fn across(sheet: &BentSheet, hinge: &Hinge) -> f64 {
    let one = modulus(sheet, hinge.first);
    match hinge.opposite {
        // Without axes the two differ by round-off.
        Opposite::Node(_, second) if sheet.directions.is_some() => {
            let [near, far] = hinge.heights;
            (near + far) / (near / one + far / modulus(sheet, second))
        }
        _ => one,
    }
}

/// Returns the bending modulus across an edge of a triangle, (m ⊗ m):D:(m ⊗ m), N m. Here m is normal to the edge in the plane of
/// the triangle.
fn modulus(sheet: &BentSheet, side: (u32, u8)) -> f64 {
    let (triangle, k) = (side.0 as usize, usize::from(side.1));
    let p = sheet.plane(triangle);
    let (a, b) = (p[(k + 1) % 3], p[(k + 2) % 3]);
    let length = (b[0] - a[0]).hypot(b[1] - a[1]);
    let m = [(b[1] - a[1]) / length, (a[0] - b[0]) / length];
    let strain = [m[0] * m[0], m[1] * m[1], 2.0 * m[0] * m[1]];
    (0..3).map(|i| (0..3).map(|j| strain[i] * sheet.moduli[i][j] * strain[j]).sum::<f64>()).sum()
}
